"""SPICE's toolkit, through spiceypy: loaded where it is needed, its pool of kernels left as it was found."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from rigidsim.scene.kernels.kernel import KernelError

_EXTRA = "pip install 'rigidsim[spice]'"
_LONGEST_PATH = 255  # characters that SPICE's loader takes


@cache
def spice() -> Any:
    """The package spiceypy.

    Raises:
        KernelError: it isn't installed.
    """
    try:
        return importlib.import_module("spiceypy")
    except ImportError:
        what = f"which SPICE's toolkit reads and writes, and the package spiceypy isn't installed: {_EXTRA}"
        raise KernelError(what) from None


@contextmanager
def loaded(*paths: Path) -> Iterator[Any]:
    """spiceypy with some kernels loaded, which are unloaded again.

    Raises:
        KernelError: SPICE refuses a kernel, or what is asked of it within the block.
    """
    toolkit = spice()
    long = next((path for path in paths if len(str(path)) > _LONGEST_PATH), None)
    if long is not None:
        raise KernelError(f"whose path has {len(str(long))} characters, of which SPICE takes {_LONGEST_PATH}")
    done: list[str] = []
    try:
        for path in paths:
            toolkit.furnsh(str(path))
            done.append(str(path))
        yield toolkit
    except toolkit.utils.exceptions.SpiceyError as error:
        raise KernelError(f"which SPICE refuses ({_words(error)})") from None
    finally:
        for name in reversed(done):
            toolkit.unload(name)


def _words(error: Any) -> str:
    """The first sentence of what SPICE says, without line breaks."""
    short, text = str(error.short), " ".join(str(error.long).split())
    return f"{short}: {text.split('. ')[0][:160]}"
