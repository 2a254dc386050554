"""Sweeps on a Dask cluster of this machine, whose workers are killed under it."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest
from support import config

from rigidsim import RigidsimError, parse, sweep
from rigidsim.workflows.sweeps.sweep import SweepObserver, cluster

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
    dask_cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
    )

    class Killer(SweepObserver):
        killed = 0

        def progressed(self, done: int) -> None:
            if not self.killed:  # its nanny starts another, the other one goes on meanwhile
                self.killed += 1
                worker = list(dask_cluster.workers.values())[self.killed % len(dask_cluster.workers)]
                os.kill(worker.pid, signal.SIGKILL)

    killer = Killer()
    with dask_cluster:
        address = dask_cluster.scheduler_address
        found = sweep(parse(CONFIG), out=tmp_path / "a", scheduler=address, observer=killer)
    assert found.finished
    assert killer.killed
    alone = sweep(parse(CONFIG), out=tmp_path / "b")
    for name in ("angular_velocity_final", "energy_drift_largest", "steps", "status"):
        np.testing.assert_array_equal(found.dataset[name].values, alone.dataset[name].values)


def test_a_scheduler_that_does_not_answer_is_told() -> None:
    with (
        pytest.raises(RigidsimError, match="no Dask scheduler answers"),
        cluster("tcp://127.0.0.1:9", patience=0.5),
    ):
        pass
