"""Is anything lost when a run is killed, the disk fills up, or its files are damaged?

Question: after SIGKILL at any moment, is the folder readable, is every sample still there whose segment had
its
name before the kill, and is the dataset bit for bit that of a run that nobody disturbed? The same for a disk
that fills up, and is every file that was truncated, flipped in a bit, exchanged or lost recognised?

Method: each scene is run once undisturbed. Then it is begun in a child process, killed, resumed in another
child, killed again, ..., and left to finish after one to six kills. A third of the moments are uniform over
the
scene's duration, a third while a temporary file is being written, a third just after a file got its name.
What
was saved is noted from outside before the kill. Segments are written some hundred times as often as usual
(``frequent``), to have many moments at which something can go wrong. Then: the same on a small tmpfs (as
root;
else under a limit of the files' size), enlarged before each resume; and files of finished and unfinished runs
damaged at random places.

Seeded: the same kills are planned, though the machine's timing moves what they hit.

Run: python -m experiments.kill_campaign [--kills 300] [--full-disks 40] [--damages 400] [--seconds 1200]
[--seed 1]
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray

import rigidsim
from rigidsim.errors import RigidsimError, RunFolderError
from rigidsim.solve import advance, harvest
from rigidsim.store import segments
from rigidsim.store.seal import check_seal
from rigidsim.store.segments import read_chain

BODY = """
[body]
principal_moments = [1, 2, 2.5]
mass = 1.5
center_of_mass = [0.01, 0.02, 0.3]
[initial]
angular_velocity = [0.3, 1.0, 0.5]
euler_angles = [0.2, 1.1, 0.7]
"""
EVENT = '[[events]]\nname = "flip"\nexpression = "wy"\n'
DRIVEN = '[[loads]]\nkind = "torque"\ncomponents = ["0.1*sin(t)", "0", "0.05*wx"]\n'
GRAVITY = '[[loads]]\nkind = "uniform_gravity"\n'

# end, samples, precision, formulation, rest: some tenths of a second of work each
SCENES = {
    "double_dense": (4000, 16001, '"double"', "auto", ""),
    "double_sparse": (60000, 13, '"double"', "auto", ""),
    "double_driven": (3000, 3001, '"double"', "auto", DRIVEN),
    "double_euler": (1000, 2001, '"double"', "euler_angles", GRAVITY),
    "double_events": (3000, 1501, '"double"', "auto", EVENT),
    "extended_dense": (3000, 3001, '"extended"', "auto", ""),
    "extended_events": (1000, 501, '"extended"', "auto", EVENT + DRIVEN),
    "quadruple_dense": (80, 321, '"quadruple"', "auto", ""),
    "quadruple_events": (60, 61, '"quadruple"', "rotation_matrix", EVENT),
}


def text_of(name: str) -> str:
    """The scene's config."""
    end, samples, precision, formulation, rest = SCENES[name]
    return (
        f'name = "{name}"\n{BODY}{rest}[time]\nend = {end}\nsamples = {samples}\n'
        f'[integrator]\nprecision = {precision}\nformulation = "{formulation}"\n[output]\ntimeline = false\n'
    )


def frequent() -> None:
    """Segments some thirty times a second instead of once in thirty seconds, in this process."""
    segments.SEGMENT_SECONDS = harvest._PATIENCE = 0.03
    segments.SEGMENT_BYTES = 400_000
    advance._CHUNK_SECONDS = 0.01


@dataclass
class Tally:
    """What was counted, and what went wrong."""

    counts: Counter[str] = field(default_factory=Counter)
    failures: list[str] = field(default_factory=list)

    def expect(self, good: bool, what: str) -> bool:
        """Note a failure."""
        if not good:
            self.failures.append(what)
            print(f"FAILED: {what}", flush=True)
        return good


def child(work: Callable[[], object], log: Path) -> int:
    """Do something in a process of its own; returns its id. Its exit code is 0 when nothing was raised."""
    pid = os.fork()
    if pid:
        return pid
    code = 9
    try:
        os.nice(5)
        with log.open("a") as file:
            os.dup2(file.fileno(), 2)
        frequent()
        work()
        code = 0
    except RunFolderError as error:
        print(error, file=sys.stderr)
        code = 2
    except BaseException as error:
        print(repr(error), file=sys.stderr)
    finally:
        sys.stderr.flush()
        os._exit(code)


def work_on(folder: Path, text: str) -> Callable[[], object]:
    """Begin the run of a folder, or go on with it."""
    begun = (folder / "segments").exists() or (folder / "dataset.h5").exists()
    if begun:
        return lambda: rigidsim.resume(folder)
    return lambda: rigidsim.run(rigidsim.parse(text), out=folder.parent, force=True)


