"""What pictures of a part are asked for."""

from collections.abc import Callable
from pathlib import Path

import pytest
import xarray

from rigidsim.look import film
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
