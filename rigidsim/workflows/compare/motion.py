"""The experiment's own motion at the times of a trajectory, in its own precision and by its own method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from rigidsim.errors import ConfigError, Problem, RigidsimError
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.workflows.run import run

_FLIGHT = ("position", "velocity")


@dataclass(frozen=True)
class OwnMotion:
    """The experiment at the trajectory's times.

    Attributes:
        quaternions: float64 parts (rows, 4) each, w x y z, whose sum is the attitude.
        rates: (rows, 3), rad/s, body axes. positions, velocities: (rows, 3), SI; None without flight.
        uncertainty: announced error of its attitude at the end, rad; 0 if unknown.
        ended: why the motion ended before the trajectory; empty if it didn't.
    """

    quaternions: list[np.ndarray]
    rates: np.ndarray
    positions: np.ndarray | None
    velocities: np.ndarray | None
    uncertainty: float
    ended: str


def plain(experiment: Experiment) -> tuple[Experiment, Scene]:
    """The experiment with nothing drawn or recorded but attitude, rates and flight; and its scene."""
    config = experiment.config
    if config.sweep is not None:
        what = "describes many members, and this takes a single experiment; remove [sweep]"
        raise ConfigError(Problem("[sweep]", what), experiment.source)
    flies = config.initial.position is not None or config.initial.velocity is not None
    names = ["quaternion", "angular_velocity", *(_FLIGHT if flies else ())]
    output = {
        "record": names,
        "timeline": False,
        "lyapunov": False,
        "sensitivity": None,
        "orientation": None,
        "orientation_of": None,
    }
    quiet = replace(
        experiment,
        config=config.model_copy(update={"output": config.output.model_copy(update=output)}),
    )
    return quiet, build_scene(quiet)


def own_motion(experiment: Experiment, times: np.ndarray) -> OwnMotion:
    """Run the experiment, sampled at exactly these doubles (s, ascending).

    Raises:
        RigidsimError: the motion ends before the third of them.
    """
    listed = [ExactNumber(Fraction(time)) for time in times.tolist()]
    sampled = {"times": listed, "end": None, "samples": None, "every": None}
    config = experiment.config
    table = config.time.model_copy(update=sampled)
    made = run(
        replace(experiment, config=config.model_copy(update={"time": table})), out=None, progress=False
    )
    found = made.dataset
    if found.sizes["time"] < min(3, len(times)):
        raise RigidsimError(f"the experiment's motion {made.outcome.message}, before the trajectory begins")
    ended = "" if found.sizes["time"] == len(times) else str(made.outcome.message)
    names: Sequence[str] = [n for n in ("quaternion", "quaternion_lo", "quaternion_lo2") if n in found]
    place, speed = (found[name].values if name in found else None for name in _FLIGHT)
    accuracy = getattr(made.outcome, "accuracy", None)
    announced = getattr(accuracy, "certified", None) or getattr(accuracy, "estimated_attitude_error", None)
    return OwnMotion(
        [found[name].values for name in names],
        found["angular_velocity"].values,
        place,
        speed,
        uncertainty=float(announced or 0.0),
        ended=ended,
    )
