"""Timelines with dates, sources at a planet, and what pictures of a part are asked for."""

from pathlib import Path

import numpy as np
import pytest

import rigidsim
from rigidsim.look.stages.registry import build_picture


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
