"""Which class carries out which load of a config."""

from __future__ import annotations

from rigidsim.model.applied import AppliedModel
from rigidsim.model.loads import (
    CentralGravityModel,
    GravityGradientModel,
    LoadModel,
    UniformGravityModel,
    ViscousTorqueModel,
)
from rigidsim.scene.loads import Applied, CentralGravity, GravityGradient, ViscousTorque
from rigidsim.scene.scene import Scene


def load_models(scene: Scene) -> list[LoadModel]:
    """The loads of a scene as mechanics; all uniform fields are one."""
    models: list[LoadModel] = []
    if scene.gravity is not None:
        models.append(UniformGravityModel(scene))
    for number, spec in enumerate(scene.loads):
        if isinstance(spec, GravityGradient):
            models.append(GravityGradientModel(spec, str(number + 1)))
        elif isinstance(spec, CentralGravity):
            models.append(CentralGravityModel(spec))
        elif isinstance(spec, ViscousTorque):
            models.append(ViscousTorqueModel(spec))
        elif isinstance(spec, Applied):
            models.append(AppliedModel(spec, scene))
    return models
