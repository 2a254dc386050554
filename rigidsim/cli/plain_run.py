"""The usual ``rigidsim run CONFIG``, read without typer and the 36 modules that come with it.

They are 4 % of the CPU time of a whole short run (median of 25 pairs), by which it stays within 2.2 times
``python -c "import heyoka, h5py"`` (``experiments/benchmark.py``). Only what has one possible meaning is read
here; everything else, help and errors among it, is left to typer, whose reading of the same arguments is the
same (a test compares them).
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

_VALUES = {"--out": "out", "--set": "overrides"}
_FLAGS = {"--force": "force", "--json": "as_json"}
_COMPLETING = "_RIGIDSIM_COMPLETE"
"""Environment variable set when the shell asks for completions."""


def plain(arguments: Sequence[str]) -> dict[str, Any] | None:
    """Arguments for ``run_all``; None if typer has to read the command line.

    Args:
        arguments: the program's arguments.
    """
    if list(arguments[:1]) != ["run"] or _COMPLETING in os.environ:
        return None
    found: dict[str, Any] = {"configs": []}
    rest = iter(arguments[1:])
    for argument in rest:
        if argument in _FLAGS:
            found[_FLAGS[argument]] = True
        elif argument in _VALUES:
            value = next(rest, "-")
            if value.startswith("-"):  # a missing value, or one that looks like an option
                return None
            if argument == "--set":
                found.setdefault("overrides", []).append(value)
            else:
                found["out"] = Path(value)
        elif argument.startswith("-") or not argument:
            return None
        else:
            found["configs"].append(Path(argument))
    return found if found["configs"] else None
