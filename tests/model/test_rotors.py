"""Gyrostats against equations of their own, closed forms, and what is known of their stability."""

from __future__ import annotations

import re
from typing import Any

import heyoka as hy
import numpy as np
import pytest
from gyrostats import Wheel, exact, followed
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from support import assert_announced, cases, config, loaded, run_text, same_bits, wide

import rigidsim

MOMENTS, RATES = [1, 2, 2.5], [0.3, 1.0, 0.5]
FREE = Wheel([1, 0.5, -0.3], 0.2, 3)
FIXED = Wheel([0, 1, 0], 0.1, -2, fixed=True)
DRIVEN = Wheel(
    [0, 0, 1], 0.3, -4, torque=lambda t, w, r: exact("0.05") * hy.sin(t) - exact("0.1") * w[2] * r[0][0]
)
MOTOR = "0.05*sin(t) - 0.1*wz*(1 - 2*(qy^2 + qz^2))"


def scene(
    *wheels: Wheel, end: float, samples: int = 21, motors: dict[int, str] | None = None, **more: str
) -> str:
    """A scene's text; ``more`` as for ``support.config``, its ``integrator`` and ``loads`` for instance."""
    tables = ""
    for k, wheel in enumerate(wheels):
        tables += f'[[rotors]]\nname = "w{k}"\naxis = {list(wheel.axis)}\n'
        tables += f"moment = {wheel.moment}\nrate = {wheel.rate}\nfixed = {str(wheel.fixed).lower()}\n"
        tables += f'torque = "{motors[k]}"\n' if motors and k in motors else ""
    body = more.pop("body", f"principal_moments = {MOMENTS}")
    initial = more.pop("initial", f"angular_velocity = {RATES}")
    return config(body=body, initial=initial, time=f"end = {end}\nsamples = {samples}", **more) + tables


def matrices(data: Any) -> np.ndarray:
    """Rotation matrices of a dataset's quaternions, with all their digits."""
    w, x, y, z = wide(data, "quaternion").T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def assert_followed(data: Any, truth: tuple[np.ndarray, np.ndarray, np.ndarray], within: float) -> None:
    rates, attitudes, spins = truth
    assert np.abs(wide(data, "angular_velocity") - rates).max() <= within * np.abs(rates).max()
    assert np.abs(matrices(data) - attitudes).max() <= within
    assert np.abs(wide(data, "rotor_rate") - spins).max() <= within * max(1, float(np.abs(spins).max()))


# --- against equations of their own -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("integrator", "within"),
    [
        pytest.param('precision = "double"\nhold_invariants = true', 1e-12, id="double"),
        pytest.param(
            'precision = "extended"\nhold_invariants = true', 1e-15, id="80 bits", marks=pytest.mark.slow
        ),
    ],
)
def test_several_rotors_over_a_thousand_radians(integrator: str, within: float) -> None:
    wheels = (FREE, FIXED, Wheel([0, 1, 1], 0.1, 1))
    data = run_text(scene(*wheels, end=1000, integrator=integrator)).dataset
    assert_followed(data, followed(MOMENTS, wheels, RATES, np.eye(3), data["time"].values), within)


@pytest.mark.parametrize(
    ("formulation", "precision", "within"),
    # rounding in some hundreds of steps, amplified a few times by the motion
    [
        ("quaternion", '"quadruple"', 1e-18),
        ("euler_angles", '"double"', 5e-13),
        ("rotation_matrix", '"double"', 5e-13),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in [
                ("quaternion", '"single"', 2e-4),
                ("quaternion", '"double"', 5e-13),
                ("quaternion", '"extended"', 2e-16),
                ("rotation_matrix", '"extended"', 2e-16),
                ("euler_angles", '"extended"', 2e-16),
                ("quaternion", "50", 1e-18),
            ]
        ),
    ],
)
def test_free_fixed_and_driven_rotors_in_every_formulation(
    formulation: str, precision: str, within: float
) -> None:
    wheels = (FREE, DRIVEN, FIXED)
    integrator = f'precision = {precision}\nformulation = "{formulation}"'
    run = run_text(scene(*wheels, end=50, motors={1: MOTOR}, integrator=integrator))
    times = run.dataset["time"].values
    assert_followed(run.dataset, followed(MOMENTS, wheels, RATES, np.eye(3), times), within)
    rows = run.summary["invariants"]
    assert {name for name, row in rows.items() if not row["numerical"]} == {
        "angular_momentum", "angular_momentum_norm", "energy_balance",
    }  # fmt: skip
    assert all(row["largest_drift"] <= row["bound"] for row in rows.values())