def ended(folder: Path) -> bool:
    """Whether nothing is left to do."""
    return (folder / "dataset.h5").exists() and not (folder / "segments").exists()


def names(folder: Path) -> set[str]:
    """Of all files of a run folder."""
    found = set()
    for place in (folder, folder / "segments"):
        try:
            found.update(entry.name for entry in os.scandir(place))
        except OSError:
            continue
    return found


def await_moment(pid: int, folder: Path, kind: str, delay: float, nth: int) -> bool:
    """Wait for a moment to kill at; False when the child ended before."""
    deadline = time.monotonic() + (delay if kind == "any" else 20.0)
    seen, count = names(folder), 0
    while time.monotonic() < deadline:
        if os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT):
            return False
        if kind == "any":
            time.sleep(0.0005)
            continue
        time.sleep(0.0002)
        now = names(folder)
        new = now - seen
        seen = now
        writing = any(name.endswith(".partial") for name in new)
        named = any(not name.startswith(".") for name in new)
        if (kind == "writing" and writing) or (kind == "named" and named):
            count += 1
            if count >= nth:
                time.sleep(delay % 0.002)
                return True
    return True


def saved_rows(folder: Path) -> int:
    """Samples in segments that have their names, from outside."""
    if (folder / "dataset.h5").exists():
        return -1  # all of them
    last = max((n for n in names(folder / "segments") if n[0].isdigit()), default=None)
    if last is None:
        return 0
    try:
        labels = segments.root_attributes(folder / "segments" / last)
    except RunFolderError:  # gone meanwhile: the dataset took its place
        return saved_rows(folder)
    return int(labels.get("first_sample", 0)) + int(labels["rows"])


def same(one: xarray.Dataset, other: xarray.Dataset, rows: int | None = None) -> str:
    """The first variable in which datasets differ in any bit, over as many rows; empty where none does."""
    variables = set(one.variables) | set(other.variables)
    for name in sorted(map(str, variables)):
        if rows is not None and (name not in one or "time" not in one[name].dims):
            continue
        if name not in one or name not in other:
            return f"{name} is missing"
        a, b = one[name].values, other[name].values
        if rows is not None:
            a, b = a[:rows], b[:rows]
        if a.dtype == np.float64:
            a, b = np.ascontiguousarray(a).view(np.int64), np.ascontiguousarray(b).view(np.int64)
        if not np.array_equal(a, b):
            return name
    return ""


def check_after(tally: Tally, folder: Path, reference: xarray.Dataset, acknowledged: int, what: str) -> None:
    """A disturbed run's folder: readable, with all that was acknowledged, and with the right bits."""
    everything = reference.sizes["time"]
    acknowledged = everything if acknowledged < 0 else acknowledged
    try:
        if not (folder / "segments").exists() and not (folder / "dataset.h5").exists():
            tally.expect(acknowledged == 0, f"{what}: nothing there, {acknowledged} rows acknowledged")
            return
        run = rigidsim.open_run(folder)
        if not run.saved:
            tally.expect(acknowledged == 0, f"{what}: nothing saved, {acknowledged} rows acknowledged")
            return
        with run.dataset as found:
            rows = found.sizes["time"]
            tally.expect(rows >= acknowledged, f"{what}: {rows} rows, {acknowledged} acknowledged")
            difference = same(found, reference, rows)
            tally.expect(not difference, f"{what}: {difference} differs")
    except RigidsimError as error:
        tally.expect(False, f"{what}: unreadable: {error}")


def check_complete(tally: Tally, folder: Path, reference: xarray.Dataset, what: str) -> None:
    """A completed run is the undisturbed one."""
    run = rigidsim.open_run(folder)
    with run.dataset as found:
        difference = same(found, reference)
        steps = found.attrs["steps"] == reference.attrs["steps"]
    tally.expect(run.status == "finished" and not difference and steps, f"{what}: {difference or run.status}")
    left = {"config.toml", "dataset.h5", "summary.json", "checkpoint.h5"}
    tally.expect(names(folder) == left, f"{what}: left behind {names(folder) ^ left}")
    tally.counts["completed runs identical"] += not difference


