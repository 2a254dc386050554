"""What commands print: lines and tables, with colours on a terminal, and JSON for machines."""

import json
import math
import shutil
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeAlias

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

Styled: TypeAlias = str | tuple[str, str]
"""A text, or a text with its style on a terminal; neither is read as markup."""

_PIPED_WIDTH = 110  # columns, where there is no terminal and COLUMNS says nothing
_LEAST_WIDTH = 40
_LABEL = 8
_BETWEEN = 3  # columns of space between a table's columns
_NUMBERS = ("largest drift", "final", "bound", "initial", "correction")


class Page:
    """Prints on a console, by default on stdout, wide enough for whole words where it is piped."""

    def __init__(self, out: Console | None = None) -> None:
        terminal = sys.stdout is not None and sys.stdout.isatty()  # it may be closed
        piped = max(_LEAST_WIDTH, shutil.get_terminal_size((_PIPED_WIDTH, 24)).columns)
        self.console = out or Console(width=None if terminal else piped, highlight=False)

    @property
    def width(self) -> int:
        """Width in columns."""
        return self.console.width

    def say(self, *parts: Styled, whole: bool = False) -> None:
        """Print one line of parts, broken between words unless it stays ``whole``."""
        self.console.print(Text.assemble(*parts), soft_wrap=whole)

    def line(self, label: str, text: str, style: str = "") -> None:
        """Print a label and a text that is broken between words, indented."""
        for part in Text(text, style).wrap(self.console, self.width - _LABEL - 1):
            part.rstrip()
            self.console.print(Text.assemble((f"{label:{_LABEL}} ", style), part))
            label = ""

    def lines(self, label: str, texts: Iterable[str], style: str = "") -> None:
        """Print each text with the label."""
        for text in texts:
            self.line(label, text, style)

    def fits(self, columns: Sequence[str], rows: Iterable[Sequence[Styled]]) -> bool:
        """Whether a table fits without folding."""
        lines = [columns, *([Text.assemble(cell).plain for cell in row] for row in rows)]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        return sum(widths) + _BETWEEN * (len(widths) - 1) <= self.width

    def table(self, columns: Sequence[str], rows: Iterable[Sequence[Styled]], *, ruled: bool = True) -> None:
        """Print a table under the names of its columns, ``ruled`` off."""
        table = Table(box=SIMPLE_HEAD if ruled else None, pad_edge=False, show_edge=False)
        for name in columns:
            table.add_column(Text(name), justify="right" if name in _NUMBERS else "left", overflow="fold")
        for row in rows:
            table.add_row(*map(Text.assemble, row))
        self.console.print(table)


def answer(as_json: bool, result: Any, screen: Callable[..., None], *shown: Any) -> None:
    """Print a result as JSON for machines, or what a screen shows of it."""
    if as_json:
        print_json(result)
    else:
        screen(*shown)


def print_json(value: Any, *, indent: int | None = None) -> None:
    """Print a result as strict JSON: null for nan and infinities, [real, imaginary] for complex ones."""
    print(json.dumps(_plain(value), indent=indent, allow_nan=False), flush=True)


def _plain(value: Any) -> Any:
    """The same with nothing but what JSON has."""
    if hasattr(value, "tolist"):  # numpy's numbers and arrays
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


def reporting(subject: str) -> Callable[[str], None]:
    """A function that shows lines on the progress of something, on stderr."""
    return lambda text: print(f"{subject}: {text}", file=sys.stderr, flush=True)
