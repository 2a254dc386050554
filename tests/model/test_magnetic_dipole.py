"""A magnetic dipole of the body: torque m x B in a uniform field, and in that of a dipole along an orbit."""

import re

import numpy as np
import pytest
from equations import CLOSE, Random, array, derivative, general_body, matrix, observed, prepared
from support import config, run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.solve.problem import prepare

BODY = "principal_moments = [1, 1.5, 2]"
START = "angular_velocity = [0.4, -0.7, 0.9]\nquaternion = [0.3, -0.5, 0.2, 0.75]"
ORBIT = (
    "orbit = {semi_major_axis = 7e6, eccentricity = 0.2, inclination = 0.9, ascending_node = 0.3, "
    "periapsis = 0.5, mean_anomaly = 0.7, node_rate = 0.01, period = 20}"
)


def text(load: str, end: float = 20.0, extra: str = "") -> str:
    load = f'kind = "magnetic_dipole"\n{load}'
    return config(BODY, START, load, f"end = {end}\nsamples = 201", more=extra, name="magnet")


def test_the_torque_is_the_moment_cross_the_field_in_any_body_axes() -> None:
    random = Random(7)
    for _ in range(2):
        tensor, field, moment = random.tensor(), random.vector(3), random.vector(2)
        q, w = random.quaternion(), random.vector()
        system = prepared(
            general_body(tensor),
            f"angular_velocity = {array(w)}\nquaternion = {array(q)}",
            f'kind = "magnetic_dipole"\nmoment = {array(moment)}\nfield = {array(field)}',
        ).system
        state = np.concatenate([w, q])
        torque = np.cross(moment, matrix(q).T @ field)
        expected = np.linalg.solve(tensor, np.cross(tensor @ w, w) + torque)
        found = derivative(system, state)[:3]
        assert np.abs(found - expected).max() <= CLOSE * np.linalg.cond(tensor) * (1 + np.abs(expected).max())
        energy = w @ tensor @ w / 2 - moment @ (matrix(q).T @ field)
        assert abs(observed(system, state)["energy"][0] - energy) <= CLOSE * (1 + abs(energy))


