"""Flights on which loads do work, held against other integrators of the plain equations in SI."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from flights import MU, Flight, Flights, by_scipy, direction, in_orbit, turned_by
from support import run_estimated, run_text, unoptimised_code

import rigidsim
from rigidsim import ConfigError
from rigidsim.session.verdict import Soundness, verdict_on
from rigidsim.solve.problem import prepare

FAULT = Path(__file__).parents[1] / "data" / "faults" / "drag_in_orbit.toml"
IN_ORBIT = Flight(
    np.array([1.0, 2.0, 3.0]), 100.0, np.array([0.01, 0.02, 0.015]), np.array([1.0, 0.1, 0.2, 0.3]),
    np.array([6900e3, 0.0, 0.0]), np.array([0.0, 5000.0, 5700.0]), 3600.0, strength=MU, drag=1e-9, power=2.0,
)  # fmt: skip
SOUND = {Soundness.SOUND, Soundness.AMPLIFIED}


def errors(run: rigidsim.Run, truth: np.ndarray) -> tuple[float, float]:
    """Errors of attitude (rad) and position (m) at the end; ``truth`` is a state of ``Flights``."""
    dataset = run.dataset
    place = np.linalg.norm(dataset["position"].values[-1] - truth[:3])
    return turned_by(dataset["quaternion"].values[-1], truth[6:10]), float(place)


@pytest.mark.slow
def test_a_small_drag_leaves_the_attitude_as_right_as_announced() -> None:
    """The other integrator's own errors: 1e-13 of each of some thousand steps, over a hundred radians."""
    run = rigidsim.run(rigidsim.load(FAULT, overrides=["output.timeline=false"]), out=None)
    attitude, place = errors(run, by_scipy(IN_ORBIT))
    assert attitude <= 1e-11
    assert place <= 1e-5
    assert run.summary["warnings"] == []
    assert verdict_on(run.outcome).soundness in SOUND


def test_a_source_among_the_bodies_leaves_the_quaternion_its_norm() -> None:
    """Its force does work on the flight too, since it moves."""
    bodies = "".join(
        f'[[bodies]]\nname = "{name}"\ngravitational_parameter = {strength}\nposition = {place}\n'
        f"velocity = {speed}\n"
        for name, strength, place, speed in (
            ("earth", MU, "[0, 0, 0]", "[0, 0, 0]"), ("moon", 4.9e12, "[3.8e8, 0, 0]", "[0, 1000, 100]")
        )
    )  # fmt: skip
    text = IN_ORBIT.text.replace(f"gravitational_parameter = {MU!r}\nposition = [0.0, 0.0, 0.0]",
                                 'orbit = {body = "earth"}')  # fmt: skip
    without_drag = text[: text.index('[[loads]]\nkind = "force"')] + "[time]\nend = 3600\nsamples = 2\n"
    run = run_text(without_drag + bodies)
    assert run.summary["warnings"] == []
    gradient = '[[loads]]\nkind = "gravity_gradient"\norbit = {body = "earth"}\n'
    with pytest.raises(ConfigError, match="which has its torque; remove it"):
        prepare(rigidsim.parse(without_drag + gradient + bodies))


def quadratic(random: np.random.Generator) -> Flight:
    return in_orbit(random, drag=10 ** random.uniform(-11, -6), power=2.0)


def linear(random: np.random.Generator) -> Flight:
    return in_orbit(random, drag=10 ** random.uniform(-7, -3))


def thrust(random: np.random.Generator) -> Flight:
    return in_orbit(random, thrust=10 ** random.uniform(-4, 0) * direction(random))


def off_centre(random: np.random.Generator) -> Flight:
    arm = 1e-6 * direction(random)  # it turns the body by less than it turns already
    return in_orbit(random, drag=10 ** random.uniform(-10, -8), power=2.0, arm=arm)


def far_from_the_origin(random: np.random.Generator) -> Flight:
    found, shift = quadratic(random), 10 ** random.uniform(8, 11) * direction(random)
    found.centre, found.position = shift, found.position + shift
    return found


def falling(random: np.random.Generator) -> Flight:
    """Downwards from the start: the root of a speed that nearly vanishes needs another integrator."""
    found = in_orbit(random)
    found.strength, found.end = 0.0, 30 / float(np.linalg.norm(found.rates))
    found.position, found.velocity = found.position / 1e4, found.velocity / 1e2
    found.velocity[2] = -20 - abs(found.velocity[2])
    found.gravity = np.array([0, 0, -9.8])
    found.drag, found.power = found.mass * 10 ** random.uniform(-6, -4.5), 2.0
    return found


def in_free_space(random: np.random.Generator) -> Flight:
    found = thrust(random)
    found.strength = 0.0
    return found


def a_magnet(random: np.random.Generator) -> Flight:
    """A moment whose torque in the dipole's field turns the body as fast as it turns already, at most."""
    found = in_orbit(random)
    found.dipole = 7.7e22 * direction(random)
    field = 1e-7 * 7.7e22 / np.linalg.norm(found.position) ** 3
    energy = float(found.inertia @ found.rates**2)
    found.moment = 10 ** random.uniform(-3, -0.5) * energy / field * direction(random)
    return found


KINDS: tuple[Callable[[np.random.Generator], Flight], ...] = (
    quadratic, linear, thrust, off_centre, far_from_the_origin, falling, in_free_space, a_magnet
)  # fmt: skip


@pytest.mark.slow(45)
@pytest.mark.parametrize("kind", KINDS)
def test_random_flights_err_by_no_more_than_announced(kind: Callable[[np.random.Generator], Flight]) -> None:
    """Within three times what is announced, 99 of 100: none of 6 of each kind may be beyond.

    The truth is right to 1e-15 rad (it changes by less with twice the steps).
    """
    random = np.random.default_rng(25)
    flights = [kind(random) for _ in range(6)]
    truth = Flights(flights).at_end(300)
    for i, flight in enumerate(flights):
        with unoptimised_code():
            run = run_estimated(flight.text)
        attitude, place = errors(run, truth[:, i])
        accuracy = run.summary["accuracy"]
        assert attitude <= 3 * accuracy["estimated_attitude_error"], flight.text
        assert place <= 3 * accuracy["estimated_position_error"], flight.text
        assert run.summary["warning_codes"] == []
        assert verdict_on(run.outcome).soundness in SOUND
