"""Gyrostats against equations of their own, closed forms, and what is known of their stability."""

from __future__ import annotations

from typing import Any

import heyoka as hy
import numpy as np
import pytest
from gyrostats import Wheel, exact, followed
from scipy.integrate import solve_ivp
from support import config, loaded, matrices, run_text, same_bits, wide

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


def assert_followed(data: Any, truth: tuple[np.ndarray, np.ndarray, np.ndarray], within: float) -> None:
    rates, attitudes, spins = truth
    assert np.abs(wide(data, "angular_velocity") - rates).max() <= within * np.abs(rates).max()
    if "quaternion" in data:
        assert np.abs(matrices(wide(data, "quaternion")) - attitudes).max() <= within
    assert np.abs(wide(data, "rotor_rate") - spins).max() <= within * max(1, float(np.abs(spins).max()))


# --- against equations of their own -------------------------------------------------------------------------


def assert_kept(run: rigidsim.Run, names: set[str]) -> None:
    """Exactly these invariants are listed, and all kept."""
    rows = run.summary["invariants"]
    assert {name for name, row in rows.items() if not row["numerical"]} == names
    assert all(row["largest_drift"] <= row["bound"] for row in rows.values())


def test_several_rotors_over_hundreds_of_radians() -> None:
    wheels = (FREE, FIXED, Wheel([0, 1, 1], 0.1, 1))
    data = run_text(scene(*wheels, end=300, integrator="hold_invariants = true")).dataset
    assert_followed(data, followed(MOMENTS, wheels, RATES, np.eye(3), data["time"].values), 1e-12)


@pytest.mark.parametrize(
    ("formulation", "precision", "within"),
    # rounding in some hundreds of steps, amplified a few times by the motion
    [
        ("quaternion", "quadruple", 1e-18),
        ("euler_angles", "double", 5e-13),
        ("rotation_matrix", "double", 5e-13),
        ("rates", "double", 5e-13),
    ],
)
def test_free_fixed_and_driven_rotors(formulation: str, precision: str, within: float) -> None:
    wheels, motors, record = (FREE, DRIVEN, FIXED), {1: MOTOR}, ""
    if formulation == "rates":  # which know no attitude that the motor could read
        wheels, motors, record = (FREE, FIXED), {}, 'record = ["angular_velocity", "rotor_rate"]'
    integrator = f'precision = "{precision}"\nformulation = "{formulation}"'
    run = run_text(scene(*wheels, end=50, motors=motors, integrator=integrator, output=record))
    times = run.dataset["time"].values
    assert_followed(run.dataset, followed(MOMENTS, wheels, RATES, np.eye(3), times), within)
    if not record:
        assert_kept(run, {"angular_momentum", "angular_momentum_norm", "energy_balance"})


@pytest.mark.slow
def test_a_wheel_whose_momentum_dwarfs_the_bodys() -> None:
    """Over 1500 rad of nutation, by which rounded coefficients of h would make the rates drift by 2e-13."""
    wheel = Wheel([1, 2, 3], 0.05, 3000)
    data = run_text(scene(wheel, end=20)).dataset
    assert_followed(data, followed(MOMENTS, (wheel,), RATES, np.eye(3), data["time"].values), 1e-13)


@pytest.mark.parametrize("source", ["orbit = {semi_major_axis = 1}", "position = [1, 0, 0]"])
def test_the_gradient_of_gravity_feels_the_whole_tensor(source: str) -> None:
    """Whether the attitude is carried in the frame of a circle or in space; the rates turn by I_b."""
    load = f'kind = "gravity_gradient"\ngravitational_parameter = 1\n{source}'
    run = run_text(scene(FREE, FIXED, end=20, loads=load))
    along = [hy.cos(hy.time), hy.sin(hy.time)] if "orbit" in source else [1.0, 0.0]

    def torque(t: Any, w: Any, r: Any) -> list[Any]:
        c = [r[0][k] * along[0] + r[1][k] * along[1] for k in range(3)]
        tensor = [exact(x) for x in MOMENTS]
        return [3.0 * c[j] * c[k] * (tensor[k] - tensor[j]) for j, k in ((1, 2), (2, 0), (0, 1))]

    truth = followed(MOMENTS, (FREE, FIXED), RATES, np.eye(3), run.dataset["time"].values, torque)
    assert_followed(run.dataset, truth, 5e-13)
    fixed = {"body_energy", "angular_momentum_source"}  # the energy of the body with its wheels locked
    assert_kept(run, {"jacobi_constant", "energy_balance"} if "orbit" in source else fixed)


