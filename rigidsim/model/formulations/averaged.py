"""Motions averaged over the body's rotation, as [model] level asks for: the door to ``averaged``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from rigidsim.model.averaged.average import Average, average_of
from rigidsim.model.averaged.states import averaged_states, refuse_untold
from rigidsim.model.formulations.formulation import Formulation, ModelPlan, Requirements
from rigidsim.model.frames.reference_plane import refuse_without_plane
from rigidsim.model.load import Load
from rigidsim.model.mechanics import Mechanics
from rigidsim.model.scaling import Rounder, choose_scaling
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene.formulations import Variables
from rigidsim.scene.scene import Scene


class Averaged(Formulation):
    """The direction of the angular momentum, and its slow companions."""

    carries_rates = False
    resolves_rotation = False
    twin = None
    average: Average

    def __init__(self, average: Average) -> None:
        self.average, self.longitude = average, average.longitude
        summed = average.driven is not None and average.driven.course.nodes
        self.wide = average.resonance is not None or bool(summed)
        self.variables = Variables(average.level, general=False)  # type: ignore[misc]  # told by the scene

    @classmethod
    def along(cls, scene: Scene, loads: Sequence[Load], along: Average | None) -> Averaged:
        """The average of a scene.

        Args:
            along: the average, already chosen, of a motion that this scene is a part of.

        Raises:
            ConfigError: the scene can't be averaged, or what is recorded needs every rotation.
        """
        average = average_of(scene, loads, replace(choose_scaling(scene), rates=(0, 0, 0)), along)
        refuse_untold(average, scene.config.output.record)
        refuse_without_plane(scene, loads)
        return cls(average)

    def requirements(self, scene: Scene) -> Requirements:
        """What is carried, and what isn't."""
        left_out = [("attitude", f'[model] level = "{self.average.level}" averages over the rotation')]
        if self.average.over_orbits:
            left_out.append(("anomalies", "the torques are averaged over the orbits"))
        return Requirements(True, False, False, scene.config.output.record, {}, left_out)

    def assembled(self, plan: ModelPlan, number: Rounder) -> tuple[Mechanics, list[StateBlock]]:
        return averaged_states(
            plan.scene,
            self.average,
            plan.loads,
            plan.scaling,
            plan.numbers,
            plan.orbit_tags,
            plan.tables,
            number,
        )

    def rate_bound(self, plan: ModelPlan) -> Any:
        """See ``Formulation``: of the momentum's turning rate."""
        return self.average.rate_bound
