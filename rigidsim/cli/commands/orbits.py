"""``rigidsim orbits``: tables of the planets' averaged elements."""

import sys
from pathlib import Path

from rigidsim.cli.screens.page import answer
from rigidsim.workflows.orbits import CHAOTIC, Orbits, write_orbits


def orbits(
    planets: list[str], end: str, every: str, window: str, kernel: str, out: Path, force: bool, resume: bool,
    as_json: bool,
) -> int:  # fmt: skip
    """Integrate the planets; 130 after Ctrl-C, which keeps the rows."""
    found = write_orbits(
        planets, end, every=every, window=window, kernel=kernel, out=out, force=force, resume=resume
    )
    answer(as_json, found.as_dict(), _print, found)
    return 0 if found.complete else 130


def _print(found: Orbits) -> None:
    for file in found.files:
        print(f"{file}: {found.rows:,} rows, mean semi-major axis {found.axes[file.stem]:.10f} au")
    if not found.complete:
        reached = f"{found.reached:,.6g} yr" if found.rows else "the first row"
        print(f"rigidsim: interrupted at {reached}; the rows are kept, --resume continues", file=sys.stderr)
    if abs(found.reached) > CHAOTIC:
        print("beyond some 50 Myr this orbit is one of many that fit the observations")
