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
from killing import killed
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from support import STARTS, assert_announced_from, config, loaded, run_text, same_bits

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


@pytest.mark.slow
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
    # true ones are some last bits of the attitude
    assert_announced_from(text(), STARTS, exact="quadruple", at_most=20)
    assert rigidsim.verify(run.folder.path).identical


def test_a_symmetric_body_with_its_rotor_along_the_axis_nutates_as_in_closed_form() -> None:
    """w_x + i w_y turns at ((C - A) w_z + h) / A, and w_z stays."""
    a, c, h = 2.0, 3.0, 1.5
    data = loaded(run_text(text(rotor([0, 0, h]), body=f"principal_moments = [{a}, {a}, {c}]")))
    phase = ((c - a) * RATES[2] + h) / a * data["time"].values
    across = (RATES[0] + 1j * RATES[1]) * np.exp(1j * phase)
    exact = np.array([across.real, across.imag, np.full(len(phase), RATES[2])]).T
    # rounding in each of some hundred steps, and in the phase of the exact ones
    np.testing.assert_allclose(data["angular_velocity"].values, exact, rtol=0, atol=1e-13)


def test_a_spin_along_the_whole_momentum_is_steady() -> None:
    held = 5.0 * RATES - MOMENTS * RATES  # I w + h along w, and beyond any moment: stable
    data = loaded(run_text(text(rotor(held))))
    np.testing.assert_allclose(data["angular_velocity"].values, np.tile(RATES, (81, 1)), rtol=0, atol=1e-13)


def test_a_rotor_at_rest_changes_no_bit() -> None:
    same_bits(run_text(text(rotor([0, 0, 0]))), run_text(text("")))


@pytest.mark.slow
@pytest.mark.optimised  # as in the process that is killed
def test_a_killed_run_resumes_bit_for_bit(tmp_path: Path) -> None:
    given = text(integrator="tolerance = 1e-12", time="end = 6\nsamples = 25")
    done = rigidsim.resume(killed("test_a_carrier", given, tmp_path))
    assert done.summary["cost"]["sessions"] == 2
    same_bits(run_text(given, estimate=True), done)


@pytest.mark.slow
@pytest.mark.optimised
def test_a_killed_run_with_rotors_of_the_config_resumes_bit_for_bit(tmp_path: Path) -> None:
    rotors = '[[rotors]]\nname = "free"\naxis = [1, 2, 3]\nmoment = 0.1\nrate = 5\n'
    rotors += (
        '[[rotors]]\nname = "driven"\naxis = [0, 0, 1]\nmoment = 0.1\ntorque = "min(wx, 0.1) - rate_free/9"\n'
    )
    given = text("", time="end = 6\nsamples = 25") + rotors
    done = rigidsim.resume(killed("test_a_carrier", given, tmp_path))
    assert done.summary["cost"]["sessions"] == 2
    same_bits(run_text(given, estimate=True), done)
    assert rigidsim.verify(done.folder.path).identical


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


HEAVY = "principal_moments = [2, 2, 1]\nmass = 1\ncenter_of_mass = [0, 0, 0.2]"
ORBIT = 'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {semi_major_axis = 1}'
CENTRE = 'kind = "central_gravity"\ngravitational_parameter = 1'
FLIGHT = "angular_velocity = [0.1, 1, 0.3]\nposition = [1, 0, 0]\nvelocity = [0, 1, 0]"
MOMENTUM = {"angular_momentum", "angular_momentum_norm"}
KEPT: dict[str, tuple[dict[str, str], str, set[str]]] = {
    "on a circle": ({}, ORBIT, {"jacobi_constant", "energy_balance"}),
    "top": ({"body": HEAVY}, 'kind = "uniform_gravity"', {"energy", "angular_momentum_vertical"}),
    "about a point": (
        {"body": "principal_moments = [2, 2, 2]\nmass = 1", "initial": FLIGHT}, CENTRE,
        {"energy", "rotational_energy", "total_angular_momentum", *MOMENTUM},
    ),
    "held": ({"integrator": "hold_invariants = true"}, "", {"energy", *MOMENTUM}),
}  # fmt: skip


@pytest.mark.parametrize("case", list(KEPT))
def test_what_is_conserved_is_of_body_and_rotor_together(case: str) -> None:
    """Neither an axial momentum nor the constants of special tops are claimed, as of a body alone."""
    tables, load, expected = KEPT[case]
    given = config(loads=[rotor(), load], time="end = 5\nsamples = 21", **tables)
    rows = {name: row for name, row in run_text(given).summary["invariants"].items() if not row["numerical"]}
    assert set(rows) == expected
    assert all(row["largest_drift"] <= row["bound"] for row in rows.values())


def test_in_flight_only_a_rotor_left_to_itself_keeps_the_energy_of_rotation() -> None:
    flight = {
        "body": "principal_moments = [1, 2, 2.5]\nmass = 3",
        "initial": "angular_velocity = [0.3, 1.0, 0.5]\nposition = [0, 0, 0]\nvelocity = [1, 0, 0]",
        "time": "end = 3\nsamples = 7",
    }
    assert "rotational_energy" in run_text(text(**flight)).summary["invariants"]
    driven = rigidsim.run(rigidsim.parse(text("", **flight)), out=None, loads=[Wheel("0.2", "0.25")])
    assert {"energy", "rotational_energy"} & set(driven.summary["invariants"]) == set()


def test_what_knows_the_body_alone_refuses_it() -> None:
    orbit = 'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {semi_major_axis = 1}'
    for what in ('integrator.formulation="canonical"', 'model.level="spin_averaged"'):
        with pytest.raises(rigidsim.ConfigError, match="rotor carries angular momentum beside the body"):
            run_text(config(loads=[rotor(), orbit]), what)
    spin = "angular_velocity = [0, 0, 1]"
    with pytest.raises(rigidsim.ConfigError, match="rotor carries angular momentum beside the body"):
        run_text(config(loads=rotor([0, 0, 1]), initial=spin), 'integrator.formulation="planar"')
    with pytest.raises(rigidsim.ConfigError, match="a rotor has no closed form"):
        run_text(text(), 'integrator.method="closed_form"')
