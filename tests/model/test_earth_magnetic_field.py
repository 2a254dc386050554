"""``field = "igrf"``: the Earth's magnetic field where a body flies, against another program."""

from decimal import Decimal

import numpy as np
import pytest
from equations import array, derivative, matrix
from support import cases

import rigidsim
from rigidsim import ConfigError
from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.epochs import parse_epoch
from rigidsim.scene.space_axes import earth_axes
from rigidsim.solve.problem import prepare

PPIGRF = {
    (6771.2, 30.0, 45.0, "2025-06-01"): [-44202.750395932795, -11751.033734422732, 2822.2445305695137],
    (6971.2, 100.5, -120.0, "2012-08-20"): [4138.3745336818265, -22286.563187077627, 4156.099118407208],
    (7371.2, 160.0, 200.25, "1993-03-03"): [37918.0460914933, -2907.3431177976577, 7125.178487871471],
    (6471.2, 2.5, 10.0, "2029-12-31"): [-53968.61511605684, -2557.838068725283, 962.1339365195618],
    (42164.0, 88.0, -75.0, "2020-01-01"): [-39.9651736872862, -97.93949674826855, -0.8232766441594168],
}
"""Radius (km), colatitude and longitude (deg) and date; B in nT, outwards, to the south and to the east:
``ppigrf.igrf_gc`` of ppigrf 2.1.0 with IGRF14.shc (all degrees), in double precision."""
SPHERE = "principal_moments = [1, 1, 1]\nmass = 4"
PLACE, VELOCITY = np.array([6900e3, 500e3, 100e3]), np.array([-300.0, 4000.0, 6400.0])


def text(
    load: str = "moment = [0, 0, 0.1]",
    *,
    place: np.ndarray = PLACE,
    body: str = SPHERE,
    axes: str = 'axes = "ICRF"',
    epoch: str = 'epoch = "2025-06-01 TT"',
    field: str = 'field = "igrf"',
    mu: float = 3.986004418e14,
    end: float = 600.0,
    start: str = "angular_velocity = [0.01, -0.02, 0.03]\nquaternion = [0.3, -0.5, 0.2, 0.75]",
    kind: str = "magnetic_dipole",
) -> str:
    return (
        f'name = "sat"\n[frame]\n{axes}\n[body]\n{body}\n[initial]\n{start}\nposition = {array(place)}\n'
        f'velocity = {array(VELOCITY)}\n[[loads]]\nkind = "central_gravity"\n'
        f"gravitational_parameter = {mu!r}\n"
        f'[[loads]]\nkind = "{kind}"\n{field}\n{load}\n[time]\n{epoch}\nend = {end!r}\nsamples = 11\n'
    )


def earth_fixed(date: str, axes: str = "ICRF", later: float = 0.0) -> np.ndarray:
    epoch = parse_epoch(date).after(Decimal(later))
    return np.array([[float(x) for x in row] for row in earth_axes(epoch, axes, context_for("double"))])


def sphere_axes(colatitude: float, longitude: float) -> np.ndarray:
    """Outwards, to the south and to the east, as rows."""
    (c, s), (k, f) = ((np.cos(x), np.sin(x)) for x in np.radians([colatitude, longitude]))
    return np.array([[s * k, s * f, c], [c * k, c * f, -s], [-f, k, 0]])


@pytest.mark.parametrize("case", cases(PPIGRF, list(PPIGRF)[:2]))
def test_it_is_that_of_another_program(case: tuple[float, float, float, str]) -> None:
    radius, colatitude, longitude, day = case
    axes = "ICRF" if radius < 7000 else "ecliptic J2000"
    local = sphere_axes(colatitude, longitude) @ earth_fixed(f"{day} TT", axes)
    place = radius * 1e3 * local[0]
    found = prepare(
        rigidsim.parse(text(place=place, axes=f'axes = "{axes}"', epoch=f'epoch = "{day} TT"', end=1.0))
    )
    load = found.scene.given_loads[1]
    field = np.array([float(x) for x in load.field.at_start(found.scene)])
    expected = np.array(PPIGRF[case])
    # rounding of a sum of 195 terms in the other program, in double
    assert np.abs(1e9 * local @ field - expected).max() <= 1e-12 * np.linalg.norm(expected)


@pytest.mark.parametrize("degree", cases([1, 13], [13]))
def test_its_expressions_turn_with_the_earth(degree: int) -> None:
    """The torque on a moment some time on, against the field worked out for the Earth's axes of that date."""
    moment, q, day = np.array([2e3, -1e3, 3e3]), np.array([0.3, -0.5, 0.2, 0.75]), "2025-06-01 TT"
    load = f"moment = {array(moment)}\nfield_degree = {degree}"
    system = prepare(rigidsim.parse(text(load))).system
    q = q / np.linalg.norm(q)
    state = np.concatenate([[0.01, -0.02, 0.03], q, PLACE, VELOCITY, [0.0]])
    for later in (0, 5000):
        date = parse_epoch(day).after(Decimal(later))
        there = prepare(rigidsim.parse(text(load, epoch=f'epoch = "{date}"'))).scene
        field = np.array([float(x) for x in there.given_loads[1].field.at_start(there)])
        torque = np.cross(moment, matrix(q).T @ field)
        found = derivative(system, state, later)[:3]
        # rounding, and 5000 s of precession with 80 nT a year of secular variation
        near = 1e-6 if later else 1e-13
        assert np.abs(found - torque).max() <= near * np.linalg.norm(moment) * np.linalg.norm(field)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"epoch": ""}, 'field: given "igrf", which turns with the Earth and takes [time] epoch; give epoch'),
        ({"epoch": 'epoch = "1969-07-20 TT"'}, "are for 1970 to 2030: a run within 1970 to 2029 is allowed"),
        ({"load": "moment = [0, 0, 1]\nfield_degree = 14"}, "field_degree: given 14"),
        ({"place": np.array([6900.0, 0, 0])}, "starts 6900 m from its centre, inside it"),
    ],
)
def test_nonsense_is_refused(keys: dict, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        prepare(rigidsim.parse(text(**{"load": "moment = [0, 0, 1]", **keys})))
    assert message in str(caught.value)
