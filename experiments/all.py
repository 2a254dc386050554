"""Do all studies pass? Runs each at reduced length (--full: at full length) and prints one table.

Held against: every study's own published numbers and closed forms. A study that breaks down counts as failed.
A new study is one more name in STUDIES: a module of this folder with ``study(full)`` under ``@Study``.

Run: python -m experiments.all [--full] [--out DIR] [NAME ...]      exit code 1 if anything failed
"""

import argparse
import importlib
import sys
import time
import traceback
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from experiments.common import DEFAULT_OUT, Check, table

STUDIES = (
    "earth_free_nutation",
    "heavy_top_regimes",
    "flip_period",
    "precession_and_nutation",
    "spectral_lines",
    "hyperion",
    "sweep_coverage",
    "apophis_flyby",
    "averaged_motions",
    "whole_cycle",
    "cassini_states",
    "tumbling_averages",
    "damped_averages",
    "rigid_earth",
    "real_moon",
    "mars_rotation",
    "mercury_librations",
    "phobos_and_vesta",
    "apophis_real_sky",
    "fitted_bodies",
)


def run_studies(names: Sequence[str], full: bool, out: Path) -> tuple[list[Check], list[str]]:
    """Checks of studies, named after them, and the names of those that broke down; stderr has the times."""
    checks: list[Check] = []
    broken = []
    for name in names:
        started = time.process_time()
        try:
            study = importlib.import_module(f"experiments.{name}").study
            found = study(full, out)
        except Exception:
            traceback.print_exc()
            broken.append(name)
            continue
        checks += [replace(check, name=f"{name}: {check.name}") for check in found]
        seconds = time.process_time() - started
        print(f"{name}: {len(found)} checks, {seconds:.1f} s CPU", file=sys.stderr, flush=True)
    return checks, broken


def main(argv: Sequence[str] | None = None) -> int:
    """Run them, print the table, return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m experiments.all")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"default: {', '.join(STUDIES)}")
    parser.add_argument("--out", type=Path, default=DEFAULT_OUT, help="folder of the figures")
    parser.add_argument("--full", action="store_true", help="longer runs and more cases")
    arguments = parser.parse_args(argv)
    checks, broken = run_studies(arguments.names or STUDIES, arguments.full, arguments.out)
    print(table(checks, "All studies"))
    for name in broken:
        print(f"{name}: BROKE DOWN, see the traceback above")
    print(f"figures: {arguments.out}")
    return int(bool(broken) or not checks or not all(check.passed for check in checks))


if __name__ == "__main__":
    sys.exit(main())
