"""Gyrostats against equations of their own, closed forms, and what is known of their stability."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from equations import CLOSE, Random, derivative, matrix
from scipy.integrate import solve_ivp
from support import config, loaded, matrices, run_text, same_bits, seeds

import rigidsim
from rigidsim.model.loads import Load
from rigidsim.solve.problem import prepare

MOMENTS, RATES = [1, 2, 2.5], [0.3, 1.0, 0.5]


@dataclass(frozen=True)
class Wheel:
    axis: Sequence[float]
    moment: float
    rate: float = 0
    fixed: bool = False

    @property
    def unit(self) -> np.ndarray:
        return np.array(self.axis) / np.linalg.norm(self.axis)


FREE = Wheel([1, 0.5, -0.3], 0.2, 3)
FIXED = Wheel([0, 1, 0], 0.1, -2, fixed=True)
DRIVEN = Wheel([0, 0, 1], 0.3, -4)
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


# --- against equations of their own -------------------------------------------------------------------------


def assert_kept(run: rigidsim.Run, names: set[str]) -> None:
    """Exactly these invariants are listed, and all kept."""
    rows = run.summary["invariants"]
    assert {name for name, row in rows.items() if not row["numerical"]} == names
    assert all(row["largest_drift"] <= row["bound"] for row in rows.values())


@pytest.mark.parametrize("more", ["", "a source", "moving mass"])
def test_free_fixed_and_driven_rotors_are_in_the_equations(more: str) -> None:
    """With the whole momentum M in body axes M' = M x w + N, h' = torque, w = I_b^-1 (M - sum of h a), I_b
    the tensor without what is on bearings; the gradient of gravity feels the whole one.
    """
    wheels, moment_of_x = (FREE, DRIVEN, FIXED), '"1 + 0.05*sin(t)"' if more == "moving mass" else "1"
    load = 'kind = "gravity_gradient"\ngravitational_parameter = 0.5\nposition = [1, 0, 0]'
    body, loads = f"principal_moments = [{moment_of_x}, 2, 2.5]", load if more == "a source" else ""
    text = scene(*wheels, end=5, motors={1: MOTOR}, body=body, loads=loads)
    system, random, time = prepare(rigidsim.parse(text)).system, Random(4), 1.7
    free, driven, fixed = (wheel.unit for wheel in wheels)
    for _ in range(5):
        w, q, h = random.vector(), random.quaternion(), random.vector()[0]
        known = dict(zip(("wx", "wy", "wz", "qw", "qx", "qy", "qz"), [*w, *q], strict=True))
        state = np.array([(known | {"momentum_w1": h}).get(name, 0.0) for name in system.states])
        found = dict(zip(system.states, derivative(system, state, time), strict=True))
        inertia, change = np.diag([1.0, 2, 2.5]), np.zeros(3)
        if more == "moving mass":
            inertia[0, 0], change[0] = 1 + 0.05 * np.sin(time), 0.05 * np.cos(time) * w[0]
        turning = inertia - 0.2 * np.outer(free, free) - 0.3 * np.outer(driven, driven)
        momentum = turning @ w + 0.2 * (3 + free @ RATES) * free + h * driven + 0.1 * -2 * fixed
        c = matrix(q)[0]
        torque = 1.5 * np.cross(c, inertia @ c) if more == "a source" else np.zeros(3)
        motor = 0.05 * np.sin(time) - 0.1 * w[2] * matrix(q)[0, 0]
        expected = np.linalg.solve(turning, np.cross(momentum, w) + torque - motor * driven - change)
        assert found["momentum_w1"] == pytest.approx(motor, abs=CLOSE)
        np.testing.assert_allclose([found[x] for x in ("wx", "wy", "wz")], expected, atol=20 * CLOSE)


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


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (["rotors[0].moment=3"], "more than the body's moment about this axis, 1.2"),
        (["rotors[0].moment=1.05"], "principal moments .* which no body has"),
        (["rotors[0].axis=[0, 0, 0]"], "a direction is needed"),
        (["rotors[0].fixed=true", 'rotors[0].torque="1"'], "given with fixed = true"),
        (['rotors[0].torque="0.1*qx"'], r"\[\[rotors\]\] number 1 torque: rotor w0 depends"),
        (['integrator.formulation="canonical"'], "rotor w0 carries angular momentum"),
        (['integrator.method="closed_form"'], "has no closed form"),
    ],
)
def test_nonsense_is_refused(changes: list[str], message: str) -> None:
    with pytest.raises(rigidsim.ConfigError, match=message):
        run_text(scene(FREE, FIXED, end=5), *changes)


@pytest.mark.parametrize("seed", seeds(1, 30))
def test_a_control_moment_gyro_exchanges_momentum_with_the_body(seed: int) -> None:
    """Against DOP853; the momentum in space stays, and the energy is the work of the gimbal."""
    rng = np.random.default_rng(seed)
    axis, other = rng.normal(size=(2, 3))
    axis, gimbal = axis / np.linalg.norm(axis), np.cross(axis, other)
    start, rate, w = rng.uniform(-3, 3), rng.uniform(5, 20), rng.normal(size=3) * 0.3
    text = config(
        f"principal_moments = {MOMENTS}", f"angular_velocity = {w.tolist()}", time="end = 10\nsamples = 11",
        more=f'[[rotors]]\nname = "g"\naxis = {(3 * axis).tolist()}\nmoment = 0.1\nrate = {rate}\n'
        f"fixed = true\ngimbal = {gimbal.tolist()}\ngimbal_angle = {start}\n"
        'gimbal_rate = "0.2*sin(t) - wy*cos(gimbal_g)"\n',
    )  # fmt: skip
    run = run_text(text)
    assert_kept(run, {"angular_momentum", "angular_momentum_norm", "energy_balance"})
    gimbal /= np.linalg.norm(gimbal)

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        turned, moving = y[3], 0.2 * np.sin(t) - y[1] * np.cos(y[3])
        along = np.cos(turned) * axis + np.sin(turned) * np.cross(gimbal, axis)
        torque = np.cross(MOMENTS * y[:3] + 0.1 * rate * along, y[:3])
        return np.append((torque - 0.1 * rate * moving * np.cross(gimbal, along)) / MOMENTS, moving)

    data = loaded(run)
    known = solve_ivp(slope, [0, 10], [*w, start], "DOP853", data.time.values, rtol=1e-12, atol=1e-13).y
    np.testing.assert_allclose(data.angular_velocity.values.T, known[:3], rtol=0, atol=1e-10)
    np.testing.assert_allclose(data.gimbal_g.values, known[3], rtol=0, atol=1e-10)


def test_a_start_by_angular_momentum_counts_a_turned_gimbal() -> None:
    wheel = '[[rotors]]\nname = "g"\naxis = [0, 0, 1]\nmoment = 0.1\nrate = 9\nfixed = true\n'
    wheel += 'gimbal = [1, 0, 0]\ngimbal_angle = 1.2\ngimbal_rate = "0.1"\n'
    output = 'record = ["angular_momentum"]'
    run = run_text(config(initial="angular_momentum = [1, 2, 3]", output=output, more=wheel))
    np.testing.assert_allclose(loaded(run).angular_momentum[0], [1, 2, 3], rtol=1e-15)


def test_a_gimbal_that_is_none_is_refused() -> None:
    wheel = '[[rotors]]\nname = "g"\naxis = [0, 0, 1]\nmoment = 0.1\nrate = 9\ngimbal_rate = "1"\n'
    for more, said in (
        ("gimbal = [1, 0, 0]", "fixed: missing; a rotor on a gimbal needs fixed = true"),
        ("fixed = true\ngimbal = [1, 0, 1]", "whose cosine with the rotor's is 0.707; 0 is allowed"),
        ("fixed = true", "missing gimbal"),
    ):
        with pytest.raises(rigidsim.ConfigError, match=said):
            run_text(config(more=wheel + more + "\n"))


def test_a_carrier_from_python_with_a_tensor_apart_is_a_free_rotor() -> None:
    class Own(Load):
        title, conservative, apart = "wheel", True, [[0, 0, 0], [0, 0, 0], [0, 0, 0.2]]

        def carried_momentum(self, m: Any) -> Any:
            return [([0, 0, 0.2 * (3 + RATES[2])], 1.0)]

        def exerted_torque(self, m: Any) -> Any:
            return []

        def carried_energy(self, m: Any) -> Any:
            return None

        def supplied_power(self, m: Any) -> Any:
            return None

        def carried_at_start(self, scene: Any) -> Any:
            zero = scene.context.zero
            return [zero, zero, scene.context.mpf(0.2 * (3 + RATES[2]))], zero

        def amplitude(self, scene: Any) -> Any:
            return scene.context.zero

    free = run_text(scene(Wheel([0, 0, 1], 0.2, 3), end=9))
    given = rigidsim.parse(scene(end=9))
    found = rigidsim.run(given, out=None, loads=[Own()]).dataset.angular_velocity
    np.testing.assert_allclose(found, loaded(free).angular_velocity, rtol=0, atol=1e-13)
