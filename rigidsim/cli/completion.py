"""Completions that the shell offers on Tab: scenes, runs, and keys of a config."""

import types
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel

from rigidsim.scene.bodies.presets import PRESETS
from rigidsim.scene.bodies.shapes import SHAPES
from rigidsim.scene.choices import METHODS
from rigidsim.scene.fields import EULER_SEQUENCES
from rigidsim.scene.schema import Config
from rigidsim.workflows.ready_scenes import ALIASES, described

_NAMES: dict[str, Iterable[str]] = {
    "body.preset": PRESETS,
    "body.shape": SHAPES,
    "integrator.euler_sequence": EULER_SEQUENCES,
    "integrator.method": METHODS,
}


def scenes(incomplete: str) -> list[tuple[str, str]]:
    """Scenes of ``rigidsim new`` and their other names, with descriptions."""
    descriptions = described()
    known = {**descriptions, **{alias: descriptions[name] for alias, name in ALIASES.items()}}
    return [(name, text) for name, text in known.items() if name.startswith(incomplete)]


def runs(incomplete: str) -> list[str]:
    """Run folders in ``runs``; none elsewhere, so that the shell continues with its files."""
    found = sorted(str(path.parent) for path in Path("runs").glob("*/config.toml"))
    return [path for path in found if path.startswith(incomplete)]


def settings(incomplete: str) -> list[str]:
    """Keys for ``--set``, and after ``KEY=`` the values if these are names."""
    key, equals, _ = incomplete.partition("=")
    keys = dict(_keys("", Config))
    values = _NAMES.get(key) or _literals(keys.get(key))
    offered = [f"{key}={value}" for value in values] if equals else list(keys)
    return [text for text in offered if text.startswith(incomplete)]


def _keys(prefix: str, table: type[BaseModel]) -> Iterator[tuple[str, Any]]:
    """Dotted keys of a table and of the tables in it, with their annotations."""
    for name, field in table.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            yield from _keys(f"{prefix}{name}.", inner)
        else:
            yield f"{prefix}{name}", inner


def _literals(annotation: Any) -> Iterator[str]:
    if annotation is bool:
        yield from ("true", "false")
    elif get_origin(annotation) is Literal:
        yield from map(str, get_args(annotation))
    elif get_origin(annotation) in (Union, types.UnionType):
        for part in get_args(annotation):
            yield from _literals(part)
