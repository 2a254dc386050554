"""Pages on which commands print: plain text if stdout is piped, colours on a terminal.

Texts are never read as markup. The library that draws on terminals takes longer to load than many runs take,
so it isn't where nothing but lines of text is wanted.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text

Styled: TypeAlias = "str | tuple[str, str]"
"""A text, or a text with its style on a terminal."""

_PIPED_WIDTH = 110  # columns, where there is no terminal and COLUMNS says nothing
_LEAST_WIDTH = 40
_LABEL = 8
_BETWEEN = "   "  # what stands between the columns of a table
_WORD = re.compile(r"\s*\S+\s*")
_NUMBERS = ("largest drift", "final", "bound", "initial", "put back")


class Page:
    """Prints plain lines on stdout."""

    def __init__(self) -> None:
        self._width = _piped_width()

    @property
    def width(self) -> int:
        """Width in columns."""
        return self._width

    def say(self, *parts: Styled, whole: bool = False) -> None:
        """Print a text, broken between words.

        Args:
            parts: parts of one line, each possibly with a style.
            whole: leave breaking to the terminal.
        """
        text = "".join(map(_bare, parts))
        if whole:
            print(text)
        elif _is_narrow(text):
            print("\n".join(_broken(text, self._width)))
        else:
            _Screen.of_stdout().say(*parts)

    def line(self, label: str, text: str, style: str = "") -> None:
        """Print a label and a text that is broken between words, indented."""
        if len(label) > _LABEL or not _is_narrow(label + text):
            _Screen.of_stdout().line(label, text, style)
            return
        for number, part in enumerate(_broken(text, self._width - _LABEL - 1)):
            print(f"{'' if number else label:{_LABEL}} {part}".rstrip())

    def fits(self, columns: Sequence[str], rows: Iterable[Sequence[Styled]]) -> bool:
        """Whether a table fits without folding."""
        return sum(_widths(columns, rows)) + len(_BETWEEN) * (len(columns) - 1) <= self.width

    def table(self, columns: Sequence[str], rows: Iterable[Sequence[Styled]]) -> None:
        """Print a table under the names of its columns."""
        rows = [tuple(row) for row in rows]
        lines = [tuple(columns), *(tuple(map(_bare, row)) for row in rows)]
        widths = _widths(columns, rows)
        whole = sum(widths) + len(_BETWEEN) * (len(widths) - 1)
        if whole > self._width or not all(_is_narrow(cell) and "\n" not in cell for cell in sum(lines, ())):
            _Screen.of_stdout().table(columns, rows)
            return
        for number, line in enumerate(lines):
            cells = [
                cell.rjust(width) if name in _NUMBERS else cell.ljust(width)
                for cell, width, name in zip(line, widths, columns, strict=True)
            ]
            print(_BETWEEN.join(cells).rstrip())
            if number == 0:
                print("─" * whole)


class _Screen(Page):
    """Prints on a terminal, or on something made to look like one."""

    def __init__(self, console: Console) -> None:
        self._console = console

    @property
    def width(self) -> int:
        """Width in columns."""
        return self._console.width

    @classmethod
    def of_stdout(cls) -> _Screen:
        return cls(console())

    def say(self, *parts: Styled, whole: bool = False) -> None:
        self._console.print(_text(*parts), soft_wrap=whole)

    def line(self, label: str, text: str, style: str = "") -> None:
        from rich.table import Table

        line = Table.grid(padding=(0, 1))
        line.add_column(width=_LABEL)
        line.add_column(overflow="fold")
        line.add_row(_text((label, style)), _text((text, style)))
        self._console.print(line)

    def table(self, columns: Sequence[str], rows: Iterable[Sequence[Styled]]) -> None:
        from rich.box import SIMPLE_HEAD
        from rich.table import Table

        table = Table(box=SIMPLE_HEAD, pad_edge=False, show_edge=False)
        for name in columns:
            table.add_column(_text(name), justify="right" if name in _NUMBERS else "left", overflow="fold")
        for row in rows:
            table.add_row(*map(_text, row))
        self._console.print(table)


def _piped_width() -> int:
    """Width of piped output: enough for whole words, unless the reader asks for another."""
    return max(_LEAST_WIDTH, shutil.get_terminal_size((_PIPED_WIDTH, 24)).columns)


def console() -> Console:
    """Console on stdout, wide enough for whole words when piped."""
    from rich.console import Console

    width = None if sys.stdout.isatty() else _piped_width()
    return Console(width=width, highlight=False)


def page(out: Console | None = None) -> Page:
    """The page for a command: a given console, or stdout in the way that suits it."""
    if out is not None:
        return _Screen(out)
    colours = any(os.environ.get(name) for name in ("FORCE_COLOR", "TTY_COMPATIBLE"))
    screen = sys.stdout is not None and sys.stdout.isatty()  # it may be closed
    return _Screen.of_stdout() if screen or colours else Page()


def _widths(columns: Sequence[str], rows: Iterable[Sequence[Styled]]) -> list[int]:
    lines = [tuple(columns), *(tuple(map(_bare, row)) for row in rows)]
    return [max(map(len, column)) for column in zip(*lines, strict=True)]


def _bare(part: Styled) -> str:
    return part if isinstance(part, str) else part[0]


def _text(*parts: Styled) -> Text:
    from rich.text import Text

    made: Any = Text.assemble(*parts)
    return made if len(parts) > 1 else Text(_bare(parts[0]), "" if isinstance(parts[0], str) else parts[0][1])


def _is_narrow(text: str) -> bool:
    """Whether each letter surely takes one column."""
    return all(" " <= c < "\u0300" or "\u0370" <= c < "\u0400" or c in "\n′″–—…×→" for c in text)


def _broken(text: str, width: int) -> list[str]:
    """Lines of at most ``width`` characters, broken between words if possible."""
    lines = []
    for line in text.split("\n"):
        parts = [""]
        for word in _WORD.findall(line):
            if len(parts[-1]) + len(word.rstrip()) > width and parts[-1]:
                parts.append("")
            while len(word.rstrip()) > width:
                parts[-1] = word[:width]
                word = word[width:]
                parts.append("")
            parts[-1] += word
        lines += [part.rstrip() for part in parts]
    return lines
