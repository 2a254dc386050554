"""How a displacement grows: as closed forms and the whole spectrum say, and without moving a step."""

import numpy as np
import pytest
from support import config, loaded, run_text

from rigidsim.solve.indicators import indicators

SPIN = "angular_velocity = [0, 0, 1.1]\neuler_angles = [0, 0, 0.4]"
GRADIENT = (
    'kind = "gravity_gradient"\ngravitational_parameter = 1\n'
    "orbit = {semi_major_axis = 1, eccentricity = 0.1}"
)


def hyperion(time: str, integrator: str = "", growth: bool = True) -> str:
    """A body in spin-orbit coupling, chaotic: errors grow e-fold every 8 time units."""
    record = 'record = ["quaternion"' + (', "tangent_growth"]' if growth else "]")
    return config("principal_moments = [1, 1.2, 1.35]", SPIN, GRADIENT, time, integrator, record)


@pytest.mark.parametrize("axis", [1, 2], ids=["intermediate", "extreme"])
def test_a_displacement_from_a_permanent_rotation(axis: int) -> None:
    """About the intermediate axis it grows like e^(k w t), k^2 = (B - A) (C - B) / (A C), else like t."""
    rates = [0, 0, 0]
    rates[axis] = 1
    text = config(
        "principal_moments = [1, 2, 3]",
        f"angular_velocity = {rates}",
        time="end = 60\nsamples = 301",
        output='record = ["tangent_growth"]',
    )
    data = loaded(run_text(text))
    t, growth = data.time.values, data.tangent_growth.values
    if axis == 1:
        exponent = np.sqrt(1 / 3)
        assert np.diff(growth)[-50:] == pytest.approx(exponent * 0.2, rel=1e-9)
        found = indicators(t, growth[:, None])
        assert found.largest_exponent[0] == pytest.approx(exponent, rel=0.1)
        assert found.megno[0] == pytest.approx(exponent * 60 / 2, rel=0.1)
    else:  # a rate across the axis turns around, one along it turns the attitude away
        assert np.exp(growth[-1]) < 3 * 60


def test_the_motion_is_the_same_with_and_without() -> None:
    """To the last bit where code is compact, as it is in 128 bits."""
    time = "end = 10\nsamples = 11"
    integrator = 'formulation = "planar"\nprecision = "quadruple"'
    without, along = (loaded(run_text(hyperion(time, integrator, growth))) for growth in (False, True))
    assert (without.quaternion.values == along.quaternion.values).all()


def test_a_regular_spin_has_a_megno_of_two() -> None:
    """Growth of ln(1 + c t) beside an oscillation, as quasi-periodic motion has it; chaos is exponential."""
    t = np.linspace(0, 1e5, 200_001)
    regular = np.log1p(3 * t) + 0.5 * np.sin(1.3 * t)
    chaotic = 0.01 * t
    lost = np.where(t < 5e4, chaotic, np.nan)
    found = indicators(t, np.stack([regular, chaotic, lost], axis=1))
    assert found.megno[0] == pytest.approx(2, abs=0.01)
    assert found.megno[1] == pytest.approx(0.01 * 1e5 / 2, rel=1e-6)
    assert found.largest_exponent[1:] == pytest.approx([0.01, 0.01])
    assert found.until[2] == pytest.approx(5e4, abs=1)
    assert found.fli[1] == pytest.approx(1000)
    assert np.isnan(indicators(t[:2], np.full((2, 1), np.nan)).megno).all()
