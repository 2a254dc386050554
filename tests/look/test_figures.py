"""Figures of a run: what is drawn, in which units, and that no text covers another."""

from __future__ import annotations

import json
from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray

pytest.importorskip("matplotlib")

from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.text import Text

from rigidsim.look import figures, signals
from rigidsim.look.figures import composing, drift, fits, polhode, scales, timelines
from rigidsim.look.plots import pretty_unit
from rigidsim.solve.problem import DRIFT_FACTOR

Build = Callable[..., xarray.Dataset]

DAY, YEAR = 86400.0, 365.25 * 86400
MAS = np.pi / 180 / 3600e3
ARCSEC = 1000 * MAS


def titles(figure: Figure) -> list[str]:
    return [axes.get_title("left") or axes.get_title() for axes in figure.axes]


def inked(path: Path) -> float:
    """Part of a picture that isn't white."""
    return float((imread(path)[..., :3].min(axis=2) < 0.9).mean())


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
    np.testing.assert_allclose(
        over_time.get_lines()[0].get_ydata(), signals.polar_motion(earth())[:, 0] / ARCSEC
    )
    assert over_time.get_ylabel() == "polar motion [arcsec]"
    assert page.axes[1].get_xlabel() == "time [yr]"


def test_recorded_polar_motion_is_drawn_as_it_is() -> None:
    dataset = earth()
    recorded = np.stack([np.full(1001, 3 * MAS), np.linspace(0, 5 * MAS, 1001)], axis=1)
    dataset["polar_motion"] = (("time", "polar_motion_component"), recorded)
    line = figures.figure(dataset, "polar_motion").axes[0].get_lines()[1]
    np.testing.assert_allclose(line.get_ydata(), np.linspace(0, 5, 1001))


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
    mean = fits.secular(dataset["time"].values, tilt, level=True).at_start
    np.testing.assert_allclose(shown.get_ydata(), (tilt - mean) / ARCSEC, atol=1e-9)
    assert np.ptp(lower.get_lines()[0].get_ydata()) == pytest.approx(
        2 * 6.9 / np.sin(np.deg2rad(23.44)), rel=1e-3
    )


@pytest.mark.parametrize(("swing", "whole"), [(50.0, True), (0.5, True), (0.05, False)])
def test_swings_that_ticks_tell_are_drawn_with_nothing_taken_off(swing: float, whole: bool) -> None:
    dataset = precessing()
    wave = np.deg2rad(swing) * np.sin(2 * np.pi * dataset["time"].values / (18.6 * YEAR))
    dataset["obliquity"].values[:] = np.deg2rad(89.3) + wave[:, None]
    dataset["node_longitude"].values[:] = np.deg2rad(60) + wave[:, None]
    page = figures.figure(dataset, "obliquity")
    upper, lower = (axes.get_lines()[0].get_ydata() for axes in page.axes)
    assert titles(page)[0].startswith("Obliquity less its mean, ") != whole
    # half a radian from the mean motion is no small path about it
    assert ("nutation" in figures.available(dataset)) == (swing < 30)
    assert titles(page)[1].startswith("Longitude of the node less its mean motion, ") != whole
    if whole:
        assert titles(page) == ["Obliquity", "Longitude of the node"]
        np.testing.assert_allclose(upper, 89.3 + np.rad2deg(wave), rtol=1e-12)
        np.testing.assert_allclose(lower, 60 + np.rad2deg(wave), rtol=1e-12)
    assert [axes.get_ylabel() for axes in page.axes] == (
        ["obliquity [deg]", "longitude [deg]"]
        if whole
        else ["obliquity − mean [arcsec]", "longitude − line [arcsec]"]
    )


def test_the_page_of_a_run_with_axes_alone_is_about_their_precession() -> None:
    dataset = precessing()  # as of an averaged model: neither attitude nor rates
    page = figures.figure(dataset.assign_attrs(formulation="orbit_averaged"))
    shown = [title.split(" less")[0].split(":")[0].split(" (")[0] for title in titles(page)]
    assert shown[:4] == ["Obliquity", "Longitude of the node", "Nutation", "Path of the pole in space"]
    said = [text.get_text() for text in texts(page)]
    assert "model" in said
    assert "formulation" not in said
    alone = dataset.drop_vars(["obliquity", "node_longitude"])
    tilt, node = (dataset[name].values[:, 1] for name in ("obliquity", "node_longitude"))
    axis = np.stack([np.sin(tilt) * np.sin(node), -np.sin(tilt) * np.cos(node), np.cos(tilt)], axis=1)
    alone = alone.assign(momentum_axis=(("time", "space_axis"), axis))  # of a tumbling body
    assert {"obliquity", "nutation", "pole_path"} <= set(figures.available(alone))
    assert titles(figures.figure(alone))[0] == titles(page)[0]


