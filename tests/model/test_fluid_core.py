"""Bodies with a fluid core: by equations of their own and closed forms; in sessions and sweeps; refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cores import Core, followed
from gyrostats import exact
from scipy.integrate import solve_ivp
from support import EPSILON, config, law, run_estimated, run_text, same_bits, wide
from test_rotors import matrices

import rigidsim

MOMENTS, RATES = ["1", "1.2", "1.5"], ["0.1", "0.2", "1"]
CORE = Core("0.3", "0.02", "0.01", ["0.1", "-0.05", "0.9"])
FREE = Core("0.3", "0.02", rate=["0.1", "-0.05", "0.9"])


def written(core: Core) -> str:
    rate = "" if core.rate is None else f", angular_velocity = [{', '.join(core.rate)}]"
    return (
        f'core = {{moment = {core.moment}, flattening = {core.flattening}, friction = "{core.friction} s^-1"'
        f"{rate}}}"
    )


def scene(end: float, core: Core | None = CORE, samples: int = 21, **more: str) -> str:
    """A scene's text; ``more`` as for ``support.config``."""
    body = more.pop("body", f"principal_moments = [{', '.join(MOMENTS)}]")
    initial = more.pop("initial", f"angular_velocity = [{', '.join(RATES)}]")
    body = f"{body}\n{written(core)}" if core else body
    return config(body=body, initial=initial, time=f"end = {end}\nsamples = {samples}", **more)


def assert_sound(run: rigidsim.Run) -> None:
    rows = run.summary["invariants"]
    assert all(row["largest_drift"] <= row["bound"] for row in rows.values())


def physical(run: rigidsim.Run) -> set[str]:
    return {name for name, row in run.summary["invariants"].items() if not row["numerical"]}


# --- against equations of their own -------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.optimised  # as runs are: what isn't rounds more
@pytest.mark.parametrize("core", [CORE, FREE])
@pytest.mark.parametrize(("precision", "within"), [("double", 1e-12), ("extended", 1e-15)])
def test_a_thousand_radians(core: Core, precision: str, within: float) -> None:
    run = run_text(scene(1000, core, integrator=f'precision = "{precision}"'))
    data = run.dataset
    rates, attitudes, cores = followed(MOMENTS, core, RATES, data["time"].values)
    assert np.abs(wide(data, "angular_velocity") - rates).max() <= within
    assert np.abs(wide(data, "core_angular_velocity") - cores).max() <= within
    # a rate that isn't damped gathers rounding, and the angle with it: twice the law's standard deviation
    turned = 2 * law(EPSILON[precision], run.summary["cost"]["steps"], 1.03, 1000)
    assert np.abs(matrices(data) - attitudes).max() <= (within if core.friction else max(within, turned))
    assert_sound(run)


@pytest.mark.parametrize(
    ("precision", "formulation", "within"),
    # rounding in some hundreds of steps, amplified a few times by the motion
    [
        ('"single"', "quaternion", 2e-4), ('"double"', "quaternion", 5e-13),
        ('"double"', "rotation_matrix", 5e-13), ('"double"', "euler_angles", 5e-13),
        ('"quadruple"', "quaternion", 1e-18), ("50", "quaternion", 1e-18),
    ],
)  # fmt: skip
def test_every_precision_and_formulation(precision: str, formulation: str, within: float) -> None:
    integrator = f'precision = {precision}\nformulation = "{formulation}"'
    run = run_text(scene(50, integrator=integrator))
    rates, attitudes, cores = followed(MOMENTS, CORE, RATES, run.dataset["time"].values)
    assert np.abs(wide(run.dataset, "angular_velocity") - rates).max() <= within
    assert np.abs(wide(run.dataset, "core_angular_velocity") - cores).max() <= within
    assert np.abs(matrices(run.dataset) - attitudes).max() <= within
    assert_sound(run)


def test_rates_alone_are_enough() -> None:
    record = 'record = ["angular_velocity", "core_angular_velocity"]'
    data = run_text(scene(50, integrator='formulation = "rates"', output=record)).dataset
    rates, _, cores = followed(MOMENTS, CORE, RATES, data["time"].values)
    assert np.abs(wide(data, "angular_velocity") - rates).max() <= 5e-13
    assert np.abs(wide(data, "core_angular_velocity") - cores).max() <= 5e-13


