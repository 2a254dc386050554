"""Growth of tangent vectors beside members that run side by side: no bit of the motion moves."""

from typing import Any

import numpy as np
import pytest
from support import cases
from test_batch_lanes import FREE, ORBIT, PLANAR, TORQUE, blocks_of, by_member, swept

import rigidsim

pytestmark = pytest.mark.unoptimised

RATES = {"initial.angular_velocity[2]": "uniform = [0.3, 2.2], count = 9"}


def growing(text: str) -> str:
    """The same with the growth recorded, between others."""
    return text.replace('["angular_velocity", ', '["angular_velocity", "tangent_growth", ')


def motions(text: str, axes: dict[str, str], **options: float) -> dict[int, Any]:
    """Bits of all that is recorded of members but the growth, which is apart; steps and status."""
    found = {}
    for member, (values, *rest) in by_member(blocks_of(swept(text, axes), **options)).items():
        growth = values.pop("tangent_growth", None)
        found[member] = ({name: table.tobytes() for name, table in values.items()}, rest), growth
    return found


SCENES = {
    "planar": (PLANAR, RATES),
    "free": (FREE, RATES),
    "two samples": (PLANAR.replace("samples = 5", "samples = 2"), RATES),
    "orbit": (ORBIT, RATES | {"body.principal_moments[0]": "uniform = [0.5, 1], count = 9"}),
    "torque": (TORQUE, {"parameters.k": "uniform = [0.05, 0.3], count = 9"}),
}


@pytest.mark.slow
@pytest.mark.parametrize("scene", cases(SCENES, ["planar"]))
def test_the_motion_has_the_same_bits_with_and_without(scene: str) -> None:
    text, axes = SCENES[scene]
    without, along = motions(text, axes), motions(growing(text), axes)
    assert len(along) == 9
    for member, (bits, growth) in along.items():
        assert bits == without[member][0]
        assert growth.shape == (len(growth), 1)
        assert np.isfinite(growth).all()
    sweep = swept(growing(text), axes)
    single = rigidsim.run(sweep.experiment_of(4), changes={"output.estimate": False}, out=None).dataset
    np.testing.assert_allclose(along[4][1][:, 0], single.tangent_growth.values, rtol=0, atol=1e-9)
