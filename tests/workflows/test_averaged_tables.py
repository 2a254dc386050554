"""Averages over orbits by a table: against the same orbit by its elements, and against every rotation."""

import math
from pathlib import Path

import numpy as np
import pytest
from support import cases, config, run_text

import rigidsim
from rigidsim.solve.problem import prepare

pytestmark = pytest.mark.unoptimised

FLATTENING, SPIN, ECCENTRICITY = 0.02, 60.0, 0.2
NODE, PERIAPSIS = 0.004, 0.006  # rad/s beside a mean motion of 1
BODY = f"principal_moments = [{1 - FLATTENING}, {1 - FLATTENING}, 1]"
START = f'angular_velocity = [0, 0, {SPIN}]\neuler_angles = [0.3, "35 deg", 0]'
LOAD = 'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {orbit}'
KEPLER = (
    f"{{semi_major_axis = 1, eccentricity = {ECCENTRICITY}, inclination = 0.2, ascending_node = 1, "
    f"periapsis = 0.5, mean_anomaly = 0.3, node_rate = {NODE}, periapsis_rate = {PERIAPSIS}}}"
)
RATE = 3 * FLATTENING / SPIN
RECORD = 'record = ["momentum_axis", "figure_axis", "obliquity", "node_longitude"]'


def table(*, anomaly: bool = True) -> str:
    """Rows every half turn or so; the whole turns follow from Kepler's third law."""
    lines = [
        "time, eccentricity, inclination, ascending_node, periapsis" + (", mean_anomaly" if anomaly else "")
    ]
    for t in np.arange(-12.0, 120.0, 4.0):
        cells = [t, ECCENTRICITY, 0.2, 1 + NODE * t, 0.5 + PERIAPSIS * t]
        cells += [(0.3 + t) % (2 * math.pi)] if anomaly else []
        lines.append(", ".join(repr(float(x)) for x in cells))
    return "\n".join(lines)


def text(level: str, *, by_table: bool, short_period: bool = True, anomaly: bool = True) -> str:
    orbit = '{table = "orbit.csv", semi_major_axis = 1}' if by_table else KEPLER
    if by_table and not anomaly:
        orbit = orbit[:-1] + ", mean_anomaly = 0.3}"
    model = f'[model]\nlevel = "{level}"\nshort_period = {str(short_period).lower()}\n'
    model += '[frame]\nreference = "orbit"\n'
    if by_table:
        model += f"[tables.\"orbit.csv\"]\ntext = '''\n{table(anomaly=anomaly)}\n'''"
    return config(BODY, START, LOAD.format(orbit=orbit), "end = 100\nsamples = 101", "", RECORD, model)


def apart(one: rigidsim.Run, other: rigidsim.Run, name: str = "momentum_axis") -> float:
    return float(np.linalg.norm(one.dataset[name].values - other.dataset[name].values, axis=1).max())


@pytest.fixture(scope="module")
def full() -> rigidsim.Run:
    return run_text(text("full", by_table=True))


@pytest.mark.slow
@pytest.mark.parametrize("level", cases(["spin_averaged", "orbit_averaged"], ["orbit_averaged"]))
def test_a_table_of_an_orbit_averages_as_the_orbit_does(level: str, full: rigidsim.Run) -> None:
    found = run_text(text(level, by_table=True), estimate=True)
    assert apart(found, full) <= found.summary["modelling"]["momentum_axis"]
    direct = run_text(text(level, by_table=False))
    prepared = prepare(rigidsim.parse(text(level, by_table=True)))
    (load,) = prepared.system.plan.loads
    error = load.table.error  # type: ignore[union-attr]
    path = RATE * (1 - ECCENTRICITY) ** -3 * 100  # of the momentum, at most
    # a torque errs by twice the direction's error and three times the distance's; all rows do better
    bound = path * (2 * error.direction + 3 * error.distance)
    assert bound < 1e-4  # it means something beside the path of 0.2 rad
    for name in ("momentum_axis", "figure_axis"):
        assert apart(found, direct, name) < bound
    for name in ("obliquity", "node_longitude"):
        difference = np.abs(found.dataset[name].values - direct.dataset[name].values).max()
        assert difference < 4 * (bound + error.direction)
    # and the model's own error is what it is for elements (tests/workflows/test_averaged_runs.py)
    nodding = RATE * (1 - ECCENTRICITY) ** -3
    assert apart(found, full) < 10 * path * (nodding**2 + nodding / SPIN + NODE * nodding) + bound


def test_columns_that_rest_are_constants() -> None:
    """A column of equal values changes no bit of what the same constant gives."""
    given = text("orbit_averaged", by_table=True, short_period=False, anomaly=False)
    lines = table(anomaly=False).splitlines()
    axes = "\n".join([lines[0] + ", semi_major_axis", *(f"{line}, 1.0" for line in lines[1:])])
    column = given.replace(table(anomaly=False), axes).replace("semi_major_axis = 1, ", "")
    states = prepare(rigidsim.parse(column)).system.states
    assert not [name for name in states if "axis" in name]
    one, other = (run_text(x).dataset.momentum_axis.values for x in (given, column))
    assert (one == other).all()


@pytest.mark.slow
def test_the_obliquity_of_mars_swings_as_published() -> None:
    """On its perturbed orbit, over half a million years: Ward 1973, Science 181, 260, says some 120,000 years
    for a swing, between 14.9 and 35.5 deg at most.
    """
    path = Path(__file__).parents[2] / "configs" / "tables" / "mars_obliquity.toml"
    short = ["time.end='500 kyr'", "output.timeline=false", "output.estimate=false"]
    data = rigidsim.run(rigidsim.load(path, overrides=short), out=None).dataset
    obliquity = np.degrees(data.obliquity.values[:, 0])
    assert obliquity[0] == pytest.approx(25.19, abs=0.005)  # of almanacs
    # his elements are of 1950 and linear; a degree is what Laskar & Robutel 1993 differ by over so long
    assert 14.9 - 1 < obliquity.min() < 18
    assert 33 < obliquity.max() < 35.5 + 1
    turns = np.flatnonzero(np.diff(np.sign(np.diff(obliquity))) < 0)
    assert np.diff(turns).mean() * 2 == pytest.approx(120, abs=6)  # thousands of years; 1.2e5 has two digits