def test_against_scipy() -> None:
    """Momenta of mantle and core apart, in double precision."""
    data = run_text(scene(20)).dataset
    whole = np.array([1, 1.2, 1.5])
    polar, f, friction = 0.45, 0.02, 0.015
    core = polar * np.array([1 - f, 1 - f, 1])
    mantle = whole - core

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        w, v = y[:3] / mantle, y[3:] / core
        torque = friction * (v - w) + polar * f * v[2] * np.cross([0, 0, 1], v)
        return np.concatenate([torque - np.cross(w, y[:3]), -torque - np.cross(w, y[3:])])

    start = np.concatenate([mantle * [0.1, 0.2, 1], core * [0.1, -0.05, 0.9]])
    found = solve_ivp(slope, (0, 20), start, "DOP853", data["time"].values, rtol=1e-13, atol=1e-15).y.T
    # DOP853's own error at this tolerance
    np.testing.assert_allclose(data["angular_velocity"], found[:, :3] / mantle, rtol=0, atol=1e-11)
    np.testing.assert_allclose(data["core_angular_velocity"], found[:, 3:] / core, rtol=0, atol=1e-11)


@pytest.mark.parametrize("tilted", [False, True])
def test_an_axis_that_isnt_z(tilted: bool) -> None:
    """The axis of largest moment is x, or none of the body axes."""
    if tilted:
        c, s = exact_cosines()
        tensor = [
            [1 * c * c + 1.5 * s * s, 0, 0.5 * c * s],
            [0, 1.2, 0],
            [0.5 * c * s, 0, s * s + 1.5 * c * c],
        ]
        axis = [s, 0, c]
        body = f"inertia_tensor = [[{', '.join(map(str, tensor[0]))}], [0, 1.2, 0], "
        body += f"[{', '.join(map(str, tensor[2]))}]]"
        inertia: Any = tensor
    else:
        body, inertia, axis = "principal_moments = [1.5, 1.2, 1]", ["1.5", "1.2", "1"], [1, 0, 0]
    run = run_text(scene(50, body=body))
    core = Core(CORE.moment, CORE.flattening, CORE.friction, CORE.rate, axis)
    rates, attitudes, cores = followed(inertia, core, RATES, run.dataset["time"].values)
    assert np.abs(wide(run.dataset, "angular_velocity") - rates).max() <= 5e-13
    assert np.abs(wide(run.dataset, "core_angular_velocity") - cores).max() <= 5e-13
    assert np.abs(matrices(run.dataset) - attitudes).max() <= 5e-13
    assert_sound(run)


def exact_cosines() -> tuple[Any, Any]:
    """cos and sin of an angle as exact decimals."""
    import mpmath

    return mpmath.mpf("0.8"), mpmath.mpf("0.6")


def test_gravity_acts_on_the_whole_tensor() -> None:
    load = 'kind = "gravity_gradient"\ngravitational_parameter = 0.05\nposition = [1, 0, 0]'
    run = run_text(scene(50, loads=load))

    def torque(t: Any, w: Any, r: Any) -> list[Any]:
        c, strength, tensor = r[0], exact("0.15"), [exact(x) for x in MOMENTS]
        return [strength * c[j] * c[k] * (tensor[k] - tensor[j]) for j, k in ((1, 2), (2, 0), (0, 1))]

    rates, attitudes, cores = followed(MOMENTS, CORE, RATES, run.dataset["time"].values, torque)
    assert np.abs(wide(run.dataset, "angular_velocity") - rates).max() <= 5e-13
    assert np.abs(wide(run.dataset, "core_angular_velocity") - cores).max() <= 5e-13
    assert np.abs(matrices(run.dataset) - attitudes).max() <= 5e-13
    assert "energy_balance" in run.summary["invariants"]
    assert_sound(run)


# --- what is conserved --------------------------------------------------------------------------------------