def test_rates_alone_are_enough() -> None:
    text = scene(FREE, FIXED, end=50, integrator='formulation = "rates"')
    data = run_text(text, 'output.record=["angular_velocity", "rotor_rate"]').dataset
    rates, _, spins = followed(MOMENTS, (FREE, FIXED), RATES, np.eye(3), data["time"].values)
    np.testing.assert_allclose(data["angular_velocity"].values, rates.astype(float), rtol=0, atol=2e-13)
    np.testing.assert_allclose(data["rotor_rate"].values, spins.astype(float), rtol=0, atol=2e-13)


@pytest.mark.slow
def test_a_wheel_whose_momentum_dwarfs_the_bodys() -> None:
    announced, true = [], []
    for axis in ([1, 2, 3], [3, 1, -2], [1, -1, 2], [2, 3, 1], [-1, 3, 2]):
        wheel = Wheel(axis, 0.05, 3000)
        run = run_text(scene(wheel, end=20), estimate=True)
        truth = followed(MOMENTS, (wheel,), RATES, np.eye(3), run.dataset["time"].values)
        # over 1500 rad of nutation, by which rounded coefficients of h would make the rates drift by 2e-13
        assert_followed(run.dataset, truth, 1e-13)
        announced.append(run.summary["accuracy"]["estimated_attitude_error"])
        true.append(np.abs(matrices(run.dataset) - truth[1]).max())
    assert_announced(announced, true)


@pytest.mark.parametrize(
    "eccentricity", cases([0.2, 0.0], [0.2])
)  # on a circle the attitude is carried relative to it
def test_the_gradient_of_gravity_feels_the_whole_tensor(eccentricity: float) -> None:
    """On an orbit, against scipy: the rates by I_b, the torque by I."""
    load = (
        'kind = "gravity_gradient"\ngravitational_parameter = 1\n'
        f"orbit = {{semi_major_axis = 1, eccentricity = {eccentricity}, mean_anomaly = 0.3}}"
    )
    data = loaded(run_text(scene(FREE, FIXED, end=20, loads=load)))
    inertia = np.diag(MOMENTS).astype(float)
    a = np.array(FREE.axis) / np.linalg.norm(FREE.axis)
    turning = inertia - FREE.moment * np.outer(a, a)
    h = FREE.moment * (FREE.rate + a @ RATES) * a + FIXED.moment * FIXED.rate * np.array(FIXED.axis)

    def place(time: float) -> np.ndarray:
        mean, e = time + 0.3, eccentricity
        anomaly = mean
        for _ in range(50):
            anomaly -= (anomaly - e * np.sin(anomaly) - mean) / (1 - e * np.cos(anomaly))
        return np.array([np.cos(anomaly) - e, np.sqrt(1 - e * e) * np.sin(anomaly), 0.0])

    def slope(time: float, state: np.ndarray) -> np.ndarray:
        momentum, matrix = state[:3], state[3:].reshape(3, 3)
        w = np.linalg.solve(turning, momentum - h)
        seen = matrix.T @ place(time)
        torque = 3 / np.linalg.norm(seen) ** 5 * np.cross(seen, inertia @ seen)
        return np.concatenate([np.cross(momentum, w) + torque, (matrix @ np.cross(np.eye(3), w)).ravel()])

    start = np.concatenate([turning @ RATES + h, np.eye(3).ravel()])
    found = solve_ivp(slope, (0, 20), start, "DOP853", data["time"].values, rtol=1e-13, atol=1e-14).y.T
    # that scipy's own steps leave
    np.testing.assert_allclose(matrices(data).astype(float), found[:, 3:].reshape(-1, 3, 3), atol=5e-11)