def test_the_page_of_an_averaged_rotation_that_is_braked_says_what_is_left_of_it() -> None:
    dataset = precessing().assign_attrs(formulation="spin_averaged")
    left = np.exp(-np.linspace(0.0, 2.0, dataset.sizes["time"]))
    recorded = {"angular_momentum_norm": 3.0 * left, "energy": 5.0 * left**2}
    page = figures.figure(dataset.assign({name: ("time", values) for name, values in recorded.items()}))
    assert titles(page)[0] == "What is left of the rotation"
    momentum, energy = (line.get_ydata() for line in page.axes[0].get_lines())
    np.testing.assert_allclose(momentum, left, rtol=1e-15)
    np.testing.assert_allclose(energy, left**2, rtol=1e-15)
    assert collisions(page) == []
    steady = {name: ("time", np.full_like(left, values[0])) for name, values in recorded.items()}
    assert titles(figures.figure(dataset.assign(steady)))[0].startswith("Obliquity")


def test_nutation_ellipse_has_its_period_and_its_axes() -> None:
    page = figures.figure(precessing(years=60), "nutation")
    (axes,) = page.axes
    (label,) = [t.get_text() for t in axes.get_legend().get_texts() if "semi-axes" in t.get_text()]
    assert label == "18.6 yr: semi-axes 9.2″, 6.9″"
    assert axes.get_ylabel() == "Δobliquity [arcsec]"


def test_pole_path_is_in_the_distance_of_the_obliquity() -> None:
    page = figures.figure(precessing(years=26000 / 10), "pole_path")
    assert [axes.get_xlabel() for axes in page.axes] == [
        "along X [deg]",
        "Δlongitude · sin(obliquity) [arcsec]",
    ]
    paths, center, _ = figures.catalogue.poles.pole_paths(precessing())
    assert center == "reference pole"
    tilt = precessing()["obliquity"].values[:, 0]
    np.testing.assert_allclose(np.hypot(*paths["figure"].T), tilt, rtol=1e-12)


def test_pole_of_a_free_body_circles_the_momentum(symmetric_top: Build) -> None:
    paths, center, _ = figures.catalogue.poles.pole_paths(symmetric_top())
    assert center == "momentum"
    np.testing.assert_allclose(np.hypot(*paths["figure"].T), 0.5, rtol=1e-9)  # its tilt against L
    assert "once round in 6.28" in titles(figures.figure(symmetric_top(), "pole_path"))[0].replace("\n", " ")


def test_tip_of_a_top_is_seen_from_above_with_its_first_turn() -> None:
    dataset = heavy_top()
    page = figures.figure(dataset)
    axes = next(axes for axes in page.axes if "X" in axes.get_xlabel())
    assert axes.get_xlabel() == "X [mm]"
    first = next(line for line in axes.get_lines() if line.get_label() == "first turn")
    rows = len(first.get_xdata())
    assert rows == pytest.approx(2001 / 3, abs=2)
    np.testing.assert_allclose(np.transpose(first.get_data()), dataset["tip"].values[:rows, :2] * 1e3)
    assert titles(page)[0] == "Tilt against the vertical"
    assert titles(page)[1] == "Precession: uniform, 1 turns/s"


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


def test_herpolhode_of_a_symmetric_body_is_a_circle(symmetric_top: Build) -> None:
    plane = polhode.herpolhode(symmetric_top())
    assert plane is not None
    rates = symmetric_top()["angular_velocity"].values
    along = rates**2 @ [1, 1, 2]  # 2 T, and L = 1
    np.testing.assert_allclose(np.hypot(*plane.T), np.sqrt((rates**2).sum(axis=1) - along**2), rtol=1e-9)
    np.testing.assert_allclose(np.hypot(*plane.T), np.hypot(*plane[0]), rtol=1e-9)