def test_invariants_are_those_that_exist() -> None:
    momentum = {"angular_momentum", "angular_momentum_norm"}
    assert physical(run_text(scene(5, FREE))) == momentum | {"energy"}
    assert physical(run_text(scene(5))) == momentum | {"energy_balance"}
    load = 'kind = "gravity_gradient"\ngravitational_parameter = 0.05\nposition = [1, 0, 0]'
    assert "energy" in physical(run_text(scene(5, FREE, loads=load)))


def test_friction_takes_what_the_work_says() -> None:
    data = run_text(scene(200, samples=4001)).dataset
    slip = (data["core_angular_velocity"] - data["angular_velocity"]).values
    power = -0.015 * (slip**2).sum(axis=1)
    taken = np.trapezoid(power, data["time"].values)
    np.testing.assert_allclose(data["work"][-1], taken, rtol=1e-4)  # of the trapezoidal rule
    np.testing.assert_allclose(data["energy"][-1] - data["energy"][0], data["work"][-1], rtol=1e-12)


def test_beside_a_rotor_and_in_flight_and_with_moving_mass() -> None:
    wheel = '[[rotors]]\nname = "wheel"\naxis = [3, 0, 4]\nmoment = 0.05\nrate = 5\n'
    beside = run_text(scene(20, FREE) + wheel)
    assert physical(beside) == {"angular_momentum", "angular_momentum_norm", "energy"}
    assert_sound(beside)
    flying = "position = [3, 0, 0]\nvelocity = [0, 0.6, 0]\nangular_velocity = [0.1, 0.2, 1]"
    load = 'kind = "central_gravity"\ngravitational_parameter = 1'
    body = "principal_moments = [1, 1.2, 1.5]\nmass = 10"
    flown = run_text(scene(20, FREE, body=body, loads=load, initial=flying))
    assert {"energy", "total_angular_momentum"} <= physical(flown)
    assert_sound(flown)
    moving = run_text(scene(20, body='principal_moments = ["1 + 0.1*sin(t)", "1.2", "1.5"]'))
    assert {"angular_momentum", "energy_balance"} <= physical(moving)
    assert_sound(moving)


def test_within_an_elastic_body() -> None:
    """Spin and delay distort the mantle: the momentum stays, and what friction and delay take is told."""
    body = "principal_moments = [8e37, 8.05e37, 8.1e37]\n"
    body += 'elasticity = {love_number = 0.3, radius = "6378 km", raised_by = []}'
    core = 'core = {moment = 0.1, flattening = 0.003, angular_velocity = ["1e-6 rad/s", 0, "7.29e-5 rad/s"]}'
    initial = 'angular_velocity = ["2e-6 rad/s", 0, "7.292115e-5 rad/s"]'
    text = config(f"{body}\n{core}", initial, time='end = "20 day"\nsamples = 21')
    free = run_text(text)
    assert physical(free) == {"angular_momentum", "angular_momentum_norm", "energy"}
    assert_sound(free)
    late = text.replace("0.003,", '0.003, friction = "1e-3 day^-1",').replace("[]", '[], delay = "20 min"')
    lossy = run_text(late)
    assert physical(lossy) == {"angular_momentum", "angular_momentum_norm", "energy_balance"}
    assert_sound(lossy)
    assert lossy.dataset["work"].values[-1] < 0


# --- closed forms -------------------------------------------------------------------------------------------


