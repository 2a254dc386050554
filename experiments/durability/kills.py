"""SIGKILL at random moments."""

import os
import random
import shutil
import signal
import time
from pathlib import Path

from experiments.durability.judging import Tally, ended, names, saved_rows
from experiments.durability.processes import Trial, await_moment, exit_code, in_turn
from experiments.durability.scenes import SCENES, Undisturbed


def kill_runs(tally: Tally, kills: int, draw: random.Random, folder: Path, deadline: float) -> None:
    """Runs that are killed one to six times each, and then left to finish."""
    wholes = Undisturbed(folder / "undisturbed")
    done = 0
    for number, name in in_turn(list(SCENES), 10**9, deadline):
        if done >= kills:
            break
        out = folder / f"killed{number}"
        trial = Trial(tally, wholes, out / name, f"run {number} {name}")
        out.mkdir()
        before = done
        for _ in range(draw.randint(1, 6)):
            # killed when all was done, before the process ended by itself; enough kills, or out of time
            if ended(trial.run) or done >= kills or time.monotonic() > deadline:
                break
            if not _kill_once(trial, draw):
                break
            done += 1
        trial.finish()
        shutil.rmtree(out)
        tally.tell(f"kills: {done} of {kills}, {trial.title} after {done - before}")


def _kill_once(trial: Trial, draw: random.Random) -> bool:
    """Begin or go on, and kill; False where the process was faster."""
    kind = draw.choice(["any", "writing", "named"])
    delay, nth = draw.uniform(0, 1.3 * trial.wholes.seconds(trial.run.name)), draw.randint(1, 12)
    pid = trial.begin()
    alive = await_moment(pid, trial.run, kind, delay, nth)
    acknowledged = saved_rows(trial.run)
    os.kill(pid, signal.SIGKILL)
    code = exit_code(pid)
    if not alive or code != -signal.SIGKILL:
        trial.expect(code == 0, f"ended with {code}")
        return False
    counts = trial.tally.counts
    counts["kills"] += 1
    counts[f"kills: {kind}"] += 1
    counts["kills before the first segment"] += acknowledged == 0
    counts["kills after the dataset"] += acknowledged < 0
    counts["kills that left a torn file"] += any(n.endswith(".partial") for n in names(trial.run))
    trial.check(acknowledged)
    return True
