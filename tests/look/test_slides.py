"""Figures for slides, and the plate's wobble in space."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray
from typer.testing import CliRunner

pytest.importorskip("matplotlib")

from matplotlib.colors import to_rgb
from matplotlib.image import imread

import rigidsim
from rigidsim.cli.app import app
from rigidsim.look import figures

Build = Callable[..., xarray.Dataset]


@pytest.mark.parametrize("ground", ["dark"])
def test_a_slide_is_one_panel_in_letters_that_stand_out(symmetric_top: Build, ground: str) -> None:
    page = figures.figure(symmetric_top(), "rates")
    slide = figures.for_slides(symmetric_top(), "rates", ground)
    (axes,) = slide.axes
    assert len(axes.get_lines()) == 3
    ratio = slide.get_figwidth() / slide.get_figheight()
    assert ratio == pytest.approx(16 / 9, rel=0.06)
    # relative to the page that they are seen on
    letters = [f.axes[0].xaxis.label.get_fontsize() / f.get_figwidth() for f in (slide, page)]
    assert letters[0] > 1.25 * letters[1]
    back = np.mean(to_rgb(slide.get_facecolor()))
    texts = [axes.title, axes._left_title, axes.xaxis.label, axes.yaxis.label, *axes.get_legend().get_texts()]  # type: ignore[attr-defined]
    for text in (*texts, *axes.get_xticklabels(), *slide.texts):
        assert abs(np.mean(to_rgb(text.get_color())) - back) > 0.45
    for line in axes.get_lines():
        assert abs(np.mean(to_rgb(line.get_color())) - back) > 0.25


def test_the_command_draws_slides_and_refuses_other_grounds(symmetric_top: Build, tmp_path: Path) -> None:
    text = 'name = "a"\n[body]\nprincipal_moments = [1, 2, 3]\n[initial]\nangular_velocity = [0.1, 1, 0.1]\n'
    rigidsim.run(rigidsim.parse(f"{text}[time]\nend = 20\nsamples = 101\n"), out=tmp_path)
    run = CliRunner().invoke
    told = run(app, ["plot", str(tmp_path / "a"), "--for-slides", "dark"])
    assert told.exit_code == 0, told.output
    picture = imread(tmp_path / "a" / "figure_slide.png")
    assert picture.shape[1] == 1900
    assert picture[..., :3].mean() < 0.25
    refused = run(app, ["plot", str(tmp_path / "a"), "--for-slides", "green"])
    assert refused.exit_code != 0
    assert "light or dark" in " ".join(refused.output.split())


def test_a_thin_plate_wobbles_twice_a_turn(symmetric_top: Build) -> None:
    """I = (1, 1, 2): the axis turns by L t / A about L, the body by L cos(theta) / C about the axis."""
    dataset = symmetric_top()
    assert "wobble" in figures.available(dataset)
    (axes,) = figures.figure(dataset, "wobble").axes
    wobble, spin = (line.get_ydata()[-1] for line in axes.get_lines())
    momentum = dataset["angular_momentum"].values[0]
    cosine = np.cos(0.5)
    assert wobble == pytest.approx(
        np.linalg.norm(momentum) * float(dataset["time"][-1]) / (2 * np.pi), rel=1e-6
    )
    assert wobble / spin == pytest.approx(2 / cosine, rel=1e-9)
