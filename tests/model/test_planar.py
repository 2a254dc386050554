"""A spin about a principal axis along an orbit's normal stays there: an angle and its rate are it all."""

from __future__ import annotations

import numpy as np
import pytest
from equations import prepared
from hypothesis import given, settings
from hypothesis import strategies as st
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


ANGLE = st.floats(-3.0, 3.0).map(lambda x: round(x, 3))


@settings(max_examples=3, deadline=None)
@given(
    axis=st.sampled_from([(0, 1, 2), (2, 0, 1), (1, 2, 0)]),
    forwards=st.booleans(),
    node=ANGLE,
    inclination=ANGLE.map(abs),
    heading=ANGLE,
    rate=ANGLE,
    eccentricity=st.sampled_from(["0", "0.25"]),
)
def test_the_plane_is_that_of_nine_direction_cosines(
    axis: tuple[int, int, int],
    forwards: bool,
    node: float,
    inclination: float,
    heading: float,
    rate: float,
    eccentricity: str,
) -> None:
    """About any body axis, up or down the normal of any orbit; two sets of equations in 128 bits."""
    # near a sphere, so that neither motion is chaotic within the time
    moments = [[1.02, 1.04, 1.05][i] for i in axis]
    turns = axis.index(2)
    sequence = ("yzx", "zxy", "xyz")[turns][::-1]  # its last axis is the one that the body turns about
    rates = [0.0, 0.0, 0.0]
    rates[turns] = rate
    flip = 0.0 if forwards else 180.0
    # R3(node) R1(inclination) brings z to the normal, which ``quaternion_of`` undoes for the body's own axis
    q = quaternion_of(node, inclination, turns, flip, heading)
    text = config(
        f"principal_moments = {moments}",
        f"angular_velocity = {rates}\nquaternion = {q}",
        orbit(f"inclination = {inclination}, ascending_node = {node}, periapsis = 0.5", eccentricity),
        "end = 4\nsamples = 33",
        f'euler_sequence = "{sequence}"\nprecision = "quadruple"',
    )
    plane, cosines = (tried(text, "quadruple", f) for f in ("planar", "rotation_matrix"))
    assert plane.rows == cosines.rows == 33
    allowed = 10 * law(2.0**-112, cosines.steps, abs(rate) + 2, 4) * np.exp(8)
    assert angles_between(plane.attitudes, cosines.attitudes).max() <= allowed


def quaternion_of(node: float, inclination: float, turns: int, flip: float, heading: float) -> list[str]:
    """Of a body whose axis ``turns`` lies along an orbit's normal, 90 digits."""
    import mpmath

    with mpmath.workdps(100):

        def product(p: list[mpmath.mpf], q: list[mpmath.mpf]) -> list[mpmath.mpf]:
            (a, *v), (b, *w) = p, q
            across = [v[1] * w[2] - v[2] * w[1], v[2] * w[0] - v[0] * w[2], v[0] * w[1] - v[1] * w[0]]
            return [
                a * b - mpmath.fdot(v, w),
                *(a * y + b * x + z for x, y, z in zip(v, w, across, strict=True)),
            ]

        def turn(angle: mpmath.mpf, axis: int) -> list[mpmath.mpf]:
            found = [mpmath.cos(mpmath.mpf(angle) / 2)] + [mpmath.mpf(0)] * 3
            found[1 + axis] = mpmath.sin(mpmath.mpf(angle) / 2)
            return found

        q = product(turn(mpmath.mpf(str(node)), 2), turn(mpmath.mpf(str(inclination)), 0))
        q = product(q, turn(mpmath.radians(mpmath.mpf(flip)), 0))
        if turns == 0:  # body x to z: a turn by -90 degrees about y
            q = product(q, turn(-mpmath.pi / 2, 1))
        elif turns == 1:  # body y to z: by 90 degrees about x
            q = product(q, turn(mpmath.pi / 2, 0))
        q = product(q, turn(mpmath.mpf(str(heading)), turns))
        return [mpmath.nstr(x, 90) for x in q]


def test_the_model_finds_the_plane() -> None:
    assert states(BODY, SPIN, orbit())[:2] == ["angle", "spin"]
    at_rest = SPIN.replace("1.1", "0")
    assert states(BODY, at_rest, orbit())[:2] == ["angle", "spin"]
    damped = orbit() + '\n[[loads]]\nkind = "viscous_torque"\ncoefficients = [0.1, 0.2, 0.3]'
    assert states(BODY, SPIN, damped)[:2] == ["angle", "spin"]
    pushed = orbit() + '\n[[loads]]\nkind = "torque"\ncomponents = ["0", "0", "0.1*sin(t)"]'
    assert states(BODY, SPIN, pushed)[:2] == ["angle", "spin"]


@pytest.mark.parametrize(
    ("body", "start", "loads", "integrator"),
    [
        (BODY, SPIN.replace("[0, 0,", '["1e-30", 0,'), orbit(), ""),
        (BODY, SPIN.replace("20 deg", "20.000000000000000001 deg"), orbit(), ""),
        (BODY, SPIN, orbit(PLACE + ", node_rate = 0.1"), ""),
        (BODY, SPIN, orbit() + '\n[[loads]]\nkind = "torque"\ncomponents = ["1e-9*t", "0", "0"]', ""),
        (BODY, SPIN, orbit(), 'formulation = "quaternion"'),
        (BODY, SPIN, "", ""),
        (PENDULUM, "angular_velocity = [0, 0, 0]", PULL, ""),
    ],
    ids=["rate across", "tilted", "moving plane", "torque across", "asked", "free", "pendulum"],
)
def test_elsewhere_the_full_motion_is_carried(body: str, start: str, loads: str, integrator: str) -> None:
    """Also where nobody asked for it and no orbit has a plane: a pendulum, a free spin."""
    assert "angle" not in states(body, start, loads, integrator=integrator)


@pytest.mark.parametrize(
    ("start", "why"),
    [
        ("angular_velocity = [0.1, 0, 1]", "doesn't turn about a principal axis"),
        ("angular_velocity = [0, 1, 0]", "uniform_gravity may turn the body out of its plane"),
    ],
)
def test_a_motion_that_leaves_the_plane_is_refused_with_the_reason(start: str, why: str) -> None:
    with pytest.raises(rigidsim.ConfigError, match=why) as error:
        prepared(PENDULUM, start, PULL, integrator='formulation = "planar"')
    assert 'choose "auto"' in str(error.value)


def test_a_pendulum_that_goes_round_and_round() -> None:
    """Fifty turns; with each the quaternion changes its sign, and so it should in the plane."""
    text = config(PENDULUM, "angular_velocity = [0, 0, 8]", PULL, "end = 40\nsamples = 401")
    full = loaded(run_text(text, "integrator.formulation=quaternion", "integrator.precision=extended"))
    run = run_text(text, "integrator.formulation=planar", "output.estimate=true")
    plane = loaded(run)
    apart = 2 * np.linalg.norm(plane["quaternion"].values - full["quaternion"].values, axis=1).max()
    assert apart <= 3 * run.summary["accuracy"]["estimated_attitude_error"] < 1e-10
    assert "out of the plane" in run.summary["accuracy"]["estimated_how"]


def test_turns_never_loosen_the_steps() -> None:
    """A spin of 30 rad/s in a gradient: 30,000 rad on, and steps as short as at the beginning."""
    text = config(BODY, SPIN.replace("1.1", "30"), orbit(), "end = 1000\nsamples = 3")
    cost = run_text(text).summary["cost"]
    assert cost["largest_step"] < 1.5 * cost["smallest_step"]