def test_a_symmetric_bodys_nutation_angle_is_constant_below_its_attitude(symmetric_top: Build) -> None:
    page = figures.figure(symmetric_top(), "attitude")
    assert titles(page)[-1] == "Nutation angle: the figure axis from the momentum"
    angle = page.axes[-1].get_lines()[0].get_ydata()
    rates = symmetric_top()["angular_velocity"].values[0]
    expected = np.degrees(np.arccos(2 * rates[2] / np.linalg.norm(rates * [1, 1, 2])))  # cos = C w3 / L
    np.testing.assert_allclose(angle, expected, rtol=1e-9)


def test_motion_off_the_surfaces_is_drawn_without_them(symmetric_top: Build) -> None:
    dataset = symmetric_top()
    dataset.attrs["principal_moments"] = "[1, 2, 2]"
    assert titles(figures.figure(dataset, "polhode")) == ["Path of ω in body axes [rad/s]"]
    del dataset.attrs["principal_moments"]
    assert titles(figures.figure(dataset, "polhode")) == ["Path of ω in body axes [rad/s]"]


def test_drifts_stand_over_the_band_of_rounding(symmetric_top: Build) -> None:
    dataset = symmetric_top().assign_attrs(steps=400, tolerance=2.0**-52)
    law = drift.law(dataset)
    assert law is not None
    assert law[-1] == pytest.approx(2.0**-52 * 20)
    assert law[250] == pytest.approx(2.0**-52 * 10)
    (axes,) = figures.figure(dataset, "drift").axes
    np.testing.assert_allclose(axes.get_lines()[0].get_ydata()[1:], 1e-16 * np.arange(1, 1001))
    assert axes.get_yscale() == "log"
    assert len(axes.collections) == 1
    assert drift.law(dataset.assign_attrs(steps=0)) is None
    assert drift.MOST == DRIFT_FACTOR


def test_drifts_that_are_exactly_zero_are_said_so() -> None:
    (axes,) = figures.figure(earth(), "drift").axes
    assert [t.get_text() for t in axes.texts] == ["exactly 0: energy"]


def test_the_table_has_every_invariant(symmetric_top: Build) -> None:
    dataset = symmetric_top()
    for k in range(14):
        dataset[f"constant_{k}_drift"] = dataset["energy_drift"].assign_attrs(drift_of=f"constant_{k}")
    page = figures.figure(dataset)
    rows = [text.get_text() for text in page.axes[-1].texts]
    assert [f"largest drift, constant {k}" in rows for k in range(14)] == [True] * 14
    assert collisions(page) == []


# the page


def test_no_text_covers_another_on_the_pages_of_scenes(symmetric_top: Build) -> None:
    place = np.random.default_rng(1).random((1001, 3))
    moving = symmetric_top().assign(position=(("time", "space_axis"), place))
    long = heavy_top().assign_attrs(
        config=f'name = "x"\ndescription = "{"a very long description of it " * 9}"',
        title="a_name_that_goes_on_and_on_" * 5,
    )
    for dataset in (earth(), precessing(), long, satellite(), moving):
        assert collisions(figures.figure(dataset)) == []


@pytest.mark.slow
def test_no_text_covers_another_in_any_figure(symmetric_top: Build) -> None:
    drawn = 0
    tumbling = symmetric_top(count=20000, end=2000.0)  # its start alone is shown
    for dataset in (earth(), precessing(), heavy_top(), satellite(), tumbling):
        for name in figures.available(dataset):
            assert collisions(figures.figure(dataset, name)) == [], name
            drawn += 1
    assert drawn > 20


def test_of_a_fast_motion_the_start_is_shown_and_said(symmetric_top: Build) -> None:
    page = figures.figure(symmetric_top(count=20000, end=2000.0))
    labels = [axes.get_xlabel() for axes in page.axes if axes.get_xlabel().startswith("time")]
    assert labels[0].startswith("time [min], the first 3.3 min")
    assert labels[-1] == "time [min]"
    low, high = page.axes[0].get_xlim()
    # w_x = sin(psi) turns with |1/C - 1/A| cos(0.5) = 0.439 rad/s: fourteen turns
    assert (low, high) == (0.0, pytest.approx(14 * 2 * np.pi / 0.4388 / 60, rel=0.02))
    assert "first" not in figures.figure(symmetric_top()).axes[0].get_xlabel()