@pytest.mark.slow
def test_rotors_in_a_body_whose_mass_moves() -> None:
    """Against scipy, in momentum and matrix: the tensor that turns is I(t) less what is on bearings."""
    body = 'principal_moments = ["1 + 0.05*sin(t)", 2, 2.5]'
    run = run_text(scene(FREE, FIXED, DRIVEN, end=20, motors={2: MOTOR}, body=body))
    data, rows = loaded(run), run.summary["invariants"]
    a, b = np.array(FREE.axis) / np.linalg.norm(FREE.axis), np.array([0.0, 0.0, 1.0])
    held = FREE.moment * (FREE.rate + a @ RATES) * a + FIXED.moment * FIXED.rate * np.array(FIXED.axis)

    def turning(time: float) -> np.ndarray:
        inertia = np.diag([1 + 0.05 * np.sin(time), 2, 2.5])
        return inertia - FREE.moment * np.outer(a, a) - DRIVEN.moment * np.outer(b, b)

    def slope(time: float, state: np.ndarray) -> np.ndarray:
        momentum, h, matrix = state[:3], state[3], state[4:].reshape(3, 3)
        w = np.linalg.solve(turning(time), momentum - held - h * b)
        motor = 0.05 * np.sin(time) - 0.1 * w[2] * matrix[0, 0]
        turned = (matrix @ np.cross(np.eye(3), w)).ravel()
        return np.concatenate([np.cross(momentum, w), [motor], turned])

    own = DRIVEN.moment * (DRIVEN.rate + RATES[2])
    start = np.concatenate([turning(0) @ RATES + held + own * b, [own], np.eye(3).ravel()])
    found = solve_ivp(slope, (0, 20), start, "DOP853", data["time"].values, rtol=1e-13, atol=1e-14).y.T
    # that scipy's own steps leave
    np.testing.assert_allclose(matrices(data).astype(float), found[:, 4:].reshape(-1, 3, 3), atol=1e-11)
    for name in ("angular_momentum", "energy_balance"):
        assert rows[name]["largest_drift"] <= rows[name]["bound"]


def test_a_rotor_along_the_axis_of_a_symmetric_body_nutates_as_in_closed_form() -> None:
    """w_x + i w_y turns at ((C_b - A) w_z + h) / A, and w_z stays; the tensor that turns has the axial moment
    C_b = C - J.
    """
    a, c, j, s, end = 2.0, 3.0, 0.5, 7.0, 100.0
    data = loaded(
        run_text(scene(Wheel([0, 0, 1], j, s), end=end, body=f"principal_moments = [{a}, {a}, {c}]"))
    )
    h = j * (s + RATES[2])
    phase = ((c - j - a) * RATES[2] + h) / a * data["time"].values
    across = (RATES[0] + 1j * RATES[1]) * np.exp(1j * phase)
    exact_ones = np.array([across.real, across.imag, np.full(len(phase), RATES[2])]).T
    np.testing.assert_allclose(data["angular_velocity"].values, exact_ones, rtol=0, atol=5e-13)
    np.testing.assert_allclose(data["rotor_rate"].values[:, 0], s, rtol=1e-13)
    axial = c * RATES[2] + j * s
    np.testing.assert_allclose(data["angular_momentum_axial"].values, axial, rtol=1e-13)


@pytest.mark.parametrize(("axis", "kept"), [([0, 0, 1], True), ([0, 0.1, 1], False)])
def test_a_heavy_gyrostat_keeps_what_lagranges_top_does(axis: list[float], kept: bool) -> None:
    body = "principal_moments = [2, 2, 1]\nmass = 1\ncenter_of_mass = [0, 0, 0.2]"
    wheel, load = Wheel(axis, 0.3, 5, fixed=True), 'kind = "uniform_gravity"'
    rows = run_text(scene(wheel, Wheel(axis, 0.1, 5), end=20, body=body, loads=load)).summary["invariants"]
    found = {name for name, row in rows.items() if not row["numerical"]}
    assert found - {"angular_momentum_axial"} == {"body_energy", "angular_momentum_vertical"}
    assert ("angular_momentum_axial" in found) == kept
    assert all(row["largest_drift"] <= row["bound"] for row in rows.values())


# --- limits and invariants ----------------------------------------------------------------------------------


