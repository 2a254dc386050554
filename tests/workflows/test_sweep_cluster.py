"""Sweeps on a Dask cluster of this machine, whose workers are killed under it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import config

from rigidsim import RigidsimError, parse, sweep
from rigidsim.errors import StoppedError
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.store.sweeps.folder import SweepFolder
from rigidsim.workflows.sweeps.cluster import Cluster
from rigidsim.workflows.sweeps.sweep import SweepObserver, run_sweep

distributed = pytest.importorskip("distributed")

CONFIG = config(
    initial="angular_velocity = [0.1, 1, 0.05]",
    time="end = 5\nsamples = 6",
    integrator='formulation = "rates"',
    more="""\
[sweep]
keep = ["final"]
tile = 1
axes."initial.angular_velocity[2]" = {step = [0.1, 0.1, 6], name = "w3"}
""",
    name="cluster",
)


@pytest.mark.slow  # five processes that import everything
def test_a_cluster_makes_the_same_dataset_though_a_worker_dies(tmp_path: Path) -> None:
    # a busy machine may take longer than 15 s to start a worker again, for which Dask would give it up
    import dask

    dask.config.set({"distributed.deploy.lost-worker-timeout": "10 minutes"})
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
    )

    class Killer(SweepObserver):
        killed = 0

        def progressed(self, done: int) -> None:
            if not self.killed:  # its nanny starts another, the other one goes on meanwhile
                self.killed += 1
                worker = list(cluster.workers.values())[self.killed % len(cluster.workers)]
                os.kill(worker.pid, signal.SIGKILL)

    killer = Killer()
    with cluster:
        found = sweep(parse(CONFIG), out=tmp_path / "a", scheduler=cluster.scheduler_address, observer=killer)
    assert found.finished
    assert killer.killed
    alone = sweep(parse(CONFIG), out=tmp_path / "b")
    for name in ("angular_velocity_final", "energy_drift_largest", "steps", "status"):
        np.testing.assert_array_equal(found.dataset[name].values, alone.dataset[name].values)


@contextmanager
def worker_without_nanny(address: str) -> Iterator[subprocess.Popen[bytes]]:
    """A worker that nobody starts again."""
    command = [
        sys.executable,
        "-m",
        "dask",
        "worker",
        address,
        "--no-nanny",
        "--nthreads",
        "1",
        "--no-dashboard",
    ]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.mark.slow  # a scheduler, and two workers that import everything
def test_a_worker_that_dies_before_its_tile_is_fetched_does_not_hang_the_sweep(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended = distributed.wait
    dying: list[subprocess.Popen[bytes]] = []

    def then_killed(*args: Any, **options: Any) -> Any:
        found = ended(*args, **options)
        if found.done and dying:
            dying.pop().kill()
        return found

    monkeypatch.setattr(distributed, "wait", then_killed)
    wanted, folder = Sweep.of(parse(CONFIG)), SweepFolder(tmp_path / "a" / "cluster")
    with distributed.LocalCluster(n_workers=0, host="127.0.0.1", dashboard_address=None) as cluster:
        way = Cluster(cluster.scheduler_address, alone=1)
        with worker_without_nanny(cluster.scheduler_address) as worker:
            cluster.wait_for_workers(1)
            dying.append(worker)
            with pytest.raises(StoppedError, match="no worker is left there"):
                run_sweep(wanted, folder, way=way, observer=SweepObserver())
        with worker_without_nanny(cluster.scheduler_address):
            cluster.wait_for_workers(1)
            found = run_sweep(wanted, folder, way=way, observer=SweepObserver())
    assert found.finished
    alone = sweep(parse(CONFIG), out=tmp_path / "b")
    for name in ("angular_velocity_final", "energy_drift_largest", "steps", "status"):
        np.testing.assert_array_equal(found.dataset[name].values, alone.dataset[name].values)


class _Gone:
    """A client whose scheduler went: what Dask raises then differs from version to version."""

    status = "running"

    def __init__(self, error: Exception, status: str) -> None:
        self._error, self._status = error, status

    def __enter__(self) -> _Gone:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is left to close."""

    def nthreads(self) -> dict[str, int]:
        self.status = self._status
        raise self._error


@pytest.mark.parametrize("error", [OSError("Timed out"), RuntimeError("Client is closed")])
def test_a_scheduler_that_goes_is_told_and_another_fault_is_not_taken_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    monkeypatch.setattr(distributed, "Client", lambda *_, **__: _Gone(error, "closed"))
    with pytest.raises(RigidsimError, match="the scheduler is gone; start it again"):
        sweep(parse(CONFIG), out=tmp_path / "a", scheduler="tcp://127.0.0.1:9")
    monkeypatch.setattr(distributed, "Client", lambda *_, **__: _Gone(error, "running"))
    with pytest.raises(Exception, match=str(error)):
        sweep(parse(CONFIG), out=tmp_path / "b", scheduler="tcp://127.0.0.1:9")


def test_a_scheduler_that_does_not_answer_is_told(tmp_path: Path) -> None:
    begun = sweep(parse(CONFIG), out=tmp_path)
    (generation,) = begun.folder.generations()
    with pytest.raises(RigidsimError, match="no Dask scheduler answers"):
        next(Cluster("tcp://127.0.0.1:9", patience=0.5).images(generation, [0]))
