"""Averages over the rotation and over orbits: closed forms against sums, and what forbids them."""

import math

import numpy as np
import pytest
from equations import EPS, Random, derivative, matrix
from support import config

from rigidsim import ConfigError, parse
from rigidsim.scene.arithmetic import dot
from rigidsim.solve.problem import InitialValueProblem, prepare

# --- which scenes have averages ---------------------------------------------------------------------------

BODY = "principal_moments = [1, 1.1, 1.3]"
START = 'angular_velocity = [0, 0, 100]\neuler_angles = [0.3, "20 deg", 0]'
GRADIENT = 'kind = "gravity_gradient"\ngravitational_parameter = 1\n'
KEPLER = GRADIENT + "orbit = {semi_major_axis = 1, eccentricity = 0.1}"


def averaged(
    start: str = START,
    loads: str = KEPLER,
    *,
    level: str = "orbit_averaged",
    inertia: str = BODY,
    integrator: str = "",
    output: str = "",
    more: str = "",
) -> InitialValueProblem:
    model = f'[model]\nlevel = "{level}"\n{more}'
    return prepare(parse(config(inertia, start, loads, "end = 10\nsamples = 11", integrator, output, model)))


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"start": START.replace("0, 0, 100", "0, 100, 0")}, "intermediate axis"),
        ({"start": START.replace("100", "0")}, "starts at rest"),
        ({"inertia": "principal_moments = [1, 1, 1]"}, "moments are all the same"),
        ({"loads": KEPLER + '\n[[loads]]\nkind = "viscous_torque"\ncoefficients = [1, 1, 1]'}, "no gravity"),
        ({"integrator": 'formulation = "quaternion"'}, 'formulation = "quaternion"'),
        ({"integrator": "hold_invariants = true"}, "hold_invariants = true"),
    ],
    ids=lambda x: x if isinstance(x, str) else "",
)
def test_what_has_no_average_is_refused_with_the_reason(given: dict[str, str], said: str) -> None:
    with pytest.raises(ConfigError, match=r"\[model\] level: given \"orbit_averaged\", but ") as found:
        averaged(**given)  # type: ignore[arg-type]
    assert said in str(found.value)
    assert "choose" in str(found.value)


def test_a_tumbling_bodys_figure_axis_points_nowhere() -> None:
    tumbling = START.replace("0, 0, 100", "60, 20, 80")
    with pytest.raises(ConfigError, match="figure axis points nowhere on average; record momentum_axis"):
        averaged(tumbling, output='record = ["figure_axis"]')
    names = {r.name for r in averaged(tumbling).system.recorded}
    assert names == {"angular_momentum", "angular_momentum_norm", "energy"}


def test_the_right_hand_side_is_the_averaged_torque() -> None:
    """Ward 1974, with the orbit's factor and the mean tensor, in a frame where nothing is special."""
    random = Random(3)
    q = random.quaternion()
    start = f"angular_velocity = [0, 0, 1e4]\nquaternion = {q.tolist()}"
    elements = 'semi_major_axis = 2, eccentricity = 0.4, inclination = "50 deg", ascending_node = 1.2'
    system = averaged(start, GRADIENT + f"orbit = {{{elements}}}").system
    s = matrix(q)[:, 2]
    tilt, node = math.radians(50), 1.2
    normal = np.array([math.sin(tilt) * math.sin(node), -math.sin(tilt) * math.cos(node), math.cos(tilt)])
    size = 1.5 / 8 * (1.3 - 1.05) / (1.3 * 1e4) * (1 - 0.16) ** -1.5
    # second order: k / n of it, 1e-5
    expected = -size * (normal @ s) * np.cross(normal, s)
    np.testing.assert_allclose(derivative(system, s), expected, atol=3e-5 * size)
    assert dot(list(derivative(system, s)), list(s)) == pytest.approx(0, abs=EPS * size)
