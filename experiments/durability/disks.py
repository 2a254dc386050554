"""Disks that fill up, and disks that become read-only, while a run writes to them."""

import os
import random
import resource
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from experiments.durability.judging import Tally, ended, saved_rows
from experiments.durability.processes import Trial, await_moment, exit_code, in_turn
from experiments.durability.scenes import SCENES, Undisturbed

_STOPPED, _REFUSED = 3, 2  # exit codes: on the way; before anything was done
_BUSY_SECONDS = 5.0  # that a file system may stay busy with a file being written
CHOSEN = [name for name in SCENES if name not in ("double_sparse", "double_lyapunov")]
"""Scenes that write enough to fill a disk."""


def _mount(folder: Path, *options: str) -> bool:
    done = subprocess.run(["mount", *options, folder], capture_output=True)
    return done.returncode == 0


@contextmanager
def small_disk(folder: Path) -> Iterator[Callable[[int], None]]:
    """A file system of its own, whose size in bytes can be set; without root, a limit of each file's size."""
    folder.mkdir()
    if _mount(folder, "-t", "tmpfs", "-o", "size=1m", "tmpfs"):
        try:
            yield lambda size: None if _mount(folder, "-o", f"remount,size={size}") else _refused(folder)
        finally:
            subprocess.run(["umount", folder], check=True)
        return
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size // 4, before[1]))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def _refused(folder: Path) -> None:
    raise OSError(f"{folder}: can't be mounted anew")


def fill_disks(tally: Tally, trials: int, draw: random.Random, folder: Path, deadline: float) -> None:
    """A disk that fills up, and is enlarged before each resume."""
    wholes = Undisturbed(folder / "roomy")
    for number, name in in_turn(CHOSEN, trials, deadline):
        place = folder / f"disk{number}"
        trial = Trial(tally, wholes, place / name, f"disk {number} {name}")
        full = 0
        with small_disk(place) as resize:
            size = int(wholes.size(name) * draw.uniform(0.05, 1.0)) + 65536
            for _ in range(40):
                resize(size)
                code = exit_code(trial.begin())
                if code == 0:
                    break
                full += 1
                good = code in (_STOPPED, _REFUSED) and "space" in trial.told.splitlines()[-1]
                trial.expect(good, f"code {code}")
                trial.check(saved_rows(trial.run))
                size = int(size * draw.uniform(1.1, 2.0)) + 65536
            trial.finish()
        tally.counts["full disks"] += full
        tally.tell(f"disks: {number + 1} of {trials}, {name} after {full} full ones")


def lock_disks(tally: Tally, trials: int, draw: random.Random, folder: Path, deadline: float) -> None:
    """A disk that becomes read-only at a random moment, and writable before each resume; as root only."""
    wholes = Undisturbed(folder / "writable")
    for number, name in in_turn(list(SCENES), trials, deadline):
        place = folder / f"locked{number}"
        place.mkdir()
        if not _mount(place, "-t", "tmpfs", "-o", "size=64m", "tmpfs"):
            print("read-only disks: left out, mounting isn't allowed here", flush=True)
            return
        try:
            _lock_one(Trial(tally, wholes, place / name, f"locked {number} {name}"), draw)
        finally:
            subprocess.run(["umount", "-l", place], check=True)
        tally.tell(f"read-only disks: {number + 1} of {trials}, {name}")


def _lock_one(trial: Trial, draw: random.Random) -> None:
    run, place = trial.run, trial.run.parent
    for _ in range(draw.randint(1, 4)):
        if ended(run):
            break
        pid = trial.begin()
        kind = draw.choice(["any", "named"])
        delay = draw.uniform(0, 1.3 * trial.wholes.seconds(run.name))
        await_moment(pid, run, kind, delay, draw.randint(1, 12))
        locked = _locked(place)
        acknowledged = saved_rows(run)
        code = exit_code(pid)
        if code:
            trial.tally.counts["read-only disks"] += 1
            good = locked and code in (_STOPPED, _REFUSED) and "Read-only file system" in trial.told
            trial.expect(good, f"code {code}")
        if run.exists():
            trial.check(acknowledged)
            refused = exit_code(trial.begin()) if locked else _REFUSED
            good = refused == _REFUSED or (refused == 0 and ended(run))  # a complete run needs no writing
            trial.expect(good, f"resumed read-only with {refused}")
        _mount(place, "-o", "remount,rw")
    trial.finish()


def _locked(place: Path) -> bool:
    """Make a file system read-only, as soon as no file on it is being written."""
    end = time.monotonic() + _BUSY_SECONDS
    while not _mount(place, "-o", "remount,ro"):
        if time.monotonic() > end:
            return False
    return bool(os.statvfs(place).f_flag & os.ST_RDONLY)