def test_unknown_and_impossible_figures_are_refused_with_those_there_are(symmetric_top: Build) -> None:
    with pytest.raises(
        ValueError, match=r"none of that name; did you mean 'polhode'. Available: overview, pol"
    ):
        figures.figure(symmetric_top(), "polhod")
    with pytest.raises(
        ValueError,
        match="needs libration, roll_pitch_yaw or nadir recorded, which this run hasn't; it has overview",
    ):
        figures.figure(symmetric_top(), "libration")
    with pytest.raises(ValueError, match=r"spectrum_figure\(rigidsim\.analyse\(run\)\.dataset\)"):
        figures.figure(symmetric_top(), "spectrum")
    rates = symmetric_top()[["angular_velocity"]].assign_attrs(symmetric_top().attrs)
    assert figures.available(rates) == ["overview", "polhode", "rates"]


@pytest.mark.slow
def test_png_and_svg_are_files_of_their_kind(symmetric_top: Build, tmp_path: Path) -> None:
    assert figures.save_figure(symmetric_top(), tmp_path / "f.png") == tmp_path / "f.png"
    assert min(imread(tmp_path / "f.png").shape[:2]) > 600
    assert 0.01 < inked(tmp_path / "f.png") < 0.6
    figures.save_figure(heavy_top(), tmp_path / "f.svg", "tip")
    assert ElementTree.parse(tmp_path / "f.svg").getroot().tag.endswith("svg")
    assert {path.name for path in tmp_path.iterdir()} == {"f.png", "f.svg"}


