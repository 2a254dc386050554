"""Invariants of loads that spare an axis or a direction: found where they hold, kept there, and nowhere else.

A good integration lets an invariant wander like a random walk of its steps' roundings: 50 eps sqrt(steps),
relative to the invariant's scale, leaves each step some tens of them (Brouwer 1937).
"""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from equations import matrix
from support import EPSILON, cases, config, run_text

import rigidsim
from rigidsim.solve.problem import prepare

ASYMMETRIC, SYMMETRIC, SPHERE = (
    f"principal_moments = {moments}\nmass = 1" for moments in ("[1, 1.75, 2]", "[1, 1, 1.5]", "[1, 1, 1]")
)
GENERAL = "inertia_tensor = [[2, 0.3, -0.2], [0.3, 1.5, 0.1], [-0.2, 0.1, 1.25]]\nmass = 1"
HANGING = "\ncenter_of_mass = [0.3, 0.1, 0.5]"
ON_AXIS = "\ncenter_of_mass = [0, 0, 0.5]"
TURNING = "angular_velocity = [0.3, 0.9, 0.4]\nquaternion = [0.7, 0.4, 0.5, 0.3]"
FLYING = TURNING + "\nposition = [1.5, 0.2, 0]\nvelocity = [-0.1, 0.85, 0.3]"
SMALL = "principal_moments = [0.01, 0.0175, 0.02]\nmass = 1"


def gradient(position: str, strength: float = 1) -> str:
    return f'kind = "gravity_gradient"\ngravitational_parameter = {strength}\nposition = {position}\n'


CIRCLE = "semi_major_axis = 1, inclination = '90 deg'"


def orbiting(orbit: str) -> str:
    return f'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {{{orbit}}}\n'


def several(*loads: str) -> str:
    return "\n[[loads]]\n".join(loads)


def dipole(moment: str, field: str) -> str:
    return f'kind = "magnetic_dipole"\nmoment = {moment}\nfield = {field}\n'


def applied(kind: str, components: str, more: str = 'frame = "space"') -> str:
    return f'kind = "{kind}"\ncomponents = {components}\n{more}\n'


def attractor(position: str) -> str:
    return f'kind = "central_gravity"\ngravitational_parameter = 1\nposition = {position}\n'


GRAVITY = 'kind = "uniform_gravity"\nacceleration = [0, 0.5, -2]\n'
DOWN = 'kind = "uniform_gravity"\nacceleration = [0, 0, -2]\n'
SOURCE = "[1, 0.5, 0.3]"
FREE = {"angular_momentum", "angular_momentum_norm"}
L = "angular_momentum_"

