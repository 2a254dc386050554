"""Figures of a run: what is drawn, in which units, and that no text covers another."""

from collections.abc import Callable

import numpy as np
import pytest
import xarray

pytest.importorskip("matplotlib")

from matplotlib.figure import Figure

from rigidsim.look import figures
from rigidsim.look.figures import surfaces as polhode
from rigidsim.look.pages import numbers

Build = Callable[..., xarray.Dataset]

DAY = 86400.0
MAS = np.pi / 180 / 3600e3
ARCSEC = 1000 * MAS


def titles(figure: Figure) -> list[str]:
    return [axes.get_title("left") or axes.get_title() for axes in figure.axes]


def earth(count: int = 1001, end: float = 1000 * DAY, tilt: float = 1e-6) -> xarray.Dataset:
    """Rates of a free Earth with pole and figure axis 1e-6 rad apart: round in 303.62 days."""
    time = np.linspace(0.0, end, count)
    spin, turn = 7.292115e-5, 2 * np.pi / (303.62 * DAY) * time
    rates = spin * np.stack([tilt * np.cos(turn), tilt * np.sin(turn), np.ones(count)], axis=1)
    return xarray.Dataset(
        {
            "angular_velocity": (("time", "body_axis"), rates, {"units": "rad s-1"}),
            "energy_drift": ("time", np.zeros(count), {"units": "1", "drift_of": "energy"}),
        },
        coords={"time": ("time", time, {"units": "s"}), "body_axis": list("xyz")},
        attrs={
            "title": "Earth",
            "config": 'name = "earth"\ndescription = "the free nutation"\n',
            "principal_moments": "[8.0101e37, 8.0101e37, 8.0365e37]",
            "steps": 70,
            "tolerance": 2.2e-16,
        },
    )


def test_polar_motion_of_the_earth_is_a_circle_with_its_period() -> None:
    page = figures.figure(earth())
    circle = next(axes for axes in page.axes if "m₁" in axes.get_xlabel())
    assert circle.get_xlabel() == "m₁ [arcsec]"
    x, y = next(line for line in circle.get_lines() if len(line.get_xdata()) > 100).get_data()
    np.testing.assert_allclose(np.hypot(x, y), 1e-6 / ARCSEC, rtol=1e-12)
    title = " ".join(circle.get_title("left").split())
    assert title == "Polar motion: once round in 303.62 d, counterclockwise, 0.2063″ (+: figure axis)"
    assert ("polar motion once round in", "303.62 d") in numbers(earth())
    over_time = page.axes[0]
    rates = earth()["angular_velocity"].values
    np.testing.assert_allclose(over_time.get_lines()[0].get_ydata(), rates[:, 0] / rates[:, 2] / ARCSEC)
    assert over_time.get_ylabel() == "polar motion [arcsec]"
    assert page.axes[1].get_xlabel() == "time [yr]"


def test_polhode_lies_on_both_surfaces_and_the_separatrix_on_its_plane(symmetric_top: Build) -> None:
    dataset = symmetric_top()
    energy, momentum = polhode.surfaces(dataset) or pytest.fail("no surfaces")
    rates = dataset["angular_velocity"].values
    np.testing.assert_allclose((rates**2 / energy**2).sum(axis=1), 1, rtol=1e-12)
    np.testing.assert_allclose((rates**2 / momentum**2).sum(axis=1), 1, rtol=1e-12)
    assert polhode.separatrix(np.array([1.0, 1.0, 2.0]), energy) == []
    moments = np.array([3.0, 1.0, 2.0])
    radii = np.sqrt(1 / moments)  # 2 T = 1
    for ring in polhode.separatrix(moments, radii):
        np.testing.assert_allclose(ring**2 @ moments, 1, rtol=1e-12)
        np.testing.assert_allclose(ring**2 @ moments**2, 2, rtol=1e-12)  # L^2 = 2 T B
    assert len(polhode.separatrix(moments, radii)) == 2
    assert titles(figures.figure(dataset, "polhode")) == [
        "Polhode: the surfaces of energy and momentum",
        "It rolls on the invariable plane (Poinsot)",
    ]


def test_a_thin_plate_wobbles_twice_a_turn(symmetric_top: Build) -> None:
    """I = (1, 1, 2): the axis turns by L t / A about L, the body by L cos(theta) / C about the axis."""
    dataset = symmetric_top()
    (axes,) = figures.figure(dataset, "wobble").axes
    wobble, spin = (line.get_ydata()[-1] for line in axes.get_lines())
    momentum, end = np.linalg.norm(dataset["angular_momentum"].values[0]), float(dataset["time"][-1])
    assert wobble == pytest.approx(momentum * end / (2 * np.pi), rel=1e-6)
    assert wobble / spin == pytest.approx(2 / np.cos(0.5), rel=1e-9)


def test_drifts_stand_over_the_band_of_rounding(symmetric_top: Build) -> None:
    dataset = symmetric_top().assign_attrs(steps=400, tolerance=2.0**-52)
    (axes,) = figures.figure(dataset, "drift").axes
    np.testing.assert_allclose(axes.get_lines()[0].get_ydata()[1:], 1e-16 * np.arange(1, 1001))
    assert axes.get_yscale() == "log"
    assert len(axes.collections) == 1