@pytest.mark.parametrize("still", [Wheel([0, 1, 0], 0.1, 0, fixed=True), Wheel([1, 1, 0], 0, 5, fixed=True)])
def test_a_locked_rotor_is_part_of_the_body_bit_for_bit(still: Wheel) -> None:
    run = run_text(scene(still, end=20))
    alone = run_text(scene(end=20))
    same_bits(loaded(run).drop_vars(["rotor", "rotor_rate"]), alone)
    assert list(run.dataset["rotor"].values) == ["w0"]
    assert set(run.dataset["rotor_rate"].values.ravel()) == {float(still.rate)}


def test_a_free_gyrostat_keeps_energy_and_the_whole_momentum() -> None:
    run = run_text(scene(FREE, end=20))
    data, rows = loaded(run), run.summary["invariants"]
    assert {name for name, row in rows.items() if not row["numerical"]} == {
        "angular_momentum", "angular_momentum_norm", "energy",
    }  # fmt: skip
    w, s = data["angular_velocity"].values, data["rotor_rate"].values[:, 0]
    a = np.array(FREE.axis) / np.linalg.norm(FREE.axis)
    momentum = MOMENTS * w + FREE.moment * s[:, None] * a
    turned = Rotation.from_matrix(matrices(data).astype(float)).apply(momentum)
    np.testing.assert_allclose(data["angular_momentum"].values, turned, atol=1e-13)
    np.testing.assert_allclose(turned, np.tile(turned[0], (len(turned), 1)), atol=1e-13)
    energy = (MOMENTS * w**2).sum(axis=1) / 2 + FREE.moment * (s * (w @ a) + s**2 / 2)
    np.testing.assert_allclose(data["energy"].values, energy, rtol=1e-13)
    assert np.ptp((MOMENTS * w**2).sum(axis=1)) > 0.01  # which the body alone doesn't keep


def test_a_motor_that_keeps_a_rate_works_and_leaves_the_energy_of_the_locked_body() -> None:
    run = run_text(scene(FIXED, end=20))
    data, rows = loaded(run), run.summary["invariants"]
    assert {name for name, row in rows.items() if not row["numerical"]} == {
        "angular_momentum", "angular_momentum_norm", "body_energy",
    }  # fmt: skip
    w = data["angular_velocity"].values
    np.testing.assert_allclose(data["body_energy"].values, (MOMENTS * w**2).sum(axis=1) / 2, rtol=1e-14)
    whole = data["body_energy"].values + FIXED.moment * FIXED.rate * (w[:, 1] + FIXED.rate / 2)
    np.testing.assert_allclose(data["energy"].values, whole, rtol=1e-13)
    assert np.ptp(data["energy"].values) > 0.01


def test_energy_changes_by_the_work_of_the_motors() -> None:
    data = loaded(run_text(scene(FREE, DRIVEN, FIXED, end=20, samples=2001, motors={1: MOTOR})))
    w, s, t = data["angular_velocity"].values, data["rotor_rate"].values, data["time"].values
    motor = 0.05 * np.sin(t) - 0.1 * w[:, 2] * matrices(data)[:, 0, 0].astype(float)
    power = motor * s[:, 1]
    steps = np.diff(t)[0] * (power[1:] + power[:-1]) / 2
    work = np.concatenate([[0], np.cumsum(steps)]) + FIXED.moment * FIXED.rate * (w[:, 1] - w[0, 1])
    # the trapezoidal rule's own error, h^2 / 12 times the change of the power's slope
    np.testing.assert_allclose(data["work"].values, work, atol=2e-5)
    kept = data["energy"].values - data["work"].values
    np.testing.assert_allclose(kept, kept[0], rtol=1e-13)


def test_on_a_circle_jacobis_constant_includes_the_rotors() -> None:
    load = 'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {semi_major_axis = 1}'
    run = run_text(scene(FREE, FIXED, end=50, loads=load))
    rows = run.summary["invariants"]
    assert {"jacobi_constant", "energy_balance"} == {
        name for name, row in rows.items() if not row["numerical"]
    }
    assert all(row["largest_drift"] <= row["bound"] for row in rows.values())


