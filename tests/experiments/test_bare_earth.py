"""The rigid Earth written with heyoka alone: its nutations are the published ones of a rigid Earth."""

import pytest

pytest.importorskip("heyoka")
pytest.importorskip("de421")
from experiments.bare import earth
from experiments.real_bodies import nutation


@pytest.mark.slow(30)
@pytest.mark.parametrize("level", [3])
def test_five_published_amplitudes_of_a_rigid_earth(level):
    computed = earth.Earth("de421", level)
    found = computed.integrate(18264.0)
    axis = earth.figure_axis(found["quaternion"])
    lines = nutation.fit(found["dates"], axis, computed.free_rate)
    for name, (_, _, published) in nutation.PUBLISHED.items():
        assert lines.amplitude(name) == pytest.approx(published, abs=0.5), name