# body, start, loads, what is kept beside representations' own norms
SCENES: dict[str, tuple[str, str, str, set[str]]] = {
    "source, general axes": (GENERAL, TURNING, gradient(SOURCE), {"energy", L + "source", "brun_constant"}),
    "sources in two directions": (
        GENERAL, TURNING, several(gradient(SOURCE), gradient("[0, -1, 0.6]", 2)),
        {"energy", "brun_constant", "bogoyavlensky_constant"},
    ),
    "two equal sources at right angles": (
        GENERAL, TURNING, several(gradient("[1, 0, 0]"), gradient("[0, 1, 0]")),
        {"energy", L + "source", "brun_constant", "bogoyavlensky_constant"},
    ),
    "source and weight": (ASYMMETRIC + HANGING, TURNING, several(GRAVITY, gradient(SOURCE)), {"energy"}),
    "sphere and source": (
        SPHERE, TURNING, gradient(SOURCE), FREE | {"energy"},
    ),
    "dipole": (ASYMMETRIC, TURNING, dipole("[1, 2, 3]", SOURCE), {"energy", L + "field"}),
    "dipole on the axis": (
        SYMMETRIC, TURNING, dipole("[0, 0, 3]", SOURCE), {"energy", L + "field", L + "axial"},
    ),
    "dipole towards the centre of mass": (
        ASYMMETRIC + HANGING, TURNING, several(GRAVITY, dipole("[0.6, 0.2, 1]", SOURCE)),
        {"energy", L + "field"},
    ),
    "source along a dipole's field": (
        ASYMMETRIC, TURNING, several(gradient("[0, 2, 0]"), dipole("[1, 2, 3]", "[0, 1, 0]")),
        {"energy", L + "source"},
    ),
    "torque along an axis": (
        ASYMMETRIC, TURNING, applied("torque", '[0, "sin(t)", 0]'), {"energy_balance", L + "x", L + "z"},
    ),
    "force on a point": (
        ASYMMETRIC, TURNING, applied("force", '[0, 0, "sin(t)"]', "point = [1, 2, 3]"),
        {"energy_balance", L + "z"},
    ),
    "constant force on a point": (
        ASYMMETRIC, TURNING, applied("force", "[1, 2, 3]", "point = [1, 2, 3]"),
        {"energy_balance", L + "field"},
    ),
    "damping in proportion to the moments": (
        ASYMMETRIC, TURNING, 'kind = "viscous_torque"\ncoefficients = [0.1, 0.175, 0.2]',
        {"energy_balance", L + "across"},
    ),
    "two sources on circles of one plane and period": (
        ASYMMETRIC, TURNING, several(orbiting(CIRCLE), orbiting(CIRCLE + ", mean_anomaly = 2")),
        {"jacobi_constant", "energy_balance"},
    ),
    "circular orbit and a field along its normal": (
        ASYMMETRIC, TURNING, several(orbiting(CIRCLE), dipole("[1, 2, 3]", "[0, 0.7, 0]")),
        {"jacobi_constant", "energy_balance"},
    ),
    "circular orbit of a body in free fall": (
        ASYMMETRIC, FLYING, several(orbiting(CIRCLE), DOWN),
        {"jacobi_constant", "linear_momentum_horizontal", "energy_balance"},
    ),
    "two attracting points": (
        SMALL, FLYING, several(attractor("[0, 0, 0]"), attractor("[0.2, -0.4, 0.4]")),
        {"energy", "total_angular_momentum_axial"},
    ),
    "two attracting points in one place": (
        SMALL, FLYING, several(attractor("[0, 0, 0]"), attractor("[0, 0, 0]")),
        {"energy", "total_angular_momentum"},
    ),
    "three attracting points": (
        SMALL, FLYING, several(*(attractor(p) for p in ("[0, 0, 0]", "[0, -1, 0]", "[-1, 0, 1]"))),
        {"energy"},
    ),
    "attracting point in a uniform field": (
        SMALL, FLYING, several(GRAVITY, attractor("[0.1, 0, 0]")), {"energy", "total_angular_momentum_axial"},
    ),
    "attracting point and a dipole": (
        SMALL, FLYING, several(GRAVITY, attractor("[0.1, 0, 0]"), dipole("[1, 2, 3]", "[0.01, 0, 0]")),
        {"energy"},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", cases(SCENES, list(SCENES)[::3]))
def test_they_are_found_where_they_hold_and_kept(name: str) -> None:
    body, start, loads, expected = SCENES[name]
    text = config(body, start, loads, "end = 10\nsamples = 41")
    found = prepare(rigidsim.parse(text)).system.invariants
    assert {i.name for i in found if not i.numerical} == expected
    run = run_text(text, "output.timeline=false")
    bound = 50 * EPSILON["double"] * math.sqrt(run.summary["cost"]["steps"])
    for invariant in expected:
        assert run.summary["invariants"][invariant]["largest_drift"] <= bound, invariant
        if invariant != L + "across":  # zeros, recorded when named
            assert run.dataset[invariant].attrs["invariant"] == 1


def test_their_values_are_those_of_their_formulas() -> None:
    """Brun's and Bogoyavlensky's constants and momenta along axes, in numpy."""
    body, start, loads, _ = SCENES["two equal sources at right angles"]
    run = run_text(config(body, start, loads, "end = 3\nsamples = 7"), "output.timeline=false")
    inertia = np.array([[2, 0.3, -0.2], [0.3, 1.5, 0.1], [-0.2, 0.1, 1.25]])
    adjugate, s = np.linalg.det(inertia) * np.linalg.inv(inertia), np.diag([3.0, 3.0, 0.0])
    for row in range(7):
        sample = run.dataset.isel(time=row)
        attitude, momentum = matrix(sample["quaternion"].values), sample["angular_momentum"].values
        seen = attitude.T @ s @ attitude
        brun = momentum @ momentum - np.trace(adjugate @ seen)
        other = momentum @ s @ momentum - 6 * momentum @ momentum + np.trace(adjugate @ seen @ seen)
        assert float(sample["brun_constant"]) == pytest.approx(brun, rel=1e-13)
        assert float(sample["bogoyavlensky_constant"]) == pytest.approx(other, rel=1e-13)
        assert abs(float(sample["angular_momentum_source"])) == pytest.approx(abs(momentum[2]), rel=1e-13)


def test_bruns_constant_holds_to_quadruple_precision() -> None:
    """The sign of the second term, and det(I) I^-1, to 30 digits; in the issue's form for one source."""
    text = config(GENERAL, TURNING, gradient(SOURCE), "end = 2\nsamples = 3", 'precision = "quadruple"')
    run = run_text(text, "output.timeline=false")
    steps = run.summary["cost"]["steps"]
    for name in ("brun_constant", "angular_momentum_source"):
        assert run.summary["invariants"][name]["largest_drift"] <= 50 * 2.0**-112 * math.sqrt(steps)
    with mpmath.workdps(40):
        inertia = mpmath.matrix([["2", "0.3", "-0.2"], ["0.3", "1.5", "0.1"], ["-0.2", "0.1", "1.25"]])
        q = mpmath.matrix(["0.7", "0.4", "0.5", "0.3"])
        w, x, y, z = q / mpmath.norm(q)
        turned = mpmath.matrix(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        place = mpmath.matrix(["1", "0.5", "0.3"])
        distance = mpmath.norm(place)
        c = turned.T * place / distance
        momentum = inertia * mpmath.matrix(["0.3", "0.9", "0.4"])
        along = (c.T * mpmath.inverse(inertia) * c)[0] * mpmath.det(inertia)
        expected = mpmath.norm(momentum) ** 2 - 3 * along / distance**3
        first = run.dataset.isel(time=0)
        found = mpmath.fsum(float(first[f"brun_constant{part}"]) for part in ("_lo2", "_lo", ""))
        assert abs(found - expected) < mpmath.mpf(10) ** -32