def test_a_momentum_given_at_the_start_includes_the_rotors() -> None:
    run = run_text(scene(FREE, FIXED, end=1, initial="angular_momentum = [1, 2, 3]"))
    np.testing.assert_allclose(run.dataset["angular_momentum"].values[0], [1, 2, 3], rtol=1e-14)


# --- stability ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fixed", [True, False])
@pytest.mark.parametrize("excess", cases([-0.5, -0.05, 0.05, 0.5], [-0.05, 0.05]))
def test_a_wheel_along_the_intermediate_axis_steadies_a_spin_about_it(excess: float, fixed: bool) -> None:
    """From the linearised equations of moments A < B < C and a spin w2, with L2 = B w2 + J s,

        A w1' = (L2 - C w2) w3,    C w3' = (A w2 - L2) w1,

    so that it is stable if and only if J s > (C - B) w2, or J s < -(B - A) w2 (Hughes 1986, section 6.3).
    """
    a, b, c, w2, tilt = 1.0, 2.0, 2.5, 1.0, 1e-8
    momentum = (c - b) * w2 * (1 + excess)
    wheel = Wheel([0, 1, 0], 0.1, momentum / 0.1, fixed=fixed)
    body, initial = f"principal_moments = [{a}, {b}, {c}]", f"angular_velocity = [{tilt}, {w2}, 0]"
    data = loaded(run_text(scene(wheel, end=30, samples=61, body=body, initial=initial)))
    along = b * w2 + momentum
    squared = (along - c * w2) * (a * w2 - along) / (a * c)
    expected = tilt * np.cosh(np.sqrt(complex(squared)) * data["time"].values).real
    # what is quadratic in the tilt changes w2, and with it the exponent
    largest = np.abs(expected).max()
    np.testing.assert_allclose(data["angular_velocity"].values[:, 0], expected, atol=1e-4 * largest)
    assert (squared < 0) == (excess > 0)


def damped(
    inertia: list[float], spin: float, wheel: Wheel, tilt: float, end: float
) -> tuple[Any, float, float]:
    """A body that spins about z with a wheel along it and a ring damper along x, a rotor with friction.

    Returns the dataset, the real part of the nutation's eigenvalue by the linearised equations

        (A - Jd) w1' = (B n - L3) w2 - torque,    B w2' = L3 w1 - n ((A - Jd) w1 + h),    h' = torque,

    with torque = -c (h / Jd - w1), n = w3 and L3 = C n + J s; and the rate of the nutation as seen from the
    body, L3 / A - n.
    """
    a, b, c = inertia
    ring, friction = 0.02, 0.02
    text = scene(
        wheel, Wheel([1, 0, 0], ring), end=end, samples=401, motors={1: f"-{friction}*rate_w1"},
        body=f"principal_moments = {inertia}", initial=f"angular_velocity = [{tilt}, 0, {spin}]",
    )  # fmt: skip
    along = c * spin + float(wheel.moment) * float(wheel.rate)
    light = a - ring
    torque = np.array([friction, 0, -friction / ring])  # of w1, w2, h
    matrix = np.array(
        [
            (np.array([0, b * spin - along, 0]) - torque) / light,
            np.array([along - spin * light, 0, -spin]) / b,
            torque,
        ]
    )
    values = np.linalg.eigvals(matrix)
    return loaded(run_text(text)), float(values[np.argmax(np.abs(values.imag))].real), along / a - spin


@pytest.mark.parametrize("where", ["in the platform", "in the rotor", "in the rotor of a flat one"])
def test_a_dual_spin_satellite_is_stable_as_likins_found(where: str) -> None:
    """An energy sink damps the nutation where its rate, seen from the part with the sink, is positive, and
    amplifies it where it is negative: L3 / A - n (Likins, J. Spacecraft Rockets 4, 1638, 1967; by its numbers
    the sign is that of C_r / A - 1 for a sink in the rotor beside a platform at rest). A satellite as slender
    as this one is stable with its damper in the slow platform alone.
    """
    if where == "in the platform":  # which is the body; its rotor has half of the axial moment
        inertia, spin, wheel = [2.0, 2.0, 1.0], 0.02, Wheel([0, 0, 1], 0.5, 10)
    elif where == "in the rotor":  # which is the body, with a platform at rest in space
        inertia, spin, wheel = [2.0, 2.0, 1.0], 10.0, Wheel([0, 0, 1], 0.5, -10)
    else:
        inertia, spin, wheel = [0.7, 0.7, 1.0], 10.0, Wheel([0, 0, 1], 0.1, -10)
    tilt = 1e-5
    data, growth, nutation = damped(inertia, spin, wheel, tilt, end=40)
    assert (growth < 0) == (nutation > 0) == (where != "in the rotor")
    across = np.hypot(*(data["angular_velocity"].values[:, i] for i in (0, 1)))
    quiet = np.log(across[100:].reshape(-1, 43).max(axis=1))  # over whole nutations
    times = data["time"].values[100:].reshape(-1, 43).mean(axis=1)
    # to what a maximum over samples leaves of an oscillation that isn't quite circular
    np.testing.assert_allclose(np.polyfit(times, quiet, 1)[0], growth, rtol=0.02)


