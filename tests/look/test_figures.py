"""Figures of a run: what is drawn, in which units, and that no text covers another."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest
import xarray

pytest.importorskip("matplotlib")

from matplotlib.figure import Figure
from matplotlib.text import Text

from rigidsim.look import figures
from rigidsim.look.figures import polhode

Build = Callable[..., xarray.Dataset]

DAY, YEAR = 86400.0, 365.25 * 86400
MAS = np.pi / 180 / 3600e3
ARCSEC = 1000 * MAS


def titles(figure: Figure) -> list[str]:
    return [axes.get_title("left") or axes.get_title() for axes in figure.axes]


def texts(figure: Figure) -> list[Text]:
    """All texts that are seen: of ticks only those within the limits."""
    figure.draw_without_rendering()
    found = [*figure.texts]
    for axes in figure.axes:
        found += [axes.title, axes._left_title]  # type: ignore[attr-defined]
        found += axes.texts
        if axes.get_legend() is not None:
            found += axes.get_legend().get_texts()
        if axes.axison:
            for axis, limits in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
                low, high = sorted(limits)
                found += [axis.label, axis.get_offset_text()]
                found += [t.label1 for t in axis.get_major_ticks() if low <= t.get_loc() <= high]
    return [text for text in found if text.get_visible() and text.get_text().strip()]


def collisions(figure: Figure) -> list[tuple[str, str]]:
    """Pairs of texts whose rendered boxes overlap by more than half a pixel, and texts beyond the page."""
    boxes = [(text.get_text(), text.get_window_extent()) for text in texts(figure)]
    page = figure.bbox
    found = [
        (name, "the page's edge")
        for name, box in boxes
        if box.x0 < page.x0 - 0.5
        or box.x1 > page.x1 + 0.5
        or box.y0 < page.y0 - 0.5
        or box.y1 > page.y1 + 0.5
    ]
    for (one, a), (other, b) in combinations(boxes, 2):
        across, up = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
        if across > 0.5 and up > 0.5:
            found.append((one, other))
    return found


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


def precessing(years: float = 60.0) -> xarray.Dataset:
    """An Earth whose pole precesses by 50 arcsec a year and nutates in 18.6 years by 9.2 and 6.9 arcsec."""
    time = np.arange(0.0, years * YEAR, 20 * DAY)
    phase = 2 * np.pi * time / (18.6 * YEAR)
    tilt = np.deg2rad(23.44) + 9.2 * ARCSEC * np.cos(phase)
    node = -50 * ARCSEC * time / YEAR - 6.9 * ARCSEC / np.sin(np.deg2rad(23.44)) * np.sin(phase)
    both = [np.stack([x, x + 1e-6 * ARCSEC], axis=1) for x in (tilt, node)]
    return xarray.Dataset(
        {
            "obliquity": (("time", "axis"), both[0], {"units": "rad"}),
            "node_longitude": (("time", "axis"), both[1], {"units": "rad"}),
        },
        coords={"time": ("time", time, {"units": "s"}), "axis": ["figure", "momentum"]},
        attrs={"title": "precession", "config": '[[loads]]\nkind = "gravity_gradient"\n'},
    )


def heavy_top(count: int = 2001) -> xarray.Dataset:
    """A top that precesses three times while it nutates thirty times, tip 4 cm from the fixed point."""
    time = np.linspace(0.0, 3.0, count)
    tilt = np.deg2rad(30) + np.deg2rad(3) * (1 - np.cos(2 * np.pi * 10 * time))
    phi = 2 * np.pi * time
    up = np.stack([np.sin(tilt) * np.sin(phi), -np.sin(tilt) * np.cos(phi), np.cos(tilt)], axis=1)
    return xarray.Dataset(
        {
            "tip": (("time", "space_axis"), 0.04 * up, {"units": "m"}),
            "tilt": ("time", tilt, {"units": "rad"}),
            "precession_angle": ("time", phi, {"units": "rad"}),
            "energy_drift": ("time", 1e-16 * np.arange(count), {"units": "1", "drift_of": "energy"}),
        },
        coords={"time": ("time", time, {"units": "s"}), "space_axis": list("XYZ")},
        attrs={"title": "top", "config": '[[loads]]\nkind = "uniform_gravity"\n'},
    )


def satellite(count: int = 801) -> xarray.Dataset:
    """A satellite that librates by a few degrees."""
    time = np.linspace(0.0, DAY, count)
    angles = np.deg2rad([3.0, 5.0, 1.0]) * np.sin(np.outer(time, [2.2e-3, 1.9e-3, 1.1e-3]) + np.arange(3))
    nadir = np.stack([np.sin(angles[:, 1]), np.sin(angles[:, 0]), np.ones(count)], axis=1)
    nadir /= -np.linalg.norm(nadir, axis=1, keepdims=True)
    return xarray.Dataset(
        {
            "roll_pitch_yaw": (("time", "angle"), angles, {"units": "rad"}),
            "libration": (("time", "libration_angle"), angles[:, [1, 0]] + [np.pi, 0], {"units": "rad"}),
            "nadir": (("time", "body_axis"), nadir, {"units": "1"}),
        },
        coords={"time": ("time", time, {"units": "s"}), "angle": ["roll", "pitch", "yaw"]},
        attrs={"title": "satellite", "config": '[[loads]]\nkind = "gravity_gradient"\n'},
    )


# what is drawn


def test_polar_motion_of_the_earth_is_a_circle_with_its_period() -> None:
    page = figures.figure(earth())
    circle = next(axes for axes in page.axes if "m_1" in axes.get_xlabel())
    assert circle.get_xlabel() == "$m_1$ [arcsec]"
    x, y = next(line for line in circle.get_lines() if len(line.get_xdata()) > 100).get_data()
    np.testing.assert_allclose(np.hypot(x, y), 1e-6 / ARCSEC, rtol=1e-12)
    assert [t.get_text() for t in circle.texts] == ["303.62 d\ncounterclockwise", "radius 0.2063″"]
    over_time = page.axes[0]
    rates = earth()["angular_velocity"].values
    np.testing.assert_allclose(over_time.get_lines()[0].get_ydata(), rates[:, 0] / rates[:, 2] / ARCSEC)
    assert over_time.get_ylabel() == "polar motion [arcsec]"
    assert page.axes[1].get_xlabel() == "time [yr]"


def test_obliquity_and_longitude_have_axes_of_their_own_and_say_what_was_taken_off() -> None:
    dataset = precessing()
    page = figures.figure(dataset, "obliquity")
    upper, lower = page.axes
    assert titles(page)[0] == "Obliquity less its mean, 23.44°"
    assert titles(page)[1].startswith("Longitude of the node less its mean motion, −50")
    assert titles(page)[1].endswith("″/yr")
    assert upper.get_ylabel() == "obliquity − mean [arcsec]"
    # the momentum goes with the figure axis to a millionth of an arcsecond: one curve
    (shown,) = upper.get_lines()
    tilt = dataset["obliquity"].values[:, 0]
    off = shown.get_ydata() - tilt / ARCSEC
    np.testing.assert_allclose(off, off[0], rtol=0, atol=1e-9)
    assert off[0] == pytest.approx(-np.deg2rad(23.44) / ARCSEC, abs=1)
    assert np.ptp(lower.get_lines()[0].get_ydata()) == pytest.approx(
        2 * 6.9 / np.sin(np.deg2rad(23.44)), rel=1e-3
    )


def test_nutation_ellipse_has_its_period_and_its_axes() -> None:
    page = figures.figure(precessing(years=60), "nutation")
    (axes,) = page.axes
    (label,) = [t.get_text() for t in axes.get_legend().get_texts() if "semi-axes" in t.get_text()]
    assert label == "18.6 yr: semi-axes 9.2″, 6.9″"
    assert axes.get_ylabel() == "Δobliquity [arcsec]"


def test_libration_in_time_and_in_planes() -> None:
    dataset = satellite()
    page = figures.figure(dataset, "libration")
    for line, name in zip(page.axes[1].get_lines(), ("roll", "pitch", "yaw"), strict=True):
        assert line.get_label() == name
        np.testing.assert_allclose(
            line.get_ydata(), np.rad2deg(dataset["roll_pitch_yaw"].sel(angle=name).values)
        )
    inside, outside = page.axes[0].get_lines()
    assert (inside.get_label(), outside.get_label()) == ("in the orbit's plane − 180°", "out of it")
    np.testing.assert_allclose(
        inside.get_ydata(), np.rad2deg(dataset["roll_pitch_yaw"].values[:, 1]), atol=1e-9
    )
    assert page.axes[2].get_xlabel() == "towards −x [deg]"
    assert titles(page)[2:] == ["The source seen from the body (+: −z axis)", "Phase planes"]
    assert titles(figures.figure(dataset))[0].startswith("Libration")
    # pitched by a right angle roll and yaw are undefined, and the source still where it is
    steep = dataset[["nadir", "roll_pitch_yaw"]].assign_attrs(dataset.attrs)
    steep["roll_pitch_yaw"] = steep["roll_pitch_yaw"] + np.array([0, np.pi / 2, 0])
    assert titles(figures.figure(steep, "libration")) == ["The source seen from the body (+: −z axis)"]


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


def test_drifts_stand_over_the_band_of_rounding(symmetric_top: Build) -> None:
    dataset = symmetric_top().assign_attrs(steps=400, tolerance=2.0**-52)
    (axes,) = figures.figure(dataset, "drift").axes
    np.testing.assert_allclose(axes.get_lines()[0].get_ydata()[1:], 1e-16 * np.arange(1, 1001))
    assert axes.get_yscale() == "log"
    assert len(axes.collections) == 1


# the page


@pytest.mark.slow
def test_no_text_covers_another_in_any_figure(symmetric_top: Build) -> None:
    drawn = 0
    tumbling = symmetric_top(count=20000, end=2000.0)  # its start alone is shown
    for dataset in (earth(), precessing(), heavy_top(), satellite(), tumbling):
        for name in figures.available(dataset):
            assert collisions(figures.figure(dataset, name)) == [], name
            drawn += 1
    assert drawn > 20


def test_unknown_and_impossible_figures_are_refused_with_those_there_are(symmetric_top: Build) -> None:
    with pytest.raises(
        ValueError, match=r"none of that name; did you mean 'polhode'. Available: overview, pol"
    ):
        figures.figure(symmetric_top(), "polhod")
    with pytest.raises(
        ValueError,
        match="needs libration, roll_pitch_yaw, nadir or source_position recorded, which this run hasn't",
    ):
        figures.figure(symmetric_top(), "libration")
    with pytest.raises(ValueError, match=r"rigidsim\.analyse\(run\)\.figure"):
        figures.figure(symmetric_top(), "spectrum")
    rates = symmetric_top()[["angular_velocity"]].assign_attrs(symmetric_top().attrs)
    assert figures.available(rates) == ["overview", "polhode", "momentum_sphere", "rates"]


# units and numbers
