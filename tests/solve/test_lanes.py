"""What carries a motion's neighbours forward, and what a tolerance lets a step be wrong by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from support import config

import rigidsim
from rigidsim.model.system import System
from rigidsim.solve.neighbours.lanes import NEIGHBOURS, BatchLanes, OwnLanes, SeriesErrors
from rigidsim.solve.precision import precision_of
from rigidsim.solve.problem import prepare
from rigidsim.solve.steppers import stepper_of

COMET = config(
    body="principal_moments = [1e-4, 2e-4, 2.5e-4]\nmass = 1",
    initial="angular_velocity = [3e-4, 1e-3, 5e-4]\nposition = [200, 0, 0]\nvelocity = [0, 0.01, 0]",
    loads='kind = "central_gravity"\ngravitational_parameter = 1',
    time="end = 8000\nsamples = 2",
)
"""An ellipse with its pericentre at a 100th of its apocentre."""
COMPACT = replace(precision_of("double"), compact=True)


def system_of(text: str) -> System:
    return prepare(rigidsim.parse(text)).system


def test_a_stretch_ends_where_steps_change_in_length() -> None:
    """Stretches of equal times jump over a close passage, whose errors count for most."""
    prepared = prepare(rigidsim.parse(COMET))
    system, end = prepared.system, float(prepared.clock.at(1))
    stepper = stepper_of(system, COMPACT, None, prepared.clock.start)
    initial = np.array([float(x) for x in system.initial])
    place = [system.states.index(name) for name in "xyz"]
    for lanes in (OwnLanes(system, stepper.integrator), BatchLanes(system, 100.0, 1e-14)):
        states = np.repeat(initial[:, None], NEIGHBOURS + 1, axis=1)
        states[place, 1:] *= 1 + 1e-12
        time, nearest, taken = 0.0, [], 0
        while time < end:
            found = lanes.advance(states, np.full(4, time), np.full(4, end), 50)
            assert found is not None
            states, steps, time = found
            assert np.allclose(
                states[place, :1], states[place, 1:], rtol=0, atol=1e-6
            )  # all at the same time
            nearest.append(float(np.linalg.norm(states[place, 0])))
            taken += steps
        near = 0.1 * max(nearest)
        assert sum(r < near for r in nearest) >= 2  # of the one passage, which takes a 50th of the time
        assert taken <= 50 * len(nearest)


def test_states_that_nothing_feels_are_not_carried() -> None:
    """The work done by a load is one, and what it would cost to compile is saved; the motion is the same."""
    system = system_of(
        config(
            body="principal_moments = [1, 2, 2.5]",
            initial="angular_velocity = [0.5, 0.25, 1]",
            loads='kind = "torque"\ncomponents = ["0.01*sin(0.3*t)", "0.02*cos(0.5*t)", "0"]',
            time="end = 100\nsamples = 2",
        )
    )
    work = system.states.index("work")
    assert work == len(system.states) - 1
    lanes = BatchLanes(system, 100.0, 1e-14)
    initial = np.array([float(x) for x in system.initial])
    states = np.repeat(initial[:, None], NEIGHBOURS + 1, axis=1)
    states[work] = 0.25
    found = lanes.advance(states, np.zeros(4), np.full(4, 8.0), 1000)
    whole = stepper_of(system, COMPACT, None, 0.0)
    assert whole.to(8.0)
    assert found is not None
    assert (found[0][work] == 0.25).all()
    assert abs(whole.state[work]) > 1e-6  # where it is carried it moves
    # two tolerances of 1e-14 and 2e-16 over some tens of steps
    assert np.abs(found[0][:work] - whole.state[:work, None]).max() < 1e-12


def test_errors_of_series_are_those_of_their_order() -> None:
    """An order belongs to all tolerances down to the next; one more may gain more than the tolerance says, or
    nothing.
    """
    system = system_of(COMET)
    initial = np.array([float(x) for x in system.initial])
    one, other = (SeriesErrors(system, tolerance).of_step(initial, 0.0) for tolerance in (1.3e-12, 3e-12))
    assert (one == other).all()
    looser, tighter = (SeriesErrors(system, tolerance).of_step(initial, 0.0) for tolerance in (1e-9, 1e-13))
    sizes = [float(np.abs(found).max()) for found in (looser, one, tighter)]
    assert sizes[0] > 3 * sizes[1] > 9 * sizes[2] > 0


def test_errors_of_steps_add_up_to_what_a_run_has_lost() -> None:
    """Whatever the motion turns through within a step: what a step gets wrong of the quaternion's length,
    which is 1 without errors, would have another size and sign if it were counted as made in the beginning.
    """
    system = system_of(
        config(
            body="principal_moments = [0.85, 0.85, 1]",
            initial="angular_velocity = [0, 0, 30]\neuler_angles = [0.1, 0.9, 0.2]",
            loads='kind = "gravity_gradient"\ngravitational_parameter = 1\n'
            "orbit = {semi_major_axis = 1, eccentricity = 0.2, inclination = 0.4}",
            time="end = 10\nsamples = 2",
        )
    )
    engine = stepper_of(system, COMPACT, 1e-7, 0.0).integrator
    errors, told = SeriesErrors(system, 1e-7, engine), 0.0
    places = [system.states.index(name) for name in ("qw", "qx", "qy", "qz")]
    before = float(np.linalg.norm(engine.state[places]))
    for _ in range(100):
        state = np.array(engine.state)
        told += float(state[places] @ errors.of_step(state, float(engine.time))[places])
        engine.step()
    lost = float(np.linalg.norm(engine.state[places])) - before
    assert abs(lost) > 1e-10
    # what is carried back, and the sum of steps, are of first order
    assert abs(told - lost) < 1e-3 * abs(lost)