@pytest.mark.parametrize("name", ["f.pdf", "f", "f.png.txt"])
def test_other_suffix_is_refused_with_those_allowed(symmetric_top: Build, tmp_path: Path, name: str) -> None:
    with pytest.raises(ValueError, match=r"must be one of \.png, \.svg"):
        figures.save_figure(symmetric_top(), tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_one_sample_and_nan_are_drawn(symmetric_top: Build) -> None:
    assert collisions(figures.figure(symmetric_top().isel(time=[0]))) == []
    broken = symmetric_top(count=30).copy(deep=True)
    for name in ("quaternion", "angular_velocity", "energy_drift"):
        broken[name][-3:] = np.nan
    page = figures.figure(broken)
    assert collisions(page) == []
    shown = page.axes[0].get_lines()[0].get_ydata()
    np.testing.assert_allclose(shown, broken["angular_velocity"].values[:, 0])


def test_rates_only_and_moving_runs_have_their_panels(symmetric_top: Build) -> None:
    dataset = symmetric_top()
    rates = titles(figures.figure(dataset[["angular_velocity"]].assign_attrs(dataset.attrs)))
    assert rates[0] == "Angular velocity, body axes"
    assert not any("z axis" in t for t in rates)
    angles = dataset.assign(euler_angles=(("time", "euler_angle"), np.ones((1001, 3))))
    assert "Euler angles" in titles(figures.figure(angles))
    flat = np.stack([np.cos(dataset["time"]), np.sin(dataset["time"]), np.zeros(1001)], axis=1)
    moving = figures.figure(dataset.assign(position=(("time", "space_axis"), 7e6 * flat)))
    axes = next(
        axes for axes in moving.axes if "Path in its plane" in titles(moving)[moving.axes.index(axes)]
    )
    assert axes.get_xlabel() == "X [Mm]"


def test_largest_drift_is_that_of_every_sample(symmetric_top: Build) -> None:
    dataset = symmetric_top(count=9999)
    dataset["energy_drift"][4567] = -3e-9  # between the samples that the curves show
    shown = composing.shown_rows(dataset, 500)
    assert shown.rows.sizes["time"] <= 500
    assert (shown.largest, shown.complete) == ({"energy": 3e-9}, True)
    shown = composing.shown_rows(dataset, 500, 5000)
    assert (shown.largest, shown.complete) == ({"energy": pytest.approx(1e-16 * 9998)}, False)
    assert ("largest drift, energy", "≥ 1.0e-12") in composing.facts_of(shown)


# units and numbers


def test_fast_spin_does_not_press_the_other_angles_flat(symmetric_top: Build) -> None:
    dataset = symmetric_top()
    seconds = dataset["time"].values
    angles = np.stack([0 * seconds, 0.1 * np.sin(seconds), 40 * seconds + 0.2 * np.sin(seconds)], axis=1)
    shown, labels = timelines.without_growth(dataset, np.rad2deg(angles))
    assert labels[:2] == ["φ", "θ"]
    assert labels[2].startswith("ψ − 6.3")
    assert labels[2].endswith("turns/s")
    # The swing of 0.2 rad both ways, and what the mean growth misses of it at the end.
    assert np.ptp(shown[:, 2]) < np.rad2deg(3 * 0.2)
    np.testing.assert_array_equal(shown[:, 1], np.rad2deg(angles[:, 1]))


def test_values_get_si_prefixes_and_angles_their_units() -> None:
    assert scales.si_scale(np.array([7e-5]), "rad/s") == (pytest.approx(1e-6), "µrad/s")
    assert scales.si_scale(np.array([4.2e7]), "m") == (pytest.approx(1e6), "Mm")
    assert scales.si_scale(np.zeros(3), "m") == (1.0, "m")
    assert scales.si_scale(np.array([3e-9]), "m")[1] == "nm"
    assert scales.si_scale(np.array([1.5e21]), "m")[1] == "1e21 m"
    for value, unit in ((0.4, "deg"), (1e-4, "arcsec"), (1e-7, "mas"), (1e-10, "µas"), (0.0, "deg")):
        assert scales.angle_scale(np.array([value]))[1] == unit
    assert scales.angle_text(1e-7) == "20.63 mas"
    assert scales.angle_text(-np.deg2rad(23.44)) == "−23.44°"


def test_secular_part_and_circulation_are_those_of_the_motion() -> None:
    time = np.linspace(0.0, 50.0, 4001)
    line = fits.secular(time, 1.0 + 0.3 * time + 0.01 * np.sin(2.1 * time))
    assert line.rate == pytest.approx(0.3, abs=1e-6)
    assert line.at(time[:1])[0] == pytest.approx(1.0, abs=1e-4)
    circle = np.stack([np.cos(2.5 * time), -np.sin(2.5 * time)], axis=1)
    assert fits.circulation(time, circle) == pytest.approx(-2.5, rel=1e-9)
    assert fits.circulation(time[::200], circle[::200]) is None  # 6.25 rad between samples
    assert fits.circulation(time, np.stack([2 + np.cos(time), np.sin(time)], axis=1)) is None
    assert fits.circulation(time, np.stack([np.cos(time**2 / 9), np.sin(time**2 / 9)], axis=1)) is None


def test_leading_ellipse_is_the_strongest_of_two() -> None:
    time = np.linspace(0.0, 100.0, 2001)
    plane = np.stack([3 * np.cos(time) + 0.1 * np.sin(7 * time), 2 * np.sin(time)], axis=1)
    found = fits.leading_ellipse(time, plane)
    assert found is not None
    assert found.rate == pytest.approx(1.0, rel=1e-4)
    assert found.semi_axes == (pytest.approx(3.0, rel=1e-2), pytest.approx(2.0, rel=1e-2))
    assert fits.leading_ellipse(time[:60], plane[:60]) is None  # half a turn


@pytest.mark.parametrize(
    ("unit", "wanted"),
    [
        ("rad s-1", "rad/s"),
        ("kg m2 s-1", "kg m²/s"),
        ("kg m^2/s", "kg m²/s"),
        ("s^-4", "1/s⁴"),
        ("J", "J"),
        ("1", ""),
        ("", ""),
    ],
)
def test_units_read_as_people_write_them(unit: str, wanted: str) -> None:
    assert pretty_unit(unit) == wanted


def test_figure_axis_is_that_of_symmetry_or_of_the_largest_moment(symmetric_top: Build) -> None:
    assert signals.figure_index(np.array([2.0, 2.0, 1.0])) == 2
    assert signals.figure_index(np.array([1.0, 2.0, 2.0])) == 0
    assert signals.figure_index(np.array([1.0, 3.0, 2.0])) == 1
    dataset = symmetric_top()
    turned = json.dumps([[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    np.testing.assert_array_equal(
        signals.figure_direction(dataset.assign_attrs(principal_axes=turned)), [1.0, 0.0, 0.0]
    )
    asked = dataset.assign_attrs(config='[frame]\nfigure_axis = "y"\n')
    np.testing.assert_array_equal(signals.figure_direction(asked), [0.0, 1.0, 0.0])


def test_an_axis_that_is_nowhere_defined_has_no_path() -> None:
    """The figure axis of an average over a tumbling rotation."""
    angles = [[np.nan, 1.0], [np.nan, 1.25]]
    dataset = xarray.Dataset(
        dict.fromkeys(("obliquity", "node_longitude"), (("time", "axis"), angles)),
        coords={"axis": ["figure", "momentum"]},
    )
    assert signals.orientation(dataset, "figure") is None
    found = signals.orientation(dataset, "momentum")
    assert found is not None
    assert [column.tolist() for column in found] == [[1.0, 1.25], [1.0, 1.25]]
