"""Runs in a process of their own that is killed once some samples are saved, as nothing else is as sudden."""

import subprocess
import sys
import time
from pathlib import Path

import rigidsim
from rigidsim.session.session import Observer, Tuning
from rigidsim.solve.sampler import Pacing, Progress
from rigidsim.store.segments import SegmentLimits

# a segment after every few samples
TUNING = Tuning(Pacing(chunk_seconds=0.0, patience=0.0, rows_at_once=4), SegmentLimits(seconds=0.0))
_CODE = """
import sys
sys.path[:0] = {places!r}
import {extension}
getattr({extension}, "register", lambda: None)()
from killing import run_until_killed
run_until_killed({text!r}, {out!r})
"""


class _Waits(Observer):
    """Tells when a third of the samples is taken, and waits to be killed."""

    def progressed(self, progress: Progress) -> None:
        if 3 * progress.next_sample > progress.samples:
            print("under way", flush=True)
            time.sleep(600)


def run_until_killed(text: str, out: str) -> None:
    rigidsim.run(rigidsim.parse(text), out=out, observer=_Waits(), tuning=TUNING)


def killed(extension: str, text: str, out: Path) -> Path:
    """The folder of a run that was killed on its way.

    Args:
        extension: module of ``extension``, or of this folder, that the process imports, as a user's script
            would.
    """
    here = Path(__file__).parent
    places = [str(here / "extension"), str(here), str(here.parent)]
    code = _CODE.format(places=places, extension=extension, text=text, out=str(out))
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        assert process.stdout.readline() == "under way\n"
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
    [folder] = out.iterdir()
    assert list((folder / "segments").iterdir())
    assert not (folder / "dataset.h5").exists()
    return folder
