"""Precession into the past along a table of an orbit, as the equations of the literature have it."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import loaded

import rigidsim

YEAR = 365.25 * 86400
ARCSEC = np.pi / 648000
STRENGTH, AXIS, SPIN, RATIO = 1.32712440041e20, 1.495978707e11, 7.292115e-5, 0.0032738134
TILT = np.radians(23.4392911)
SECULAR = 1.5 * STRENGTH * RATIO / (SPIN * AXIS**3)  # rad/s
LINES = {  # rates (arcsec a year), sizes and phases of e exp(i perihelion) and of sin(i/2) exp(i node)
    "kh": ([5.46, 7.34, 17.33], [0.019, 0.016, 0.013], [0.3, 2.1, 4.0]),
    "qp": ([-5.6, -18.85, -26.3], [0.007, 0.005, 0.003], [1.0, 3.3, 5.1]),
}
END = -20_000  # years


def elements(years: np.ndarray) -> list[np.ndarray]:
    """k, h, q, p of a made-up orbit."""
    found = []
    for rates, sizes, phases in LINES.values():
        angles = np.outer(years, np.array(rates) * ARCSEC) + np.array(phases)
        found += [(np.array(sizes) * turn(angles)).sum(axis=1) for turn in (np.cos, np.sin)]
    return found


def normal_of(year: float) -> tuple[np.ndarray, float, float]:
    k, h, q, p = (float(x[0]) for x in elements(np.array([year])))
    chi = np.sqrt(1 - p * p - q * q)
    return np.array([2 * p * chi, -2 * q * chi, 1 - 2 * (p * p + q * q)]), k, h


def truth(years: np.ndarray, geodetic: float = 0.0) -> dict[str, np.ndarray]:
    """By s' = K (1 - e^2)^(-3/2) (n.s) s x n + G n x s, with DOP853 and without a table."""

    def slope(year: float, axis: np.ndarray) -> np.ndarray:
        normal, k, h = normal_of(year)
        size = SECULAR * YEAR * (1 - k * k - h * h) ** -1.5
        return (size * (normal @ axis) - geodetic * YEAR) * np.cross(axis, normal)

    start = [0, np.sin(TILT), np.cos(TILT)]
    axes = solve_ivp(slope, [0, END], start, "DOP853", years, rtol=1e-12, atol=1e-14).y.T
    rows = []
    for year, axis in zip(years, axes, strict=True):
        normal, k, h = normal_of(year)
        first = np.array([1, 0, 0]) - normal[0] * (np.array([0, 0, 1]) + normal) / (1 + normal[2])
        equinox = np.arctan2(-first @ axis, np.cross(normal, first) @ axis)
        perihelion = np.arctan2(h, k) - equinox
        tilt, e = np.arccos(normal @ axis), np.hypot(k, h)
        rise = np.sin(np.radians(65)) * np.sin(tilt)
        flat = np.cos(np.radians(65)) * np.cos(np.arcsin(np.sin(tilt)))
        hour = np.arccos(np.clip(-rise / flat, -1, 1))
        near = (1 + e * np.cos(np.pi / 2 - perihelion - np.pi)) / (1 - e * e)
        sun = 1360.7 / np.pi * near**2 * (hour * rise + flat * np.sin(hour))
        rows.append([tilt, equinox, e * np.sin(perihelion), e, sun])
    obliquity, equinox, climatic, e, sun = np.array(rows).T
    precession = np.unwrap(equinox)
    return {
        "obliquity": obliquity, "precession": precession - precession[0], "climatic_precession": climatic,
        "orbit_eccentricity": e, "insolation": sun,
    }  # fmt: skip


