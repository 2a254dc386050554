"""Moments that vary, mass that leaves: by equations of their own, closed forms; and where they end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import heyoka as hy
import numpy as np
import pytest
from gyrostats import exact
from moving_bodies import followed
from scipy.integrate import solve_ivp
from support import cases, config, run_text, same_bits, wide
from test_rotors import matrices

import rigidsim

BEGUN, RATES = [1, 2, "2.5"], ["0.1", "0.2", "1"]
TABLES = """
[parameters]
k = 0.1
[[states]]
name = "m"
unit = "kg m^2"
derivative = "0.05*cos(t/3) - 0.1*m"
"""
STATES = {"m": (0, lambda t, s, w: exact("0.05") * hy.cos(t / exact(3)) - exact("0.1") * s["m"])}
MOMENTS = 'principal_moments = ["1 + k*sin(t)", 2, "2.5 - m/3"]'


def moments(t: Any, s: dict[str, Any]) -> list[Any]:
    """The truth's own."""
    return [exact(1) + exact("0.1") * hy.sin(t), exact(2) + 0.0 * t, exact("2.5") - s["m"] / exact(3)]


def scene(end: float, body: str = MOMENTS, samples: int = 21, **more: str) -> str:
    """A scene's text; ``more`` as for ``support.config``."""
    initial = more.pop("initial", "angular_velocity = [0.1, 0.2, 1]")
    return config(body=body, initial=initial, time=f"end = {end}\nsamples = {samples}", **more)


def assert_sound(run: rigidsim.Run) -> None:
    rows = run.summary["invariants"]
    assert all(row["largest_drift"] <= row["bound"] for row in rows.values())


