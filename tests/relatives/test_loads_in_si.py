"""Loads of users speak SI: their motion is scipy's of the same formulas, whatever the internal units are."""

import random
from collections.abc import Iterator
from typing import Any

import heyoka as hy
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import seeds

import rigidsim
from rigidsim.model.loads import Load, StateBlock, seconds
from rigidsim.model.observables import Observable, only_when_named
from rigidsim.scene.registry import OBSERVABLES, register_observable


class Mixed(Load):
    """Damping, a push in time, a wire towards the space axis X, and an elastic and damped flight."""

    title = "mixed"
    reads = frozenset({"attitude", "flight"})

    def __init__(self, damping: float, push: float, pace: float, wire: float, pull: float) -> None:
        self.damping_, self.push, self.pace, self.wire, self.pull = damping, push, pace, wire, pull

    def torque(self, m: Any) -> Any:
        c, w, towards = -self.damping_, m.rates, m.matrix[0]
        time = m.time if self.push > 0 else seconds(m)
        return [
            ([c, 0, 0], w[0]), ([0, 2 * c, 0], w[1]), ([0, 0, c], w[2]),
            ([0, 0, self.push], hy.sin(self.pace * time)),
            ([-self.wire, 0, 0], towards[1]), ([0, self.wire, 0], towards[0]),
        ]  # fmt: skip

    def force(self, m: Any) -> Any:
        unit = np.eye(3).tolist()
        pulled = [(unit[i], -(self.pull**2) * m.position[i]) for i in range(3)]
        return pulled + [(unit[i], -0.3 * self.pull * m.velocity[i]) for i in range(3)]


class Wheel(Load):
    """A wheel along z whose motor follows the rate, h' = k w_z - h / tau; its energy is h^2 / 2 J."""

    title = "wheel"

    def __init__(self, gain: float, lag: float, moment: float) -> None:
        self.gain, self.lag, self.moment = gain, lag, moment

    def extra_states(self, m: Any) -> StateBlock:
        return StateBlock(["held"], [self._slope(m)], [0], exponents=[m.units.momentum])

    def _slope(self, m: Any) -> Any:
        return self.gain * m.rates[2] - hy.make_vars("held") / self.lag

    def carried_momentum(self, m: Any) -> Any:
        return [([0, 0, 1], hy.make_vars("held"))]

    def carried_energy(self, m: Any) -> Any:
        return 0.5 / self.moment * hy.make_vars("held") ** 2.0

    def exerted_torque(self, m: Any) -> Any:
        return [([0, 0, -1], self._slope(m))]

    def supplied_power(self, m: Any) -> Any:
        return self._slope(m) * (hy.make_vars("held") / self.moment - m.rates[2])

    def carried_at_start(self, scene: Any) -> Any:
        return [scene.context.zero] * 3, scene.context.zero


class Scaled(Load):
    """Written for 1.0, with a constant in internal units."""

    title = "scaled"

    def torque(self, m: Any) -> Any:
        k = m.scene.context.ldexp(m.scene.context.mpf("0.3"), -m.scaling.energy)
        return [([-k, 0, 0], m.rates[0])]


class Timed(Load):
    """Reads heyoka's time, which is in internal units."""

    title = "timed"

    def torque(self, m: Any) -> Any:
        return [([1, 0, 0], hy.sin(hy.time))]


def momentum_across(m: Any) -> list[Any]:
    return [m.momentum_body[0] + 2.0 * m.momentum_body[1]]


OWN = Observable("momentum_of_a_user", (), "kg m2 s-1", "a sum", momentum_across, by_default=only_when_named)


def scene(rng: random.Random, end: float, rate: float, inertia: float) -> dict[str, Any]:
    moments = [inertia * x for x in (rng.uniform(1, 1.3), rng.uniform(1.4, 1.6), rng.uniform(1.7, 2.1))]
    return {
        "name": "own",
        "body": {"principal_moments": moments, "mass": 3},
        "initial": {"angular_velocity": [rate * rng.uniform(0.2, 1) for _ in range(3)]},
        "time": {"end": end, "samples": 4},
        "output": {"timeline": False, "estimate": False},
    }


@pytest.fixture(autouse=True, scope="module")
def _observable() -> Iterator[None]:
    register_observable(OWN)
    yield
    del OBSERVABLES[OWN.name]


