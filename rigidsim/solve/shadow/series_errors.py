"""What a loose tolerance cuts off from a step's series, measured at some steps."""

import copy
import math
from collections.abc import Sequence
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.system import System
from rigidsim.solve.compiled import TaylorEngine
from rigidsim.solve.shadow.through_pieces import ThroughPieces

_EIGHTY_BITS = int(np.finfo(np.longdouble).nmant) == 63
_LEAST_TOLERANCE, _LEAST_WIDE_TOLERANCE = 1e-11, 1e-15
"""Least tolerances whose step errors stand out from rounding; errors of smaller ones are in proportion."""
ONE_ORDER = math.exp(2.0)
"""Typical gain of one more order, which is the tolerance's own step from order to order (Jorba & Zou 2005);
the factor by which proportions can be wrong.
"""
_FAR, _MOST_BACK = 2.0**10, 64
"""Longest step, and most of those that lead back over one."""
_THROUGH_PIECES = 32
"""Most steps of a stretch that are looked at together where steps end at edges of pieces of the equations.
None is like another there: one would stand for many that are much shorter, or have errors of other signs. By
one the errors of a tumbling body, the Moon and a satellite at 1e-9 were announced up to 160 times too large.
"""
_PARTS = 4
"""Parts of a step, whose errors are at most a thousandth of its own: 4 to the power of the series' order."""


class SeriesErrors:
    """Truncation errors that a tolerance allows in a step, from comparing it with the same step in parts; the
    mean of several steps through pieces of the equations.

    Errors are those of the series' order, a whole number, and one more term may gain nothing at all (its
    coefficient has a phase): they are looked at with the tolerance as it is. Where they don't stand out of
    double precision's rounding, that is done with 80 bits. Without an integrator in double one is compiled.

    Args:
        turning: indices of the rates and the attitude, if these stand in for a run's Euler angles.
        mean: mean step of that run. Where it is shorter than other states alone would make it, angles set it,
            and an error is what the tolerance allows these, however short the other states make steps here.
    """

    def __init__(
        self,
        system: System,
        tolerance: float,
        integrator: TaylorEngine | None = None,
        *,
        turning: Sequence[int] = (),
        mean: float = math.inf,
    ) -> None:
        self._turning, self._mean = list(turning), mean
        self._through = None if system.pieces is None else ThroughPieces(system.pieces, system.states)
        wide = tolerance < _LEAST_TOLERANCE and _EIGHTY_BITS
        tried = max(tolerance, _LEAST_WIDE_TOLERANCE if wide else _LEAST_TOLERANCE)
        self._share = min(tolerance / tried * ONE_ORDER, 1.0)
        self._rounding = 16 * float(np.finfo(np.longdouble if wide else float).eps)
        if integrator is not None and not wide and tried == tolerance:
            self._integrator: TaylorEngine = copy.deepcopy(integrator)
            return
        number: Any = np.longdouble if wide else float
        initial = [number(float(x)) for x in system.initial]
        options = {"compact_mode": True, "opt_level": 0, "fp_type": number}
        self._integrator = hy.taylor_adaptive(system.equations, initial, tol=number(tried), **options)

    def of_step(self, state: np.ndarray, time: float, stretch: float) -> np.ndarray:
        """Error (states,) of a step that begins in the given state and stands for a stretch of so many, as
        one of that state: what is wrong at the step's end is carried back, since the motion turns a good part
        of a radian in between.
        """
        engine = self._integrator
        number = engine.state.dtype.type
        engine.time = number(time)
        engine.state[:] = state
        longest = _FAR if self._through is None else min(self._through.at(engine, time) - time, _FAR)
        _, size = engine.step(number(longest), write_tc=bool(self._turning))
        if not (size and np.isfinite(engine.state).all()):
            return np.zeros_like(state)
        least, steps = self._of_turning(state, float(size)), 1
        if self._through is None:
            engine.propagate_until(number(time), max_steps=_MOST_BACK, max_delta_t=number(size) / _PARTS)
        else:
            steps = self._there_and_back(self._through, time, stretch)
        wrong = (engine.state - state).astype(float)
        wrong[np.abs(wrong) < self._rounding * np.abs(state)] = 0.0
        wrong = self._share / steps * wrong if np.isfinite(wrong).all() else np.zeros_like(wrong)
        return np.copysign(np.maximum(np.abs(wrong), np.abs(least)), np.where(wrong != 0, wrong, least))

    def _there_and_back(self, through: ThroughPieces, time: float, stretch: float) -> int:
        """Take more steps of a stretch, and go back over all of them in parts; returns how many."""
        engine = self._integrator
        number = engine.state.dtype.type
        piece, steps, most = through.number_at(time), 1, min(stretch, _THROUGH_PIECES)
        edge, left = through.set(engine, piece), list[tuple[float, np.ndarray]]()
        while steps < most and math.isfinite(edge) and np.isfinite(engine.state).all():
            if float(engine.time) >= edge:
                left.append((edge, np.array(engine.state)))
                piece += 1
                engine.time = number(edge)
                through.enter(engine.state, piece)
                edge = through.set(engine, piece)
                continue
            engine.step(number(min(edge - float(engine.time), _FAR)))
            steps += 1
        part = (engine.time - number(time)) / steps / _PARTS
        for begun, state in reversed(left):
            engine.propagate_until(number(begun), max_steps=_MOST_BACK * steps, max_delta_t=part)
            through.leave(engine.state, piece, state)
            piece -= 1
            through.set(engine, piece)
        engine.propagate_until(number(time), max_steps=_MOST_BACK * steps, max_delta_t=part)
        return steps

    def _of_turning(self, state: np.ndarray, size: float) -> np.ndarray:
        """First neglected term of the rates and the attitude in a step as long as they alone would make it,
        times the share of the run's steps that angles set; 0 where no other states shorten steps.
        """
        found = np.zeros_like(state)
        if not self._turning:
            return found
        series = np.asarray(self._integrator.tc, dtype=float)
        order = series.shape[1] - 1
        longer = _radius(series[self._turning], state) / _radius(series, state)
        share = 1 - self._mean / size
        turning, step = series[self._turning], size * longer
        before, last = (np.abs(turning[:, n]).max() for n in (order - 1, order))
        if longer > 1 and share > 0 and math.isfinite(longer) and before > 0:
            gain = min(step * last / before, 1 / ONE_ORDER)  # terms of a rotation gain more and more
            found[self._turning] = share * self._share * gain * step**order * turning[:, order]
        return found


def _radius(series: np.ndarray, state: np.ndarray) -> float:
    """Radius of convergence by which steps are chosen (Jorba & Zou 2005), from the last two orders."""
    largest, order = max(1.0, float(np.abs(state).max())), series.shape[1] - 1
    terms = [(n, float(np.abs(series[:, n]).max())) for n in (order - 1, order)]
    return min((largest / term) ** (1 / n) if term > 0 else math.inf for n, term in terms)
