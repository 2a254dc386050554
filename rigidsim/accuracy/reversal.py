"""There and back again: a motion to its last sample, and from the state there back to its start.

By how much the way back misses the start is what both ways have made of rounding and of the tolerance, a
measure that needs no other solution. It says nothing of the model, nor of errors that both ways share.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigidsim.accuracy.comparison import Collected, angles_between, distances_between
from rigidsim.accuracy.estimates import estimate_errors
from rigidsim.errors import ConfigError, Problem, RigidsimError, required
from rigidsim.model.load import Load
from rigidsim.model.system import System
from rigidsim.scene.choices import variables_named
from rigidsim.scene.config import Experiment
from rigidsim.scene.sample_times import SampleTimes
from rigidsim.scene.scene import FROM_BEHIND, Scene, build_scene
from rigidsim.solve.problem import InitialValueProblem, prepare_scene
from rigidsim.solve.sampling import SampleClock
from rigidsim.solve.status import Status

_RUNAWAY, _SOME = 10, 1000  # times the steps there, and more, after which a way back has left the motion
_BEYOND = 10.0  # times the announced error: no run is further off without a warning
_SMALL = {
    "quaternion": "attitude",
    "momentum_axis": "attitude",
    "angular_velocity": "rates",
    "position": "position",
    "rigid_body_quaternion": "attitude",
    "rigid_body_angular_velocity": "rates",
    "rigid_body_position": "position",
}


@dataclass(frozen=True)
class Reversal:
    """How close a motion comes back to its start.

    Attributes:
        attitude: angle, rad; of an averaged motion, of the angular momentum's direction; None without either.
        rates: difference of angular velocities relative to their size; None where none are carried.
        position: distance, m; None for a body that doesn't fly. Of two bodies all are the larger ones.
        announced: estimated error of the attitude, or of the rates without one, rad or relative: of the way
            there, as the way back amplifies it, and of the way back; None if they can't be estimated.
        steps: of both ways.
    """

    attitude: float | None
    rates: float | None
    position: float | None
    announced: float | None
    steps: int

    @property
    def beyond(self) -> bool:
        """Whether the difference is more than ten times what both ways announce."""
        found = self.rates if self.attitude is None else self.attitude
        return self.announced is not None and not (found or 0.0) <= _BEYOND * self.announced

    @property
    def words(self) -> str:
        """The difference in words."""
        sizes = (
            (self.attitude, "attitude", "rad"),
            (self.rates, "angular velocity", "of its size"),
            (self.position, "position", "m"),
        )
        parts = [f"{what} within {size:.2g} {unit}" for size, what, unit in sizes if size is not None]
        unit = "" if self.attitude is None else " rad"
        announced = "" if self.announced is None else f"; both ways announce {self.announced:.2g}{unit}"
        return f"integrated to the end and back, it returns to its start: {', '.join(parts)}{announced}"


def there_and_back(experiment: Experiment, loads: Sequence[Load] = (), *, compact: bool = False) -> Reversal:
    """Integrate an experiment's motion to its last sample and back.

    Args:
        compact: to equations that are compiled sooner, and slower.

    Raises:
        ConfigError: it can't be integrated.
        RigidsimError: it ends before its last sample, or on the way back.
    """
    if not variables_named(experiment.config.integrator.formulation).regular:  # whose charts change
        experiment = experiment.with_overrides(['integrator.formulation="quaternion"'])
    names = [name for name in _SMALL if _records(experiment, name, loads)]
    if "quaternion" in names and "momentum_axis" in names:
        names.remove("momentum_axis")
    if not names:
        prepare_scene(experiment, build_scene(experiment), loads=loads)  # which may say why
        raise ConfigError(Problem("[integrator]", "the motion has neither an attitude nor rates to compare"))
    quiet = experiment.quiet(names)
    scene = build_scene(quiet)
    for impulse in (required(event.impulse) for event in scene.impulses if event.time is None):
        raise impulse.fault("expression", FROM_BEHIND)
    scene = _between(scene, scene.start, scene.samples.last)
    there = prepare_scene(quiet, scene, loads=loads)
    there = replace(there, precision=replace(there.precision, compact=compact or there.precision.compact))
    one = _taken(there, names, "the motion", experiment.config.limits.max_steps or math.inf)
    back = _reversed(there, one.state)
    other = _taken(back, names, "the motion back", _RUNAWAY * one.progress.steps + _SOME)
    found: dict[str, float] = {}
    for name in names:  # of two bodies the larger one
        found[_SMALL[name]] = max(found.get(_SMALL[name], 0.0), _apart(name, one[name], other[name]))
    begun, own = (
        estimate_errors(
            problem, way.progress.steps, float(problem.scene.samples.last), corrected=way.parts.corrected
        )
        for problem, way in ((there, one), (back, other))
    )
    return Reversal(
        attitude=found.get("attitude"),
        rates=found.get("rates"),
        position=found.get("position"),
        announced=None if begun is None or own is None else begun.leading * own.amplification + own.leading,
        steps=one.progress.steps + other.progress.steps,
    )


def _records(experiment: Experiment, name: str, loads: Sequence[Load]) -> bool:
    try:
        quiet = experiment.quiet([name])
        prepare_scene(quiet, build_scene(quiet), loads=loads)
    except ConfigError:
        return False
    return True


def _between(scene: Scene, start: object, end: object) -> Scene:
    """The scene from one time (mpf, s) to another, sampled at both."""
    exact = [scene.samples.begin, scene.samples.exact_last]
    if start != scene.start:
        exact.reverse()
    samples = SampleTimes.listed(exact[0], exact, scene.context)
    return replace(scene, start=start, end=end, samples=samples)


def _taken(problem: InitialValueProblem, names: Sequence[str], what: str, most: float) -> Collected:
    found = Collected(problem, names, lambda now: Status.MAX_STEPS if now.steps > most else None)
    status, seconds = found.progress.status, found.progress.time
    if status is Status.FINISHED:
        return found
    why = status.message
    if status is Status.MAX_STEPS:
        why = f"it takes more than {most:,.0f} steps"
    raise RigidsimError(
        f"{what} ends at {seconds:.6g} s, before its last sample: {why}; nothing was compared"
    )


def _reversed(there: InitialValueProblem, state: np.ndarray) -> InitialValueProblem:
    """The problem from a state at the end (scalars of the precision, internal units) back to the start."""
    system, precision = there.system, there.precision
    scene = _between(there.scene, there.scene.end, there.scene.start)
    scaling = replace(system.scaling, direction=-system.scaling.direction)
    plan = replace(system.plan, scene=scene, scaling=scaling)
    off = 1 + scene.context.mpf(float(precision.epsilon)) / 8  # too little to change a number: it was rounded
    begin = [scene.context.mpf(precision.exact(x)) * off for x in state]
    again = System(plan, system.number, coefficients=system.coefficients, initial=begin)
    clock = SampleClock(scene.samples, precision, scaling)
    return replace(there, scene=scene, system=again, clock=clock)


def _apart(name: str, there: list[np.ndarray], back: list[np.ndarray]) -> float:
    """Between the start and where the way back ended, both recorded as float64 parts (2, components)."""
    one, other = [part[:1] for part in there], [part[-1:] for part in back]
    if name.endswith("quaternion"):
        return float(angles_between(one, other)[0])
    apart = float(distances_between(one, other)[0])
    size = max(float(np.linalg.norm(part[0], axis=1).max()) for part in (there, back))
    return apart / (size or 1.0) if name.endswith("angular_velocity") else apart
