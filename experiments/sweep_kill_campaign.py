"""Is anything lost or computed twice when a sweep is killed, its workers are, or its disk fills up?

Question: after SIGKILL of the process (with all its workers), of one worker, of workers of a Dask cluster on
this machine (where ``rigidsim[cluster]`` is installed), or after a disk that fills up,
is every tile still there that was there before, untouched, and is the dataset bit for bit that of a sweep
that nobody disturbed, with every member exactly once?

Method: a sweep of 12 members in tiles of one is run undisturbed. Then, for each trial, it is begun in a child
process, disturbed at a random moment, and given again until it is complete. Full disks are a limit of the
files' size, drawn so that some fail at a tile and some at the dataset. Which tiles there are is noted from
outside after the kill; those have to be the same files, unchanged, at the end.

Run: python -m experiments.sweep_kill_campaign [--kills 100] [--seconds 1800] [--seed 1]
"""

import argparse
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from experiments.durability.judging import Tally
from rigidsim.errors import RigidsimError
from rigidsim.store.sweeps.folder import SweepFolder
from rigidsim.store.sweeps.run import open_sweep
from rigidsim.workflows.read import parse
from rigidsim.workflows.sweeps.sweep import resume_sweep, sweep

CONFIG = """\
name = "kills"
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.1, 1, 0.05]
[time]
end = 20
samples = 201
[integrator]
formulation = "rates"
[output]
estimate = false
record = ["angular_velocity"]
[sweep]
keep = ["final", "series"]
tile = 1
axes."initial.angular_velocity[2]" = {step = [0.1, 0.1, 6], name = "w3"}
axes."body.principal_moments[2]" = {values = [2.5, 2.75], name = "C"}
"""
WAYS = ("process", "process with workers", "worker", "full disk", "scheduler's worker")
_PATIENCE = 300.0  # seconds for one child


def main(argv: Sequence[str] | None = None) -> int:
    """The campaign; exit code 1 if anything failed."""
    parser = argparse.ArgumentParser(prog="python -m experiments.sweep_kill_campaign")
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=1800, help="at most, roughly")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args(argv)
    tally = Tally()
    with tempfile.TemporaryDirectory(prefix="rigidsim-sweeps-") as folder:
        campaign(tally, arguments.kills, random.Random(arguments.seed), Path(folder), arguments.seconds)
    tally.print_totals()
    return int(bool(tally.failures))


def campaign(tally: Tally, kills: int, draw: random.Random, place: Path, seconds: float) -> None:
    """So many disturbances, or as many as there is time for."""
    began = time.monotonic()
    whole = sweep(parse(CONFIG), out=place / "whole").dataset.load()
    duration = time.monotonic() - began
    (place / "kills.toml").write_text(CONFIG)
    done = trial = 0
    with local_cluster() as cluster:
        ways = WAYS if cluster is not None else WAYS[:-1]
        while done < kills and time.monotonic() - began < seconds:
            way = ways[trial % len(ways)]
            trial += 1
            done += _trial(tally, way, draw, place, place / f"trial{trial}", whole, duration, cluster)
            tally.tell(f"{done} of {kills} disturbances ({way})")


def _trial(
    tally: Tally,
    way: str,
    draw: random.Random,
    place: Path,
    out: Path,
    whole: xarray.Dataset,
    duration: float,
    cluster: Any,
) -> int:
    """One sweep, disturbed up to three times; how often it was."""
    folder, disturbed = SweepFolder(out / "kills"), 0
    for _ in range(draw.randint(1, 3)):
        before = _files(folder)
        if not _disturbed(tally, way, draw, place, out, folder, duration, cluster):
            break
        disturbed += 1
        tally.counts[way] += 1
        after = _files(folder)
        tally.expect(before.items() <= after.items(), f"{way}: tiles changed or went ({out.name})")
        for tile in after:
            _expect_whole(tally, folder, tile, way)
    kept = _files(folder)
    found = resume_sweep(folder.path) if folder.is_sweep else sweep(parse(CONFIG), out=out)
    tally.expect(found.finished, f"{way}: not finished")
    tally.expect(kept.items() <= _files(folder).items(), f"{way}: tiles were computed again")
    dataset = open_sweep(folder.path).dataset.load()
    same = all(np.array_equal(dataset[n].values, whole[n].values, equal_nan=True) for n in whole.variables
               if whole[n].dtype.kind in "if")  # fmt: skip
    tally.expect(same and set(dataset.variables) == set(whole.variables), f"{way}: other bits ({out.name})")
    tally.counts["sweeps completed"] += 1
    return disturbed


