"""How an averaged motion carries small errors of its direction on: steadily, in proportion to time, or
exponentially, as near a hyperbolic Cassini state.

Neighbours of the averaged motion, two tangent directions of its direction, are followed over short stretches
one after the other: each gives the tangent map of its stretch, and their products that between any two times.
The average over the orbits serves where there is one, whose steps are few whatever the run's level; it
carries errors alike, up to terms that averaging leaves out.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from rigidsim.accuracy.models.side_by_side import Unmeasured
from rigidsim.accuracy.trial import compactly
from rigidsim.errors import ConfigError
from rigidsim.model.averaged.average import DIRECTION, Average
from rigidsim.scene.choices import DEFAULT_METHOD, ORBIT_AVERAGED
from rigidsim.solve.problem import InitialValueProblem, prepare_scene
from rigidsim.solve.shadow.carriers import BatchCarrier, StepperCarrier
from rigidsim.solve.shadow.ensemble import PERTURBED, EnsembleCarrier
from rigidsim.store.summary_parts import UnmeasuredCode

_PART_OF_TURN = math.pi / 6
"""Largest angle of precession within a stretch, over which the path's direction is nearly the same."""
_FEWEST, _MOST = 64, 1024  # stretches
_APART = 2.0**-20
"""Distance of neighbours, rad: its square is below, and the lanes' tolerance far below, what matters."""
_STEPS = 1 << 20  # of one call
_STEPS_OF_SPIN = 10_000  # from which code pays that takes longer to compile
_STANDS = 1e-13  # rad: a path that is shorter has no direction


@dataclass(frozen=True)
class Carrying:
    """Tangent maps (stretches, 2, 2) of an averaged motion's direction, in components along the path and
    across it.
    """

    seconds: float
    maps: np.ndarray

    def grown(self, along: float, across: float) -> float:
        """Largest error (rad) until the end, of a motion that errs by given rates (rad/s) along the path and
        across it all the time: what is made at different times adds up whatever its sign, which need not stay
        the same.
        """
        largest = 0.0
        for error in self.errors(along, across):
            largest = max(largest, error)
            if largest > math.pi:
                break
        return largest

    def errors(self, along: float, across: float) -> Iterator[float]:
        """Errors (rad) at the ends of the stretches, as of ``grown``."""
        made = np.diag([along, across]) * self.seconds / 2
        errors = np.empty((2, 2 * len(self.maps)))  # a column for each time and component
        for n, step in enumerate(self.maps):
            errors[:, : 2 * n] = step @ errors[:, : 2 * n]
            # half of a stretch's errors at its beginning, half at its end
            errors[:, 2 * n : 2 * n + 2] = step @ made + made
            yield math.hypot(*np.abs(errors[:, : 2 * n + 2]).sum(axis=1))


def carrying(
    prepared: InitialValueProblem, average: Average | None, go_on: Callable[[], bool] = lambda: True
) -> Carrying:
    """Tangent maps of a run's averaged motion, from its start to its end; of a run of the full model (None),
    of its average over the orbits. Raises ``ConfigError`` where there is none, and ``Unmeasured`` if
    ``go_on`` ended it, or the motion can't be followed.
    """
    problem = _problem(prepared, average)
    system = problem.system
    average = system.formulation.average
    assert average is not None
    if average.resonance is not None:
        raise Unmeasured(UnmeasuredCode.AVERAGED_STOPPED, "a resonance is no motion of a direction alone")
    start, end = float(problem.clock.start), float(problem.clock.at(problem.clock.count - 1))
    seconds = math.ldexp(end - start, system.scaling.time)
    turned = seconds * average.strength * abs(float(average.motion.excess / average.motion.momentum))
    count = int(min(max(turned / _PART_OF_TURN, _FEWEST), _MOST))
    ahead = min(1.0, _PART_OF_TURN * count / max(turned, 1e-300))  # of a stretch
    carrier, edges = _carrier(problem), np.linspace(start, end, count + 1)
    places = [system.states.index(name) for name in DIRECTION]
    state = np.array([float(x) for x in system.initial])
    bases, moved = [_basis(state[places], np.zeros(3))], []
    for begin, until in pairwise(edges):
        middle = float(begin + ahead * (until - begin))
        states = np.repeat(state[:, None], PERTURBED + 1, axis=1)
        pushed = bases[-1]
        states[places, 1:3] += _APART * pushed.T
        if not go_on():
            raise Unmeasured(UnmeasuredCode.INTERRUPTED, "the measurement was interrupted")
        states = _to(carrier, states, float(begin), middle)
        bases[-1] = _basis(state[places], states[places, 0] - state[places], pushed[0])
        states = _to(carrier, states, middle, float(until))
        state = states[:, 0]
        apart = (states[places, 1:3] - state[places, None]) / _APART
        moved.append(apart @ pushed @ bases[-1].T)
        bases.append(_basis(state[places], np.zeros(3), bases[-1][0]))
    maps = [after @ step for after, step in zip(bases[1:], moved, strict=True)]
    return Carrying(seconds / count, np.array(maps))


