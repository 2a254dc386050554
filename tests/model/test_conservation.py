"""What loads keep: exactly the invariants that hold are listed, and kept in double and in 80-bit arithmetic.

A good integration lets an invariant wander like a random walk of its steps' roundings: 50 eps sqrt(steps),
relative to the invariant's scale, leaves each step some tens of them (Brouwer 1937).
"""

import math

import numpy as np
import pytest
from support import EPSILON, cases, config, matrices, run_text

ASYMMETRIC, SYMMETRIC, SPHERE, HEAVY_TOP = (
    f"principal_moments = {moments}\nmass = 1"
    for moments in ("[1, 1.75, 2]", "[1, 1, 1.5]", "[1, 1, 1]", "[2, 2, 1]")
)
GENERAL = "inertia_tensor = [[2, 0.3, -0.2], [0.3, 1.5, 0.1], [-0.2, 0.1, 1.25]]\nmass = 1"
SMALL = "principal_moments = [0.01, 0.0175, 0.02]\nmass = 1"
HANGING, ON_AXIS = "\ncenter_of_mass = [0.3, 0.1, 0.5]", "\ncenter_of_mass = [0, 0, 0.5]"
TURNING = "angular_velocity = [0.3, 0.9, 0.4]\nquaternion = [0.7, 0.4, 0.5, 0.3]"
FLYING = TURNING + "\nposition = [1.5, 0.2, 0]\nvelocity = [-0.1, 0.85, 0.3]"
CIRCLE = "semi_major_axis = 1, inclination = '90 deg'"
GRAVITY = 'kind = "uniform_gravity"\nacceleration = [0, 0.5, -2]\n'
DOWN = 'kind = "uniform_gravity"\nacceleration = [0, 0, -2]\n'
VISCOUS = 'kind = "viscous_torque"\ncoefficients = [0.1, 0.2, 0.3]\n'
SOURCE = "[1, 0.5, 0.3]"
L = "angular_momentum_"
FREE = {"angular_momentum", L + "norm"}


def gradient(position: str, strength: float = 1) -> str:
    return f'kind = "gravity_gradient"\ngravitational_parameter = {strength}\nposition = {position}\n'


def orbiting(orbit: str) -> str:
    return f'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {{{orbit}}}\n'


def several(*loads: str) -> str:
    return "\n[[loads]]\n".join(loads)


def dipole(moment: str, field: str) -> str:
    return f'kind = "magnetic_dipole"\nmoment = {moment}\nfield = {field}\n'


def applied(kind: str, components: str, more: str = 'frame = "space"') -> str:
    return f'kind = "{kind}"\ncomponents = {components}\n{more}\n'


def attractor(position: str = "[0, 0, 0]") -> str:
    return f'kind = "central_gravity"\ngravitational_parameter = 1\nposition = {position}\n'


# body, start, loads, what is kept beside representations' own norms
SCENES: dict[str, tuple[str, str, str, set[str]]] = {
    "circular orbit": (ASYMMETRIC, TURNING, orbiting(CIRCLE), {"jacobi_constant"}),
    "circular orbit in the plane of reference, moving node": (
        ASYMMETRIC,
        TURNING,
        orbiting("semi_major_axis = 1, node_rate = -0.25"),
        {"jacobi_constant"},
    ),
    "symmetric body on a circular orbit": (
        SYMMETRIC,
        TURNING,
        orbiting(CIRCLE),
        {"jacobi_constant", L + "axial"},
    ),
    "eccentric orbit": (ASYMMETRIC, TURNING, orbiting(CIRCLE + ", eccentricity = 0.1"), {"energy_balance"}),
    "circular orbit and damping": (
        ASYMMETRIC,
        TURNING,
        several(orbiting(CIRCLE), VISCOUS),
        {"energy_balance"},
    ),
    "circular orbit and a field along its normal": (
        ASYMMETRIC,
        TURNING,
        several(orbiting(CIRCLE), dipole("[1, 2, 3]", "[0, 0.7, 0]")),
        {"jacobi_constant", "energy_balance"},
    ),
    "source, general axes": (GENERAL, TURNING, gradient(SOURCE), {"energy", L + "source", "brun_constant"}),
    "two equal sources at right angles": (
        GENERAL,
        TURNING,
        several(gradient("[1, 0, 0]"), gradient("[0, 1, 0]")),
        {"energy", L + "source", "brun_constant", "bogoyavlensky_constant"},
    ),
    "sphere and source": (SPHERE, TURNING, gradient(SOURCE), FREE | {"energy"}),
    "dipole": (ASYMMETRIC, TURNING, dipole("[1, 2, 3]", SOURCE), {"energy", L + "field"}),
    "source along a dipole's field": (
        ASYMMETRIC,
        TURNING,
        several(gradient("[0, 2, 0]"), dipole("[1, 2, 3]", "[0, 1, 0]")),
        {"energy", L + "source"},
    ),
    "torque along an axis": (
        ASYMMETRIC,
        TURNING,
        applied("torque", '[0, "sin(t)", 0]'),
        {"energy_balance", L + "x", L + "z"},
    ),
    "force on a point": (
        ASYMMETRIC,
        TURNING,
        applied("force", '[0, 0, "sin(t)"]', "point = [1, 2, 3]"),
        {"energy_balance", L + "z"},
    ),
    "damping in proportion to the moments": (
        ASYMMETRIC,
        TURNING,
        'kind = "viscous_torque"\ncoefficients = [0.1, 0.175, 0.2]',
        {"energy_balance", L + "across"},
    ),
    "heavy body about a fixed point": (ASYMMETRIC + HANGING, TURNING, GRAVITY, {"energy", L + "vertical"}),
    "heavy symmetric top": (SYMMETRIC + ON_AXIS, TURNING, DOWN, {"energy", L + "vertical", L + "axial"}),
    "Kovalevskaya's top": (
        HEAVY_TOP + "\ncenter_of_mass = [1, 0, 0]",
        TURNING,
        GRAVITY,
        {"energy", L + "vertical", "kovalevskaya_constant"},
    ),
    "Goryachev's and Chaplygin's top": (
        "principal_moments = [4, 4, 1]\nmass = 1\ncenter_of_mass = [1, 0, 0]",
        "angular_momentum = [1.5, 0, 0]\nquaternion = [0.7, 0.4, 0.5, 0.3]",
        'kind = "uniform_gravity"\nacceleration = [0, 0, -1]',
        {"energy", L + "vertical", "goryachev_chaplygin_constant"},
    ),
    "free flight in uniform gravity": (
        ASYMMETRIC,
        FLYING,
        GRAVITY,
        FREE | {"energy", "rotational_energy", "linear_momentum_horizontal"},
    ),
    "attracting point": (SMALL, FLYING, attractor(), {"energy", "total_angular_momentum"}),
    "two attracting points": (
        SMALL,
        FLYING,
        several(attractor(), attractor("[0.2, -0.4, 0.4]")),
        {"energy", "total_angular_momentum_axial"},
    ),
    "attracting point in a uniform field": (
        SMALL,
        FLYING,
        several(GRAVITY, attractor("[0.1, 0, 0]")),
        {"energy", "total_angular_momentum_axial"},
    ),
}


