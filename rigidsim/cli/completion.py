"""Completions that the shell offers on Tab: scenes, runs, and keys of a config."""

import pathlib
from collections.abc import Iterator

from rigidsim.scene.paths import Path
from rigidsim.scene.schema import Config
from rigidsim.workflows.ready_scenes import ALIASES, described


def scenes(incomplete: str) -> list[tuple[str, str]]:
    """Scenes of ``rigidsim new`` and their other names, with descriptions."""
    descriptions = described()
    known = {**descriptions, **{alias: descriptions[name] for alias, name in ALIASES.items()}}
    return [(name, text) for name, text in known.items() if name.startswith(incomplete)]


def runs(incomplete: str) -> list[str]:
    """Run folders in ``runs``; none elsewhere, so that the shell continues with its files."""
    found = sorted(str(path.parent) for path in pathlib.Path("runs").glob("*/config.toml"))
    return [path for path in found if path.startswith(incomplete)]


def settings(incomplete: str) -> list[str]:
    """Keys for ``--set``, and after ``KEY=`` the values if these are names."""
    key, equals, _ = incomplete.partition("=")
    offered = list(_keys(Path()))
    if equals:
        words = Path.of(key).taken(Config, {}).words if key in offered else []
        offered = [f"{key}={word}" for word in words]
    return [text for text in offered if text.startswith(incomplete)]


def _keys(path: Path) -> Iterator[str]:
    """Dotted keys of a config and of the tables in it."""
    inside = path.keys(Config, {})
    for key in inside:
        yield from _keys(path / key)
    if not inside:
        yield str(path)