def _files(folder: SweepFolder) -> dict[str, int]:
    """Tiles, and when each was written."""
    if not folder.tiles.is_dir():
        return {}
    return {path.name: path.stat().st_mtime_ns for path in folder.tiles.glob("g*-*.h5")}


def _expect_whole(tally: Tally, folder: SweepFolder, name: str, way: str) -> None:
    generation = folder.generations()[0]
    try:
        folder.read(generation, int(name[5:12]))
    except RigidsimError as error:
        tally.expect(False, f"{way}: {error}")


def _disturbed(
    tally: Tally,
    way: str,
    draw: random.Random,
    place: Path,
    out: Path,
    folder: SweepFolder,
    duration: float,
    cluster: Any,
) -> bool:
    """Begin, and disturb; False where the sweep was complete before it could be."""
    command = [sys.executable, "-m", "rigidsim", "sweep", str(place / "kills.toml"), "--out", str(out)]
    if way == "scheduler's worker":
        command += ["--scheduler", cluster.scheduler_address]
    elif "worker" in way:
        command += ["--workers", "2"]
    limit = draw.choice([3_000, 20_000, 60_000]) if way == "full disk" else None

    def limited() -> None:
        if limit is not None:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    child = subprocess.Popen(command, start_new_session=True, preexec_fn=limited, **quiet)
    if limit is not None:
        return child.wait(_PATIENCE) != 0
    wanted = len(_files(folder)) + draw.randint(0, 3)
    deadline = time.monotonic() + _PATIENCE
    while child.poll() is None and len(_files(folder)) < wanted and time.monotonic() < deadline:
        time.sleep(0.005)
    time.sleep(draw.random() * duration / 24)  # anywhere within a tile
    if child.poll() is not None:
        return False
    if way in ("worker", "scheduler's worker"):
        if way == "worker":
            workers = _workers(child.pid)
            if workers:
                os.kill(draw.choice(workers), signal.SIGKILL)
            disturbed = bool(workers)
        else:
            disturbed = _kill_cluster_workers(tally, draw, cluster, child, duration / 4)
        try:
            child.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            tally.expect(False, f"{way}: the sweep hangs ({out.name})")
            os.killpg(child.pid, signal.SIGKILL)
            child.wait()
        tally.expect(child.returncode == 0, f"{way}: the sweep ended with {child.returncode} ({out.name})")
        return disturbed
    os.killpg(child.pid, signal.SIGKILL)
    child.wait()
    return True


def _workers(pid: int) -> list[int]:
    """Worker processes of a sweep."""
    found = []
    for text in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        try:
            if b"spawn_main" in Path(f"/proc/{text}/cmdline").read_bytes():
                found.append(int(text))
        except OSError:
            continue
    return found


@contextmanager
def local_cluster() -> Iterator[Any]:
    """A Dask cluster of two workers on this machine, whose nannies start new ones; None without Dask."""
    try:
        import distributed
    except ImportError:
        yield None
        return
    import dask

    # Dask takes workers for lost that take longer than this (15 s) to be there again at another address
    dask.config.set({"distributed.deploy.lost-worker-timeout": "10 minutes"})
    options = {"threads_per_worker": 1, "processes": True, "host": "127.0.0.1", "dashboard_address": None}
    with distributed.LocalCluster(n_workers=2, silence_logs=50, **options) as cluster:
        yield cluster


def _kill_cluster_workers(tally: Tally, draw: random.Random, cluster: Any, child: Any, pause: float) -> bool:
    """Up to three deaths while a sweep runs; whether there was any. The sweep has to get over them."""
    killed: set[int] = set()
    for _ in range(draw.randint(1, 3)):
        pids = [nanny.pid for nanny in cluster.workers.values() if nanny.pid and nanny.pid not in killed]
        if child.poll() is None and pids:
            with suppress(ProcessLookupError):
                chosen = draw.choice(pids)
                os.kill(chosen, signal.SIGKILL)
                killed.add(chosen)  # its nanny may not have noticed when the next is drawn
        time.sleep(draw.random() * pause)
    tally.counts["deaths of a scheduler's workers"] += len(killed)
    return bool(killed)


if __name__ == "__main__":
    raise SystemExit(main())
