"""The rigid Earth written with heyoka alone: its nutations are the published ones of a rigid Earth."""

import numpy as np
import pytest

pytest.importorskip("heyoka")
pytest.importorskip("de421")
from experiments.bare import earth, precession
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


def test_a_fit_finds_the_circles_that_were_put_in():
    dates = 2442412.5 + 0.8 * np.arange(22830)
    t, arguments = precession.centuries(dates), nutation.delaunay(dates)
    theta = arguments[4]  # the node goes backwards
    shift = 8000.0 * np.exp(1j * theta) + 1000.0j * np.exp(-1j * theta) + 300.0 + 200.0j * t
    x, y = shift.real, shift.imag
    pole = np.stack([x, y, np.zeros_like(x)], axis=1) * precession.ARCSEC / 1000
    pole[:, 2] = np.sqrt(1 - pole[:, 0] ** 2 - pole[:, 1] ** 2)
    lines = nutation.fit(dates, precession.from_date(dates, pole), 1.0033)
    assert lines.amplitude("18.6 yr retrograde") == pytest.approx(8000.0, abs=1e-4)
    assert lines.amplitude("18.6 yr prograde") == pytest.approx(1000.0, abs=1e-4)
    assert lines.amplitude("13.66 d prograde") == pytest.approx(0.0, abs=1e-4)
    assert lines.secular[:2] == pytest.approx([300.0, 200.0j], abs=1e-3)