def modes(a: float, c: float, moment: float, f: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies over the spin, in body axes, of the two circular modes of a symmetric body with a core
    without friction, to first order in their amplitude, and the modes (wobble of mantle and core).

    With u and v the complex wobbles, A_m u' = i (C_m - A_m) u + i (C_c - A_c) v and
    v' = i (u - v) / (1 - f) (Poincare 1910; Sasao, Okubo & Saito 1980, for f to first order).
    """
    polar = moment * c
    equatorial = polar * (1 - f)
    mantle = a - equatorial
    matrix = [[(c - polar - mantle) / mantle, polar * f / mantle], [1 / (1 - f), -1 / (1 - f)]]
    values, vectors = np.linalg.eig(np.array(matrix))
    order = np.argsort(values)
    return values[order], vectors[:, order]


@pytest.mark.optimised
@pytest.mark.parametrize("which", [0, 1])
def test_the_free_core_nutation_and_the_wobble(which: int) -> None:
    """The retrograde, nearly diurnal mode, in space the free core nutation, and Chandler's."""
    a, c, moment, f = 0.9967, 1.0, 0.11, 0.0025
    values, vectors = modes(a, c, moment, f)
    frequency, (u, v) = values[which], vectors[:, which] / np.abs(vectors[:, which]).max() * 1e-7
    core = Core(str(moment), str(f), rate=[repr(float(v)), "0", "1"])
    body = f"principal_moments = [{a}, {a}, {c}]"
    initial = f"angular_velocity = [{float(u)!r}, 0, 1]"
    data = run_text(scene(1000, core, 1001, body=body, initial=initial)).dataset
    times = data["time"].values
    if which == 0:  # in space it takes (1 + ...) A / A_m f of a turn back for each of the body's
        assert frequency + 1 == pytest.approx(-(a / (a - moment * (1 - f))) * f, rel=5e-3)
    for name, size in (("angular_velocity", u), ("core_angular_velocity", v)):
        wobble = data[name].values[:, 0] + 1j * data[name].values[:, 1]
        turned = wobble / (size * np.exp(1j * frequency * times))
        assert np.abs(np.angle(turned)).max() <= 1e-9 * 1000  # of the phase, at a frequency of order one
        slope = np.polyfit(times, np.unwrap(np.angle(wobble)), 1)[0]
        assert slope == pytest.approx(frequency, rel=1e-9)


def test_a_spherical_core_in_a_spherical_mantle() -> None:
    """The difference of the rates keeps its direction in space, and decays with K (1/A_m + 1/A_c)."""
    core = Core("0.2", 0, "0.03", ["0.3", "-0.2", "0.5"])
    data = run_text(scene(60, core, body="principal_moments = [1, 1, 1]")).dataset
    slip = (wide(data, "core_angular_velocity") - wide(data, "angular_velocity"))[:, :, None]
    in_space = (matrices(data) @ slip)[:, :, 0]
    decay = np.exp(-np.longdouble("0.03") * (1 / np.longdouble("0.8") + 5) * data["time"].values)
    assert np.abs(in_space - in_space[0] * decay[:, None]).max() <= 1e-14


def test_differential_rotation_about_the_axis() -> None:
    """Whatever the flattening: K (1/C_m + 1/C_c)."""
    core = Core("0.3", "0.1", "0.02", ["0", "0", "2"])
    data = run_text(scene(60, core, initial="angular_velocity = [0, 0, 1]")).dataset
    slip = (data["core_angular_velocity"] - data["angular_velocity"]).values
    decay = np.exp(-0.03 * (1 / 1.05 + 1 / 0.45) * data["time"].values)
    assert np.abs(slip - decay[:, None] * [0, 0, 1]).max() <= 1e-14


@pytest.mark.optimised
def test_strong_friction_makes_the_body_rigid() -> None:
    """The core lags by A_c |w'| / K: ten times the friction, a tenth of the difference."""
    rigid = run_text(scene(10, None)).dataset["angular_velocity"].values
    apart = []
    for friction in ("1e2", "1e3", "1e4"):
        data = run_text(scene(10, Core("0.3", "0.02", friction))).dataset
        apart.append(np.abs(data["angular_velocity"].values - rigid).max())
    assert apart[0] < 1e-2
    np.testing.assert_allclose(np.array(apart[1:]) / apart[:-1], 0.1, rtol=0.02)


def test_stiff_friction_is_told_beforehand() -> None:
    warned = run_text(scene(0.01, Core("0.3", "0.02", "1e3"))).summary["warnings"]
    assert len(warned) == 1
    assert "steps are as short as that" in warned[0]
    assert not run_text(scene(0.01, CORE)).summary["warnings"]


def test_without_a_moment_the_body_is_rigid_bit_for_bit() -> None:
    same_bits(run_text(scene(20, None)), run_text(scene(20, Core(0, "0.02", "0.01"))))


def test_by_default_it_turns_with_the_body() -> None:
    given = Core("0.3", "0.02", "0.01", RATES)
    same_bits(run_text(scene(20, Core("0.3", "0.02", "0.01"))), run_text(scene(20, given)))
    start = "angular_momentum = [0.1, 0.24, 1.5]"
    begun = run_text(scene(1, Core("0.3", "0.02"), initial=start)).dataset.isel(time=0)
    np.testing.assert_allclose(begun["angular_velocity"], [0.1, 0.2, 1], rtol=1e-15)
    np.testing.assert_allclose(begun["angular_momentum"], [0.1, 0.24, 1.5], rtol=1e-15)


# --- what is refused ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("core", "more", "said"),
    [
        ("moment = 1", "", "[body] core.moment: given 1; a part of the body's own"),
        ("moment = -0.1", "", "[body] core.moment: given -0.1"),
        ("moment = 0.1, flattening = 0.6", "", "[body] core.flattening: given 0.6; a number from 0 to 0.5"),
        ("moment = 0.1, flattening = -0.1", "", "[body] core.flattening"),
        ('moment = 0.1, friction = "-1 s^-1"', "", "[body] core.friction: given -1 s^-1"),
        ('moment = 0.1, friction = "1 m"', "", "[body] core.friction"),
        ("moment = 0.9", "", "which leaves the mantle the moments"),
        ("flattening = 0.1", "", "core.moment"),
        ("moment = 0.1, radius = 3", "", "radius"),
        ("moment = 0.1, angular_velocity = [1, 2]", "", "exactly 3"),
        ("moment = 0.1", 'initial.equilibrium = "cassini_1"', "equilibria are found for rigid bodies"),
        ("moment = 0.1", 'integrator.formulation = "canonical"', "carries angular momentum beside the body"),
        ("moment = 0.1", 'integrator.formulation = "planar"', "carries angular momentum beside the body"),
        ("moment = 0.1", 'integrator.method = "closed_form"', "core"),
        ("moment = 0.1", 'model.level = "spin_averaged"', "carries angular momentum beside the body"),
        ("moment = 0.1", "body.center_of_mass = [0, 0, 1]", "turns about another point"),
        ("moment = 0.1, flattening = 0.1", "body.principal_moments = [1, 1, 1]", "moments are equal"),
    ],
)  # fmt: skip
def test_what_no_core_is_is_refused(core: str, more: str, said: str) -> None:
    initial = "" if "equilibrium" in more else "angular_velocity = [0, 0, 1]"
    body = f"principal_moments = [1, 1.2, 1.5]\ncore = {{{core}}}"
    text = config(body, initial, time="end = 1\nsamples = 2")
    with pytest.raises(rigidsim.ConfigError) as refused:
        run_text(text, *filter(None, [more]))
    assert said in str(refused.value)


