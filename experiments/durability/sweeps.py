"""Sweeps of which processes are killed, or whose disk fills up.

A sweep of 12 members in tiles of one is begun in a child process, disturbed at a random moment, and given
again until it is complete. Killed are the process (with all its workers), one worker, or workers of a Dask
cluster on this machine (where ``rigidsim[cluster]`` is installed). Full disks are a limit of the files' size,
drawn so that some fail at a tile and some at the dataset. Which tiles there are is noted from outside after
the kill; those have to be the same files, unchanged, at the end, and the dataset that of an undisturbed
sweep, bit for bit.
"""

import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.durability.judging import Tally
from experiments.durability.scenes import same
from rigidsim.errors import RigidsimError
from rigidsim.store.folder import SweepFolder
from rigidsim.store.sweeps.saved import open_sweep
from rigidsim.store.sweeps.tiles import read_tile
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
axes."time.end" = {values = [20, -20], name = "end"}
"""
WAYS = ("process", "process with workers", "worker", "full disk", "scheduler's worker")
_PATIENCE = 300.0  # seconds for one child


def disturb_sweeps(tally: Tally, kills: int, draw: random.Random, folder: Path, deadline: float) -> None:
    """So many disturbances, or as many as there is time for."""
    began = time.monotonic()
    whole = sweep(parse(CONFIG), out=folder / "whole").dataset.load()
    duration = time.monotonic() - began
    config = folder / "kills.toml"
    config.write_text(CONFIG)
    done = trial = 0
    with local_cluster() as cluster:
        ways = WAYS if cluster is not None else WAYS[:-1]
        while done < kills and time.monotonic() < deadline:
            way = ways[trial % len(ways)]
            trial += 1
            out = folder / f"trial{trial}"
            disturbed = _Sweep(tally, way, draw, config, out, duration, cluster)
            for _ in range(draw.randint(1, 3)):
                if not disturbed.once_more():
                    break
                done += 1
            kept = disturbed.tiles()
            begun = disturbed.folder.begun_here
            found = resume_sweep(out / "kills") if begun else sweep(parse(CONFIG), out=out)
            tally.expect(found.finished, f"{way}: not finished")
            tally.expect(kept.items() <= disturbed.tiles().items(), f"{way}: tiles were computed again")
            difference = same(open_sweep(out / "kills").dataset.load(), whole)
            tally.expect(not difference, f"{way}: other bits of {difference} ({out.name})")
            tally.counts["sweeps completed"] += 1
            tally.tell(f"{done} of {kills} disturbances ({way})")


@dataclass
class _Sweep:
    """One sweep that is disturbed in one way.

    Attributes:
        duration: seconds of an undisturbed sweep.
        cluster: of Dask, or None.
    """

    tally: Tally
    way: str
    draw: random.Random
    config: Path
    out: Path
    duration: float
    cluster: Any

    @property
    def folder(self) -> SweepFolder:
        """Of the sweep itself."""
        return SweepFolder(self.out / "kills")

    def tiles(self) -> dict[str, int]:
        """Tiles, and when each was written."""
        if not self.folder.tiles.is_dir():
            return {}
        return {path.name: path.stat().st_mtime_ns for path in self.folder.tile_files()}

    def once_more(self) -> bool:
        """Begin or go on, disturb, and look at the tiles; False where the sweep was complete before."""
        before = self.tiles()
        if not self._disturbed():
            return False
        self.tally.counts[self.way] += 1
        after = self.tiles()
        self.expect(before.items() <= after.items(), "tiles changed or went")
        for name in after:
            try:
                read_tile(self.folder.tiles / name)
            except RigidsimError as error:
                self.expect(False, str(error))
        return True

    def expect(self, good: bool, what: str) -> None:
        """Note a failure."""
        self.tally.expect(good, f"{self.way}: {what} ({self.out.name})")

    def _disturbed(self) -> bool:
        command = [sys.executable, "-m", "rigidsim", "sweep", str(self.config), "--out", str(self.out)]
        if self.way == "scheduler's worker":
            command += ["--scheduler", self.cluster.scheduler_address]
        elif "worker" in self.way:
            command += ["--workers", "2"]
        limit = self.draw.choice([3_000, 20_000, 60_000]) if self.way == "full disk" else None

        def limited() -> None:
            if limit is not None:
                signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        child = subprocess.Popen(command, start_new_session=True, preexec_fn=limited, **quiet)
        if limit is not None:
            return child.wait(_PATIENCE) != 0
        wanted = len(self.tiles()) + self.draw.randint(0, 3)
        deadline = time.monotonic() + _PATIENCE
        while child.poll() is None and len(self.tiles()) < wanted and time.monotonic() < deadline:
            time.sleep(0.005)
        time.sleep(self.draw.random() * self.duration / 24)  # anywhere within a tile
        if child.poll() is not None:
            return False
        if "process" in self.way:
            os.killpg(child.pid, signal.SIGKILL)
            child.wait()
            return True
        kill = self._kill_worker if self.way == "worker" else self._kill_cluster_workers
        disturbed = kill(child)
        try:
            child.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self.expect(False, "the sweep hangs")
            os.killpg(child.pid, signal.SIGKILL)
            child.wait()
        allowed = (0, 3) if self.way == "worker" else (0,)  # one of a pool ends the session
        self.expect(child.returncode in allowed, f"the sweep ended with {child.returncode}")
        return disturbed

    def _kill_worker(self, child: Any) -> bool:
        """One of a sweep's; whether there was any."""
        found = []
        for text in Path(f"/proc/{child.pid}/task/{child.pid}/children").read_text().split():
            with suppress(OSError):
                if b"spawn_main" in Path(f"/proc/{text}/cmdline").read_bytes():
                    found.append(int(text))
        if found:
            os.kill(self.draw.choice(found), signal.SIGKILL)
        return bool(found)

    def _kill_cluster_workers(self, child: Any) -> bool:
        """Up to three deaths while a sweep runs; whether there was any. The sweep has to get over them."""
        killed: set[int] = set()
        for _ in range(self.draw.randint(1, 3)):
            nannies = self.cluster.workers.values()
            pids = [nanny.pid for nanny in nannies if nanny.pid and nanny.pid not in killed]
            if child.poll() is None and pids:
                with suppress(ProcessLookupError):
                    chosen = self.draw.choice(pids)
                    os.kill(chosen, signal.SIGKILL)
                    killed.add(chosen)  # its nanny may not have noticed when the next is drawn
            time.sleep(self.draw.random() * self.duration / 4)
        self.tally.counts["deaths of a scheduler's workers"] += len(killed)
        return bool(killed)


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
