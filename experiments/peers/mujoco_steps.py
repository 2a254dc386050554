"""MuJoCo: a body on a ball joint, fixed steps of RK4 and of the implicit integrator."""

from collections.abc import Callable, Sequence

import mujoco
import numpy as np

from experiments.peers.scenes import Scene

TITLES = {"RK4": "MuJoCo RK4", "implicit": "MuJoCo implicit"}
_MODEL = """
<mujoco>
  <option integrator="{integrator}" timestep="{step!r}" gravity="0 0 {gravity!r}">
    <flag contact="disable" constraint="disable" energy="disable"/>
  </option>
  <worldbody>
    <body>
      <joint type="ball" damping="0" armature="0" frictionloss="0"/>
      <inertial pos="0 0 {lever!r}" mass="1" diaginertia="{a!r} {b!r} {c!r}"/>
    </body>
  </worldbody>
</mujoco>
"""


def knobs(variant: str, scene: Scene) -> list[float]:
    """Step sizes, powers of two so that they divide the horizon; it knows no gravity gradient."""
    if scene.orbit_rate:
        return []
    return [2.0**-n for n in (range(2, 15, 2) if variant == "RK4" else range(4, 15, 4))]


def prepare(scene: Scene, end: float, variant: str, knob: float) -> Callable[[], Sequence[float]]:
    """See ``experiments.peers``."""
    a, b, c = scene.moments
    lever = scene.lever if scene.weight else 0.0
    model = mujoco.MjModel.from_xml_string(
        _MODEL.format(
            integrator=variant,
            step=knob,
            gravity=-scene.weight / scene.lever,
            lever=lever,
            a=a - lever**2,  # about the centre of mass
            b=b - lever**2,
            c=c,
        )
    )
    data = mujoco.MjData(model)
    steps = round(end / knob)

    def solve() -> Sequence[float]:
        mujoco.mj_resetData(model, data)
        data.qpos[:] = scene.quaternion
        data.qvel[:] = scene.rates
        mujoco.mj_step(model, data, nstep=steps)
        return [float(q) for q in np.array(data.qpos)]

    return solve
