"""A spin driven by a table of an orbit, held against the same orbit given directly."""

import math
from pathlib import Path

import numpy as np
import pytest
import xarray
from support import config, law, run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.solve.problem import prepare

pytestmark = pytest.mark.unoptimised

AU, SUN, DAY = 149597870700.0, 1.32712440018e20, 86400.0
MOTION = math.sqrt(SUN / AU**3)
NODE, PERIAPSIS = 1.5e-8, 6e-8  # rad/s: the periapsis turns by 12 degrees in 40 days
KEPLER = (
    '{semi_major_axis = "1 au", eccentricity = 0.1, inclination = "20 deg", ascending_node = 0.7, '
    f"periapsis = 1.2, mean_anomaly = 0.3, node_rate = {NODE!r}, periapsis_rate = {PERIAPSIS!r}}}"
)
PLANET = config(
    "principal_moments = [0.95, 0.96, 1]",
    'angular_velocity = [0, 0, "300 deg/day"]\neuler_angles = [0, "25 deg", 0]',
    'kind = "gravity_gradient"\ngravitational_parameter = "1.32712440018e20 m^3/s^2"\norbit = %s',
    'start = "10 day"\nend = "210 day"\nevery = "10 day"',
    output='record = ["quaternion", "momentum_axis", "obliquity", "node_longitude"]',
    more='[frame]\nreference = "orbit"',
)


def table(every: float, anomaly: bool = True) -> str:
    """Of the same orbit, with rows so many days apart."""
    header = "time [day], semi_major_axis [au], eccentricity, inclination [deg], ascending_node, periapsis"
    lines = [header + (", mean_anomaly [deg]" if anomaly else "")]
    for day in np.arange(-60, 280, every):
        t = float(day) * DAY
        cells = [float(day), 1.0, 0.1, 20.0, (0.7 + NODE * t) % (2 * math.pi), 1.2 + PERIAPSIS * t]
        if anomaly:
            cells.append(math.degrees(0.3 + MOTION * t) % 360)
        lines.append(", ".join(repr(float(x)) for x in cells))
    return "\n".join(lines)


def by_table(every: float, anomaly: bool = True) -> str:
    text = PLANET % '{table = "orbit.csv"}'
    return text + f"[tables.\"orbit.csv\"]\ntext = '''\n{table(every, anomaly)}\n'''\n"


@pytest.fixture(scope="module")
def direct() -> xarray.Dataset:
    return run_text(PLANET % KEPLER).dataset


def apart(one: xarray.Dataset, other: xarray.Dataset) -> float:
    """Largest angle between the momenta, rad."""
    return float(np.linalg.norm(one.momentum_axis.values - other.momentum_axis.values, axis=1).max())


def test_a_table_of_an_orbit_drives_a_spin_as_the_orbit_does(direct: xarray.Dataset) -> None:
    turned = float(np.arccos(np.clip(direct.momentum_axis[0] @ direct.momentum_axis[-1], -1, 1)))
    path = 4 * turned  # the pole's path is longer than its chord: it nods twice a year
    rounding = 4 * law(2.0**-52, 4000, math.radians(300) / DAY, 200 * DAY)
    found = {}
    for every in (4.0, 40.0):
        (load,) = prepare(rigidsim.parse(by_table(every))).system.plan.loads
        error = load.table.error  # type: ignore[union-attr]
        # the torque is 3 (G M / r^3) c x I c: the direction's error counts twice, the distance's three times
        bound = path * (2 * error.direction + 3 * error.distance)
        run = run_text(by_table(every)).dataset
        found[every] = apart(run, direct)
        assert found[every] < bound + rounding
        plane = np.abs(run.node_longitude.values - direct.node_longitude.values).max()
        assert plane < 4 * error.direction + bound + rounding  # the plane itself is interpolated
    assert bound > 100 * rounding  # so that it means something
    assert found[40.0] > 10 * found[4.0]  # and rows 40 days apart are so few that it can be seen


def test_without_an_anomaly_the_mean_longitude_advances_by_keplers_law(direct: xarray.Dataset) -> None:
    """The orbit's phase then is that of elements whose mean longitude, not anomaly, goes at Kepler's rate."""
    text = by_table(4.0, anomaly=False).replace('"orbit.csv"}', '"orbit.csv", mean_anomaly = 0.3}')
    node = NODE + PERIAPSIS
    start = 10 * DAY
    # such an orbit has the anomaly l - pi, with l = 0.3 + pi(start) + n start at the start
    anomaly = 0.3 + node * start
    same = KEPLER.replace("mean_anomaly = 0.3", f"mean_anomaly = {anomaly!r}")
    same = same[:-1] + f', period = "{2 * math.pi / (MOTION - node)!r} s"}}'
    kepler = run_text(PLANET % same).dataset
    assert apart(run_text(text).dataset, kepler) < 1e-10  # rows 4 days apart: interpolated to some 1e-11
    assert apart(direct, kepler) > 1e-6  # and the phase matters


def test_what_a_table_can_not_be_combined_with() -> None:
    with pytest.raises(ConfigError, match="edges of a table"):
        prepare(rigidsim.parse(by_table(40.0), overrides=["output.lyapunov=true"]))


def test_mars_with_a_table_of_its_orbit_has_the_obliquity_of_almanacs() -> None:
    path = Path(__file__).parents[2] / "configs" / "tables" / "mars_with_table.toml"
    short = ["time.end='60 day'", "output.timeline=false", "output.estimate=false"]
    run = rigidsim.run(rigidsim.load(path, overrides=short), out=None)
    # 25.19 deg in almanacs, of the orbit's plane and equator of date, both of J2000 here
    assert np.degrees(run.dataset.obliquity.values) == pytest.approx(25.19, abs=0.005)
