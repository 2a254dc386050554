"""Bodies with a fluid core: by equations of their own and closed forms; in sessions and sweeps; refused."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
import pytest
from cores import Core, followed
from gyrostats import exact
from support import config, matrices, run_text, same_bits, wide

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


def assert_followed(run: rigidsim.Run, truth: tuple[np.ndarray, np.ndarray, np.ndarray], most: float) -> None:
    """Rates and attitudes of the mantle, and rates of the core."""
    data = run.dataset
    assert np.abs(wide(data, "angular_velocity") - truth[0]).max() <= most
    assert np.abs(wide(data, "core_angular_velocity") - truth[2]).max() <= most
    if "quaternion" in data:
        assert np.abs(matrices(wide(data, "quaternion")) - truth[1]).max() <= most
    assert_sound(run)


def physical(run: rigidsim.Run) -> set[str]:
    return {name for name, row in run.summary["invariants"].items() if not row["numerical"]}


# --- against equations of their own -------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("core", [CORE, FREE])
def test_a_thousand_radians(core: Core) -> None:
    run = run_text(scene(1000, core, integrator='precision = "extended"'))
    # a rate that isn't damped gathers rounding
    assert_followed(run, followed(MOMENTS, core, RATES, run.dataset["time"].values), 3e-15)


@pytest.mark.parametrize(
    ("precision", "formulation", "within"),
    # rounding in some hundreds of steps, amplified a few times by the motion
    [
        ("double", "rotation_matrix", 5e-13), ("double", "euler_angles", 5e-13), ("double", "rates", 5e-13),
        ("quadruple", "quaternion", 1e-18),
    ],
)  # fmt: skip
def test_motions_are_those_of_momenta(precision: str, formulation: str, within: float) -> None:
    integrator = f'precision = "{precision}"\nformulation = "{formulation}"'
    record = 'record = ["angular_velocity", "core_angular_velocity"]' if formulation == "rates" else ""
    run = run_text(scene(50, integrator=integrator, output=record))
    assert_followed(run, followed(MOMENTS, CORE, RATES, run.dataset["time"].values), within)


@pytest.mark.parametrize("tilted", [False, True])
def test_an_axis_that_isnt_z(tilted: bool) -> None:
    """The axis of largest moment is x, or none of the body axes."""
    body, inertia, axis = "principal_moments = [1.5, 1.2, 1]", ["1.5", "1.2", "1"], [1, 0, 0]
    if tilted:  # by an angle whose cosine and sine are 0.8 and 0.6
        c, s, zero = mpmath.mpf("0.8"), mpmath.mpf("0.6"), mpmath.mpf(0)
        inertia = [
            [c * c + 1.5 * s * s, zero, 0.5 * c * s], [zero, mpmath.mpf("1.2"), zero],
            [0.5 * c * s, zero, s * s + 1.5 * c * c],
        ]  # fmt: skip
        body, axis = "inertia_tensor = [[1.18, 0, 0.24], [0, 1.2, 0], [0.24, 0, 1.32]]", [s, 0, c]
    run = run_text(scene(50, body=body))
    core = Core(CORE.moment, CORE.flattening, CORE.friction, CORE.rate, axis)
    assert_followed(run, followed(inertia, core, RATES, run.dataset["time"].values), 5e-13)


def test_gravity_acts_on_the_whole_tensor() -> None:
    load = 'kind = "gravity_gradient"\ngravitational_parameter = 0.05\nposition = [1, 0, 0]'
    run = run_text(scene(50, loads=load))

    def torque(t: Any, w: Any, r: Any) -> list[Any]:
        c, strength, tensor = r[0], exact("0.15"), [exact(x) for x in MOMENTS]
        return [strength * c[j] * c[k] * (tensor[k] - tensor[j]) for j, k in ((1, 2), (2, 0), (0, 1))]

    assert_followed(run, followed(MOMENTS, CORE, RATES, run.dataset["time"].values, torque), 5e-13)
    assert "energy_balance" in physical(run)
    assert "energy" in physical(run_text(scene(5, FREE, loads=load)))


# --- what is conserved --------------------------------------------------------------------------------------


def test_invariants_are_those_that_exist() -> None:
    momentum = {"angular_momentum", "angular_momentum_norm"}
    assert physical(run_text(scene(5, FREE))) == momentum | {"energy"}
    assert physical(run_text(scene(5))) == momentum | {"energy_balance"}


def test_friction_takes_what_the_work_says() -> None:
    data = run_text(scene(200, samples=4001)).dataset
    slip = (data["core_angular_velocity"] - data["angular_velocity"]).values
    power = -0.015 * (slip**2).sum(axis=1)
    taken = np.trapezoid(power, data["time"].values)
    np.testing.assert_allclose(data["work"][-1], taken, rtol=1e-4)  # of the trapezoidal rule
    np.testing.assert_allclose(data["energy"][-1] - data["energy"][0], data["work"][-1], rtol=1e-12)


def test_beside_a_rotor_and_with_moving_mass() -> None:
    wheel = '[[rotors]]\nname = "wheel"\naxis = [3, 0, 4]\nmoment = 0.05\nrate = 5\n'
    beside = run_text(scene(20, FREE) + wheel)
    assert physical(beside) == {"angular_momentum", "angular_momentum_norm", "energy"}
    assert_sound(beside)
    moving = run_text(scene(20, body='principal_moments = ["1 + 0.1*sin(t)", "1.2", "1.5"]'))
    assert {"angular_momentum", "energy_balance"} <= physical(moving)
    assert_sound(moving)


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
    in_space = (matrices(wide(data, "quaternion")) @ slip)[:, :, 0]
    decay = np.exp(-np.longdouble("0.03") * (1 / np.longdouble("0.8") + 5) * data["time"].values)
    assert np.abs(in_space - in_space[0] * decay[:, None]).max() <= 1e-14


def test_differential_rotation_about_the_axis() -> None:
    """Whatever the flattening: K (1/C_m + 1/C_c)."""
    core = Core("0.3", "0.1", "0.02", ["0", "0", "2"])
    data = run_text(scene(60, core, initial="angular_velocity = [0, 0, 1]")).dataset
    slip = (data["core_angular_velocity"] - data["angular_velocity"]).values
    decay = np.exp(-0.03 * (1 / 1.05 + 1 / 0.45) * data["time"].values)
    assert np.abs(slip - decay[:, None] * [0, 0, 1]).max() <= 1e-14


def test_strong_friction_makes_the_body_rigid() -> None:
    """The core lags by A_c |w'| / K: ten times the friction, a tenth of the difference."""
    rigid = run_text(scene(10, None)).dataset["angular_velocity"].values
    apart = []
    for friction in ("1e2", "1e3"):
        data = run_text(scene(10, Core("0.3", "0.02", friction))).dataset
        apart.append(np.abs(data["angular_velocity"].values - rigid).max())
    assert apart[0] < 1e-2
    np.testing.assert_allclose(np.array(apart[1:]) / apart[:-1], 0.1, rtol=0.02)