def test_a_slender_satellite_with_a_damper_ends_in_a_flat_spin_as_explorer_1_did() -> None:
    """The momentum stays, and the energy falls to the least that it allows, L^2 / 2 C about the axis of the
    largest moment C (Bracewell & Garriott, Nature 182, 760, 1958).
    """
    body, initial = "principal_moments = [2.0, 2.1, 0.4]", "angular_velocity = [0.05, 0, 5]"
    ring = Wheel([1, 0, 0], 0.05)
    text = scene(ring, end=2500, samples=101, motors={0: "-0.1*rate_w0"}, body=body, initial=initial)
    run = run_text(text)
    data, rows = loaded(run), run.summary["invariants"]
    momentum = np.linalg.norm([2.0 * 0.05, 0, 0.4 * 5])
    np.testing.assert_allclose(data["angular_momentum_norm"].values, momentum, rtol=1e-13)
    assert data["energy"].values[-1] == pytest.approx(momentum**2 / (2 * 2.1), rel=1e-12)
    np.testing.assert_allclose(
        np.abs(data["angular_velocity"].values[-1]), [0, momentum / 2.1, 0], rtol=0, atol=1e-9
    )
    assert np.all(np.diff(data["energy"].values) < 1e-14)
    assert rows["energy_balance"]["largest_drift"] <= rows["energy_balance"]["bound"]


def test_a_motor_that_saturates_switches_on_a_surface() -> None:
    """Against scipy, which stops where the law has its kinks."""
    limit, gain = 0.01, 0.05
    text = scene(Wheel([0, 0, 1], 0.3), end=60, motors={0: f"min(max(-{gain}*wx, -{limit}), {limit})"})
    data = loaded(run_text(text))
    turning = np.diag(MOMENTS) - 0.3 * np.diag([0, 0, 1])

    def slope(_: float, state: np.ndarray) -> np.ndarray:
        w, h = state[:3], np.array([0, 0, state[3]])
        motor = np.clip(-gain * w[0], -limit, limit)
        turned = np.cross(turning @ w + h, w) - np.array([0, 0, motor])
        return np.append(np.linalg.solve(turning, turned), motor)

    state, time, found = np.append(RATES, 0.3 * RATES[2]), 0.0, []
    kinks = [lambda t, y, k=k: gain * y[0] - k * limit for k in (-1, 1)]
    for kink in kinks:
        kink.terminal = True  # type: ignore[attr-defined]
    wanted = data["time"].values
    while time < wanted[-1]:
        part = solve_ivp(
            slope,
            (time, wanted[-1]),
            state,
            "DOP853",
            rtol=1e-13,
            atol=1e-14,
            events=kinks,
            dense_output=True,
        )
        inside = (wanted >= time) & (wanted <= part.t[-1])
        found += [(t, part.sol(t)) for t in wanted[inside]]
        state, time = part.y[:, -1], part.t[-1]
        if time < wanted[-1]:  # on past the kink
            more = solve_ivp(slope, (time, time + 1e-6), state, "DOP853", rtol=1e-13, atol=1e-14)
            state, time = more.y[:, -1], time + 1e-6
    there = dict(found)
    rates = np.array([there[t][:3] for t in wanted if t in there])
    assert len(rates) == len(wanted)
    # dense output of scipy
    np.testing.assert_allclose(data["angular_velocity"].values, rates, rtol=0, atol=1e-9)


