"""The Moon written with heyoka alone, against DE421's librations, and its torques against potentials."""

import math

import numpy as np
import pytest

pytest.importorskip("heyoka")
from experiments.bare import mechanics

PLACE = np.array([0.3, -1.7, 0.9])


def slope(function, place, step=1e-5):
    """Central differences, fourth order."""
    found = np.zeros(3)
    for axis, direction in enumerate(np.eye(3) * step):
        near = function(place + direction) - function(place - direction)
        far = function(place + 2 * direction) - function(place - 2 * direction)
        found[axis] = (8 * near - far) / (12 * step)
    return found


def test_torque_of_a_field_is_the_potentials():
    from scipy.special import assoc_legendre_p

    field = {(3, 0): (0.3, 0.0), (3, 2): (-0.2, 0.5), (4, 1): (0.7, -0.1), (4, 4): (0.02, 0.03)}

    def potential(x):
        r = np.linalg.norm(x)
        longitude = math.atan2(x[1], x[0])
        return sum(
            (0.8 / r) ** n
            / r
            * (-1) ** m  # scipy's has the Condon-Shortley phase
            * float(assoc_legendre_p(n, m, x[2] / r)[0])
            * (c * math.cos(m * longitude) + s * math.sin(m * longitude))
            for (n, m), (c, s) in field.items()
        )

    expected = -2.5 / 0.8**2 * np.cross(PLACE, slope(potential, PLACE))
    assert mechanics.field_torque(2.5, list(PLACE), 0.8, field) == pytest.approx(expected, rel=1e-9)


def test_torque_of_an_oblate_source_is_the_potentials():
    """The body as three pairs of point masses in the source's field: a quadrupole each way."""
    pole = np.array([0.6, 0.0, 0.8])
    moments = np.array([0.35, 0.39, 0.41])
    oblateness, radius, parameter, arm = 0.1, 0.7, 3.0, 1e-2

    def potential(x):  # of the source's J2 at x from it
        r = np.linalg.norm(x)
        return oblateness * radius**2 * parameter * (3 * (x @ pole / r) ** 2 - 1) / (2 * r**3)

    weights = (moments.sum() / 2 - moments) / (2 * arm**2)  # sum m x_i^2 = (tr I)/2 - I_i
    expected = np.zeros(3)
    for axis, weight in enumerate(weights):
        for sign in (1, -1):
            at = sign * arm * np.eye(3)[axis]
            expected += np.cross(at, -weight * slope(potential, at - PLACE, 1e-3))
    tensor = np.diag(moments).tolist()
    found = mechanics.figure_torque(parameter, list(PLACE), tensor, oblateness, radius, list(pole))
    assert found == pytest.approx(expected, rel=1e-3)


def test_rates_of_the_distorted_tensor_are_its_derivatives():
    rate = np.array([0.4, 0.2, -0.3])

    def both(s):
        place, w = PLACE + s * rate, rate + s * PLACE
        tide = np.array(mechanics.tide_tensor(0.02, 80.0, 0.5, list(place)))
        return tide + np.array(mechanics.spin_tensor(0.02, 3.0, 0.5, list(w), 0.2))

    expected = (8 * (both(1e-4) - both(-1e-4)) - (both(2e-4) - both(-2e-4))) / 12e-4
    found = np.array(mechanics.tide_tensor_rate(0.02, 80.0, 0.5, list(PLACE), list(rate)))
    found += np.array(mechanics.spin_tensor_rate(0.02, 3.0, 0.5, list(rate), list(PLACE)))
    assert found == pytest.approx(expected, rel=1e-9)
    assert np.trace(both(0.0)) == pytest.approx(0.0, abs=1e-15)


def _left_over(days, without=()):
    pytest.importorskip("de421")
    from experiments.bare import moon

    computed = moon.Moon("de421", without)
    found = computed.integrate(days)
    return moon.left_over("de421", computed.start, found["days"], found["quaternion"])


def test_two_years_of_the_full_moon_are_de421s():
    assert _left_over(732.0)["rms"] < 0.1


@pytest.mark.campaign  # two minutes
def test_fifty_years_and_what_each_effect_is_worth():
    """real amounts in arcsec, nothing fitted, of the published comparison (total rms over 1969-2019)."""
    full = _left_over(18264.0)
    assert full["rms"] < 0.4
    assert max(full["components"]) < 0.5
    published = {
        "core": 7.75,
        "degree4": 1.08,
        "core_flattening": 0.70,
        "distortion": 0.355,
        "delay": 0.29,
        "core_friction": 0.25,
        "figure": 0.107,
        "spin_distortion": 0.041,
    }
    for effect, amount in published.items():
        assert _left_over(18264.0, [effect])["rms"] / 1000 == pytest.approx(amount, rel=0.02), effect
