"""The experiment's own motion at the times of a trajectory, in its own precision and by its own method."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rigidsim.errors import ConfigError, Problem, RigidsimError
from rigidsim.scene.config import Experiment
from rigidsim.scene.row_rotations import normalised
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.solve.from_states import FromStates
from rigidsim.store.many_rows import blocks_of, gathered, picked
from rigidsim.store.run import Run
from rigidsim.workflows.physics.models import rotation_vectors
from rigidsim.workflows.run import run

_FLIGHT = ("position", "velocity")
_MOST_OWN = 20_000  # rows, up to which the experiment's own method gives the motion at all of them


@dataclass(frozen=True)
class OwnMotion:
    """The experiment at the trajectory's times.

    Attributes:
        quaternions: float64 parts (rows, 4) each, w x y z, whose sum is the attitude.
        rates: (rows, 3), rad/s, body axes. positions, velocities: (rows, 3), SI; None without flight.
        uncertainty: announced error of its attitude at the end, rad; 0 if unknown.
        ended: why the motion ended before the trajectory; empty if it didn't.
        states: those of the scene's own motion by ``FromStates``, if it was found by these.
    """

    quaternions: list[np.ndarray]
    rates: np.ndarray
    positions: np.ndarray | None
    velocities: np.ndarray | None
    uncertainty: float
    ended: str
    states: np.ndarray | None = None


def plain(experiment: Experiment) -> tuple[Experiment, Scene]:
    """The experiment with nothing drawn or recorded but attitude, rates and flight; and its scene."""
    config = experiment.config
    if config.sweep is not None:
        what = "describes many members, and this takes a single experiment; remove [sweep]"
        raise ConfigError(Problem("[sweep]", what), experiment.source)
    flies = config.initial.position is not None or config.initial.velocity is not None
    names = ["quaternion", "angular_velocity", *(_FLIGHT if flies else ())]
    quiet = experiment.quiet(names, estimate=config.output.estimate)
    return quiet, build_scene(quiet)


def sampled_run(experiment: Experiment, times: np.ndarray) -> Run:
    """Run the experiment in memory, sampled at exactly these doubles (s, ascending)."""
    sampled = experiment.quiet(times=times.tolist(), estimate=experiment.config.output.estimate)
    return run(sampled, out=None, progress=False)


def own_motion(experiment: Experiment, times: np.ndarray) -> OwnMotion:
    """Run the experiment, sampled at exactly these doubles (s, ascending).

    Raises:
        RigidsimError: the motion ends before the third of them.
    """
    made = sampled_run(experiment, times)
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


def motion_at_all(
    experiment: Experiment, equations: FromStates | None, times: np.ndarray,
    sampled: tuple[np.ndarray, OwnMotion], told: list[str],
) -> OwnMotion:  # fmt: skip
    """The experiment at all rows; of very many by the same equations in double precision.

    Args:
        times: (rows,), s. sampled: rows at which the motion is known, and that.
        told: gets what a user should know of it.
    """
    rows, own = sampled
    if len(times) <= _MOST_OWN or equations is None or own.ended:
        found = own if len(times) <= len(rows) and not own.ended else own_motion(experiment, times)
        if found.ended:
            told.append(f"the experiment's motion {found.ended}; later rows aren't compared")
        return found
    states = equations.motion(times)

    def each(what: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        return gathered(what(states[block]) for block in blocks_of(len(times)))

    quaternions = each(lambda some: equations.attitude(some)[0])
    rates = each(lambda some: equations.attitude(some)[1])
    there = [normalised(picked(quaternions, rows))]
    apart = np.linalg.norm(rotation_vectors(own.quaternions, there), axis=1).max()
    told.append(
        f"{len(times):,} rows: all were compared with the motion in double precision, which is within "
        f"{apart:.1g} rad of the experiment's own at {len(rows)} of them"
    )
    place = speed = None
    if equations.flies:
        flight = each(lambda some: np.asarray(equations.flight(some)))
        place, speed = flight[:, :3], flight[:, 3:]
    return OwnMotion([quaternions], rates, place, speed, max(own.uncertainty, float(apart)), "", states)
