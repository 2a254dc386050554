"""The standard figure: what is on the page and in which units."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import xarray

pytest.importorskip("matplotlib")

from matplotlib.image import imread

from rigidsim.look import figures, panels
from rigidsim.look.plots import pretty_unit

Build = Callable[..., xarray.Dataset]


def titles(dataset: xarray.Dataset) -> list[str]:
    page = figures._page(
        figures.thin(dataset, 100).assign_attrs(dataset.attrs), largest={"energy": 1e-13}, complete=True
    )
    return [axes.get_title("left") or axes.get_title() for axes in page.axes]


def inked(path: Path) -> float:
    """Part of a picture that isn't white."""
    return float((imread(path)[..., :3].min(axis=2) < 0.9).mean())


def test_png_is_a_picture_with_ink(symmetric_top: Build, tmp_path: Path) -> None:
    assert figures.save_figure(symmetric_top(), tmp_path / "f.png") == tmp_path / "f.png"
    picture = imread(tmp_path / "f.png")
    assert min(picture.shape[:2]) > 600
    assert 0.01 < inked(tmp_path / "f.png") < 0.6
    assert list(tmp_path.iterdir()) == [tmp_path / "f.png"]


def test_svg_is_well_formed(symmetric_top: Build, tmp_path: Path) -> None:
    figures.save_figure(symmetric_top(), tmp_path / "f.svg")
    assert ElementTree.parse(tmp_path / "f.svg").getroot().tag.endswith("svg")


@pytest.mark.parametrize("name", ["f.pdf", "f", "f.png.txt"])
def test_other_suffix_is_refused_with_those_allowed(symmetric_top: Build, tmp_path: Path, name: str) -> None:
    with pytest.raises(ValueError, match=r"must be one of \.png, \.svg"):
        figures.save_figure(symmetric_top(), tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_free_top_has_its_polhode_on_the_ellipsoid(symmetric_top: Build) -> None:
    found = titles(symmetric_top())
    assert found[:4] == [
        "Angular velocity, body axes",
        "Direction of the body's z axis in space",
        "Drift of invariants",
        "Polhode on the ellipsoid of inertia",
    ]


def test_moments_that_do_not_fit_the_motion_draw_no_ellipsoid(symmetric_top: Build) -> None:
    dataset = symmetric_top()
    dataset.attrs["principal_moments"] = "[1, 2, 2]"
    assert "Polhode: the tip of ω in body axes" in titles(dataset)
    del dataset.attrs["principal_moments"]
    assert "Polhode: the tip of ω in body axes" in titles(dataset)


def test_rates_only_and_moving_runs_have_their_panels(symmetric_top: Build) -> None:
    dataset = symmetric_top()
    rates = titles(dataset[["angular_velocity"]])
    assert rates[0] == "Angular velocity, body axes"
    assert not any("z axis" in t for t in rates)
    moving = dataset.assign(position=(("time", "space_axis"), np.ones((1001, 3))))
    assert "Position in space" in titles(moving)
    angles = dataset.assign(euler_angles=(("time", "euler_angle"), np.ones((1001, 3))))
    assert "Euler angles" in titles(angles)


@pytest.mark.parametrize(
    ("span", "wanted"),
    [
        (1e-12, (1e-12, "ps")),
        (40.0, (1.0, "s")),
        (90.0, (1.0, "s")),
        (600.0, (60.0, "min")),
        (86400.0, (3600.0, "h")),
        (40 * 86400.0, (86400.0, "d")),
        (50 * 365.25 * 86400, (365.25 * 86400, "yr")),
        (3e6 * 365.25 * 86400, (365.25e6 * 86400, "Myr")),
    ],
)
def test_time_axis_reads_in_the_unit_of_its_span(span: float, wanted: tuple[float, str]) -> None:
    scale, unit = panels.time_scale(np.array([0.0, span]))
    assert unit == wanted[1]
    assert scale == pytest.approx(wanted[0])


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


def test_largest_drift_is_that_of_every_sample(
    symmetric_top: Build, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dataset = symmetric_top(count=9999)
    dataset["energy_drift"][4567] = -3e-9  # between the samples that the curves show
    found: list[tuple[dict[str, float], bool]] = []
    monkeypatch.setattr(panels, "facts", lambda *_, largest, complete: found.append((largest, complete)))
    figures.save_figure(dataset, tmp_path / "f.png")
    monkeypatch.setattr(figures, "FULL_READ", 5000)
    figures.save_figure(dataset, tmp_path / "f.png")
    assert found[0] == ({"energy": 3e-9}, True)
    assert found[1] == ({"energy": pytest.approx(1e-16 * 9998)}, False)


def test_fast_spin_does_not_press_the_other_angles_flat(symmetric_top: Build) -> None:
    dataset = symmetric_top()
    seconds = dataset["time"].values
    angles = np.stack([0 * seconds, 0.1 * np.sin(seconds), 40 * seconds + 0.2 * np.sin(seconds)], axis=1)
    dataset["euler_angles"] = (("time", "euler_angle"), angles)
    shown, labels = panels._without_growth(dataset, np.rad2deg(angles))
    assert labels[:2] == ["φ", "θ"]
    assert labels[2].startswith("ψ − 6.3")
    assert labels[2].endswith("turns/s")
    # The swing of 0.2 rad both ways, and what the mean growth misses of it at the end.
    assert np.ptp(shown[:, 2]) < np.rad2deg(3 * 0.2)
    np.testing.assert_array_equal(shown[:, 1], np.rad2deg(angles[:, 1]))


def test_values_get_si_prefixes() -> None:
    assert panels.si_scale(np.array([7e-5]), "rad/s") == (pytest.approx(1e-6), "µrad/s")
    assert panels.si_scale(np.array([4.2e7]), "m") == (pytest.approx(1e6), "Mm")
    assert panels.si_scale(np.zeros(3), "m") == (1.0, "m")
    assert panels.si_scale(np.array([1.5e21]), "m")[1] == "1e21 m"


def test_one_sample_and_nan_are_drawn(symmetric_top: Build, tmp_path: Path) -> None:
    figures.save_figure(symmetric_top().isel(time=[0]), tmp_path / "one.png")
    broken = symmetric_top(count=30).copy(deep=True)
    for name in ("quaternion", "angular_velocity", "energy_drift"):
        broken[name][-3:] = np.nan
    figures.save_figure(broken, tmp_path / "nan.png")
    figures.save_figure(symmetric_top(count=30), tmp_path / "whole.png")
    # axes and titles at least; and a tenth of the samples less leaves most of the curves
    assert 0.005 < inked(tmp_path / "one.png") < inked(tmp_path / "whole.png")
    assert inked(tmp_path / "nan.png") > 0.7 * inked(tmp_path / "whole.png")
