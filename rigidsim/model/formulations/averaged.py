"""Motions averaged over the body's rotation, as [model] level asks for: the door to ``averaged``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.averaged.applies import resonance_search
from rigidsim.model.averaged.average import DIRECTION, Average, average_of
from rigidsim.model.averaged.mechanics import (
    AMPLITUDES,
    SLOW,
    AveragedMechanics,
    DrivenMechanics,
    ResonantMechanics,
)
from rigidsim.model.formulations.formulation import Formulation, ModelPlan, Requirements
from rigidsim.model.frames import refuse_without_plane
from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder, choose_scaling
from rigidsim.model.state_blocks import AttitudeStates, StateBlock
from rigidsim.scene.choices import Variables
from rigidsim.scene.scene import Scene

_OF_FIGURE = ("figure_axis",)
_WHY = {
    "spin_averaged": "the direction of the angular momentum, under torques averaged over the body's free "
    "rotation: its size and the energy stay as they are",
    "orbit_averaged": "the direction of the angular momentum, under torques averaged over the body's free "
    "rotation and over the sources' orbits: its size and the energy stay as they are",
}

_WHY_TURNED = "the direction of the angular momentum, under gravity gradients averaged over the free rotation"
_WHY_AT_REST = "the direction of the angular momentum, which torques of the body alone don't turn on average"


class Averaged(Formulation):
    """The direction of the angular momentum, and its slow companions."""

    carries_rates = False
    resolves_rotation = False
    twin = None
    average: Average

    def __init__(self, average: Average) -> None:
        self.average, self.longitude = average, average.longitude
        summed = average.driven is not None and average.driven.nodes
        self.wide = average.resonance is not None or bool(summed)
        self.variables = Variables(average.level, general=False)  # type: ignore[misc]  # the scene decides

    @classmethod
    def along(cls, scene: Scene, loads: Sequence[Load], along: Average | None) -> Averaged:
        """The average of a scene, or the one already chosen of a motion that the scene is a part of."""
        average = average_of(scene, loads, replace(choose_scaling(scene), rates=(0, 0, 0)), along)
        _refuse_unavailable(average, scene.config.output.record)
        refuse_without_plane(scene, loads)
        return cls(average)

    def requirements(self, scene: Scene) -> Requirements:
        """What is carried, and what isn't."""
        left_out = [("attitude", f'[model] level = "{self.average.level}" averages over the rotation')]
        if self.average.over_orbits:
            left_out.append(("anomalies", "the torques are averaged over the orbits"))
        return Requirements(True, False, False, scene.config.output.record, {}, left_out)

    def assembled(self, plan: ModelPlan, number: Rounder) -> tuple[Mechanics, list[StateBlock]]:
        m, blocks = self._resonant(plan, number) if self.average.resonance else self._direction(plan, number)
        if (states := m.point_masses) is not None:
            blocks.append(states.block())
        if m.sky is not None:
            blocks.append(m.sky.block())
        return m, blocks

    def _mechanics(
        self,
        kind: type[AveragedMechanics],
        plan: ModelPlan,
        number: Rounder,
        rates: list[Symbolic],
        attitude: AttitudeStates,
    ) -> Any:
        return kind(
            plan.scene, plan.scaling, plan.numbers, rates, attitude, None, None, None, number,
            plan.orbit_tags, tables=plan.tables, loads=list(plan.loads), average=self.average,
        )  # fmt: skip

    def _resonant(self, plan: ModelPlan, number: Rounder) -> tuple[AveragedMechanics, list[StateBlock]]:
        """States of a body in spin-orbit resonance."""
        average, unit = self.average, plan.scaling.momentum
        resonance, initial = average.resonance, average.initial(unit)
        assert resonance is not None
        q = list(hy.make_vars(*SLOW[:4]))
        norm = hy.sqrt(hy.sum([x * x for x in q]))
        defect = "quaternion_norm", "norm of the slow quaternion", norm
        attitude = AttitudeStates(SLOW[:4], [], initial[:4], [], q, "state", defect=defect)
        m: ResonantMechanics = self._mechanics(ResonantMechanics, plan, number, q[:3], attitude)
        why = (
            f"the body is in resonance with [[loads]] number {resonance.source.number}, {resonance.name}: rw "
            "to rz are the quaternion of its axes turned back by so many turns to a revolution, la, lb and "
            "excess the momentum beyond that rotation, under torques averaged over rotation and orbits"
        )
        exponents = [0] * 4 + [unit] * 3
        return m, [StateBlock(SLOW, m.slow_derivatives, initial, exponents=exponents, why=why)]

    def _direction(self, plan: ModelPlan, number: Rounder) -> tuple[AveragedMechanics, list[StateBlock]]:
        """The momentum's direction, its amplitudes where torques of the body change them, and orbits."""
        average = self.average
        s = list(hy.make_vars(*DIRECTION))
        norm = hy.sqrt(hy.sum([x * x for x in s]))
        defect = "momentum_axis_norm", "norm of the momentum's direction", norm
        start = list(average.start)
        attitude = AttitudeStates(DIRECTION, [], start, [], [], "state", defect=defect, chord=1.0)
        kind = AveragedMechanics if average.driven is None else DrivenMechanics
        m = self._mechanics(kind, plan, number, s, attitude)
        why = _WHY[average.level]
        if average.driven is not None:
            why = _WHY_TURNED if average.sources else _WHY_AT_REST
        why += resonance_search(average.sources)
        blocks = [StateBlock(DIRECTION, m.derivatives, average.start, why=why)]
        if isinstance(m, DrivenMechanics):
            blocks.append(_amplitudes(m))
        for orbit in plan.tables:
            what = "elements of" if average.over_orbits else "where"
            which = "the source's orbit" if average.over_orbits else "the source is"
            block = m.table(orbit).block
            blocks.append(replace(block, why=f'gravity_gradient: {what} {which}, by "{orbit.name}"'))
        return m, blocks

    def rate_bound(self, plan: ModelPlan) -> Any:
        """See ``Formulation``: of the momentum's turning rate."""
        return self.average.rate_bound


def _amplitudes(m: DrivenMechanics) -> StateBlock:
    """P and Q of a driven motion."""
    unit = m.scaling.momentum
    return StateBlock(
        AMPLITUDES,
        m.amplitude_rates,
        m.driven.states(unit),
        exponents=[unit] * 2,
        why=f"size of the momentum and energy of rotation, under {' and '.join(m.driven.titles)}: its "
        "largest components along the axis that it circles and across it",
    )


def _refuse_unavailable(average: Average, record: Sequence[str] | None) -> None:
    """Refuse observables that need every rotation resolved."""
    for name in record or ():
        if name in _OF_FIGURE and not average.figure:
            why = "the body tumbles, so that its figure axis points nowhere on average; record momentum_axis "
            why += "instead"
        elif not average.provides(name):
            why = f'needs every rotation, which [model] level = "{average.level}" averages over'
        else:
            continue
        raise ConfigError(
            Problem("[output] record", f'given "{name}": {why}; choose level = "full" to have it')
        )