def test_rotors_in_a_body_whose_mass_moves() -> None:
    """Against scipy, in momentum and matrix: the tensor that turns is I(t) less what is on bearings."""
    body = 'principal_moments = ["1 + 0.05*sin(t)", 2, 2.5]'
    run = run_text(scene(FREE, FIXED, DRIVEN, end=20, motors={2: MOTOR}, body=body))
    data = loaded(run)
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
    turned = matrices(data["quaternion"].values)
    np.testing.assert_allclose(turned, found[:, 4:].reshape(-1, 3, 3), atol=1e-11)
    rows = run.summary["invariants"]
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
    run = run_text(scene(wheel, Wheel(axis, 0.1, 5), end=20, body=body, loads=load))
    names = {"body_energy", "angular_momentum_vertical"}
    assert_kept(run, names | ({"angular_momentum_axial"} if kept else set()))


# --- limits and invariants ----------------------------------------------------------------------------------


def test_a_locked_rotor_is_part_of_the_body_bit_for_bit() -> None:
    run = run_text(scene(Wheel([0, 1, 0], 0.1, 0, fixed=True), end=20))
    same_bits(loaded(run).drop_vars(["rotor", "rotor_rate"]), run_text(scene(end=20)))
    assert list(run.dataset["rotor"].values) == ["w0"]
    assert not run.dataset["rotor_rate"].values.any()


def test_a_free_gyrostat_keeps_energy_and_the_whole_momentum() -> None:
    run = run_text(scene(FREE, end=20))
    data = loaded(run)
    assert_kept(run, {"angular_momentum", "angular_momentum_norm", "energy"})
    w, s = data["angular_velocity"].values, data["rotor_rate"].values[:, 0]
    a = np.array(FREE.axis) / np.linalg.norm(FREE.axis)
    momentum = MOMENTS * w + FREE.moment * s[:, None] * a
    turned = np.einsum("nij,nj->ni", matrices(data["quaternion"].values), momentum)
    np.testing.assert_allclose(data["angular_momentum"].values, turned, atol=1e-13)
    np.testing.assert_allclose(turned, np.tile(turned[0], (len(turned), 1)), atol=1e-13)
    energy = (MOMENTS * w**2).sum(axis=1) / 2 + FREE.moment * (s * (w @ a) + s**2 / 2)
    np.testing.assert_allclose(data["energy"].values, energy, rtol=1e-13)
    assert np.ptp((MOMENTS * w**2).sum(axis=1)) > 0.01  # which the body alone doesn't keep


def test_a_motor_that_keeps_a_rate_works_and_leaves_the_energy_of_the_locked_body() -> None:
    run = run_text(scene(FIXED, end=20))
    data = loaded(run)
    assert_kept(run, {"angular_momentum", "angular_momentum_norm", "body_energy"})
    w = data["angular_velocity"].values
    np.testing.assert_allclose(data["body_energy"].values, (MOMENTS * w**2).sum(axis=1) / 2, rtol=1e-14)
    whole = data["body_energy"].values + FIXED.moment * FIXED.rate * (w[:, 1] + FIXED.rate / 2)
    np.testing.assert_allclose(data["energy"].values, whole, rtol=1e-13)
    assert np.ptp(data["energy"].values) > 0.01