def test_events_and_loads_read_the_rates_of_rotors() -> None:
    text = scene(
        FREE, DRIVEN, end=30, motors={1: MOTOR},
        loads='kind = "torque"\ncomponents = ["0.01*rate_w0", "0", "-0.01*rate_w1*qw*qx"]',
        more='[[events]]\nname = "slow"\nexpression = "rate_w1 + 3.9"\n',
    )  # fmt: skip
    data = run_text(text).dataset
    assert data.sizes["slow"] > 0
    np.testing.assert_allclose(data["slow_rotor_rate"].values[:, 1], -3.9, rtol=1e-12)


# --- whole workflows ----------------------------------------------------------------------------------------


def test_in_flight_it_turns_with_the_whole_tensor_pulling() -> None:
    """Energy and the whole angular momentum of a body that orbits a point, on one side of it."""
    flight = f"angular_velocity = {RATES}\nposition = [3, 0, 0]\nvelocity = [0, 0.6, 0.1]"
    load = 'kind = "central_gravity"\ngravitational_parameter = 1'
    body = f"principal_moments = {MOMENTS}\nmass = 2"
    rows = run_text(scene(FREE, end=20, body=body, initial=flight, loads=load)).summary["invariants"]
    assert {"energy", "total_angular_momentum"} <= set(rows)
    assert all(row["largest_drift"] <= row["bound"] for row in rows.values())


def test_it_is_told() -> None:
    made = rigidsim.plan(rigidsim.parse(scene(FREE, DRIVEN, FIXED, end=5, motors={1: MOTOR})))
    free, driven, fixed = made.loads
    assert re.match(r"rotor w0: 0.2 kg m\^2 about \(0.86.*free, 3 rad/s relative to the body", free)
    assert "about the body's z axis" in driven
    assert "driven by a motor of 0.05*sin(t)" in driven
    assert "kept at -2 rad/s" in fixed
    assert "momentum of rotor w1 about its axis, which its motor changes" in str(made.as_dict())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (["rotors[0].moment=3"], "more than the body's own about this axis, 1.2"),
        (["rotors[0].moment=1.05"], "principal moments .* which no body has"),
        (["rotors[0].moment=0"], "given 0; a positive moment is allowed"),
        (["rotors[0].moment=-1"], "given -1; a positive moment is allowed"),
        (["rotors[0].axis=[0, 0, 0]"], "a direction is needed"),
        (["rotors[0].fixed=true", 'rotors[0].torque="1"'], "given beside fixed = true"),
        (['rotors[0].torque="wq"'], "wq"),
        (['rotors[0].torque="1 kg"'], "N m"),
        (['rotors[0].torque="0.1*qx"'], r"\[\[rotors\]\] number 1: a driven rotor depends on the sign"),
        (['rotors[0].name="a b"'], "letters, digits and underscores"),
        (['rotors[0].rate="3 m"'], "rad/s"),
        (["rotors[0].spin=3"], "spin"),
        (['body={principal_moments = [0, 1, 1]}', "initial.angular_velocity=[0, 1, 0]"], "all three moments"),
        (['integrator.formulation="canonical"'], "rotor w0 carries angular momentum beside the body"),
        (['integrator.formulation="planar"'], "rotor w0 carries angular momentum beside the body"),
        (['model.level="spin_averaged"'], "rotor w0 carries angular momentum beside the body"),
        (['integrator.method="closed_form"'], "has no closed form"),
    ],
)  # fmt: skip
def test_nonsense_is_refused(changes: list[str], message: str) -> None:
    with pytest.raises(rigidsim.ConfigError, match=message):
        run_text(scene(FREE, end=5), *changes)


def test_names_are_different() -> None:
    text = scene(FREE, FIXED, end=5).replace('"w1"', '"w0"')
    with pytest.raises(rigidsim.ConfigError, match='two rotors are named "w0"'):
        rigidsim.parse(text)


def test_without_rotors_there_are_no_rates_of_them() -> None:
    with pytest.raises(rigidsim.ConfigError, match=r"there are no \[\[rotors\]\]"):
        run_text(scene(end=5), 'output.record=["rotor_rate"]')
