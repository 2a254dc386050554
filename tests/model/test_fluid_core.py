"""Bodies with a fluid core: by equations of their own and closed forms; in sessions and sweeps; refused."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from equations import CLOSE, Random, derivative, matrix
from support import config, matrices, run_text, same_bits, wide

import rigidsim
from rigidsim.solve.problem import prepare

MOMENTS, RATES = ["1", "1.2", "1.5"], ["0.1", "0.2", "1"]


@dataclass(frozen=True)
class Core:
    moment: Any
    flattening: Any = 0
    friction: Any = 0
    rate: Sequence[Any] | None = None


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


def physical(run: rigidsim.Run) -> set[str]:
    return {name for name, row in run.summary["invariants"].items() if not row["numerical"]}


# --- against equations of their own -------------------------------------------------------------------------


@pytest.mark.parametrize("axis", ["x", "z", "askew"])
def test_the_momenta_of_mantle_and_core_are_in_the_equations(axis: str) -> None:
    """M' = M x w + N of the whole; of a core about p h' = h x w - K (v - w) - A_c f (p . v) p x v."""
    body, whole = "principal_moments = [1, 1.2, 1.5]", np.diag([1, 1.2, 1.5])
    if axis == "x":
        body, whole = "principal_moments = [1.5, 1.2, 1]", np.diag([1.5, 1.2, 1])
    if axis == "askew":  # by an angle whose cosine and sine are 0.8 and 0.6
        whole = np.array([[1.18, 0, 0.24], [0, 1.2, 0], [0.24, 0, 1.32]])
        body = "inertia_tensor = [[1.18, 0, 0.24], [0, 1.2, 0], [0.24, 0, 1.32]]"
    load = 'kind = "gravity_gradient"\ngravitational_parameter = 0.05\nposition = [1, 0, 0]'
    system, random = prepare(rigidsim.parse(scene(1, body=body, loads=load))).system, Random(5)
    p = {"x": np.array([1, 0, 0]), "z": np.array([0, 0, 1]), "askew": np.array([0.6, 0, 0.8])}[axis]
    polar, f, friction = 0.3 * 1.5, 0.02, 0.01 * 1.5
    own = polar * (1 - f) * np.eye(3) + polar * f * np.outer(p, p)
    for _ in range(5):
        w, q, v = random.vector(), random.quaternion(), random.vector()
        names = ("wx", "wy", "wz", "qw", "qx", "qy", "qz", "core_wx", "core_wy", "core_wz")
        known = dict(zip(names, [*w, *q, *v], strict=True))
        state = np.array([known.get(name, 0.0) for name in system.states])
        found = dict(zip(system.states, derivative(system, state), strict=True))
        h, c = own @ v, matrix(q)[0]
        slipped = np.cross(h, w) - friction * (v - w) - polar * f * (p @ v) * np.cross(p, v)
        turned = np.cross((whole - own) @ w + h, w) + 0.15 * np.cross(c, whole @ c)
        expected = [*np.linalg.solve(whole - own, turned - slipped), *np.linalg.solve(own, slipped)]
        np.testing.assert_allclose([found[x] for x in (*names[:3], *names[7:])], expected, atol=20 * CLOSE)


# --- what is conserved --------------------------------------------------------------------------------------


def test_invariants_are_those_that_exist() -> None:
    momentum = {"angular_momentum", "angular_momentum_norm"}
    assert physical(run_text(scene(5, FREE))) == momentum | {"energy"}
    assert physical(run_text(scene(5))) == momentum | {"energy_balance"}


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
        ("moment = 0.1, flattening = 0.6", "", "[body] core.flattening: given 0.6; 0 to 0.5"),
        ("moment = 0.9", "", "which leaves the mantle moments"),
        ("moment = 0.1", 'integrator.formulation = "planar"', "carries angular momentum"),
        ("moment = 0.1", "body.center_of_mass = [0, 0, 1]", "turns about another point"),
    ],
)
def test_what_no_core_is_is_refused(core: str, more: str, said: str) -> None:
    initial = "" if "equilibrium" in more else "angular_velocity = [0, 0, 1]"
    body = f"principal_moments = [1, 1.2, 1.5]\ncore = {{{core}}}"
    text = config(body, initial, time="end = 1\nsamples = 2")
    with pytest.raises(rigidsim.ConfigError) as refused:
        run_text(text, *filter(None, [more]))
    assert said in str(refused.value)
