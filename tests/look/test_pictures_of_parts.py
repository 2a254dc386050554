"""Timelines with dates, sources at a planet, and what pictures of a part are asked for."""

from pathlib import Path

import numpy as np
import pytest

import rigidsim
from rigidsim.look.solids import rotation_matrix
from rigidsim.look.stages.registry import build_picture


@pytest.mark.slow
def test_the_sun_and_the_moon_stand_where_they_are() -> None:
    config = Path(__file__).parents[2] / "configs" / "bodies" / "earth_moon_sun.toml"
    overrides = ["time.end='30 day'", "output.estimate=false"]
    dataset = rigidsim.run(rigidsim.load(config, overrides=overrides), out=None).dataset
    stage = build_picture(dataset)[0].stages[0]
    arrows = {arrow.label: arrow for arrow in stage.arrows if arrow.label.startswith("to the")}
    assert set(arrows) == {"to the Sun", "to the Moon"}
    for arrow in arrows.values():
        (ball,) = [one for one in stage.solids if one.place == f"towards_{arrow.name}"]
        x, y, z, w = stage.frames[ball.place].T
        placed = rotation_matrix(np.stack([w, x, y, z], axis=1)) @ ball.mesh.vertices.mean(axis=0)
        way = arrow.vectors / np.linalg.norm(arrow.vectors, axis=1)[:, None]
        along = np.einsum("ti,ti->t", placed, way)
        np.testing.assert_allclose(along, np.linalg.norm(placed, axis=1), rtol=1e-6)
        assert (along > np.linalg.norm(arrow.vectors, axis=1)).all()
