"""Random flights on which loads do work, compared with another integrator of the plain equations in SI."""

from collections.abc import Callable

import numpy as np
import pytest
from flights import Flight, Flights, direction, in_orbit, turned_by
from support import run_estimated, unoptimised_code

from rigidsim.session.verdict import Soundness, verdict_on

SOUND = {Soundness.SOUND, Soundness.AMPLIFIED}


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


@pytest.mark.campaign
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
        dataset = run.dataset
        attitude = turned_by(dataset["quaternion"].values[-1], truth[6:10, i])
        place = float(np.linalg.norm(dataset["position"].values[-1] - truth[:3, i]))
        accuracy = run.summary["accuracy"]
        assert attitude <= 3 * accuracy["estimated_attitude_error"], flight.text
        assert place <= 3 * accuracy["estimated_position_error"], flight.text
        assert run.summary["warning_codes"] == []
        assert verdict_on(run.outcome).soundness in SOUND
