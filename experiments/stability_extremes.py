"""Which formulation survives what? Scenes at every edge of the numbers, each run against its closed form.

Held against: closed forms at 50 digits. A run is right within three times the round-off law (Brouwer 1937),
or its own estimate or warnings cover the error within a factor of three, or the scene is refused with a
message; anything else is a wrong answer given in silence, and makes the exit code 1.

Run: python -m experiments.stability_extremes [--full] [--out DIR]     3 minutes; --full about an hour: other
precisions, steps to 1e8 radians, and a campaign of random scenes.
"""

from __future__ import annotations

import argparse
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

if not __package__:  # as a script
    sys.path.insert(0, str(Path(__file__).parents[1]))

from experiments.common import BLUE, GREEN, GREY, ORANGE, RED, add_arguments, new_figure, save, tidy
from experiments.extremes.judging import Verdict, judge
from experiments.extremes.random_scenes import random_case
from experiments.extremes.scenes import ANY, Extreme, all_scenes

NAME = "stability_extremes"
SEED = 20240607
RANDOM_SCENES = 1200
KINDS = ("right", "announced", "refused", "SILENT")


@dataclass(frozen=True)
class Way:
    """A column of the table."""

    title: str
    column: str
    precision: str = "double"
    hold: bool = False


WAYS = tuple(Way(name.replace("_", " "), name) for name in ANY)
MORE_WAYS = (
    Way("quaternion, single", "quaternion", "single"),
    Way("euler angles, single", "euler_angles", "single"),
    Way("closed form, single", "closed_form", "single"),
    Way("quaternion, extended", "quaternion", "extended"),
    Way("euler angles, extended", "euler_angles", "extended"),
    Way("quaternion, held", "quaternion", hold=True),
)

Tell = Callable[[str], None]


def examine(scenes: Iterable[Extreme], ways: Sequence[Way], tell: Tell) -> dict[Way, list[Verdict]]:
    """Run every scene in every way that it is of interest for."""
    found: dict[Way, list[Verdict]] = {way: [] for way in ways}
    for scene in scenes:
        for way in ways:
            if way.column not in scene.columns or (way.precision == "extended" and scene.end > 1e5):
                continue
            verdict = guarded(scene, way.column, way.precision, hold=way.hold)
            found[way].append(verdict)
            if verdict.kind == "SILENT":
                tell(verdict.line)
    return found


def guarded(scene: Extreme, column: str, precision: str, *, hold: bool = False) -> Verdict:
    """``judge``; what breaks down is no refusal."""
    try:
        return judge(scene, column, precision, hold=hold)
    except Exception as error:
        traceback.print_exc()
        text = f"broke down: {type(error).__name__}: {error}"
        return Verdict(scene, column, precision, "SILENT", np.nan, np.nan, None, text)


def campaign(count: int, seed: int, tell: Tell) -> list[Verdict]:
    """Random scenes, formulations, precisions and tolerances."""
    generator = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        scene, column, precision, hold = random_case(lambda a, b: float(generator.uniform(a, b)))
        verdict = guarded(scene, column, precision, hold=hold)
        found.append(verdict)
        if verdict.kind == "SILENT":
            tell(f"{verdict.line}\n{scene.text(column, precision, hold=hold)}")
    return found


def table(found: dict[Way, list[Verdict]]) -> str:
    """One row per extreme, one column per way; in brackets the largest error that was announced."""
    rows = dict.fromkeys(v.scene.row for verdicts in found.values() for v in verdicts)
    lines = [
        f"| extreme | {' | '.join(way.title for way in found)} |",
        f"| --- |{' --- |' * len(found)}",
    ]
    for row in rows:
        cells = [_cell([v for v in verdicts if v.scene.row == row]) for verdicts in found.values()]
        lines.append(f"| {row} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _cell(verdicts: Sequence[Verdict]) -> str:
    counts = Counter(v.kind for v in verdicts)
    parts = []
    for kind in KINDS:
        if counts[kind]:
            worst = max((v.error for v in verdicts if v.kind == kind), default=0.0)
            size = f" ({worst:.0e})" if kind in ("announced", "SILENT") else ""
            parts.append(f"{counts[kind]} {kind}{size}")
    return ", ".join(parts) or "-"


def totals(verdicts: Sequence[Verdict]) -> str:
    """The counts in one line."""
    counts = Counter(v.kind for v in verdicts)
    return f"{len(verdicts)} runs: " + ", ".join(f"{counts[kind]} {kind}" for kind in KINDS)


def draw(verdicts: Sequence[Verdict], out: Path) -> Path:
    """Errors over what the runs said of them: all below the line of a factor three, or announced in words."""
    figure = new_figure(9, 6.5, "No error is larger than the run says, unless it says so in words")
    axes = figure.subplots()
    shown = [v for v in verdicts if v.kind in ("right", "announced", "SILENT") and v.estimate is not None]
    for kind, color in (("right", GREEN), ("announced", ORANGE), ("SILENT", RED)):
        for warned, marker in ((False, "o"), (True, "x")):
            picked = [v for v in shown if v.kind == kind and bool(v.text) == warned]
            if picked:
                x = [min(max(v.estimate or 0.0, 1e-20), 1e2) for v in picked]
                y = [max(v.error, 1e-20) for v in picked]
                label = f"{kind}{', warned in words' if warned else ''} ({len(picked)})"
                axes.plot(x, y, marker, color=color, markersize=4, alpha=0.6, label=label, linestyle="none")
    line = np.array([1e-20, 1e2])
    axes.plot(line, 3 * line, color=GREY, linewidth=1, label="3 x estimate")
    axes.axvline(1e-2, color=BLUE, linewidth=0.8, linestyle=":", label="digits gone: warned from here on")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.legend(fontsize=8, loc="upper left")
    tidy(
        axes,
        "the run's own estimate, rad (1e2: larger)",
        "largest error against the closed form, rad (rates: relative)",
    )
    return save(figure, out, NAME)


def main(argv: Sequence[str] | None = None) -> int:
    """The command; exit code 1 where anything was wrong in silence."""
    parser = argparse.ArgumentParser(prog=f"python -m experiments.{NAME}")
    add_arguments(parser)
    parser.add_argument(
        "--random", type=int, default=None, help=f"random scenes ({RANDOM_SCENES} with --full)"
    )
    arguments = parser.parse_args(argv)
    tell = lambda text: print(text, file=sys.stderr, flush=True)  # noqa: E731
    ways = WAYS + (MORE_WAYS if arguments.full else ())
    found = examine(all_scenes(arguments.full), ways, tell)
    print(table({way: v for way, v in found.items() if way in WAYS}))
    if arguments.full:
        print("\n" + table({way: v for way, v in found.items() if way in MORE_WAYS}))
    verdicts = [v for part in found.values() for v in part]
    print("\n" + totals(verdicts))
    count = arguments.random if arguments.random is not None else RANDOM_SCENES if arguments.full else 0
    if count:
        random = campaign(count, SEED, tell)
        print("random scenes: " + totals(random))
        verdicts += random
    print(f"figure: {draw(verdicts, arguments.out)}")
    return int(not verdicts or any(v.kind == "SILENT" for v in verdicts))


if __name__ == "__main__":
    sys.exit(main())
