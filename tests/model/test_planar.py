"""A spin about a principal axis along an orbit's normal stays there: an angle and its rate are it all."""

from typing import Any

import mpmath
import numpy as np
import pytest
from equations import prepared
from support import config, law, loaded, run_text, tried

import rigidsim
from rigidsim.accuracy.comparison import angles_between

BODY = "principal_moments = [1, 1.02, 1.04]"
SPIN = 'angular_velocity = [0, 0, 1.1]\neuler_angles = [0.3, "20 deg", 0.4]'
PLACE = 'inclination = "20 deg", ascending_node = 0.3'
PENDULUM = "principal_moments = [1, 2, 2.5]\nmass = 1\ncenter_of_mass = [0, -0.3, 0]"
PULL = 'kind = "uniform_gravity"\nacceleration = [0, -9.8, 0]'


def orbit(elements: str = PLACE, eccentricity: str = "0.1") -> str:
    elements = f"semi_major_axis = 1, eccentricity = {eccentricity}, {elements}"
    return f'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {{{elements}}}'


def states(*scene: str, integrator: str = "") -> list[str]:
    return prepared(*scene, integrator=integrator).system.states


@pytest.mark.parametrize(
    ("axis", "sequence", "turned", "eccentricity"),
    # the body's axis of rotation, with a turn that brings it to z; the last one upside down
    [(0, "xzy", ["0.5", "0.5", "-0.5", "0.5"], "0.25"), (2, "zyx", [0, 1, 0, 0], "0")],
)
def test_the_plane_is_that_of_nine_direction_cosines(
    axis: int, sequence: str, turned: list[Any], eccentricity: str
) -> None:
    """About any body axis, up or down the normal of any orbit; two sets of equations in 128 bits."""
    # near a sphere, so that neither motion is chaotic within the time
    moments, rates = np.roll([1.02, 1.04, 1.05], axis - 2).tolist(), np.roll([0, 0, 1.3], axis - 2).tolist()
    with mpmath.workdps(100):
        node, inclination, heading = (mpmath.mpf(x) for x in ("0.6", "0.9", "-1.1"))
        q = [mpmath.mpf(1), *3 * [mpmath.mpf(0)]]
        for angle, about in ((node, 2), (inclination, 0), (heading, 2)):
            q = product(q, [mpmath.cos(angle / 2), *(mpmath.sin(angle / 2) * (k == about) for k in range(3))])
        quaternion = [mpmath.nstr(x, 90) for x in product(q, [mpmath.mpf(x) for x in turned])]
    text = config(
        f"principal_moments = {moments}",
        f"angular_velocity = {rates}\nquaternion = {quaternion}",
        orbit("inclination = 0.9, ascending_node = 0.6, periapsis = 0.5", eccentricity),
        "end = 4\nsamples = 9",
        f'euler_sequence = "{sequence[::-1]}"\nprecision = "quadruple"',
    )
    plane, cosines = (tried(text, "quadruple", f) for f in ("planar", "rotation_matrix"))
    allowed = 10 * law(2.0**-112, cosines.steps, 3.3, 4) * np.exp(8)
    assert angles_between(plane.attitudes, cosines.attitudes).max() <= allowed


def product(p: list[Any], q: list[Any]) -> list[Any]:
    (a, *v), (b, *w) = p, q
    across = [v[1] * w[2] - v[2] * w[1], v[2] * w[0] - v[0] * w[2], v[0] * w[1] - v[1] * w[0]]
    dot = sum(x * y for x, y in zip(v, w, strict=True))
    return [a * b - dot, *(a * y + b * x + z for x, y, z in zip(v, w, across, strict=True))]


@pytest.mark.parametrize(
    "more",
    ["", 'kind = "viscous_torque"\ncoefficients = [0.1, 0.2, 0.3]',
     'kind = "torque"\ncomponents = ["0", "0", "0.1*sin(t)"]'],
)  # fmt: skip
def test_the_model_finds_the_plane(more: str) -> None:
    loads = orbit() + (f"\n[[loads]]\n{more}" if more else "")
    assert states(BODY, SPIN, loads)[:2] == ["angle", "spin"]


@pytest.mark.parametrize(
    ("body", "start", "loads", "integrator"),
    [
        (BODY, SPIN.replace("[0, 0,", '["1e-30", 0,'), orbit(), ""),
        (BODY, SPIN, orbit(PLACE + ", node_rate = 0.1"), ""),
        (BODY, SPIN, orbit() + '\n[[loads]]\nkind = "torque"\ncomponents = ["1e-9*t", "0", "0"]', ""),
        (BODY, SPIN, "", ""),
    ],
    ids=["rate across", "moving plane", "torque across", "free"],
)
def test_elsewhere_the_full_motion_is_carried(body: str, start: str, loads: str, integrator: str) -> None:
    """Also where nobody asked for it and no orbit has a plane: a pendulum, a free spin."""
    assert "angle" not in states(body, start, loads, integrator=integrator)


@pytest.mark.parametrize(
    ("start", "why"),
    [
        ("angular_velocity = [0.1, 0, 1]", "doesn't turn about a principal axis"),
        (
            "angular_velocity = [0, 1, 0]\nquaternion = [0.9, 0.1, 0, 0.3]",
            "uniform_gravity may turn the body out of its plane",
        ),
    ],
)
def test_a_motion_that_leaves_the_plane_is_refused_with_the_reason(start: str, why: str) -> None:
    with pytest.raises(rigidsim.ConfigError, match=why) as error:
        prepared(PENDULUM, start, PULL, integrator='formulation = "planar"')
    assert 'choose "auto"' in str(error.value)


def test_a_pendulum_that_goes_round_and_round() -> None:
    """Fifty turns; with each the quaternion changes its sign, and so it should in the plane."""
    text = config(PENDULUM, "angular_velocity = [0, 0, 8]", PULL, "end = 40\nsamples = 41")
    full = loaded(run_text(text, "integrator.formulation=quaternion", "integrator.precision=extended"))
    run = run_text(text, "integrator.formulation=planar", "output.estimate=true")
    plane = loaded(run)
    apart = 2 * np.linalg.norm(plane["quaternion"].values - full["quaternion"].values, axis=1).max()
    assert apart <= 3 * run.summary["accuracy"]["estimated_attitude_error"] < 1e-10


@pytest.mark.slow
def test_turns_never_loosen_the_steps() -> None:
    """A spin of 30 rad/s in a gradient: 30,000 rad on, and steps as short as at the beginning."""
    text = config(BODY, SPIN.replace("1.1", "30"), orbit(), "end = 1000\nsamples = 3")
    cost = run_text(text).summary["cost"]
    assert cost["largest_step"] < 1.5 * cost["smallest_step"]