def test_energy_changes_by_the_work_of_the_motors() -> None:
    data = loaded(run_text(scene(FREE, DRIVEN, FIXED, end=20, samples=2001, motors={1: MOTOR})))
    w, s, t = data["angular_velocity"].values, data["rotor_rate"].values, data["time"].values
    motor = 0.05 * np.sin(t) - 0.1 * w[:, 2] * matrices(data["quaternion"].values)[:, 0, 0]
    power = motor * s[:, 1]
    steps = np.diff(t)[0] * (power[1:] + power[:-1]) / 2
    work = np.concatenate([[0], np.cumsum(steps)]) + FIXED.moment * FIXED.rate * (w[:, 1] - w[0, 1])
    # the trapezoidal rule's own error, h^2 / 12 times the change of the power's slope
    np.testing.assert_allclose(data["work"].values, work, atol=2e-5)
    kept = data["energy"].values - data["work"].values
    np.testing.assert_allclose(kept, kept[0], rtol=1e-13)


def test_a_momentum_given_at_the_start_includes_the_rotors() -> None:
    run = run_text(scene(FREE, FIXED, end=1, initial="angular_momentum = [1, 2, 3]"))
    np.testing.assert_allclose(run.dataset["angular_momentum"].values[0], [1, 2, 3], rtol=1e-14)


# --- stability ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fixed", [True, False])
@pytest.mark.parametrize("excess", [-0.05, 0.05])
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


def test_events_and_loads_read_the_rates_of_rotors() -> None:
    text = scene(
        FREE, DRIVEN, end=30, motors={1: MOTOR},
        loads='kind = "torque"\ncomponents = ["0.01*rate_w0", "0", "-0.01*rate_w1*qw*qx"]',
        more='[[events]]\nname = "slow"\nexpression = "rate_w1 + 3.9"\n',
    )  # fmt: skip
    data = run_text(text).dataset
    assert data.sizes["slow"] > 0
    np.testing.assert_allclose(data["slow_rotor_rate"].values[:, 1], -3.9, rtol=1e-12)


def test_in_flight_it_turns_with_the_whole_tensor_pulling() -> None:
    """Energy and the whole angular momentum of a body that orbits a point, on one side of it."""
    flight = f"angular_velocity = {RATES}\nposition = [3, 0, 0]\nvelocity = [0, 0.6, 0.1]"
    load = 'kind = "central_gravity"\ngravitational_parameter = 1'
    body = f"principal_moments = {MOMENTS}\nmass = 2"
    rows = run_text(scene(FREE, end=20, body=body, initial=flight, loads=load)).summary["invariants"]
    assert {"energy", "total_angular_momentum"} <= set(rows)
    assert all(row["largest_drift"] <= row["bound"] for row in rows.values())


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (["rotors[0].moment=3"], "more than the body's own about this axis, 1.2"),
        (["rotors[0].moment=1.05"], "principal moments .* which no body has"),
        (["rotors[0].moment=-1"], "given -1; a positive moment is allowed"),
        (["rotors[0].axis=[0, 0, 0]"], "a direction is needed"),
        (["rotors[0].fixed=true", 'rotors[0].torque="1"'], "given beside fixed = true"),
        (['rotors[0].torque="0.1*qx"'], r"\[\[rotors\]\] number 1: a driven rotor depends on the sign"),
        (['rotors[0].name="a b"'], "letters, digits and underscores"),
        (['rotors[1].name="w0"'], 'two rotors are named "w0"'),
        (["rotors=", 'output.record=["rotor_rate"]'], r"there are no \[\[rotors\]\]"),
        (['body={principal_moments = [0, 1, 1]}', "initial.angular_velocity=[0, 1, 0]"], "all three moments"),
        (['integrator.formulation="canonical"'], "rotor w0 carries angular momentum beside the body"),
        (['integrator.formulation="planar"'], "rotor w0 carries angular momentum beside the body"),
        (['model.level="spin_averaged"'], "rotor w0 carries angular momentum beside the body"),
        (['integrator.method="closed_form"'], "has no closed form"),
    ],
)  # fmt: skip
def test_nonsense_is_refused(changes: list[str], message: str) -> None:
    with pytest.raises(rigidsim.ConfigError, match=message):
        run_text(scene(FREE, FIXED, end=5), *changes)
