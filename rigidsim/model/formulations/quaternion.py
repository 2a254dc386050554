"""The attitude quaternion: four states, no singularity; the cheapest, and the default."""

from __future__ import annotations

from collections.abc import Sequence

import heyoka as hy

from rigidsim.model import rotations
from rigidsim.model.body import BODY
from rigidsim.model.formulations.formulation import Formulation, ModelPlan, formulates
from rigidsim.model.formulations.orbital_frame import corotating_orbit, orbital_states
from rigidsim.model.load import Load
from rigidsim.model.numbers import Rounder
from rigidsim.model.rotations import Symbolic
from rigidsim.model.state_blocks import AttitudeStates
from rigidsim.scene.formulations import DEFAULT_FORMULATION, FORMULATIONS
from rigidsim.scene.orbits import KeplerOrbit
from rigidsim.scene.scene import Scene


@formulates(FORMULATIONS[DEFAULT_FORMULATION])
class Quaternion(Formulation):
    """q' = q (0, w) / 2."""

    @classmethod
    def of(cls, scene: Scene, loads: Sequence[Load]) -> Formulation:
        """In space axes, or where that is cheaper relative to an orbit's frame."""
        orbit = corotating_orbit(scene, loads)
        return cls() if orbit is None else OrbitalQuaternion(orbit)

    def attitude(self, plan: ModelPlan, rates: list[Symbolic], number: Rounder) -> AttitudeStates:
        """See ``Formulation``."""
        return quaternion_states(plan.scene, rates)


class OrbitalQuaternion(Quaternion):
    """The quaternion relative to the frame that turns with a circular orbit."""

    why = "relative to the frame that turns with the orbit, where the gradient takes a third fewer products"

    def __init__(self, orbit: KeplerOrbit) -> None:
        self.orbit = orbit

    def attitude(self, plan: ModelPlan, rates: list[Symbolic], number: Rounder) -> AttitudeStates:
        """See ``Formulation``."""
        scene, orbit = plan.scene, self.orbit
        unit = scene.context.ldexp(scene.context.one, plan.scaling.time)
        return orbital_states(scene, rates, orbit, plan.orbit_tags[orbit], unit, number)


def quaternion_states(scene: Scene, rates: list[Symbolic]) -> AttitudeStates:
    """The quaternion in space axes, for rates (body axes) in units of 1/time."""
    names = BODY.quaternion
    q = list(hy.make_vars(*names))
    squared = hy.sum([c * c for c in q])
    return AttitudeStates(
        names,
        rotations.quaternion_kinematics(q, rates),
        list(scene.quaternion),
        rotations.quaternion_matrix(q),
        q,
        "state",
        defect=("quaternion_norm", "norm of the attitude quaternion", hy.sqrt(squared)),
        chord=2.0,
    )
