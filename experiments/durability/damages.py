"""Files truncated, flipped, exchanged, lost: each recognised, and a run repaired with the same bits."""

import os
import random
import shutil
import signal
import time
from pathlib import Path

import xarray

import rigidsim
from experiments.durability.judging import Tally
from experiments.durability.processes import await_moment, child, exit_code, work_on
from experiments.durability.scenes import SCENES, same, text_of, tuning_of
from rigidsim.errors import RunFolderError
from rigidsim.store.seal import check_seal
from rigidsim.store.segments import read_chain

NAME = "double_driven"
TEXT = text_of(NAME, longer=20)
"""Long enough to be caught on the way."""
LATER = str(2 * 20 * SCENES[NAME][0])
_FILES = 8
_ATTEMPTS = 50
_TOLD_EVERY = 10  # trials


def damage(path: Path, draw: random.Random, others: list[Path]) -> str:
    """Do something to a file; returns what. It is different afterwards."""
    content = path.read_bytes()
    kind = draw.choice(["bit", "bit", "truncated", "zeros", "lost", "exchanged", "appended"])
    if kind == "bit":
        place = draw.randrange(len(content))
        changed = bytearray(content)
        changed[place] ^= 1 << draw.randrange(8)
        path.write_bytes(changed)
        return f"bit flipped in byte {place}"
    if kind == "truncated":
        kept = draw.randrange(len(content))
        path.write_bytes(content[:kept])
        return f"truncated to {kept} bytes"
    if kind == "zeros":  # what some file systems leave after a loss of power
        first = draw.randrange(len(content) - 1)
        last = min(len(content), first + draw.choice([1, 512, 4096, len(content)]))
        if not any(content[first:last]):
            return damage(path, draw, others)
        path.write_bytes(content[:first] + bytes(last - first) + content[last:])
        return f"zeros in bytes {first} to {last}"
    if kind == "lost":
        path.unlink()
        return "lost"
    if kind == "appended":
        path.write_bytes(content + draw.randbytes(draw.choice([1, 100, 5000])))
        return "appended to"
    other = draw.choice([p for p in others if p.read_bytes() != content])
    path.write_bytes(other.read_bytes())
    return f"exchanged for {other.parent.parent.name}/{other.name}"


def partial(out: Path, draw: random.Random) -> Path:
    """A run killed when it had some segments.

    Raises:
        RuntimeError: it was never caught at that.
    """
    run = out / NAME
    for _ in range(_ATTEMPTS):
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir(parents=True)
        pid = child(work_on(run, TEXT), out / "log")
        alive = await_moment(pid, run, "named", draw.random(), _FILES)
        os.kill(pid, signal.SIGKILL)
        exit_code(pid)
        if alive and len(read_chain(run / "segments").paths) >= 3 and not (run / "dataset.h5").exists():
            return run
    raise RuntimeError(f"{run}: finished before it had {_FILES} files, {_ATTEMPTS} times")


def damage_files(tally: Tally, trials: int, draw: random.Random, folder: Path, deadline: float) -> None:
    """Files of finished and of unfinished runs, in turn, damaged at random places."""
    run = rigidsim.run(rigidsim.parse(TEXT), out=folder / "whole")
    with run.dataset as dataset:
        whole = dataset.load()
    begun = partial(folder / "begun", draw)
    twin = partial(folder / "twin", draw)  # the same config, another run
    foreign = sorted((twin / "segments").glob("[0-9]*.h5"))
    for number in range(trials):
        if time.monotonic() > deadline:
            break
        out = folder / "damaged"
        shutil.rmtree(out, ignore_errors=True)
        if number % 2:
            shutil.copytree(run.folder.path, out)
            _damage_finished(tally, draw, out, foreign)
        else:
            shutil.copytree(begun, out)
            repair = tally.counts["damaged runs resumed, identical"] < max(1, trials // 16)
            _damage_begun(tally, draw, out, foreign, whole if repair else None)
        if (number + 1) % _TOLD_EVERY == 0 or number + 1 == trials:
            tally.tell(f"damages: {number + 1} of {trials}")
    check_seal(run.folder.dataset)


def _damage_finished(tally: Tally, draw: random.Random, out: Path, foreign: list[Path]) -> None:
    """One file of a finished run; it must be named when it is needed."""
    target = draw.choice([out / "dataset.h5", out / "checkpoint.h5"])
    what = f"{target.name} {damage(target, draw, foreign)}"
    tally.counts["damaged datasets and checkpoints"] += 1
    try:
        if target.name == "dataset.h5":
            _ = rigidsim.open_run(out).dataset
        else:
            rigidsim.resume(out, until=LATER)
        tally.expect(False, f"{what}: not recognised")
    except RunFolderError as error:
        tally.expect(target.name in str(error), f"{what}: not named: {error}")


def _damage_begun(
    tally: Tally, draw: random.Random, out: Path, foreign: list[Path], whole: xarray.Dataset | None
) -> None:
    """One segment of an unfinished run; all before it are kept. Resumed, it must give ``whole``, if given."""
    paths = sorted((out / "segments").glob("[0-9]*.h5"))
    target = draw.choice(paths)
    what = f"segment {target.name} of {len(paths)} {damage(target, draw, foreign + paths)}"
    tally.counts["damaged segments"] += 1
    if not target.exists() and target == paths[-1]:
        return  # an earlier state of the same run: nothing is wrong with it
    chain = read_chain(out / "segments")
    named = chain.damage is not None and target.name in chain.damage
    kept = chain.paths == paths[: int(target.stem)]
    tally.expect(named and kept, f"{what}: {chain.damage}, {len(chain.paths)} kept")
    if whole is None:
        return
    log = out.with_name("log")
    code = exit_code(child(lambda: rigidsim.resume(out, tuning=tuning_of(out.name)), log))
    if not tally.expect(code == 0, f"{what}: {log.read_text()[-300:]}"):
        return
    with rigidsim.open_run(out).dataset as dataset:
        difference = same(dataset, whole)
    tally.expect(not difference, f"{what}: repaired, {difference} differs")
    told = " ".join(rigidsim.open_run(out).summary["warnings"])
    tally.expect(target.name in told, f"{what}: the summary says {told}")
    tally.counts["damaged runs resumed, identical"] += not difference