@pytest.mark.parametrize("seed", seeds(1, 40))
def test_a_load_in_si_moves_the_body_as_its_formulas_say(seed: int) -> None:
    rng = random.Random(seed)
    rate, inertia, size = 10 ** rng.uniform(-6, 2), 10 ** rng.uniform(-8, 30), 10 ** rng.uniform(-3, 9)
    given = scene(rng, 3 / rate, rate, inertia)
    strength = inertia * rate**2
    damping, push, pace, wire, pull = (
        0.2 * inertia * rate, rng.choice((-0.3, 0.3)) * strength, 2 * rate, 0.4 * strength, rate
    )  # fmt: skip
    place, speed = [size, 0.3 * size, 0.1 * size], [0.0, size * rate, 0.0]
    given["initial"] |= {"position": place, "velocity": speed}
    given["output"]["record"] = ["angular_velocity", "position", "momentum_of_a_user"]
    run = rigidsim.run(given, out=None, loads=[Mixed(damping, push, pace, wire, pull)])

    moments = np.array(given["body"]["principal_moments"])

    def slope(time: float, state: np.ndarray) -> np.ndarray:
        w, matrix, x, v = state[:3], state[3:12].reshape(3, 3), state[12:15], state[15:]
        towards = matrix[0]
        torque = -damping * w * [1, 2, 1] + [0, 0, push * np.sin(pace * time)]
        torque = torque + wire * np.array([-towards[1], towards[0], 0])
        turning = (np.cross(moments * w, w) + torque) / moments
        skew = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        return np.concatenate([turning, (matrix @ skew).ravel(), v, -(pull**2) * x - 0.3 * pull * v])

    w0 = given["initial"]["angular_velocity"]
    start = np.concatenate([w0, np.eye(3).ravel(), place, speed])
    scales = np.concatenate([[rate] * 3, [1] * 9, [size] * 3, [size * rate] * 3])
    times = run.dataset.time.values
    found = solve_ivp(slope, (0, times[-1]), start, "DOP853", times, rtol=1e-12, atol=1e-13 * scales).y
    # scipy's tolerance over some ten steps a radian, a motion of three radians
    close = {"rtol": 0, "atol": 1e-9}
    rates = run.dataset.angular_velocity.values
    np.testing.assert_allclose(rates / rate, found[:3].T / rate, **close)
    np.testing.assert_allclose(run.dataset.position.values / size, found[12:15].T / size, **close)
    momentum = rates[:, 0] * moments[0] + 2 * rates[:, 1] * moments[1]
    np.testing.assert_allclose(run.dataset.momentum_of_a_user.values, momentum, rtol=1e-14)


@pytest.mark.parametrize("seed", seeds(1, 20))
def test_a_carrier_in_si_turns_the_body_as_its_formulas_say(seed: int) -> None:
    rng = random.Random(seed)
    rate, inertia = 10 ** rng.uniform(-6, 2), 10 ** rng.uniform(-8, 30)
    given = scene(rng, 3 / rate, rate, inertia)
    gain, lag = 0.4 * inertia * rate, 1.5 / rate
    run = rigidsim.run(given, out=None, loads=[Wheel(gain, lag, 0.3 * inertia)])
    assert run.dataset.attrs["python_loads"] == "Wheel"
    assert run.summary["bit_for_bit"]["claim"] is False  # the config alone doesn't hold it
    # the motor's torque is an inner one: the whole momentum stays, and the energy changes by its work
    rows = run.summary["invariants"]
    assert {"energy_balance", "angular_momentum"} <= set(rows)
    assert not {"energy", "angular_momentum_axial", "rotational_energy"} & set(rows)
    assert all(row["largest_drift"] <= row["bound"] for row in rows.values())
    assert np.ptp(run.dataset.energy.values) > 1e-3 * inertia * rate**2
    moments = np.array(given["body"]["principal_moments"])

    def slope(time: float, state: np.ndarray) -> np.ndarray:
        w, h = state[:3], state[3]
        motor = gain * w[2] - h / lag
        whole = moments * w + [0, 0, h]
        return np.append((np.cross(whole, w) - [0, 0, motor]) / moments, motor)

    start = [*given["initial"]["angular_velocity"], 0.0]
    times, scales = run.dataset.time.values, np.array([rate] * 3 + [inertia * rate])
    found = solve_ivp(slope, (0, times[-1]), start, "DOP853", times, rtol=1e-12, atol=1e-13 * scales).y
    rates = run.dataset.angular_velocity.values
    np.testing.assert_allclose(rates / rate, found[:3].T / rate, rtol=0, atol=1e-9)


def test_what_knows_the_body_alone_refuses_a_carrier() -> None:
    orbit = {"kind": "gravity_gradient", "gravitational_parameter": 1, "orbit": {"semi_major_axis": 1}}
    for more, remedy in (
        ({"integrator": {"formulation": "canonical"}, "loads": [orbit]}, "wheel carries angular momentum"),
        ({"model": {"level": "spin_averaged"}, "loads": [orbit]}, "wheel carries angular momentum"),
        ({"integrator": {"method": "closed_form"}}, "a load given from Python has no closed form"),
    ):
        with pytest.raises(rigidsim.ConfigError, match=remedy):
            rigidsim.run(scene(random.Random(1), 1, 1, 1) | more, out=None, loads=[Wheel(1, 1, 1)])


@pytest.mark.parametrize(("load", "remedy"), [(Scaled(), "leave out factors"), (Timed(), "write m.time")])
def test_a_load_in_internal_units_is_refused_with_the_remedy(load: Load, remedy: str) -> None:
    with pytest.raises(rigidsim.ConfigError, match=remedy):
        rigidsim.run(scene(random.Random(1), 1, 1, 1), out=None, loads=[load])