def test_a_rate_of_a_core_that_isnt_there() -> None:
    with pytest.raises(rigidsim.ConfigError, match="give it one by \\[body\\] core"):
        run_text(scene(1, None, output='record = ["core_angular_velocity"]'))
    own = Core("0.1", rate=["0", "0", "1"])
    with pytest.raises(rigidsim.ConfigError, match="give angular_velocity here, too"):
        run_text(scene(1, own, initial="angular_momentum = [0, 0, 1]"))


# --- sessions and sweeps ------------------------------------------------------------------------------------


@pytest.mark.slow
def test_announced_errors_are_true() -> None:
    for seed in range(3):
        generator = np.random.default_rng(seed)
        rate = [f"{x:.6f}" for x in generator.normal([0, 0, 1], 0.2)]
        core = Core(f"{generator.uniform(0.05, 0.4):.4f}", f"{generator.uniform(0, 0.1):.4f}", "0.001", rate)
        run = run_estimated(scene(300, core))
        _, attitudes, _ = followed(MOMENTS, core, RATES, run.dataset["time"].values)
        turned = np.swapaxes(matrices(run.dataset), 1, 2) @ attitudes
        # sine of the angle: half the antisymmetric part
        parts = [turned[-1][i][j] - turned[-1][j][i] for i, j in ((0, 1), (1, 2), (2, 0))]
        wrong = float(np.sqrt(sum(x * x for x in parts))) / 2
        assert wrong <= 3 * run.summary["accuracy"]["estimated_attitude_error"]
