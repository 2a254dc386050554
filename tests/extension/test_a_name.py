"""Names in expressions from outside the package: what a lamp that hangs far away in space shows a sensor.

Everything above the tests is what an author writes. Whatever reads the name is checked, planned, recorded and
resumed as with rigidsim's own.
"""

from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np
from support import config, loaded, run_text

from rigidsim.model.kinematics import Kinematics
from rigidsim.scene.attitude import rotation_matrix
from rigidsim.scene.expressions.names import NameProvider, Readable, provides
from rigidsim.scene.scene import Scene
from rigidsim.scene.schema import Config


class Lamp(NameProvider):
    """``lux``: how much of a lamp's light along space Z falls on a cell that faces the body's z: R_Zz."""

    brings = 'lux with "a lamp" in the description'

    def names(self, config: Config) -> Iterable[Readable]:
        lit = "a lamp" in config.description
        return [Readable("lux", "W/m^2", frozenset({"attitude"}), bound=1)] if lit else []

    def at_start(self, scene: Scene) -> Mapping[str, Any]:
        return {"lux": rotation_matrix(scene.quaternion)[2][2]}

    def expressions(self, m: Kinematics, names: Collection[str]) -> Mapping[str, Any]:
        return {"lux": m.matrix[2][2]} if "lux" in names else {}


def register() -> None:
    provides(Lamp)


# --- the tests ----------------------------------------------------------------------------------------------

LAW = 'kind = "torque"\ncomponents = ["-0.2*LUX", "0", "0.1*max(LUX, 0.3) - 0.05*wz"]'
EVENT = '[[events]]\nname = "half"\nexpression = "LUX - 1/2"\n'
WRITTEN = "(qw^2 - qx^2 - qy^2 + qz^2)"


def text(lux: str = "lux", more: str = EVENT, **tables: str) -> str:
    given = config(loads=LAW.replace("LUX", lux), more=more.replace("LUX", lux), **tables)
    return 'description = "a lamp"\n' + given


def test_a_name_is_what_it_stands_for() -> None:
    found, written = (loaded(run_text(text(lux, time="end = 20\nsamples = 81"))) for lux in ("lux", WRITTEN))
    assert found.sizes["half"] == written.sizes["half"] >= 2
    for name in ("angular_velocity", "quaternion", "half_time"):  # rounding along some hundred steps
        np.testing.assert_allclose(found[name].values, written[name].values, rtol=0, atol=1e-12)