@pytest.mark.parametrize(
    ("load", "message"),
    [
        ("moment = [1, 0, 0]", "[[loads]] number 1: given none; exactly one of field, source_moment"),
        (f"moment = [1, 0, 0]\nfield = [1, 0, 0]\n{ORBIT}", "given field and orbit; give one of them"),
        (f"moment = [1, 0, 0]\n{ORBIT}", "given none; exactly one of field, source_moment"),
        (
            "moment = [1, 0, 0]\norbit = {semi_major_axis = 1}\nsource_moment = [1, 0, 0]",
            "orbit.period: missing; give it, or gravitational_parameter",
        ),
    ],
)
def test_what_contradicts_itself_is_refused(load: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        prepare(rigidsim.parse(text(load)))
    assert message in str(caught.value)


MU = 3.986004418e14
AROUND = 'orbit = {semi_major_axis = "7000 km"}\ngravitational_parameter = 3.986004418e14'


def in_flight(more: str = "") -> str:
    """About the Earth, with one load more."""
    start = "angular_velocity = [0.01, 0.02, 0.015]\nquaternion = [1, 0.1, 0.2, 0.3]\n"
    start += "position = [6900e3, 1e6, 0]\nvelocity = [0, 5000, 5700]"
    attraction = f'kind = "central_gravity"\ngravitational_parameter = {MU!r}'
    return config(
        "principal_moments = [1, 2, 3]\nmass = 100", start, [attraction, more], "end = 500\nsamples = 2"
    )


def test_in_flight_the_field_is_that_at_the_body() -> None:
    """Jackson, eq. 5.56. Its torque acts without a force: neither energy nor the whole momentum is kept."""
    random, moment, dipole = Random(9), np.array([0.5, -1.0, 2.0]), np.array([2e22, -1e22, -7.4e22])
    magnet = f'kind = "magnetic_dipole"\nmoment = {array(moment)}\nsource_moment = {array(dipole)}'
    pulled, plain = (prepare(rigidsim.parse(in_flight(more))).system for more in (magnet, ""))
    for _ in range(5):
        q, place = random.quaternion(), 7e6 * random.quaternion()[:3]
        state = np.concatenate([0.01 * random.vector(), q, place, 5e3 * random.vector(), [0.0] * 9])
        given = (state[: len(system.states)] for system in (pulled, plain))
        ours, theirs = (derivative(x, y)[:13] for x, y in zip((pulled, plain), given, strict=True))
        far = np.linalg.norm(place)
        field = 1e-7 / far**3 * (3 * (dipole @ place) * place / far**2 - dipole)
        torque = np.cross(moment, matrix(q).T @ field)
        np.testing.assert_allclose((ours - theirs)[:3] * [1, 2, 3], torque, rtol=0, atol=CLOSE * 1e-3)
        np.testing.assert_array_equal(ours[3:], theirs[3:])
    assert {invariant.name for invariant in pulled.invariants} == {"energy_balance", "quaternion_norm"}


@pytest.mark.parametrize(
    ("load", "message"),
    [
        (f"source_moment = [0, 0, 1e22]\n{AROUND}", "remove it and gravitational_parameter"),
        ("", "given none; exactly one of field, source_moment is needed"),
        ("source_moment = [0, 0, 1e22]\nposition = [6900e3, 1e6, 0]", "the body starts at the dipole"),
    ],
)
def test_a_magnet_in_flight_follows_no_orbit_of_its_own(load: str, message: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(message)):
        prepare(rigidsim.parse(in_flight(f'kind = "magnetic_dipole"\nmoment = [0, 0, 1]\n{load}')))


def test_a_gradient_of_what_attracts_the_body_in_flight_is_refused() -> None:
    """It would follow an orbit of its own, and act twice; that of a third body is allowed."""
    for place in ("orbit = {semi_major_axis = 7e6}", "position = [7e6, 0, 0]"):
        gradient = f'kind = "gravity_gradient"\ngravitational_parameter = 3.986e14\n{place}'
        with pytest.raises(ConfigError, match="another orbit: remove it"):
            prepare(rigidsim.parse(in_flight(gradient)))
        prepare(rigidsim.parse(in_flight(gradient.replace("3.986e14", "4.9028e12"))))


def test_b_dot_with_the_published_gain_brakes_within_an_orbit() -> None:
    """The law m = (k / B^2) w x B with the gain k = 2 n (1 + sin i) J of Avanzini & Giulietti (2012, Journal
    of Guidance, Control, and Dynamics 35, 1326). About the normal of a polar orbit, across the field, a spin
    falls exactly as exp(-k t / J), by 1/e in T / 8 pi; any tumble is gone within an orbit.
    """
    axis, moment = 6.828e6, 0.35
    motion = float(np.sqrt(MU / axis**3))
    gain, period = 4 * motion * moment, float(2 * np.pi / motion)
    law = [f"{gain!r}*(w{a}*b{c} - w{c}*b{a})/(bx^2 + by^2 + bz^2)" for a, c in ("yz", "zx", "xy")]
    components = ", ".join(f'"{x}"' for x in law)
    load = (
        f'kind = "magnetic_dipole"\nmoment = [{components}]\nsource_moment = [0, 0, -7.7e22]\n'
        f"gravitational_parameter = {MU}\norbit = {{semi_major_axis = {axis}, inclination = {np.pi / 2!r}}}"
    )
    body, time = f"principal_moments = [{moment}, {moment}, {moment}]", f"end = {period!r}\nsamples = 25"
    spin = run_text(config(body, "angular_velocity = [0, 0.1, 0]", load, time)).dataset
    expected = 0.1 * np.exp(-gain / moment * spin["time"].values)
    assert np.abs(spin["angular_velocity"].values[:, 1] - expected).max() < 1e-14
    tumble = run_text(config(body, "angular_velocity = [0.06, 0.05, -0.06]", load, time)).dataset
    size = np.linalg.norm(tumble["angular_velocity"].values, axis=1)
    assert (np.diff(size) < 0).all()
    assert size[-1] < 0.01 * size[0]
