"""SIGKILL where the integrator stands at the edge of a kernel's block: by the run itself, and counted."""

import os
import random
import shutil
import signal
from pathlib import Path

from experiments.durability.judging import Tally, ended, saved_rows
from experiments.durability.processes import Trial, exit_code, in_turn
from experiments.durability.scenes import DAYS, MOONS, Undisturbed
from rigidsim.session.session import Observer, Tuning
from rigidsim.solve.sampler import Pacing, Progress
from rigidsim.store.segments import SegmentLimits

_BLOCK = 4 * DAYS  # of the Moon; the scenes begin at an edge
_EACH_STEP = Tuning(Pacing(chunk_seconds=0.0, patience=0.0), SegmentLimits(seconds=0.0))
"""A look at the guards and a segment after every step or two."""


class _DiesAtEdge(Observer):
    """Kills its process at an edge, or when the run goes on from one; notes where it went on, and stands.

    Attributes:
        skipped: edges to pass first.
        after: at the next look after the edge, which is saved by then.
    """

    def __init__(self, skipped: int, after: bool, note: Path) -> None:
        self._skipped, self._after, self._note = skipped, after, note
        self._ready = False

    def resumed(self, progress: Progress) -> None:
        self._tell("resumed", progress)

    def progressed(self, progress: Progress) -> None:
        if self._ready:
            self._die(progress)
        if progress.time <= 0 or progress.time % _BLOCK:
            return
        self._skipped -= 1
        if self._skipped >= 0:
            return
        if not self._after:
            self._die(progress)
        self._ready = True

    def _die(self, progress: Progress) -> None:
        self._tell("killed", progress)
        os.kill(os.getpid(), signal.SIGKILL)

    def _tell(self, what: str, progress: Progress) -> None:
        with self._note.open("a") as file:
            file.write(f"{what} {'edge' if progress.time % _BLOCK == 0 else 'within'}\n")


def kill_at_edges(tally: Tally, kills: int, draw: random.Random, folder: Path, deadline: float) -> None:
    """Runs in each precision that are killed at one to four edges, and then left to finish."""
    wholes = Undisturbed(folder / "undisturbed")
    done = 0
    for number, name in in_turn(list(MOONS), 10**9, deadline):
        if done >= kills:
            break
        out = folder / f"edges{number}"
        out.mkdir()
        trial, before, note = Trial(tally, wholes, out / name, name), done, out / "note"
        for _ in range(draw.randint(1, 4)):
            if ended(trial.run) or done >= kills:
                break
            observer = _DiesAtEdge(draw.randint(0, 5), draw.random() < 0.5, note)
            code = exit_code(trial.begin(_EACH_STEP, observer))
            if code != -signal.SIGKILL:
                trial.expect(code == 0, f"ended with {code}")
                break
            done += 1
            trial.check(saved_rows(trial.run))
        trial.finish(observer=_DiesAtEdge(10**9, False, note))
        for line in note.read_text().splitlines():
            tally.counts[f"{line}, {name}"] += 1
        shutil.rmtree(out)
        tally.tell(f"kills at edges: {done} of {kills}, run {number + 1} {name} after {done - before}")