def test_stiff_friction_is_warned_of() -> None:
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
        ("moment = 0.1, flattening = 0.6", "", "[body] core.flattening: given 0.6; a number from 0 to 0.5"),
        ('moment = 0.1, friction = "-1 s^-1"', "", "[body] core.friction: given -1 s^-1"),
        ("moment = 0.9", "", "which leaves the mantle the moments"),
        ("moment = 0.1", 'initial.equilibrium = "cassini_1"', "equilibria are found for rigid bodies"),
        ("moment = 0.1", 'integrator.formulation = "canonical"', "carries angular momentum beside the body"),
        ("moment = 0.1", 'integrator.formulation = "planar"', "carries angular momentum beside the body"),
        ("moment = 0.1", 'integrator.method = "closed_form"', "core"),
        ("moment = 0.1", 'model.level = "spin_averaged"', "carries angular momentum beside the body"),
        ("moment = 0.1", "body.center_of_mass = [0, 0, 1]", "turns about another point"),
        ("moment = 0.1, flattening = 0.1", "body.principal_moments = [1, 1, 1]", "moments are equal"),
        ("moment = 0.1, angular_velocity = [0, 0, 1]", "initial={angular_momentum = [0, 0, 1]}", "too"),
    ],
)  # fmt: skip
def test_what_no_core_is_is_refused(core: str, more: str, said: str) -> None:
    initial = "" if "equilibrium" in more else "angular_velocity = [0, 0, 1]"
    body = f"principal_moments = [1, 1.2, 1.5]\ncore = {{{core}}}"
    text = config(body, initial, time="end = 1\nsamples = 2")
    with pytest.raises(rigidsim.ConfigError) as refused:
        run_text(text, *filter(None, [more]))
    assert said in str(refused.value)
