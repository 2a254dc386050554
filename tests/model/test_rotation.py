"""Polar motion, wobble, the rotation angle and Andoyer's variables against closed forms."""

import math
import re

import numpy as np
import pytest
import xarray as xr
from support import cases, config, run_text, unoptimised_code

import rigidsim
from rigidsim import ConfigError
from rigidsim.solve.problem import prepare

MOMENTS = (1.0, 1.0, 1.5)
NAMES = (
    "quaternion", "rotation_angle", "rotation_rate", "rotation_period", "andoyer_momenta", "andoyer_angles",
    "polar_motion", "wobble_angle", "nutation_angle",
)  # fmt: skip
RECORD = f"record = {list(NAMES)}".replace("'", '"')
TILTED = 'angular_momentum = ["0.3", "0.4", 2]\neuler_angles = [0.3, 0.35, 0.2]'


@pytest.mark.parametrize(
    "integrator",
    cases(
        ['formulation = "quaternion"', 'formulation = "euler_angles"', 'formulation = "rotation_matrix"',
         'method = "closed_form"'],
        ['formulation = "quaternion"', 'method = "closed_form"'],
    ),
)  # fmt: skip
def test_a_free_symmetric_top_has_constant_momenta_and_uniform_angles(integrator: str) -> None:
    """l' = L (1/C - 1/A), g' = G/A, h' = 0; polar motion circles at l', and all turns are counted."""
    a, _, c = MOMENTS
    body, time = f"principal_moments = {[*MOMENTS]}", "end = 200\nsamples = 3"
    found = run_text(config(body, TILTED, (), time, integrator, RECORD)).dataset
    time = found["time"].values
    big_l, big_g, big_h = found["andoyer_momenta"].values.T
    momentum = np.array([0.3, 0.4, 2])
    assert big_g == pytest.approx(np.linalg.norm(momentum), rel=1e-13)
    assert big_h == pytest.approx(2, rel=1e-12)
    assert np.ptp(big_l) < 1e-11
    angles = found["andoyer_angles"].values
    rates = np.array([big_l[0] * (1 / c - 1 / a), big_g[0] / a, 0.0])
    np.testing.assert_allclose(angles - angles[0], np.outer(time, rates), atol=1e-9)
    np.testing.assert_allclose(angles.sum(axis=1), found["rotation_angle"].values, atol=1e-9)
    # h: the node of the invariable plane on XY, by definition n x L = (-L_Y, L_X)
    assert angles[0, 2] == pytest.approx(math.atan2(momentum[0], -momentum[1]), abs=1e-14)
    tilt = math.acos(big_l[0] / big_g[0])
    for name in ("wobble_angle", "nutation_angle"):
        assert found[name].values == pytest.approx(tilt, abs=1e-11)
    # w1, w2, w3 = G sin J sin l / A, G sin J cos l / A, L / C
    size = big_g[0] * math.sin(tilt) / a / (big_l[0] / c)
    expected = size * np.column_stack([np.sin(angles[:, 0]), np.cos(angles[:, 0])])
    np.testing.assert_allclose(found["polar_motion"].values, expected, atol=1e-10)
    rate = math.hypot(big_g[0] * math.sin(tilt) / a, big_l[0] / c)
    assert found["rotation_rate"].values == pytest.approx(rate, rel=1e-12)
    assert found["rotation_period"].values == pytest.approx(2 * math.pi / rate, rel=1e-12)


def test_polar_motion_is_absent_where_the_spin_has_left_the_figure_axis() -> None:
    with pytest.raises(ConfigError, match=r"87.*deg from the figure axis"):
        prepare(
            rigidsim.parse(
                config("principal_moments = [1, 2, 3]", "angular_velocity = [0, 20, 1]",
                       output='record = ["polar_motion"]')
            )
        )  # fmt: skip


def recorded_less_labelled(found: xr.Dataset) -> np.ndarray:
    """Turns by which the rotation angle differs from the sum of Andoyer's angles that its label gives."""
    told = re.match(r"(h \+ g \+ l|g [+-] h [+-] l) of andoyer_angles", found["rotation_angle"].convention)
    assert told is not None
    l, g, h = found["andoyer_angles"].values.T  # noqa: E741
    labelled = eval(told[1], {"g": g, "h": h, "l": l})
    return np.asarray((found["rotation_angle"].values - labelled) / (2 * np.pi))


@pytest.mark.slow
@unoptimised_code()
def test_the_label_is_what_is_recorded_in_all_hemispheres() -> None:
    """Starts with the momentum above and below the reference plane and the figure's equator."""
    random = np.random.default_rng(3)
    labels = set()
    for n in range(24):
        moments = [*random.uniform(0.9, 1.1, 2).tolist(), 1.6]  # turns about z or opposite to it
        rates = [*random.uniform(-0.4, 0.4, 2).tolist(), float(random.choice([-1.0, 1.0]))]
        q, normal = random.normal(size=4), random.normal(size=3)
        text = config(
            f"principal_moments = {moments}",
            f"angular_velocity = {rates}\nquaternion = {q.tolist()}",
            time="end = 10\nsamples = 21",
            output='record = ["rotation_angle", "andoyer_angles"]',
            more=f'[frame]\nfigure_axis = "z"\nreference = {normal.tolist()}',
        )
        found = run_text(text, f'name="h{n}"').dataset
        off = recorded_less_labelled(found)
        np.testing.assert_allclose(off, round(off[0]), rtol=0, atol=1e-10)
        labels.add(found["rotation_angle"].convention.split(" of ")[0])
    assert labels == {"h + g + l", "g - h + l", "g + h - l", "g - h - l"}