def references(folder: Path) -> tuple[dict[str, xarray.Dataset], dict[str, float]]:
    """Each scene undisturbed, and how long it takes."""
    found, seconds = {}, {}
    for name in SCENES:
        rigidsim.run(rigidsim.parse(text_of(name)), out=folder / "warm")  # compiles
        started = time.monotonic()
        run = rigidsim.run(rigidsim.parse(text_of(name)), out=folder / "undisturbed")
        seconds[name] = time.monotonic() - started
        with run.dataset as dataset:
            found[name] = dataset.load()
        print(f"{name}: {seconds[name]:.2f} s, {run.summary['cost']['steps']} steps", flush=True)
    shutil.rmtree(folder / "warm")
    return found, seconds


def kill_runs(tally: Tally, kills: int, draw: random.Random, folder: Path, deadline: float) -> None:
    """SIGKILL at random moments."""
    wholes, seconds = references(folder)
    done = 0
    for number in range(10**9):
        if done >= kills or time.monotonic() > deadline:
            break
        name = list(SCENES)[number % len(SCENES)]
        out = folder / f"killed{number}"
        run = out / name
        out.mkdir()
        for _ in range(draw.randint(1, 6)):
            if ended(run):  # killed when all was done, before the process ended by itself
                break
            kind = draw.choice(["any", "writing", "named"])
            delay, nth = draw.uniform(0, 1.3 * seconds[name]), draw.randint(1, 12)
            pid = child(work_on(run, text_of(name)), out / "log")
            alive = await_moment(pid, run, kind, delay, nth)
            acknowledged = saved_rows(run)
            os.kill(pid, signal.SIGKILL)
            code = os.waitpid(pid, 0)[1]
            if not alive or not os.WIFSIGNALED(code):
                words = f"run {number} {name}: ended with {code}: {(out / 'log').read_text()[-300:]}"
                tally.expect(code == 0, words)
                break
            done += 1
            tally.counts["kills"] += 1
            tally.counts[f"kills: {kind}"] += 1
            where = f"run {number} {name}, kill {done} ({kind})"
            tally.counts["kills before the first segment"] += acknowledged == 0
            tally.counts["kills after the dataset"] += acknowledged < 0
            tally.counts["kills that left a torn file"] += any(n.endswith(".partial") for n in names(run))
            check_after(tally, run, wholes[name], acknowledged, where)
        if ended(run):
            try:
                rigidsim.resume(run)  # cleans up
            except RunFolderError as error:
                tally.expect("nothing is left to do" in str(error), f"run {number} {name}: {error}")
        else:
            pid = child(work_on(run, text_of(name)), out / "log")
            code = os.waitpid(pid, 0)[1]
            if not tally.expect(code == 0, f"run {number} {name}: {(out / 'log').read_text()[-400:]}"):
                continue
        check_complete(tally, run, wholes[name], f"run {number} {name}, complete")
        shutil.rmtree(out)


@contextmanager
def small_disk(folder: Path) -> Iterator[Callable[[int], None]]:
    """A file system of its own, whose size in bytes can be set; without root, a limit of each file's size."""
    folder.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", folder], capture_output=True)
    if mounted.returncode == 0:
        try:
            yield (
                lambda size: (
                    subprocess.run(
                        ["mount", "-o", f"remount,size={size}", folder], check=True, capture_output=True
                    )
                    and None
                )
            )
        finally:
            subprocess.run(["umount", folder], check=True)
        return
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size // 4, before[1]))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def fill_disks(tally: Tally, trials: int, draw: random.Random, folder: Path, deadline: float) -> None:
    """A disk that fills up, and is enlarged before each resume."""
    wholes: dict[str, xarray.Dataset] = {}
    sizes: dict[str, int] = {}
    chosen = [n for n in SCENES if "sparse" not in n]
    for name in chosen:
        run = rigidsim.run(rigidsim.parse(text_of(name)), out=folder / "roomy")
        with run.dataset as dataset:
            wholes[name] = dataset.load()
        # at its fullest: all segments, and the dataset beside them
        sizes[name] = wholes[name].nbytes + run.folder.dataset.stat().st_size
    for number in range(trials):
        if time.monotonic() > deadline:
            break
        name = chosen[number % len(chosen)]
        place = folder / f"disk{number}"
        log = folder / f"disk{number}.log"
        with small_disk(place) as resize:
            size = int(sizes[name] * draw.uniform(0.05, 1.0)) + 65536
            run = place / name
            for _ in range(40):
                resize(size)
                pid = child(work_on(run, text_of(name)), log)
                code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
                if code == 0:
                    break
                tally.counts["full disks"] += 1
                told = log.read_text()
                good = code == 2 and "space" in told.splitlines()[-1]
                tally.expect(good, f"disk {number} {name}: code {code}, said {told[-300:]}")
                check_after(tally, run, wholes[name], saved_rows(run), f"disk {number} {name}")
                size = int(size * draw.uniform(1.1, 2.0)) + 65536
            check_complete(tally, run, wholes[name], f"disk {number} {name}, complete")


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


