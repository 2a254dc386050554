"""How an averaged motion carries small errors of its direction on: steadily, in proportion to time, or
exponentially, as near a hyperbolic Cassini state.

Two tangents of the averaged motion's direction are followed over short stretches one after the other: each
gives the tangent map of its stretch, and their products that between any two times.
The average over the orbits serves where there is one, whose steps are few whatever the run's level; it
carries errors alike, up to terms that averaging leaves out.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rigidsim.accuracy.models.side_by_side import Unmeasured, in_model
from rigidsim.errors import ConfigError
from rigidsim.model.averaged.average import DIRECTION, Average
from rigidsim.scene.choices import ORBIT_AVERAGED
from rigidsim.solve.precision import precision_of
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.tangents import Derivatives, LostTangents, Place, Tangents
from rigidsim.store.summary_parts import UnmeasuredCode

_PART_OF_TURN = math.pi / 6
"""Largest angle of precession within a stretch, over which the path's direction is nearly the same."""
_FEWEST, _MOST = 64, 1024  # stretches
_TOLERANCE = 1e-9  # far below what matters of an error's growth
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
    made, double = Derivatives.of(system), precision_of("double")
    places = [system.states.index(name) for name in DIRECTION]
    moving = made.felt(places)
    compact = average.over_orbits or system.wide  # few steps
    tangents = Tangents(made, moving, 2, double, compact_mode=compact, tol=_TOLERANCE)
    own = [moving.index(place) for place in places]
    state = np.array([float(x) for x in system.initial])
    tangents.begin(
        Place((start, 0.0), np.append(state, np.zeros(2 * len(moving))), np.zeros(2, dtype=np.int64))
    )
    bases, moved = [_basis(state[places], np.zeros(3))], []
    for begin, until in pairwise(np.linspace(start, end, count + 1)):
        pushed = np.zeros((2, len(moving)))
        pushed[:, own] = bases[-1]
        tangents.restart(state, pushed)
        before = state
        try:
            ahead_of_it, _ = tangents.to(float(begin + ahead * (until - begin)), go_on)
            state, grown = tangents.to(float(until), go_on)
        except LostTangents:
            why = "motions near the averaged one can't be followed to its end"
            raise Unmeasured(UnmeasuredCode.AVERAGED_STOPPED, why) from None
        except KeyboardInterrupt:
            raise Unmeasured(UnmeasuredCode.INTERRUPTED, "the measurement was interrupted") from None
        path = _basis(before[places], ahead_of_it[places] - before[places], bases[-1][0])
        mixed = path @ bases[-1].T  # the basis along the path, in terms of the one that was pushed
        bases[-1] = path
        moved.append((mixed @ grown[:, own]).T)
        bases.append(_basis(state[places], np.zeros(3), path[0]))
    maps = [after @ step for after, step in zip(bases[1:], moved, strict=True)]
    return Carrying(seconds / count, np.array(maps))


def _problem(prepared: InitialValueProblem, average: Average | None) -> InitialValueProblem:
    """The averaged motion that is followed: averaged over the orbits as well, if it can be."""
    scene, names = prepared.scene, ["momentum_axis"]
    if average is not None and not average.over_orbits:
        with suppress(ConfigError):
            return in_model(prepared, scene, names, ORBIT_AVERAGED, None)
        return in_model(prepared, scene, names, average.level, average)
    return in_model(prepared, scene, names, ORBIT_AVERAGED, average)


def _basis(direction: np.ndarray, towards: np.ndarray, otherwise: np.ndarray | None = None) -> np.ndarray:
    """Unit vectors (2, 3) across a direction, the first of them along a path, the second across it."""
    along = towards - (towards @ direction) * direction
    if np.linalg.norm(along) < _STANDS:
        along = np.eye(3)[int(np.argmin(np.abs(direction)))] if otherwise is None else otherwise
        along = along - (along @ direction) * direction
    along = along / np.linalg.norm(along)
    return np.array([along, np.cross(direction, along)])