# --- against equations of their own -------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.optimised  # as runs are: what isn't rounds more
@pytest.mark.parametrize(("precision", "within"), [("double", 1e-12), ("extended", 1e-15)])
def test_a_thousand_radians(precision: str, within: float) -> None:
    run = run_text(scene(1000, integrator=f'precision = "{precision}"') + TABLES)
    data = run.dataset
    rates, attitudes, tensor = followed(moments, BEGUN, RATES, data["time"].values, states=STATES)
    assert np.abs(wide(data, "angular_velocity") - rates).max() <= within
    assert np.abs(matrices(data) - attitudes).max() <= within
    assert np.abs(wide(data, "principal_moments") - tensor).max() <= within
    assert_sound(run)
    assert {name for name, row in run.summary["invariants"].items() if not row["numerical"]} == {
        "angular_momentum", "angular_momentum_norm", "energy_balance",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("precision", "formulation", "within"),
    # rounding in some hundreds of steps, amplified a few times by the motion
    [
        ('"double"', "euler_angles", 5e-13), ('"quadruple"', "quaternion", 1e-18),
        pytest.param('"single"', "quaternion", 2e-4, marks=pytest.mark.slow),
        pytest.param('"double"', "quaternion", 5e-13, marks=pytest.mark.slow),
        pytest.param('"double"', "rotation_matrix", 5e-13, marks=pytest.mark.slow),
        pytest.param("50", "quaternion", 1e-18, marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_every_precision_and_formulation(precision: str, formulation: str, within: float) -> None:
    integrator = f'precision = {precision}\nformulation = "{formulation}"'
    run = run_text(scene(50, integrator=integrator) + TABLES)
    rates, attitudes, _ = followed(moments, BEGUN, RATES, run.dataset["time"].values, states=STATES)
    assert np.abs(wide(run.dataset, "angular_velocity") - rates).max() <= within
    assert np.abs(matrices(run.dataset) - attitudes).max() <= within
    assert_sound(run)


def test_rates_alone_are_enough() -> None:
    text = scene(50, integrator='formulation = "rates"', output='record = ["angular_velocity"]') + TABLES
    data = run_text(text).dataset
    rates, _, _ = followed(moments, BEGUN, RATES, data["time"].values, states=STATES)
    np.testing.assert_allclose(data["angular_velocity"].values, rates.astype(float), rtol=0, atol=5e-13)


def test_gravity_feels_the_moments_of_the_time_and_energy_tells_all_work() -> None:
    load = 'kind = "gravity_gradient"\ngravitational_parameter = 0.05\nposition = [1, 0, 0]'
    run = run_text(scene(50, loads=load) + TABLES)

    def torque(t: Any, w: Any, r: Any, tensor: Any) -> list[Any]:
        c, strength = r[0], exact("0.15")
        return [strength * c[j] * c[k] * (tensor[k] - tensor[j]) for j, k in ((1, 2), (2, 0), (0, 1))]

    times = run.dataset["time"].values
    rates, attitudes, _ = followed(moments, BEGUN, RATES, times, states=STATES, torque=torque)
    assert np.abs(wide(run.dataset, "angular_velocity") - rates).max() <= 5e-13
    assert np.abs(matrices(run.dataset) - attitudes).max() <= 5e-13
    assert "energy_balance" in run.summary["invariants"]
    assert_sound(run)


def test_a_body_in_flight_about_a_centre() -> None:
    load = 'kind = "central_gravity"\ngravitational_parameter = 1'
    start = "position = [3, 0, 0]\nvelocity = [0, 0.6, 0]\nangular_velocity = [0.1, 0.2, 1]"
    run = run_text(scene(50, MOMENTS + "\nmass = 10", loads=load, initial=start) + TABLES)
    assert {"energy_balance", "total_angular_momentum"} <= set(run.summary["invariants"])
    assert_sound(run)


def test_beside_a_free_rotor() -> None:
    """The tensor of what turns is none of principal axes; against scipy."""
    text = scene(20) + TABLES
    text += '[[rotors]]\nname = "wheel"\naxis = [3, 0, 4]\nmoment = 0.2\nrate = 5\n'
    run = run_text(text)
    assert_sound(run)
    axis = np.array([0.6, 0, 0.8])
    h = 0.2 * (5 + axis @ [0.1, 0.2, 1])

    def rates(t: float, m: float, momentum: np.ndarray) -> np.ndarray:
        tensor = np.diag([1 + 0.1 * np.sin(t), 2, 2.5 - m / 3]) - 0.2 * np.outer(axis, axis)
        return np.linalg.solve(tensor, momentum - h * axis)

    def slope(t: float, y: np.ndarray) -> list[float]:
        return [*np.cross(y[:3], rates(t, y[3], y[:3])), 0.05 * np.cos(t / 3) - 0.1 * y[3]]

    begun = np.diag([1, 2, 2.5]) @ [0.1, 0.2, 1] + 0.2 * 5 * axis
    times = run.dataset["time"].values
    found = solve_ivp(slope, (0, 20), [*begun, 0], "DOP853", times, rtol=1e-13, atol=1e-14).y.T
    truth = [rates(t, y[3], y[:3]) for t, y in zip(times, found, strict=True)]
    # DOP853's own error at this tolerance
    np.testing.assert_allclose(run.dataset["angular_velocity"], truth, rtol=0, atol=1e-10)


# --- closed forms -------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_tensor_that_grows_as_a_whole_is_the_constant_one_in_another_time() -> None:
    """I = I0 f: w(t) = w0(s)/f and the attitude of s = integral of dt/f; here f = exp(t/10)."""
    body = 'principal_moments = ["exp(t/10)", "2*exp(t/10)", "2.5*exp(t/10)"]'
    data = run_text(scene(30, body)).dataset
    times = data["time"].values
    s = ", ".join(repr(float(x)) for x in 10 * -np.expm1(-times / 10))
    still = config(
        body="principal_moments = [1, 2, 2.5]",
        initial="angular_velocity = [0.1, 0.2, 1]",
        time=f"times = [{s}]",
        integrator='method = "closed_form"\nprecision = "extended"',
    )
    constant = run_text(still).dataset
    scaled = wide(constant, "angular_velocity") * np.exp(-times / 10)[:, None]
    assert np.abs(wide(data, "angular_velocity") - scaled).max() <= 1e-14
    assert np.abs(matrices(data) - matrices(constant)).max() <= 1e-14


def test_a_skaters_pirouette() -> None:
    """Arms drawn in by a state of one's own: the rate follows the moment at once."""
    text = scene(
        10, 'principal_moments = ["6 + 2*arms", "6 + 2*arms", "0.5 + 2*arms^2"]',
        initial="angular_velocity = [0, 0, 3]",
    )  # fmt: skip
    text += '[[states]]\nname = "arms"\ninitial = 1\nderivative = "-arms/2"\n'
    run = run_text(text)
    moment = 0.5 + 2 * np.exp(-run.dataset["time"].values)
    np.testing.assert_allclose(run.dataset["angular_velocity"][:, 2], 7.5 / moment, rtol=1e-14)
    np.testing.assert_allclose(run.dataset["energy"], 7.5**2 / 2 / moment, rtol=1e-14)
    assert "angular_momentum_axial" in run.summary["invariants"]
    assert_sound(run)


ROCKET = 'principal_moments = ["400 - 3*burnt", "400 - 3*burnt", "60 - 0.4*burnt"]'
JET = 'kind = "mass_loss"\nrate = "0.5"\nexit_point = [0, 0, -2.5]\nexit_radius = 0.4'


@pytest.mark.parametrize(("precision", "within"), [("double", 1e-12), ("extended", 1e-15)])
def test_jet_damping_by_its_closed_form(precision: str, within: float) -> None:
    """A = A0 - k m, C = C0 - c m: abs(w_t) goes with A to the power (l^2 + a^2/4)/k - 1, the spin with C to
    the power (a^2/2)/c - 1 (Thomson 1961; Eke and Wang 1995).
    """
    text = scene(
        100, ROCKET, loads=JET, initial="angular_velocity = [0.3, 0, 2]",
        integrator=f'precision = "{precision}"',
    )  # fmt: skip
    text += '[[states]]\nname = "burnt"\nunit = "kg"\nderivative = "0.5"\n'
    run = run_text(text)
    time = run.dataset["time"].values.astype(np.longdouble)
    number = np.longdouble
    a = 1 - number("1.5") * time / 400
    c = 1 - number("0.2") * time / 60
    rates = wide(run.dataset, "angular_velocity")
    transverse = np.sqrt(rates[:, 0] ** 2 + rates[:, 1] ** 2)
    ways = number("6.25") + number("0.04")
    assert np.abs(transverse / (number("0.3") * a ** (ways / 3 - 1)) - 1).max() <= within
    assert np.abs(rates[:, 2] / (2 * c ** (number("0.08") / number("0.4") - 1)) - 1).max() <= within
    assert_sound(run)


def test_mass_that_leaves_anywhere_at_any_rate() -> None:
    """Against equations of its own, with an exit off the axes and no axis of symmetry."""
    load = 'kind = "mass_loss"\nrate = "0.02*(1 + sin(t))"\nexit_point = [0.5, -1, 2]'
    body = MOMENTS + "\ncenter_of_mass = [0, 0, 0.5]"
    run = run_text(scene(50, body, loads=load) + TABLES)
    arm = [exact("0.5"), exact(-1), exact("1.5")]

    def torque(t: Any, w: Any, r: Any, tensor: Any) -> list[Any]:
        rate = exact("0.02") * (exact(1) + hy.sin(t))
        along = hy.sum([x * y for x, y in zip(arm, w, strict=True)])
        return [-(rate * (exact("3.5") * y - x * along)) for x, y in zip(arm, w, strict=True)]

    times = run.dataset["time"].values
    rates, attitudes, _ = followed(moments, BEGUN, RATES, times, states=STATES, torque=torque)
    assert np.abs(wide(run.dataset, "angular_velocity") - rates).max() <= 5e-13
    assert np.abs(matrices(run.dataset) - attitudes).max() <= 5e-13
    assert_sound(run)


# --- what stays as it was -----------------------------------------------------------------------------------


def test_constant_expressions_are_the_constant_body_bit_for_bit() -> None:
    plain = run_text(scene(20, "principal_moments = [1, 2, 2.5]"))
    body = 'principal_moments = ["2*half", "2", "2.5 kg m^2"]'
    for text in (
        scene(20, body.replace("2*half", "1 kg m^2")),
        scene(20, body) + "[parameters]\nhalf = 0.5\n",
    ):
        same_bits(plain.dataset, run_text(text).dataset)


def test_a_state_that_nothing_reads_isnt_carried() -> None:
    text = scene(20, 'principal_moments = ["1 + 0.1*sin(t)", 2, 2.5]', output='record = ["quaternion"]')
    assert "m" not in run_text(text + TABLES).dataset


# --- where no body can go on --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "time", "said"),
    [
        ('[1, 2, "2.5 + t/8"]', 4, "the moment about z exceeds the sum of the other two"),
        ('["2 - t", 2, 2]', 2, "the moment about x falls below"),
        ('[2, 2, "3 + wave"]', float(2 * np.arcsinh(0.5)), "the moment about z exceeds"),
    ],
)
@pytest.mark.parametrize("precision", cases(["double", "extended"], ["double"]))
def test_a_run_ends_where_moments_become_impossible(
    body: str, time: float, said: str, precision: str, tmp_path: Path
) -> None:
    text = scene(10, f"principal_moments = {body}", 2001, integrator=f'precision = "{precision}"')
    text += '[[states]]\nname = "wave"\nunit = "kg m^2"\nderivative = "cosh(t/2)"\n'
    run = run_text(text, tmp_path)
    assert run.status == "stopped: impossible body"
    assert said in run.summary["message"]
    # what a moment has to be above zero is 1e-9 of the sum, and what may be beyond the sum 2^-40
    assert float(run.dataset["time"][-1]) <= run.summary["time_reached"] == pytest.approx(time, abs=1e-8)
    assert_sound(run)


def test_a_rate_that_turns_negative_ends_the_run() -> None:
    load = 'kind = "mass_loss"\nrate = "1 - t/4"\nexit_point = [0, 0, 1]'
    run = run_text(scene(10, "principal_moments = [10, 10, 5]", loads=load))
    assert run.status == "stopped: impossible body"
    assert "[[loads]] number 1 mass_loss rate is negative" in run.summary["message"]
    assert run.summary["time_reached"] == pytest.approx(4, abs=1e-3)  # 2^-16 of the rate at the start


@pytest.mark.slow
def test_a_flat_body_may_swing() -> None:
    """I3 = I1 + I2 at all times: rounding ends nothing."""
    body = 'principal_moments = ["1 + 0.3*sin(t)", 2, "3 + 0.3*sin(t)"]'
    for precision in ("single", "double"):
        run = run_text(scene(50, body, integrator=f'precision = "{precision}"'))
        assert run.status == "finished"


# --- what is refused ----------------------------------------------------------------------------------------

VARYING = '"1 + 0.1*sin(t)"'


@pytest.mark.parametrize(
    ("moments", "more", "said"),
    [
        (f"[{VARYING}, 2, 4]", "", "the largest is more than the sum of the other two"),
        ('["-1 - t", 2, 2]', "", "can't be negative"),
        ('["t", 2, 2]', "", "has to be more than 1e-09 of their sum"),
        ('["1/t", 2, 2]', "", "no finite value at the start"),
        ('["1 + 0.1*wx", 2, 2]', "", "reads wx; moments may read t, [[states]] and [parameters]"),
        ('["1 + 0.5*step(t - 1)", 2, 2]', "", "which jumps: mass takes time to move"),
        ('["1 + (1 s)*t", 2, 2]', "", "kg m^2"),
        ('["1 + tt", 2, 2]', "", 'unknown name "tt"'),
        ('["1 kg", 2, 2]', "", "kg m^2"),
        ('["1 + ", 2, 2]', "", "missing"),
        (f"[{VARYING}, 2, 2]", '[integrator]\nmethod = "closed_form"', "mass that moves in the body"),
        (f"[{VARYING}, 2, 2]", '[integrator]\nformulation = "canonical"', "principal_moments vary"),
        (f"[{VARYING}, 2, 2]", '[integrator]\nformulation = "planar"', "principal_moments vary"),
        (f"[{VARYING}, 2, 2]", '[model]\nlevel = "spin_averaged"', "principal_moments vary"),
        (f"[{VARYING}, 2, 2]", "[integrator]\nhold_invariants = true", "principal_moments vary"),
    ],
)
def test_what_no_body_has_is_refused(moments: str, more: str, said: str) -> None:
    text = (
        f"[body]\nprincipal_moments = {moments}\n[initial]\nangular_velocity = [0, 0, 1]\n[time]\nend = 1\n"
    )
    text = f'name = "refused"\n{text}samples = 2\n{more}\n'
    with pytest.raises(rigidsim.ConfigError) as refused:
        rigidsim.run(rigidsim.parse(text))
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("load", "more", "said"),
    [
        ('rate = "-1"\nexit_point = [0, 0, 1]', "", "at least 0"),
        ('rate = "t - 1"\nexit_point = [0, 0, 1]', "", "at least 0"),
        ('rate = "1 m"\nexit_point = [0, 0, 1]', "", "kg/s"),
        ('rate = "1"\nexit_point = [0, 0, 1]\nexit_radius = -1', "", "at least 0"),
        ('rate = "1"\nexit_point = [0, 0, 0]\nexit_radius = 1', "", "the centre of mass"),
        ('rate = "1"\nexit_point = [0, 0, 1]', "position = [0, 0, 1]", "a constant mass"),
        (
            'rate = "1"\nexit_point = [0, 0, 1]\n[[loads]]\nkind = "uniform_gravity"\n'
            "acceleration = [0, 0, -9.8]",
            "", "constant mass",
        ),
    ],
)  # fmt: skip
def test_what_no_jet_does_is_refused(load: str, more: str, said: str) -> None:
    body = "principal_moments = [2, 2, 3]\nmass = 1"
    body += "\ncenter_of_mass = [0, 0, 0.1]" if "uniform" in load else ""
    initial = f"angular_velocity = [0, 0, 1]\n{more}"
    with pytest.raises(rigidsim.ConfigError) as refused:
        run_text(scene(1, body, loads=f'kind = "mass_loss"\n{load}', initial=initial))
    assert said in str(refused.value)


# --- sessions and sweeps ------------------------------------------------------------------------------------


def test_a_body_that_shrinks_by_states_has_scales_that_fit() -> None:
    """Energies and rates become 400 times as large: drifts are told against what there is."""
    body = 'principal_moments = ["s", "2*s", "2.5*s"]'
    text = scene(30, body) + '[[states]]\nname = "s"\ninitial = 1\nderivative = "-s/5"\n'
    run = run_text(text, estimate=True)
    assert run.summary["warnings"] == []
    assert_sound(run)
