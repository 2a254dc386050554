"""What takes the place of a file or folder is whole, or nothing changes."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest

from rigidsim.store.atomic import replacing, replacing_folder


class Cut(Exception):
    """Where a test breaks off."""


def test_a_file_that_fails_leaves_the_old_one_and_no_remains(tmp_path: Path) -> None:
    place = tmp_path / "file"
    with replacing(place) as new:
        new.write_text("old")
    with suppress(Cut), replacing(place) as new:
        new.write_text("torn")
        raise Cut
    assert place.read_text() == "old"
    with replacing(place) as new, replacing(tmp_path / "other") as other:
        assert other != new
        new.write_text("new")
        other.write_text("")
        assert place.read_text() == "old"
    assert place.read_text() == "new"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "other"]


def test_a_file_that_was_not_written_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), replacing(tmp_path / "file"):
        pass


def test_a_folder_that_fails_leaves_the_old_one_and_no_remains(tmp_path: Path) -> None:
    place = tmp_path / "folder"
    for text in ("old", "new"):
        with replacing_folder(place) as new:
            new.mkdir()
            (new / text).write_text(text)
        assert [path.name for path in place.iterdir()] == [text]
    with suppress(Cut), replacing_folder(place) as new:
        new.mkdir()
        raise Cut
    assert [path.name for path in place.iterdir()] == ["new"]
    assert list(tmp_path.iterdir()) == [place]
