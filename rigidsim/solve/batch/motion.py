"""Members' motions and their tangent vectors, which change no bit of the motions.

The motion's numbers are always those of an integrator without tangent vectors. Compiled with them, its
equations may be rounded otherwise; where a system is small they aren't, and one integrator does for both:
some lanes are taken by both, and where these differ in any bit, or a vector has grown so far that steps would
know of it, the motion is taken from the integrator without. How an operation is rounded is a matter of the
compiled code, not of the numbers, so that a difference shows in the first lanes that are compared: these are
some of the first block and of every ``_EVERY``-th after it.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from rigidsim.model.tangents import LARGEST, SMALL
from rigidsim.solve.batch.events import EventExpressions
from rigidsim.solve.batch.lane_results import LaneResults
from rigidsim.solve.batch.lanes import BatchEngine, BatchSystem
from rigidsim.solve.batch.tracing import TracedSystem

_UNFELT = float(np.exp(LARGEST - SMALL * np.log(2.0)))
"""Largest component of a tangent vector that no step control notices."""

_EVERY = 16


class BatchMotion:
    """Integrators of a traced system.

    Args:
        crossings: the system's events.
        width: lanes of the integrators.
    """

    def __init__(self, traced: TracedSystem, crossings: EventExpressions, width: int) -> None:
        self._traced, self._crossings, self._width = traced, crossings, width
        self._tangents = len(traced.system.states) > traced.moving
        unfelt_beside = traced.system.formulation.unfelt_tangents
        self._runs = 0
        self._may_share = self._tangents and unfelt_beside and not traced.system.crossings

    @cached_property
    def _plain(self) -> BatchEngine:
        return self._engine(self._traced.moving, with_events=True)

    @cached_property
    def _along(self) -> BatchEngine:
        return self._engine(len(self._traced.system.states), with_events=False)

    def _engine(self, states: int, *, with_events: bool) -> BatchEngine:
        system, tolerance = self._traced.system, self._traced.prepared.tolerance
        rights = self._traced.as_parameters([right for _, right in system.equations[:states]])
        described = BatchSystem(
            list(zip(system.variables[:states], rights, strict=True)),
            self._crossings.over_parameters() if with_events else [],
            len(self._traced.in_equations) + (self._crossings.parameters if with_events else 0),
            None if tolerance is None else float(tolerance),
            system.wide,
        )
        return BatchEngine(described, self._width)

    def compile(self) -> None:
        """Compile the integrators that ``run`` uses."""
        for engine in ("_plain", "_along") if self._tangents else ("_plain",):
            getattr(self, engine)

    def run(
        self,
        initial: np.ndarray,
        parameters: np.ndarray,
        start: np.ndarray,
        times: np.ndarray,
        most_steps: int,
    ) -> tuple[LaneResults, np.ndarray | None]:
        """Take members to their last samples.

        Args:
            initial: (states, members), tangent vectors included; parameters: (parameters, members), those of
                events after those of the equations.
            start: (members,), times: (samples, members), internal units.
            most_steps: largest number of steps of a member.

        Returns:
            the motion's lanes, and the states of motion and tangent vector, (samples, states, members); None
            where the scene has none.
        """

        moving = self._traced.moving

        def plain(which: np.ndarray) -> LaneResults:
            return self._plain.run(
                initial[:moving, which], parameters[:, which], start[which], times[:, which], most_steps
            )

        everybody = np.arange(initial.shape[1])
        if not self._tangents:
            return plain(everybody), None
        read = parameters[: len(self._traced.in_equations)]
        along = self._along.run(initial, read, start, times, most_steps)
        if not self._may_share:
            return plain(everybody), along.states
        motion = replace(along, states=along.states[:, :moving])
        felt = ~(np.abs(along.states[:, moving:]) < _UNFELT).all(axis=(0, 1))
        felt |= ~along.arrived | ~along.finite
        again, unfelt = np.flatnonzero(felt), np.flatnonzero(~felt)
        if len(unfelt):
            if self._runs % _EVERY == 0:
                tried = unfelt[np.unique(np.linspace(0, len(unfelt) - 1, self._width).astype(np.int64))]
                self._may_share = _same_bits(plain(tried), motion, tried)
            self._runs += 1
        if not self._may_share:
            return plain(everybody), along.states
        if len(again):
            motion = replace(motion, states=motion.states.copy())
            motion.put(again, plain(again))
        return motion, along.states


def _same_bits(some: LaneResults, whole: LaneResults, which: np.ndarray) -> bool:
    """Whether members came out the same in both results.

    Args:
        which: their places in the whole, in the order of ``some``.
    """
    there = np.ascontiguousarray(whole.states[:, :, which])
    return np.ascontiguousarray(some.states).tobytes() == there.tobytes() and bool(
        (some.steps == whole.steps[which]).all()
    )
