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
"""Set where the shell asks what could come next."""


def plain(arguments: Sequence[str]) -> dict[str, Any] | None:
    """What ``run_all`` is to be called with; None: typer has to read it.

    Args:
        arguments: of the program.
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
            if value.startswith("-"):  # a value that is missing, or looks like an option
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