@pytest.fixture
def config(tmp_path: Path) -> Path:
    years = np.arange(END - 4000, 4001, 400.0)
    k, h, q, p = elements(years)
    columns = [years, np.hypot(k, h), 2 * np.arcsin(np.hypot(q, p)), np.arctan2(p, q), np.arctan2(h, k)]
    names = "time [yr], eccentricity, inclination, ascending_node, longitude_of_periapsis\n"
    rows = "".join(", ".join(f"{x:.16g}" for x in row) + "\n" for row in zip(*columns, strict=True))
    (tmp_path / "orbit.csv").write_text(names + rows)
    path = tmp_path / "deep.toml"
    path.write_text(
        f'name = "deep"\n[body]\nprincipal_moments = [{1 - RATIO:.17g}, {1 - RATIO:.17g}, 1]\n'
        f'[initial]\nangular_velocity = [0, 0, {SPIN}]\neuler_angles = ["180 deg", "23.4392911 deg", 0]\n'
        f'[[loads]]\nkind = "gravity_gradient"\ngravitational_parameter = {STRENGTH}\n'
        f'orbit = {{table = "orbit.csv", semi_major_axis = {AXIS}}}\n'
        f'[frame]\nreference = "orbit"\n[time]\nend = "{END} yr"\nevery = "2 kyr"\nunit = "kyr"\n'
        '[model]\nlevel = "orbit_averaged"\norder = 1\nstart = "mean"\n[output]\ntimeline = false\n'
        'estimate = false\nrecord = ["obliquity", "precession", "climatic_precession", "orbit_eccentricity", '
        '"insolation"]\ninsolation = {latitude = "65 deg", solar_longitude = "90 deg"}\n'
    )
    return path


@pytest.mark.parametrize("geodetic", [False, True])
def test_the_past_is_that_of_the_equations_of_the_literature(config: Path, geodetic: bool) -> None:
    changes = {"model.geodetic_precession": True} if geodetic else {}
    data = loaded(rigidsim.run(rigidsim.load(config).replace(changes), out=None))
    pace = 0.0
    if geodetic:  # of a circle: eccentricities of some per cent change a ten-thousandth of it
        pace = 1.5 * STRENGTH**1.5 / (299792458**2 * AXIS**2.5)
        assert pace * 100 * YEAR / ARCSEC == pytest.approx(1.92, abs=0.005)  # published, arcsec a century
    known = truth(data.time.values / YEAR, pace)
    close = 1e-6 if geodetic else 1e-10
    for name, values in known.items():
        found = data[name].sel(axis="figure") if "axis" in data[name].dims else data[name]
        np.testing.assert_allclose(
            found.values, values, rtol=0, atol=close * (500 if name == "insolation" else 1)
        )


def test_keys_of_averages_are_refused_without_one(config: Path) -> None:
    with pytest.raises(rigidsim.ConfigError, match="order is given with level"):
        rigidsim.load(config).replace({"model.level": "full"})
    with pytest.raises(rigidsim.ConfigError, match="insolation"):
        rigidsim.run(rigidsim.load(config).replace({"output.insolation": None}), out=None)


def test_in_double_precision_a_table_is_that_of_more_digits(config: Path) -> None:
    double, more = (
        loaded(rigidsim.run(rigidsim.load(config).replace({"integrator.precision": precision}), out=None))
        for precision in ("double", "extended")
    )
    for name in ("precession", "orbit_eccentricity"):
        np.testing.assert_allclose(double[name], more[name].astype(float), rtol=0, atol=1e-14)


def test_a_long_table_is_read_by_its_digest(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table, plain = tmp_path / "orbit.csv", rigidsim.run(config, out=None).dataset
    text = table.read_text()
    table.write_text("# orbit\n" * 400_000 + text)
    monkeypatch.chdir(tmp_path)
    run = rigidsim.run(rigidsim.load(config).replace({"limits.max_steps": 20}), out="runs")
    assert len(Path("runs/deep/config.toml").read_text()) < 2000
    run = rigidsim.resume("runs/deep", overrides=["limits.max_steps=1000"])
    np.testing.assert_array_equal(run.dataset.precession, plain.precession)
    assert rigidsim.verify("runs/deep").identical
    table.write_text("# another\n" + table.read_text())
    with pytest.raises(rigidsim.ConfigError, match="put there what the run began with"):
        rigidsim.verify("runs/deep")
    table.unlink()
    with pytest.raises(rigidsim.ConfigError, match="which isn't there: looked for in"):
        rigidsim.verify("runs/deep")
