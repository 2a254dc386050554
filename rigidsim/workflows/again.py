"""A saved run integrated again: to be compared with, or for its motion between the samples."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path

import numpy as np

from rigidsim.errors import RunFolderError
from rigidsim.scene.config import Experiment
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.store.provenance import read_attributes
from rigidsim.workflows.read import embedded, refuse_other_kernel, with_recorded_variables_of
from rigidsim.workflows.run import run

RATES, ATTITUDE = "angular_velocity", "quaternion"


def experiment_again(dataset: Path) -> Experiment:
    """The experiment of a dataset as it was run: without guards, nothing left to be chosen, nothing drawn.

    Raises:
        RunFolderError: no config can reproduce it, or a kernel is another one now.
    """
    begun = embedded(dataset)
    loads = read_attributes(dataset).get("python_loads")
    if loads:
        raise RunFolderError(f"{dataset}: the run had loads from Python ({loads}), which its config lacks")
    experiment = with_recorded_variables_of(begun, dataset)
    refuse_other_kernel(experiment, dataset)
    config = experiment.config
    tables = {
        "output": config.output.model_copy(update={"timeline": False}),
        "integrator": config.integrator.model_copy(update={"accuracy": None}),
        "limits": type(config.limits).model_construct(),
    }
    return replace(experiment, config=config.model_copy(update=tables))


@dataclass(frozen=True)
class MotionAgain:
    """The motion of a saved run at any times: its own, in every bit, on the same versions and machine."""

    dataset: Path

    @cached_property
    def _experiment(self) -> Experiment:
        found = experiment_again(self.dataset)
        names = found.config.output.record or read_attributes(self.dataset).get("recorded", "").split()
        return found.quiet(list(dict.fromkeys([*names, RATES])))

    @cached_property
    def _scene(self) -> Scene:
        return build_scene(self._experiment)

    @property
    def host(self) -> str:
        """The body that it is, as ``[body] host`` names it; empty for none."""
        return self._experiment.config.body.host or ""

    @property
    def ahead(self) -> Fraction | None:
        """Date of time 0, seconds of TDB since J2000; None where the config doesn't say."""
        return None if self._scene.epoch is None else self._scene.epoch.since_j2000()

    @property
    def span(self) -> tuple[Fraction, Fraction]:
        """Exact times of the first and the last sample of the config, s."""
        return self._scene.samples.begin, self._scene.samples.exact_last

    def at(self, times: Sequence[Fraction]) -> tuple[np.ndarray, np.ndarray]:
        """Quaternions (rows, 4), body to space axes, and angular velocities (rows, 3), body axes, rad/s.

        Args:
            times: ascending, s, within the span.

        Raises:
            RunFolderError: the motion ends before.
        """
        again = run(self._experiment.quiet(times=times), out=None, progress=False)
        found = again.dataset
        if found.sizes["time"] != len(times):
            raise RunFolderError(f"{self.dataset}: integrated again, the run {again.outcome.message}")
        return found[ATTITUDE].values, found[RATES].values
