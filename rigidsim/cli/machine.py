"""Output of ``--json``: what every JSON reader takes, whatever a result holds."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any


def print_json(value: Any, *, indent: int | None = None) -> None:
    """Print a result as strict JSON: null for nan and infinities, [real, imaginary] for complex ones.

    Raises:
        TypeError: something in it has no place in JSON.
    """
    print(json.dumps(_plain(value), indent=indent, allow_nan=False), flush=True)


def _plain(value: Any) -> Any:
    """The same with nothing but what JSON has."""
    if hasattr(value, "tolist"):  # numpy's numbers and arrays, known without loading numpy for this
        value = value.tolist()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, complex):
        return [_plain(value.real), _plain(value.imag)]
    if isinstance(value, Mapping):
        return {key: _plain(content) for key, content in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(content) for content in value]
    return value
