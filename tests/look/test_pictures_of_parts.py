"""Timelines with dates, sources at a planet, and what pictures of a part are asked for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

import rigidsim
from rigidsim import RunFolderError
from rigidsim.look.solids import rotation_matrix
from rigidsim.look.stages.registry import build_picture
from rigidsim.look.timeline.drawn import build_clock, dated
from rigidsim.scene.epochs import parse_epoch
from rigidsim.store import pictures

Build = Callable[..., xarray.Dataset]


def test_clocks_of_scenes_with_an_epoch_have_its_dates() -> None:
    plain = build_clock(np.array([0.0, 1.5, 86400.0]))
    clock = dated(plain, parse_epoch("2000-01-01T12:00:00 TDB"))
    dates = clock.ticks.astype("datetime64[ns]")
    np.testing.assert_array_equal(
        dates,
        np.array(["2000-01-01T12:00:00", "2000-01-01T12:00:01.5", "2000-01-02T12:00:00"], "datetime64[ns]"),
    )
    assert clock.name == "date (TDB)"
    assert dated(plain, None) is plain
    assert dated(plain, parse_epoch("1066-10-14T09:00:00 TT")) is plain  # before the viewer's calendar
    terrestrial = dated(plain, parse_epoch("2020-01-01T00:00:00 UTC"))
    assert terrestrial.name == "date (TT)"
    assert terrestrial.ticks.astype("datetime64[ns]")[0] == np.datetime64("2020-01-01T00:01:09.184", "ns")


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


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"part": "left"}, "page, scene, plots is allowed"),
        ({"at": "40"}, "outside of the run; 0 s to 20 s is allowed"),
    ],
)
def test_odd_pictures_are_refused(
    symmetric_top: Build, tmp_path: Path, options: dict[str, str], said: str
) -> None:
    with pytest.raises(RunFolderError, match=said):
        pictures.draw(symmetric_top(), tmp_path / "a.png", **options)  # type: ignore[arg-type]
