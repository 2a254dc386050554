"""What Mars' nutations are held against, and a Martian year of its ready scene."""

import math

import numpy as np
import pytest

from experiments.real_bodies import mars

SPIN = math.radians(mars.RATE)
CORE = mars.Core(0.99462, 0.07 / 1.07, 0.00398)


def test_the_free_core_nutation_is_a_mode_of_the_pages_equations() -> None:
    """Of docs/fluid_core.md: u, v wobbles of mantle and core, in body axes."""
    core, f = CORE.moment, CORE.flattening
    mantle, polar = CORE.equatorial - core * (1 - f), 1 - core
    modes = np.linalg.eigvals([[(polar - mantle) / mantle, core * f / mantle], [1 / (1 - f), -1 / (1 - f)]])
    assert CORE.free_nutation(SPIN) == pytest.approx(SPIN * (1 + modes.min()), rel=1e-9)
    assert 2 * math.pi / CORE.free_nutation(SPIN) == pytest.approx(-240, abs=0.2)
    assert pytest.approx(0.07, abs=2e-4) == CORE.factor
    rates = 2 * math.pi / np.array([687.0, 343.5, -687.0])
    assert [CORE.response(x, SPIN) for x in rates] == pytest.approx(
        [CORE.transfer(x, SPIN) for x in rates], abs=3e-4
    )


@pytest.mark.slow
def test_a_martian_year_of_the_ready_scene_nutates_by_an_arcsecond() -> None:
    pytest.importorskip("de421")
    from experiments import mars_rotation

    days, result = mars_rotation.run("time.end=1374 day")
    psi, tilt = mars.angles(result.values("figure_axis"))
    rest = psi - np.polyval(np.polyfit(days, psi, 1), days)
    assert np.ptp(rest) / mars.MAS == pytest.approx(2 * 1.5e3, rel=0.25)
    assert np.degrees(tilt.mean()) == pytest.approx(mars.OBLIQUITY, abs=1e-4)
