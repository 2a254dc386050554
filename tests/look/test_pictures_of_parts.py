"""Timelines with dates, sources at a planet, and what pictures of a part are asked for."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

import rigidsim
from rigidsim.look import film
from rigidsim.look.stages.registry import build_picture
from rigidsim.store import pictures


def test_a_picture_of_the_scene_alone_is_drawn_at_its_moment_in_any_unit(
    symmetric_top: Callable[..., xarray.Dataset], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def render(path: Path, target: Path, **options: object) -> None:
        asked.append(options["at"])
        target.write_bytes(b"")

    monkeypatch.setattr(film, "render", render)
    dataset = symmetric_top(scale=60.0).assign_attrs(time_unit="min")  # twenty minutes
    for at in ("5", "300 s", "5 min"):
        pictures.draw(dataset, tmp_path / "a.png", at=at, part="scene")
    assert asked == pytest.approx([0.25] * 3)


@pytest.mark.slow
def test_the_sun_and_the_moon_stand_where_they_are() -> None:
    config = Path(__file__).parents[2] / "configs" / "bodies" / "earth_moon_sun.toml"
    overrides = ["time.end='30 day'", "output.estimate=false"]
    dataset = rigidsim.run(rigidsim.load(config, overrides=overrides), out=None).dataset
    stage = build_picture(dataset)[0].stages[0]
    arrows = {part.words: part for part in stage.parts if part.words.startswith("direction of")}
    assert set(arrows) == {"direction of the Sun", "direction of the Moon"}
    for words, arrow in arrows.items():
        name, positions = words.removeprefix("direction of the ").lower(), dataset["point_mass_position"]
        place = (
            (positions.sel(point_mass=name) - positions.sel(point_mass="earth")).transpose("time", ...).values
        )
        np.testing.assert_allclose(
            arrow.values / np.linalg.norm(arrow.values, axis=1)[:, None],
            place / np.linalg.norm(place, axis=1)[:, None],
            atol=1e-9,
        )
