"""Are announced errors true? Random scenes by family, their estimates held against better solutions.

Each scene runs to its end and announces its errors there; the truth comes from higher precision (80 bits for
double, 128 for these), or from an exact solution where a kink would mislead every integration. The families
are those in which estimates are most likely to be wrong; all formulations, three precisions, loose tolerances
and projected invariants take part.

Run: python -m experiments.error_coverage [--count 1000] [--seed 1] [--share 1/2] [--seconds S] [--out DIR]
Outcomes are appended to DIR/error_coverage.jsonl one by one; what is there already, of the same seed and
code, isn't repeated, so that a campaign can be stopped and gone on with. ``--only FAMILY`` looks at one.
Exit code 1 if a promise was broken.
"""

import argparse
import hashlib
import json
import math
import os
import time
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np

import rigidsim
from experiments import common
from experiments.coverage.averages import judge_average
from experiments.coverage.families import FAMILIES, coverage_scene
from experiments.coverage.judging import Judged, judge

NAME = "error_coverage"
FALSE_ALARM = 1e-4  # rad


def code_version() -> str:
    """Digest of what decides an outcome: the sources of rigidsim and of the studies."""
    folders = [Path(rigidsim.__file__).parent, Path(__file__).parent]
    digest = hashlib.sha256()
    for path in (path for folder in folders for path in sorted(folder.rglob("*.py"))):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


def campaign(numbers: Iterable[int], seed: int, out: Path, seconds: float = math.inf) -> list[Judged]:
    """Judge scenes, those that the file doesn't know yet; returns all that are known.

    Args:
        seconds: after which no other scene is begun.
    """
    path, version, started = out / f"{NAME}.jsonl", code_version(), time.monotonic()
    numbers = list(numbers)
    known = read(path, seed, version)
    for number in (n for n in numbers if n not in known):
        if time.monotonic() - started > seconds:
            break
        scene = coverage_scene(number, seed)
        try:
            found = (judge_average if FAMILIES[scene.family].averaged else judge)(scene)
        except Exception as error:  # a scene that breaks the study is an outcome, and fails it
            found = Judged(number, scene.family, f"{type(error).__name__}: {error}"[:200], "broken")
        known[number] = found
        _append(path, {"seed": seed, "version": version, **asdict(found)})
        print(found.line, flush=True)
    return [known[n] for n in numbers if n in known]


def read(path: Path, seed: int, version: str) -> dict[int, Judged]:
    """The outcomes of a seed and a state of the code, by number."""
    known: dict[int, Judged] = {}
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            try:
                row = json.loads(line)
            except ValueError:
                continue  # cut short
            if row.pop("seed") == seed and row.pop("version") == version:
                row = {k: math.nan if v is None else v for k, v in row.items()}
                known[row["number"]] = Judged(**row)
    return known


def _append(path: Path, row: dict[str, object]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    row = {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    try:
        os.write(descriptor, (json.dumps(row) + "\n").encode())
    finally:
        os.close(descriptor)


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
    ended: dict[str, int] = {}
    for one in judged:
        ended[one.ended] = ended.get(one.ended, 0) + 1
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
    alarms = [one.number for one in judged if one.gone and one.true < FALSE_ALARM]
    if alarms:
        problems.append(f"digits said to be gone where less than {FALSE_ALARM} rad is true: {alarms}")
    drifting = [one.number for one in judged if one.drifting]
    if drifting:
        problems.append(f"claimed as invariants that drift even with more digits: {drifting}")
    broken = [one.number for one in judged if one.ended in ("broken", "no truth")]
    if broken:
        problems.append(f"broken: {broken}")
    return problems


def costs(judged: Sequence[Judged]) -> str:
    """Of the estimate, over runs above a second and below."""
    long = [one.estimate_seconds / one.run_seconds for one in judged if one.run_seconds >= 1]
    short = [one.estimate_seconds for one in judged if 0 < one.run_seconds < 1 and one.ended == "finished"]

    def shown(values: Sequence[float], unit: str) -> str:
        if not values:
            return "none"
        middle, high = np.quantile(values, [0.5, 0.9])
        text = ", ".join(
            f"{name} {value:.3g}{unit}"
            for name, value in (("median", middle), ("90 %", high), ("largest", max(values)))
        )
        return f"{text} of {len(values)}"

    return f"cost of integrations above 1 s: {shown(long, '')}; below: {shown(short, ' s')}"


def main(argv: Sequence[str] | None = None) -> int:
    """The command; returns its exit code."""
    parser = argparse.ArgumentParser(prog=f"python -m experiments.{NAME}")
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--share", default="1/1", metavar="K/N", help="every Nth scene, from the Kth on")
    parser.add_argument("--seconds", type=float, default=math.inf, help="begin no scene after that")
    parser.add_argument("--only", choices=list(FAMILIES))
    parser.add_argument("--out", type=Path, default=common.DEFAULT_OUT)
    arguments = parser.parse_args(argv)
    share, _, of = arguments.share.partition("/")
    if not (share.isdecimal() and of.isdecimal() and 1 <= int(share) <= int(of)):
        raise SystemExit("give --share as 1/2 or 2/2")
    numbers = list(range(arguments.first, arguments.first + arguments.count))[int(share) - 1 :: int(of)]
    if arguments.only:
        place = list(FAMILIES).index(arguments.only)
        numbers = [n for n in numbers if n % len(FAMILIES) == place]
    judged = campaign(numbers, arguments.seed, arguments.out, arguments.seconds)
    print("\n".join(["", *table(judged), costs(judged)]))
    problems = broken_promises(judged)
    print("\n".join(problems) or "every promise was kept")
    return int(bool(problems))


if __name__ == "__main__":
    raise SystemExit(main())
