"""Carriers of angular momentum from outside the package: a rotor left to itself, and a wheel with a motor.

The body's tensor is that of all but the rotor's turning about its bearing: then L = I w + h, and the rotor's
kinetic energy is h^2 / 2 J. Everything above the tests is what an author writes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import heyoka as hy
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from support import config, loaded, run_text

import rigidsim
from rigidsim.model.loads import InSI, Load, Term
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene.fields import Moment, Momentum, Triple
from rigidsim.scene.registry import LoadFields, Surroundings, register_load
from rigidsim.scene.scene import Scene


class RotorFields(LoadFields):
    """A balanced rotor on a bearing without friction, which keeps its momentum about its axis."""

    kind: Literal["rotor"]
    momentum: Triple[Momentum]
    moment: Moment


class Rotor(Load):
    Fields = RotorFields
    title = "rotor"
    described = "a rotor"
    conservative = True

    def __init__(self, momentum: list[Any], moment: Any) -> None:
        self.momentum, self.moment = momentum, moment

    @classmethod
    def resolve(cls, fields: RotorFields, around: Surroundings) -> Rotor:
        return cls([x.at(around.context) for x in fields.momentum], fields.moment.at(around.context))

    def acts(self) -> bool:
        return any(x != 0 for x in self.momentum)

    def amplitude(self, scene: Scene) -> Any:
        return scene.context.zero

    def carried_momentum(self, m: InSI) -> list[Term]:
        return [(self.momentum, hy.expression(1.0))]

    def carried_energy(self, m: InSI) -> Any:
        return hy.expression(m.number(self._energy()))

    def exerted_torque(self, m: InSI) -> list[Term]:
        return []

    def supplied_power(self, m: InSI) -> Any:
        return None

    def carried_at_start(self, scene: Scene) -> tuple[list[Any], Any]:
        return self.momentum, self._energy()

    def _energy(self) -> Any:
        return sum(x * x for x in self.momentum) / (2 * self.moment)


def register() -> None:
    register_load(Rotor)


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
HELD = np.array([0.4, -0.3, 0.8])


def rotor(momentum: Any = HELD, moment: float = 0.25) -> str:
    return f'kind = "rotor"\nmomentum = {[float(x) for x in momentum]}\nmoment = {moment}'


def followed(times: np.ndarray, momentum: Any, motor: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Rates and attitudes by scipy from equations of its own: I w' = (I w + h) x w - h', R' = R [w]x."""

    def slope(time: float, state: np.ndarray) -> np.ndarray:
        w, matrix = state[:3], state[3:].reshape(3, 3)
        h = momentum + np.array([0, 0, motor * time])
        turning = (np.cross(MOMENTS * w + h, w) - [0, 0, motor]) / MOMENTS
        return np.concatenate([turning, (matrix @ np.cross(np.eye(3), w)).ravel()])

    start = np.concatenate([RATES, Rotation.from_euler("ZXZ", ANGLES).as_matrix().ravel()])
    found = solve_ivp(slope, (0, times[-1]), start, "DOP853", times, rtol=1e-13, atol=1e-14).y.T
    return found[:, :3], found[:, 3:].reshape(-1, 3, 3)


def assert_followed(data: Any, momentum: Any, motor: float = 0.0) -> None:
    rates, matrices = followed(data["time"].values, momentum, motor)
    np.testing.assert_allclose(data["angular_velocity"].values, rates, rtol=0, atol=1e-11)
    q = data["quaternion"].values
    np.testing.assert_allclose(Rotation.from_quat(np.roll(q, -1, axis=1)).as_matrix(), matrices, atol=1e-11)


def text(loads: str | None = None, **tables: str) -> str:
    return config(loads=rotor() if loads is None else loads, **({"time": "end = 20\nsamples = 81"} | tables))


def test_a_gyrostat_keeps_energy_and_the_whole_momentum(tmp_path: Path) -> None:
    run = rigidsim.run(rigidsim.parse(text(estimate=True)), out=tmp_path)
    data, invariants = loaded(run), run.summary["invariants"]
    assert_followed(data, HELD)
    for name in ("energy", "angular_momentum", "angular_momentum_norm"):
        assert 0 < invariants[name]["largest_drift"] <= invariants[name]["bound"]
    assert "angular_momentum_axial" not in invariants
    body = MOMENTS * data["angular_velocity"].values
    turned = Rotation.from_quat(np.roll(data["quaternion"].values, -1, axis=1))
    np.testing.assert_allclose(data["angular_momentum"].values, turned.apply(body + HELD), atol=1e-14)
    assert np.ptp(np.linalg.norm(body, axis=1)) > 0.1  # which the body alone doesn't keep
    own = (MOMENTS * data["angular_velocity"].values ** 2).sum(axis=1) / 2
    np.testing.assert_allclose(data["energy"].values, own + HELD @ HELD / 0.5, rtol=1e-15)
    assert rigidsim.verify(run.folder.path).identical


def test_a_wheel_of_states_of_its_own_trades_momentum_with_the_body() -> None:
    """The motor's torque is an inner one: the whole momentum stays, and the energy grows by its work."""
    experiment = rigidsim.parse(text("", time="end = 10\nsamples = 41"))
    run = rigidsim.run(experiment, out=None, loads=[Wheel("0.2", "0.25")])
    assert_followed(loaded(run), np.zeros(3), motor=0.2)
    invariants = run.summary["invariants"]
    for name in ("energy_balance", "angular_momentum"):
        assert 0 < invariants[name]["largest_drift"] <= invariants[name]["bound"]
    assert "energy" not in invariants
    assert np.ptp(run.dataset["energy"].values) > 0.1


ORBIT = 'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {semi_major_axis = 1}'


def test_what_knows_the_body_alone_refuses_it() -> None:
    for what in ('integrator.formulation="canonical"', 'model.level="spin_averaged"'):
        with pytest.raises(rigidsim.ConfigError, match="rotor carries angular momentum beside the body"):
            run_text(config(loads=[rotor(), ORBIT]), what)
    spin = "angular_velocity = [0, 0, 1]"
    with pytest.raises(rigidsim.ConfigError, match="rotor carries angular momentum beside the body"):
        run_text(config(loads=rotor([0, 0, 1]), initial=spin), 'integrator.formulation="planar"')
    with pytest.raises(rigidsim.ConfigError, match="a rotor has no closed form"):
        run_text(text(), 'integrator.method="closed_form"')
