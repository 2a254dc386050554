"""Are announced errors true? Random scenes by family, their estimates held against better solutions.

Each scene runs to its end and announces its errors there; the truth comes from higher precision (80 bits for
double, 128 for these), or from an exact solution where a kink would mislead every integration. The families
are those in which estimates are most likely to be wrong; all formulations, three precisions, loose tolerances
and projected invariants take part.

With --reversed, shortened scenes go forth and back in all precisions, half of them into the past first: the
difference from their start is held against what both ways announce.

Run: python -m experiments.error_coverage [--first 0] [--count 1000] [--seed 1] [--only FAMILY] [--reversed]
Exit code 1 if a promise was broken.
"""

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from experiments.common import Command
from experiments.coverage.families import FAMILIES, coverage_scene
from experiments.coverage.judging import Judged, judge, judge_average, judge_reversal

FALSE_ALARM = 1e-4  # rad


def ratios(judged: Sequence[Judged], place: bool = False) -> list[tuple[Judged, float]]:
    """True over announced of the scenes that have both, with the scene."""
    found = []
    for one in judged:
        true, announced = (one.true_place, one.announced_place) if place else (one.true, one.announced)
        if one.ended == "finished" and math.isfinite(true) and math.isfinite(announced):
            found.append((one, true / max(announced, 1e-300)))
    return found


def table(judged: Sequence[Judged]) -> list[str]:
    """Markdown, a row for each family and one for all, then the same of the positions."""
    head = "| family | scenes | true > 3 announced | > 10 | > 10, no warning "
    head += "| median announced/true | false alarms |"
    lines = [head, "| --- | --- | --- | --- | --- | --- | --- |"]
    names = [*FAMILIES, None]
    for name in names:
        mine = [one for one in judged if name in (one.family, None)]
        if mine:
            lines.append(_row(name or "**all, attitude**", ratios(mine)))
    lines.append(_row("**all, position**", ratios(judged, place=True)))
    ended = Counter(one.ended for one in judged)
    lines.append("\n" + ", ".join(f"{count} {how}" for how, count in sorted(ended.items())))
    return lines


def _row(name: str, found: Sequence[tuple[Judged, float]]) -> str:
    if not found:
        return f"| {name} | 0 | | | | | |"
    values = np.array([ratio for _, ratio in found])
    silent = [one for one, ratio in found if ratio > 10 and not one.gone and not one.warned]
    alarms = [one for one, _ in found if one.gone and one.true < FALSE_ALARM]
    middle = float(np.median(1 / np.maximum(values, 1e-300)))
    return (
        f"| {name} | {len(found)} | {(values > 3).mean():.1%} | {(values > 10).mean():.1%} | {len(silent)} "
        f"| {middle:.2g} | {len(alarms)} |"
    )


def broken_promises(judged: Sequence[Judged]) -> list[str]:
    """What the estimate promises and didn't keep."""
    problems = []
    for place, what in ((False, "attitude"), (True, "position")):
        found = ratios(judged, place)
        if not found:
            continue
        values = np.array([ratio for _, ratio in found])
        if (values > 3).mean() > 0.01:
            problems.append(f"{what}: {(values > 3).mean():.1%} beyond 3 times what was announced")
        silent = [one.number for one, r in found if r > 10 and not one.gone and not one.warned]
        if silent:
            problems.append(f"{what}: more than 10 times what was announced without a warning: {silent}")
        if np.median(1 / np.maximum(values, 1e-300)) > 20:
            problems.append(f"{what}: median announced over true is above 20")
    for what, numbers in (
        (f"digits said to be gone where less than {FALSE_ALARM} rad is true",
         [one.number for one in judged if one.gone and one.true < FALSE_ALARM]),
        ("claimed as invariants that drift even with more digits", [x.number for x in judged if x.drifting]),
        ("broken", [one.number for one in judged if one.ended in ("broken", "no truth")]),
    ):  # fmt: skip
        problems += [f"{what}: {numbers}"] * bool(numbers)
    return problems


@Command
def campaign(first: int = 0, count: int = 1000, seed: int = 1, only: str = "", reversed: bool = False) -> int:
    """Judge scenes, and print a line for each, the table, and the promises that were broken."""
    judged = []
    for number in range(first, first + count):
        scene = coverage_scene(number, seed)
        if only in ("", scene.family):
            try:
                how = judge_average if FAMILIES[scene.family].averaged else judge
                judged.append((judge_reversal if reversed else how)(scene))
            except Exception as error:  # a scene that breaks the study is an outcome, and fails it
                text = f"{type(error).__name__}: {error}"[:200]
                judged.append(Judged(number, scene.family, text, "broken"))
            print(judged[-1].line, flush=True)
    problems = broken_promises(judged)
    print("\n".join(["", *table(judged), *(problems or ["every promise was kept"])]))
    return int(bool(problems))