TRIED = [(name, "double") for name in SCENES]
TRIED += [(name, "extended") for name in ("circular orbit", "heavy symmetric top", "attracting point")]


@pytest.mark.parametrize("case", cases(TRIED, TRIED[:-3:4] + TRIED[-1:], daily=5), ids="-".join)
def test_they_are_found_where_they_hold_and_kept(case: tuple[str, str]) -> None:
    name, precision = case
    body, start, loads, expected = SCENES[name]
    text = config(body, start, loads, "end = 10\nsamples = 41", f'precision = "{precision}"')
    run = run_text(text)
    rows = run.summary["invariants"]
    assert {name for name, row in rows.items() if not row["numerical"]} == expected
    bound = 50 * EPSILON[precision] * math.sqrt(run.summary["cost"]["steps"])
    for invariant in expected:
        assert rows[invariant]["largest_drift"] <= bound, invariant
        if invariant != L + "across":  # zeros, recorded when named
            assert run.dataset[invariant].attrs["invariant"] == 1
            assert rows[invariant]["final_drift"] == float(run.dataset[f"{invariant}_drift"][-1])
    assert any(rows[invariant]["largest_drift"] > 0 for invariant in expected)


def test_their_values_are_those_of_their_formulas() -> None:
    """Brun's and Bogoyavlensky's constants, a momentum along an axis, and Jacobi's constant, in numpy."""
    body, start, loads, _ = SCENES["two equal sources at right angles"]
    run = run_text(config(body, start, loads, "end = 3\nsamples = 7"))
    inertia = np.array([[2, 0.3, -0.2], [0.3, 1.5, 0.1], [-0.2, 0.1, 1.25]])
    adjugate, s = np.linalg.det(inertia) * np.linalg.inv(inertia), np.diag([3.0, 3.0, 0.0])
    for row in range(7):
        sample = run.dataset.isel(time=row)
        attitude, momentum = matrices(sample["quaternion"].values), sample["angular_momentum"].values
        seen = attitude.T @ s @ attitude
        brun = momentum @ momentum - np.trace(adjugate @ seen)
        other = momentum @ s @ momentum - 6 * momentum @ momentum + np.trace(adjugate @ seen @ seen)
        assert float(sample["brun_constant"]) == pytest.approx(brun, rel=1e-13)
        assert float(sample["bogoyavlensky_constant"]) == pytest.approx(other, rel=1e-13)
        assert abs(float(sample["angular_momentum_source"])) == pytest.approx(abs(momentum[2]), rel=1e-13)
    body, start, _, _ = SCENES["circular orbit"]
    data = run_text(config(body, start, orbiting("semi_major_axis = 1"), "end = 3\nsamples = 7")).dataset
    time, w = data["time"].values, data["angular_velocity"].values
    towards = np.stack([np.cos(time), np.sin(time), 0 * time], axis=1)
    seen = np.einsum("nij,ni->nj", matrices(data["quaternion"].values), towards)
    moments = np.array([1, 1.75, 2])
    jacobi = (w**2 @ moments) / 2 - data["angular_momentum"].values[:, 2] + 1.5 * seen**2 @ moments
    found = data["jacobi_constant"].values
    np.testing.assert_allclose(found - found[0], jacobi - jacobi[0], rtol=0, atol=1e-13)
    assert abs(np.ptp(found - jacobi)) < 1e-13
