"""The system with which a motion is followed between samples: the run's own, or its twin in quaternions.

Euler angles and their momenta have singularities, near which a run changes its chart. Following the motion
needs neither: the twin carries the same motion, and its states are functions of the run's.
"""

from __future__ import annotations

from dataclasses import replace

import heyoka as hy
import numpy as np

from rigidsim.model.formulations.quaternion import Quaternion
from rigidsim.model.state_blocks import BODY
from rigidsim.model.system import System
from rigidsim.solve.compiled import CompiledFunction, interruptible
from rigidsim.solve.precision import precision_of
from rigidsim.solve.sample_block import SampleBlock


class FollowedSystem:
    """The system that is followed in place of a given one.

    Attributes:
        system: the system whose motion is followed; None if none can be.
    """

    def __init__(self, system: System) -> None:
        self._own = system
        self._charts: list[CompiledFunction] = []
        self.system: System | None = system
        plan = system.plan
        if not plan.formulation.variables.regular:
            twin = System(replace(plan, formulation=Quaternion()), system.number)
            self.system = None if system.switches else twin

    def states(self, block: SampleBlock) -> np.ndarray:
        """States of the followed system, float64, at the samples of a block, (n, states)."""
        states = block.states.astype(np.float64)
        if self.system is None or self.system is self._own:
            return states
        if not self._charts:
            twin = self.system
            self._charts = interruptible(lambda: self._compiled(twin))
        charts = [np.asarray(chart(np.ascontiguousarray(states.T))).T for chart in self._charts]
        return np.where(block.chart[:, None] == 0, charts[0], charts[-1])

    def _compiled(self, twin: System) -> list[CompiledFunction]:
        own = self._own.rounded(precision_of("double").number)
        return [
            hy.cfunc(_twin_states(twin, chart), chart.variables, compact_mode=True)
            for chart in (own, own.partner)
            if chart is not None
        ]


def _twin_states(twin: System, chart: System) -> list[hy.expression]:
    """States of the twin as expressions of the states of a chart."""
    m = chart.mechanics
    attitude = m.carried(m.attitude)
    known = dict(zip(chart.states, chart.variables, strict=True))
    known |= dict(zip(m.carried(twin.mechanics.attitude).names, attitude.quaternion, strict=True))
    known |= dict(zip(BODY.rates, m.rate_states, strict=True))
    return [known[name] for name in twin.states]
