"""SIGKILL at random moments."""

import os
import random
import shutil
import signal
import time
from pathlib import Path

import rigidsim
from experiments.durability.judging import Tally, check_after, check_complete, ended, names, saved_rows
from experiments.durability.processes import await_moment, child, exit_code, work_on
from experiments.durability.scenes import SCENES, Undisturbed, text_of


def kill_runs(tally: Tally, kills: int, draw: random.Random, folder: Path, deadline: float) -> None:
    """Runs that are killed one to six times each, and then left to finish."""
    wholes = Undisturbed(folder / "undisturbed")
    done = 0
    for number in range(10**9):
        if done >= kills or time.monotonic() > deadline:
            break
        name = list(SCENES)[number % len(SCENES)]
        out = folder / f"killed{number}"
        run = out / name
        out.mkdir()
        wanted = draw.randint(1, 6)
        before = done
        for _ in range(wanted):
            # killed when all was done, before the process ended by itself; enough kills, or out of time
            if ended(run) or done >= kills or time.monotonic() > deadline:
                break
            killed = _kill_once(tally, draw, wholes, out, name, f"run {number} {name}, kill {done + 1}")
            if not killed:
                break
            done += 1
        _finish(tally, wholes, out, name, f"run {number} {name}")
        shutil.rmtree(out)
        tally.tell(f"kills: {done} of {kills}, run {number} {name} after {done - before}")


def _kill_once(
    tally: Tally, draw: random.Random, wholes: Undisturbed, out: Path, name: str, where: str
) -> bool:
    """Begin or go on, and kill; False where the process was faster."""
    run = out / name
    kind = draw.choice(["any", "writing", "named"])
    delay, nth = draw.uniform(0, 1.3 * wholes.seconds(name)), draw.randint(1, 12)
    pid = child(work_on(run, text_of(name)), out / "log")
    alive = await_moment(pid, run, kind, delay, nth)
    acknowledged = saved_rows(run)
    os.kill(pid, signal.SIGKILL)
    code = exit_code(pid)
    if not alive or code != -signal.SIGKILL:
        tally.expect(code == 0, f"{where}: ended with {code}: {(out / 'log').read_text()[-300:]}")
        return False
    tally.counts["kills"] += 1
    tally.counts[f"kills: {kind}"] += 1
    tally.counts["kills before the first segment"] += acknowledged == 0
    tally.counts["kills after the dataset"] += acknowledged < 0
    tally.counts["kills that left a torn file"] += any(n.endswith(".partial") for n in names(run))
    check_after(tally, run, wholes[name], acknowledged, f"{where} ({kind})")
    return True


def _finish(tally: Tally, wholes: Undisturbed, out: Path, name: str, where: str) -> None:
    """Let a run come to its end, and hold it against the undisturbed one."""
    run = out / name
    if ended(run):
        again = rigidsim.resume(run)  # cleans up
        tally.expect(again.status == "finished", f"{where}: {again.status} when nothing was left to do")
    else:
        code = exit_code(child(work_on(run, text_of(name)), out / "log"))
        if not tally.expect(code == 0, f"{where}: {(out / 'log').read_text()[-400:]}"):
            return
    check_complete(tally, run, wholes[name], f"{where}, complete")