def _problem(prepared: InitialValueProblem, average: Average | None) -> InitialValueProblem:
    """The averaged motion that is followed: averaged over the orbits as well, if it can be."""
    scene, config = prepared.scene, prepared.scene.config
    plain: dict[str, object] = {"precision": "double", "tolerance": "auto"}
    if average is None:  # what is of the full motion alone
        plain |= {"formulation": "auto", "method": DEFAULT_METHOD, "hold_invariants": False}
        plain |= {"accuracy": None, "accuracy_position": None}
    integrator = config.integrator.model_copy(update=plain)
    output = config.output.model_copy(update={"record": ["momentum_axis"], "lyapunov": False})
    own_level = ORBIT_AVERAGED if average is None else average.level
    for level in dict.fromkeys((ORBIT_AVERAGED, own_level)):
        model = config.model.model_copy(update={"level": level, "short_period": False})
        tables = {"model": model, "integrator": integrator, "output": output, "events": []}
        found = replace(scene, config=config.model_copy(update=tables), events=())
        loads = prepared.python_loads
        own = average if level == own_level else None
        try:
            return compactly(prepare_scene(prepared.experiment, found, loads=loads, along=own))
        except ConfigError:
            if level == own_level:
                raise
    raise AssertionError


def _carrier(problem: InitialValueProblem) -> EnsembleCarrier:
    system, clock = problem.system, problem.clock
    if system.stepwise:
        start, end = float(clock.start), float(clock.at(clock.count - 1))
        return StepperCarrier(system, start, end, 1)
    average = system.formulation.average
    assert average is not None
    return BatchCarrier(system, 0 if average.over_orbits else _STEPS_OF_SPIN)


def _to(carrier: EnsembleCarrier, states: np.ndarray, begin: float, end: float) -> np.ndarray:
    """States (states, 1 + perturbed) at a later time. Raises ``Unmeasured``."""
    only, every = np.zeros(1, dtype=int), np.ones((1, states.shape[1]))
    while begin < end:
        moved, _, reached = carrier.advance(
            only, states[:, None], begin * every, end * every, np.array([_STEPS])
        )
        if not np.isfinite(moved).all():
            why = "motions beside the averaged one can't be followed to its end"
            raise Unmeasured(UnmeasuredCode.AVERAGED_STOPPED, why)
        states, begin = moved[:, 0], float(reached[0])
    return states


def _basis(direction: np.ndarray, towards: np.ndarray, otherwise: np.ndarray | None = None) -> np.ndarray:
    """Unit vectors (2, 3) across a direction, the first of them along a path, the second across it."""
    along = towards - (towards @ direction) * direction
    if np.linalg.norm(along) < _STANDS:
        along = np.eye(3)[int(np.argmin(np.abs(direction)))] if otherwise is None else otherwise
        along = along - (along @ direction) * direction
    along = along / np.linalg.norm(along)
    return np.array([along, np.cross(direction, along)])
