"""A carrier of angular momentum from outside the package: a wheel with a motor, whose momentum is a state.

The body's tensor is that of all but the wheel's turning about its bearing: then L = I w + h, and the wheel's
kinetic energy is h^2 / 2 J. Everything above the tests is what an author writes.
"""

from typing import Any

import heyoka as hy
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from support import config, loaded

import rigidsim
from rigidsim.model.loads import InSI, Load, Term
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene.scene import Scene


class Wheel(Load):
    """A wheel along the body's z whose motor has a constant torque: h' = torque, from rest against space."""

    title = "wheel"

    def __init__(self, torque: str, moment: str) -> None:
        self.torque_given, self.moment = torque, moment

    def _motor(self, m: InSI) -> Any:
        return m.scene.context.mpf(self.torque_given)

    def extra_states(self, m: InSI) -> StateBlock:
        rate = hy.expression(m.number(self._motor(m)))
        why = "momentum of the wheel"
        return StateBlock(["wheel"], [rate], [m.scene.context.zero], exponents=[m.units.momentum], why=why)

    def carried_momentum(self, m: InSI) -> list[Term]:
        zero, one = m.scene.context.zero, m.scene.context.one
        return [([zero, zero, one], hy.make_vars("wheel"))]

    def _inverse(self, m: InSI) -> Any:
        return m.number(1 / m.scene.context.mpf(self.moment))

    def carried_energy(self, m: InSI) -> Any:
        return 0.5 * self._inverse(m) * hy.make_vars("wheel") ** 2.0

    def exerted_torque(self, m: InSI) -> list[Term]:
        zero = m.scene.context.zero
        return [([zero, zero, -self._motor(m)], hy.expression(1.0))]

    def supplied_power(self, m: InSI) -> Any:
        return m.number(self._motor(m)) * (self._inverse(m) * hy.make_vars("wheel") - m.rates[2])

    def carried_at_start(self, scene: Scene) -> tuple[list[Any], Any]:
        return [scene.context.zero] * 3, scene.context.zero


# --- the tests ----------------------------------------------------------------------------------------------

MOMENTS, RATES, ANGLES = np.array([1, 2, 2.5]), np.array([0.3, 1.0, 0.5]), (0.2, 1.1, 0.7)


def followed(times: np.ndarray, motor: float) -> tuple[np.ndarray, np.ndarray]:
    """Rates and attitudes by scipy from equations of its own: I w' = (I w + h) x w - h', R' = R [w]x."""

    def slope(time: float, state: np.ndarray) -> np.ndarray:
        w, matrix = state[:3], state[3:].reshape(3, 3)
        h = np.array([0, 0, motor * time])
        turning = (np.cross(MOMENTS * w + h, w) - [0, 0, motor]) / MOMENTS
        return np.concatenate([turning, (matrix @ np.cross(np.eye(3), w)).ravel()])

    start = np.concatenate([RATES, Rotation.from_euler("ZXZ", ANGLES).as_matrix().ravel()])
    found = solve_ivp(slope, (0, times[-1]), start, "DOP853", times, rtol=1e-13, atol=1e-14).y.T
    return found[:, :3], found[:, 3:].reshape(-1, 3, 3)


def run(**tables: str) -> rigidsim.Run:
    experiment = rigidsim.parse(config(time="end = 10\nsamples = 41", **tables))
    return rigidsim.run(experiment, out=None, loads=[Wheel("0.2", "0.25")])


def test_a_wheel_of_states_of_its_own_trades_momentum_with_the_body() -> None:
    """The motor's torque is an inner one: the whole momentum stays, and the energy grows by its work."""
    found = run()
    data, invariants = loaded(found), found.summary["invariants"]
    rates, matrices = followed(data["time"].values, 0.2)
    np.testing.assert_allclose(data["angular_velocity"].values, rates, rtol=0, atol=1e-11)
    q = np.roll(data["quaternion"].values, -1, axis=1)
    np.testing.assert_allclose(Rotation.from_quat(q).as_matrix(), matrices, atol=1e-11)
    for name in ("energy_balance", "angular_momentum"):
        assert 0 < invariants[name]["largest_drift"] <= invariants[name]["bound"]
    assert not {"energy", "angular_momentum_axial", "rotational_energy"} & set(invariants)
    assert np.ptp(data["energy"].values) > 0.1


def test_what_knows_the_body_alone_refuses_it() -> None:
    orbit = 'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {semi_major_axis = 1}'
    for way in ('[integrator]\nformulation = "canonical"', '[model]\nlevel = "spin_averaged"'):
        integrator, more = (way.split("\n")[1], "") if "[integrator]" in way else ("", way)
        with pytest.raises(rigidsim.ConfigError, match="wheel carries angular momentum"):
            run(loads=orbit, integrator=integrator, more=more)
    with pytest.raises(rigidsim.ConfigError, match="a load given from Python has no closed form"):
        run(integrator='method = "closed_form"')
