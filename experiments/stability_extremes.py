"""Which formulation survives what? Scenes at every edge of the numbers, each run against its closed form.

Held against: closed forms at 50 digits. A run is right within three times the round-off law (Brouwer 1937),
or its own estimate or warnings cover the error within a factor of three, or the scene is refused with a
message; anything else is a wrong answer given in silence, and makes the exit code 1.

Run: python -m experiments.stability_extremes [--full] [--out DIR]     3 minutes; --full about an hour: other
precisions, steps to 1e8 radians, and a campaign of random scenes.
"""

import sys
import traceback
from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from experiments.common import Answer, Check, Curve, Panel, Picture, Study
from experiments.extremes.judging import Verdict, judge
from experiments.extremes.scenes import ANY, Extreme, Way, all_scenes, random_case

SEED = 20240607
RANDOM_SCENES = 1200
KINDS = ("right", "announced", "refused", "SILENT")


WAYS = tuple(map(Way, ANY))
MORE_WAYS = (
    *(Way(column, "single") for column in ("quaternion", "euler_angles", "closed_form")),
    *(Way(column, "extended") for column in ("quaternion", "euler_angles")),
    Way("quaternion", hold=True),
)


def examine(scenes: Iterable[Extreme], ways: Sequence[Way]) -> dict[Way, list[Verdict]]:
    """Run every scene in every way that it is of interest for."""
    found: dict[Way, list[Verdict]] = {way: [] for way in ways}
    for scene in scenes:
        for way in ways:
            if way.column in scene.columns and (way.precision != "extended" or scene.end <= 1e5):
                found[way].append(guarded(scene, way))
    return found


def guarded(scene: Extreme, way: Way) -> Verdict:
    """``judge``; what breaks down is no refusal. What is silent is shown with its scene."""
    try:
        verdict = judge(scene, way)
    except Exception as error:
        traceback.print_exc()
        verdict = Verdict(scene, way, "SILENT", f"broke down: {type(error).__name__}: {error}")
    if verdict.kind == "SILENT":
        print(f"{verdict.line}\n{scene.text(way)}", file=sys.stderr, flush=True)
    return verdict


def campaign(count: int, seed: int) -> list[Verdict]:
    """Random scenes, formulations, precisions and tolerances."""
    generator = np.random.default_rng(seed)
    return [guarded(*random_case(lambda a, b: float(generator.uniform(a, b)))) for _ in range(count)]


def tabulated(found: dict[Way, list[Verdict]]) -> str:
    """One row per extreme, one column per way; in brackets the largest error that was announced."""
    rows = dict.fromkeys(v.scene.row for verdicts in found.values() for v in verdicts)
    lines = [f"| extreme | {' | '.join(way.title for way in found)} |", f"| --- |{' --- |' * len(found)}"]
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


def picture(verdicts: Sequence[Verdict]) -> Picture:
    """Errors over what the runs said of them: all below the line of a factor three, or announced in words."""
    line = np.array([1e-20, 1e2])
    curves = [Curve(line, 3 * line, "3 x estimate", "grey"),
              Curve(1e-2, None, "digits gone: warned from here on", "blue", ":", 0.8)]  # fmt: skip
    for kind, color in (("right", "green"), ("announced", "orange"), ("SILENT", "red")):
        for warned, marker in ((False, "o"), (True, "x")):
            picked = [(min(max(v.estimate, 1e-20), 1e2), max(v.error, 1e-20)) for v in verdicts
                      if v.kind == kind and bool(v.text) == warned and v.estimate is not None]  # fmt: skip
            if picked:
                label = f"{kind}{', warned in words' if warned else ''} ({len(picked)})"
                curves.append(Curve(*np.array(picked).T, label, color, marker, 1))
    panel = Panel("", "the run's own estimate, rad (1e2: larger)",
                  "largest error against the closed form, rad (rates: relative)", curves, "xy",
                  legend="upper left")  # fmt: skip
    return Picture("No error is larger than the run says, unless it says so in words", "a", [panel], (9, 6.5))


@Study
def extremes(full: bool, random: int = -1) -> Answer:
    """The table, and so many random scenes (1200 with --full)."""
    found = examine(all_scenes(full), WAYS + (MORE_WAYS if full else ()))
    for ways in (WAYS, MORE_WAYS) if full else (WAYS,):
        print(tabulated({way: found[way] for way in ways}) + "\n")
    verdicts = [v for part in found.values() for v in part]
    print(totals(verdicts))
    drawn = campaign(random if random >= 0 else RANDOM_SCENES if full else 0, SEED)
    print("random scenes: " + totals(drawn))
    silent = sum(v.kind == "SILENT" for v in verdicts + drawn)
    check = Check("runs that are wrong in silence", silent, 0, 0.0, "1", "none may", "absolute")
    return [check], picture(verdicts + drawn)
