"""Moments that vary, mass that leaves: by equations of their own, closed forms; and where they end."""

import numpy as np
import pytest
from equations import CLOSE, Random, derivative, matrix
from support import EPSILON, cases, config, matrices, run_text, same_bits, wide

import rigidsim
from rigidsim.solve.problem import prepare

TABLES = """
[parameters]
k = 0.1
[[states]]
name = "m"
unit = "kg m^2"
derivative = "0.05*cos(t/3) - 0.1*m"
"""
MOMENTS = 'principal_moments = ["1 + k*sin(t)", 2, "2.5 - m/3"]'


def scene(end: float, body: str = MOMENTS, samples: int = 21, **more: str) -> str:
    """A scene's text; ``more`` as for ``support.config``."""
    initial = more.pop("initial", "angular_velocity = [0.1, 0.2, 1]")
    return config(body=body, initial=initial, time=f"end = {end}\nsamples = {samples}", **more)


def assert_sound(run: rigidsim.Run) -> None:
    rows = run.summary["invariants"]
    assert all(row["largest_drift"] <= row["bound"] for row in rows.values())


# --- against equations of their own -------------------------------------------------------------------------


def test_moments_that_vary_and_mass_that_leaves_are_in_the_equations() -> None:
    """I w' = (I w) x w + N - I' w - mu G w, with an exit off the axes and no axis of symmetry."""
    source = 'kind = "gravity_gradient"\ngravitational_parameter = 0.05\nposition = [1, 0, 0]'
    jet = 'kind = "mass_loss"\nrate = "0.02*(1 + sin(t))"\nexit_point = [0.5, -1, 1.5]'
    text = scene(5, loads=[source, jet]) + TABLES
    system, random, arm, time = prepare(rigidsim.parse(text)).system, Random(6), np.array([0.5, -1, 1.5]), 2.3
    for _ in range(5):
        w, q, m = random.vector(), random.quaternion(), random.vector()[0]
        known = dict(zip(("wx", "wy", "wz", "qw", "qx", "qy", "qz", "m"), [*w, *q, m], strict=True))
        state = np.array([known.get(name, 0.0) for name in system.states])
        found = dict(zip(system.states, derivative(system, state, time), strict=True))
        grown = 0.05 * np.cos(time / 3) - 0.1 * m
        inertia = np.array([1 + 0.1 * np.sin(time), 2, 2.5 - m / 3])
        change = np.array([0.1 * np.cos(time), 0, -grown / 3])
        c, lost = matrix(q)[0], 0.02 * (1 + np.sin(time)) * (arm @ arm * w - arm * (arm @ w))
        torque = 0.15 * np.cross(c, inertia * c) - change * w - lost
        expected = [*((np.cross(inertia * w, w) + torque) / inertia), grown]
        np.testing.assert_allclose([found[x] for x in ("wx", "wy", "wz", "m")], expected, atol=20 * CLOSE)


# --- closed forms -------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.unoptimised
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
    turned = matrices(wide(data, "quaternion")) - matrices(wide(constant, "quaternion"))
    assert np.abs(turned).max() <= 1e-14


ROCKET = 'principal_moments = ["400 - 3*burnt", "400 - 3*burnt", "60 - 0.4*burnt"]'
JET = 'kind = "mass_loss"\nrate = "0.5"\nexit_point = [0, 0, -2.5]\nexit_radius = 0.4'


@pytest.mark.parametrize(
    ("precision", "within"), [("double", 1e-12), pytest.param("extended", 1e-15, marks=pytest.mark.slow)]
)
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


# --- what stays as it was -----------------------------------------------------------------------------------


def test_constant_expressions_are_the_constant_body_bit_for_bit() -> None:
    plain = run_text(scene(20, "principal_moments = [1, 2, 2.5]"))
    body = 'principal_moments = ["2*half", "2", "2.5 kg m^2"]'
    same_bits(plain, run_text(scene(20, body) + "[parameters]\nhalf = 0.5\n"))