def partial(name: str, out: Path, kept: int, draw: random.Random) -> Path:
    """A run killed when it had some segments."""
    while True:
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir(parents=True)
        pid = child(work_on(out / name, text_of(name)), out / "log")
        alive = await_moment(pid, out / name, "named", draw.random(), kept + 2)
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        chain = read_chain(out / name / "segments")
        if alive and len(chain.paths) >= 3 and not (out / name / "dataset.h5").exists():
            return out / name


def damage_files(tally: Tally, trials: int, draw: random.Random, folder: Path, deadline: float) -> None:
    """Files truncated, flipped, exchanged, lost: each recognised, and a run repaired with the same bits."""
    name = "double_driven"
    run = rigidsim.run(rigidsim.parse(text_of(name)), out=folder / "whole")
    with run.dataset as dataset:
        whole = dataset.load()
    begun = partial(name, folder / "begun", 6, draw)
    twin = partial(name, folder / "twin", 6, draw)  # the same config, another run
    foreign = sorted((twin / "segments").glob("[0-9]*.h5"))
    repaired = 0
    for number in range(trials):
        if time.monotonic() > deadline:
            break
        out = folder / "damaged"
        shutil.rmtree(out, ignore_errors=True)
        if number % 2:
            shutil.copytree(run.folder.path, out)
            target = draw.choice([out / "dataset.h5", out / "checkpoint.h5"])
            done = damage(target, draw, foreign)
            what = f"{target.name} {done}"
            tally.counts["damaged datasets and checkpoints"] += 1
            try:
                if target.name == "dataset.h5":
                    _ = rigidsim.open_run(out).dataset
                else:
                    rigidsim.resume(out, until="6000")
                tally.expect(False, f"{what}: not recognised")
            except RunFolderError as error:
                named = target.name in str(error)
                tally.expect(named, f"{what}: not named: {error}")
            continue
        shutil.copytree(begun, out)
        paths = sorted((out / "segments").glob("[0-9]*.h5"))
        target = draw.choice(paths)
        what = f"segment {target.name} of {len(paths)} {damage(target, draw, foreign + paths)}"
        tally.counts["damaged segments"] += 1
        if not target.exists() and target == paths[-1]:
            continue  # an earlier state of the same run: nothing is wrong with it
        chain = read_chain(out / "segments")
        named = chain.damage is not None and target.name in chain.damage
        kept = chain.paths == paths[: int(target.stem)]
        tally.expect(named and kept, f"{what}: {chain.damage}, {len(chain.paths)} kept")
        if repaired < trials // 16:
            pid = child(lambda: rigidsim.resume(out), folder / "log")  # noqa: B023
            tally.expect(os.waitpid(pid, 0)[1] == 0, f"{what}: {(folder / 'log').read_text()[-300:]}")
            with rigidsim.open_run(out).dataset as dataset:
                difference = same(dataset, whole)
            if tally.expect(not difference, f"{what}: repaired, {difference} differs"):
                repaired += 1
            told = " ".join(rigidsim.open_run(out).summary["warnings"])
            tally.expect(target.name in told, f"{what}: the summary says {told}")
    tally.counts["damaged runs resumed, identical"] = repaired
    check_seal(run.folder.dataset)


def main() -> int:
    """The three campaigns; exit code 1 if anything failed."""
    parser = argparse.ArgumentParser(prog="python -m experiments.kill_campaign")
    parser.add_argument("--kills", type=int, default=300)
    parser.add_argument("--full-disks", type=int, default=40, help="trials, each of several full disks")
    parser.add_argument("--damages", type=int, default=400)
    parser.add_argument("--seconds", type=float, default=1200, help="at most, for each part")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    draw, tally = random.Random(arguments.seed), Tally()
    parts = [
        (kill_runs, arguments.kills), (fill_disks, arguments.full_disks), (damage_files, arguments.damages)
    ]  # fmt: skip
    for part, trials in parts:
        if trials:
            with tempfile.TemporaryDirectory(prefix="rigidsim-campaign-") as folder:
                part(tally, trials, draw, Path(folder), time.monotonic() + arguments.seconds)
    for name, count in sorted(tally.counts.items()):
        print(f"{name:40s} {count}")
    print(f"{'failures':40s} {len(tally.failures)}")
    return int(bool(tally.failures))


if __name__ == "__main__":
    raise SystemExit(main())
