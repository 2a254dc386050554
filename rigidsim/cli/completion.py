"""Completions that the shell offers on Tab: scenes, runs, and keys of a config, without heavy imports."""

from __future__ import annotations

import types
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Union, get_args, get_origin

if TYPE_CHECKING:
    from pydantic import BaseModel


def scenes(incomplete: str) -> list[tuple[str, str]]:
    """Templates of ``rigidsim new`` with their descriptions."""
    from rigidsim.workflows.templates import described

    return [(name, text) for name, text in described().items() if name.startswith(incomplete)]


def runs(incomplete: str) -> list[str]:
    """Run folders in ``runs``; none elsewhere, so that the shell continues with its files."""
    found = sorted(str(path.parent) for path in Path("runs").glob("*/config.toml"))
    return [path for path in found if path.startswith(incomplete)]


def settings(incomplete: str) -> list[str]:
    """Keys for ``--set``, and after ``KEY=`` the values if these are names."""
    from rigidsim.scene import schema

    key, equals, _ = incomplete.partition("=")
    keys = dict(_keys("", schema.Config))
    offered = [f"{key}={value}" for value in _values(key, keys.get(key))] if equals else list(keys)
    return [text for text in offered if text.startswith(incomplete)]


def _keys(prefix: str, table: type[BaseModel]) -> Iterator[tuple[str, Any]]:
    """Dotted keys of a table and of the tables in it, with their annotations."""
    from pydantic import BaseModel

    for name, field in table.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            yield from _keys(f"{prefix}{name}.", inner)
        else:
            yield f"{prefix}{name}", inner


def _values(key: str, annotation: Any) -> list[str]:
    from rigidsim.scene.bodies.presets import PRESETS
    from rigidsim.scene.bodies.shapes import SHAPES
    from rigidsim.scene.fields import EULER_SEQUENCES
    from rigidsim.scene.methods import METHODS

    names: dict[str, Iterable[str]] = {
        "body.preset": PRESETS,
        "body.shape": SHAPES,
        "integrator.euler_sequence": EULER_SEQUENCES,
        "integrator.method": METHODS,
    }
    return list(names[key] if key in names else _literals(annotation))


def _literals(annotation: Any) -> Iterator[str]:
    if annotation is bool:
        yield from ("true", "false")
    elif get_origin(annotation) is Literal:
        yield from (str(value) for value in get_args(annotation))
    elif get_origin(annotation) in (Union, types.UnionType):
        for part in get_args(annotation):
            yield from _literals(part)