# --- where no body can go on --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "time", "said"),
    [
        ('[1, 2, "2.5 + t/8"]', 4, "the moment about z exceeds the sum of the other two"),
        ('["2 - t", 2, 2]', 2, "the moment about x falls below"),
        pytest.param(
            '[2, 2, "3 + wave"]',
            float(2 * np.arcsinh(0.5)),
            "the moment about z exceeds",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_run_ends_where_moments_become_impossible(body: str, time: float, said: str) -> None:
    text = scene(10, f"principal_moments = {body}", 2001)
    text += '[[states]]\nname = "wave"\nunit = "kg m^2"\nderivative = "cosh(t/2)"\n'
    run = run_text(text)
    assert run.status == "stopped: impossible body"
    assert said in run.summary["message"]
    # what a moment has to be above zero is 1e-9 of the sum, and what may be beyond the sum 2^-40
    assert float(run.dataset["time"][-1]) <= run.summary["time_reached"] == pytest.approx(time, abs=1e-8)
    assert_sound(run)


# --- what is refused ----------------------------------------------------------------------------------------

VARYING = '"1 + 0.1*sin(t)"'


@pytest.mark.parametrize(
    ("moments", "more", "said"),
    [
        (f"[{VARYING}, 2, 4]", "", "the largest is more than the sum of the other two"),
        ('["-1 - t", 2, 2]', "", "can't be negative"),
        ('["1 + 0.1*wx", 2, 2]', "", "reads wx; moments may read t, [[states]] and [parameters]"),
        ('["1 + 0.5*step(t - 1)", 2, 2]', "", "jumps, and mass takes time to move"),
        (f"[{VARYING}, 2, 2]", '[integrator]\nformulation = "canonical"', "principal_moments vary"),
    ],
)
def test_what_no_body_has_is_refused(moments: str, more: str, said: str) -> None:
    text = f'name = "refused"\nbody = {{principal_moments = {moments}}}\n'
    text += "initial = {angular_velocity = [0, 0, 1]}\ntime = {end = 1, samples = 2}\n"
    with pytest.raises(rigidsim.ConfigError) as refused:
        rigidsim.run(rigidsim.parse(text + more))
    assert said in str(refused.value)


# --- kinks, axes and angles ---------------------------------------------------------------------------------


@pytest.mark.parametrize("precision", cases(["double", "extended"], ["double"]))
def test_moments_with_kinks_in_closed_form(precision: str) -> None:
    """About a principal axis w = L / I(t): kinks of a moment itself, and of the state that it reads, which
    grows from t = 3 to 8 alone, by 1/5 a second, and is held at 0.9.
    """
    for moment, more in (
        ("2.5 + 0.2*abs(sin(t))", ""),
        ("2.5 + min(drawn, 0.9)/4", '[[states]]\nname = "drawn"\nderivative = "pulse(t, 3, 8)/5"\n'),
    ):
        body, how = f'principal_moments = [1.5, 2, "{moment}"]', f'precision = "{precision}"'
        run = run_text(scene(20, body, 41, initial="angular_velocity = [0, 0, 1]", integrator=how) + more)
        t = run.dataset["time"].values.astype(np.longdouble)
        fifth = np.longdouble(1) / 5
        drawn = np.minimum(np.clip(t - 3, 0, 5) * fifth, 4.5 * fifth)
        exact_one = 2.5 + (drawn / 4 if more else fifth * np.abs(np.sin(t)))
        found = wide(run.dataset, "angular_velocity")[:, 2] * exact_one / 2.5
        assert np.abs(found - 1).max() <= 200 * EPSILON[precision]
        assert_sound(run)


def turn(angle: np.ndarray, axis: int) -> np.ndarray:
    """Matrices (n, 3, 3) that turn vectors by angles about an axis."""
    half = np.zeros((len(angle), 4))
    half[:, 0], half[:, 1 + axis] = np.cos(angle / 2), np.sin(angle / 2)
    return matrices(half)


@pytest.mark.slow
def test_axes_and_angles_of_a_body_that_changes() -> None:
    """Each by its definition, with the moments of the time: the largest at the start is the second later."""
    asked = ["andoyer_momenta", "andoyer_angles", "nutation_angle", "wobble_angle", "polar_motion"]
    record = f"record = {[*asked, 'quaternion', 'angular_velocity', 'principal_moments']}"
    data = run_text(
        scene(
            40, 'principal_moments = [1, "2 + 0.9*sin(t/20)^2", "2.5 - t/60"]', 81, output=record,
            initial="angular_velocity = [0.1, 0.2, 1]\neuler_angles = [0.3, 0.8, 0.4]",
        )
    ).dataset  # fmt: skip
    moments, rates = data["principal_moments"].values, data["angular_velocity"].values
    attitudes = matrices(data["quaternion"].values)
    assert (moments[:, 1] > moments[:, 2]).any()
    body = moments * rates
    size = np.linalg.norm(body, axis=1)
    space = np.einsum("nij,nj->ni", attitudes, body)
    named = data["andoyer_momenta"].values
    np.testing.assert_allclose(named, np.stack([body[:, 2], size, space[:, 2]], axis=1), atol=1e-13)
    around, g, h = data["andoyer_angles"].values.T
    tilt, wobble = (np.arccos(named[:, n] / size) for n in (2, 0))
    built = turn(h, 2) @ turn(tilt, 0) @ turn(g, 2) @ turn(wobble, 0) @ turn(around, 2)
    np.testing.assert_allclose(built, attitudes, atol=1e-12)
    away = np.arctan2(np.hypot(body[:, 0], body[:, 1]), body[:, 2])
    np.testing.assert_allclose(data["nutation_angle"].values, away, atol=1e-13)
    np.testing.assert_allclose(data["wobble_angle"].values, away, atol=1e-13)  # of the axis at the start
    off = np.hypot(rates[:, 0], rates[:, 1]) > np.abs(rates[:, 2])
    assert off.any()
    pole = np.where(off[:, None], np.nan, rates[:, :2] / rates[:, 2:])
    np.testing.assert_allclose(data["polar_motion"].values, pole, atol=1e-13)
