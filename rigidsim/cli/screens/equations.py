"""The equations of a plan on a screen."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence

from rigidsim.cli.screens.page import Page

MOST = 40
"""Lines of equations at most."""
_DIGITS = 6
_NUMBER = re.compile(r"(?<![\w.])\d+(?:\.\d*)?(?:e[+-]?\d+)?(?![\w.])")


def print_equations(shared: Sequence[str], equations: Sequence[str], on: Page) -> None:
    """Shared terms and the equations with them, with numbers to six digits; of many lines the first.

    Args:
        shared, equations: as of ``rigidsim.model.equation_text``.
    """
    on.say(("equations (internal units: powers of two)", "bold"))
    lines: list[str] = []
    for equation in [*shared, *equations]:
        lines += textwrap.wrap(
            shortened(equation),
            max(on.width, 40),
            initial_indent="  ",
            subsequent_indent=" " * 8,
            break_long_words=False,
            break_on_hyphens=False,
        )
    for line in lines[:MOST]:
        on.say(line, whole=True)
    if len(lines) > MOST:
        on.say((f"  and {len(lines) - MOST} more lines; `--json` has all of them, with all digits", "dim"))


def shortened(line: str) -> str:
    """A line with its numbers to six significant digits."""
    return _NUMBER.sub(lambda found: f"{float(found[0]):.{_DIGITS}g}", line)
