"""Does ``accuracy`` keep its word? True errors against certificates, and costs against a full search.

Random scenes of every kind are run with an accuracy asked for. The truth is a solution with at least
thirty digits, which no certificate was compared with. The full search tries precisions, tolerances, held
invariants and the closed form, as far as they cost less than what is known to keep the accuracy at every
sample compared, the run's own setting included.

Costs are counted, since clocks jitter: steps times the square of the Taylor order, times what a unit of
that costs in each precision; ``--calibrate`` measures these units.

Run: python -m experiments.accuracy_certificates [--full] [--out DIR] [--share 1/2] [--first N --count M]
Outcomes are written to DIR/accuracy_certificates.jsonl one by one; what is there already, of the same seed
and code, isn't repeated. Two processes with --share 1/2 and 2/2 can share the file; whichever ends later, or
the same command without --share, tells of the whole. Exit code 1 if a check failed.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

if not __package__:  # as a script
    sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from experiments import common
from experiments.certificates.calibration import calibrate
from experiments.certificates.examining import Outcome, examine
from experiments.certificates.ledger import Ledger, code_version
from experiments.common import Check
from experiments.random_scenes import RandomScene, random_scene

NAME = "accuracy_certificates"
SEED = 0
_REDUCED, _FULL = 42, 300
_DEAR = 2.0  # times the cheapest
_SHARE = 0.9  # of the runs, at least, cost less than that


def campaign(full: bool, out: Path, numbers: Iterable[int] | None = None) -> list[Check]:
    """Violations, refusals and cost ratios over random scenes; 300 of them with ``full``.

    Args:
        numbers: of the scenes to examine; those known from earlier are judged too.
    """
    whole = range(_FULL if full else _REDUCED)
    ledger = Ledger(out / f"{NAME}.jsonl", SEED, code_version())
    numbers = list(whole if numbers is None else numbers)
    missing = [number for number in numbers if number not in ledger.outcomes]
    if len(missing) < len(numbers):
        print(f"{len(numbers) - len(missing)} of {len(numbers)} scenes are in {ledger.path} already")
    for number in missing:
        outcome = _examined(random_scene(number, SEED))
        ledger.add(outcome)
        print(outcome.line, flush=True)
    ledger.read()  # what others did meanwhile
    outcomes = [ledger.outcomes[n] for n in sorted({*whole, *numbers} & set(ledger.outcomes))]
    print(f"\n{len(outcomes)} of {len({*whole, *numbers})} scenes are known")
    _figure(outcomes, out)
    for line in summary(outcomes):
        print(line)
    return checks(outcomes)


def _examined(scene: RandomScene) -> Outcome:
    """A scene that breaks the study is an outcome too, and fails it, but not the scenes after it."""
    started = time.process_time()
    try:
        return examine(scene)
    except Exception as error:
        broken = Outcome(scene.number, scene.kind, scene.radians, scene.accuracy)
        spent = time.process_time() - started
        return replace(broken, broken=f"{type(error).__name__}: {error}", cpu_seconds=spent)


def summary(outcomes: Sequence[Outcome]) -> list[str]:
    """What the scenes say, in lines."""
    run = [o for o in outcomes if o.ran]
    kept = [o for o in run if o.kept]
    refused, broken = (
        sum(map(bool, x)) for x in zip(*((o.refused, o.broken) for o in outcomes), strict=True)
    )
    lines = [
        f"{len(outcomes)} scenes: {len(kept)} kept, {len(run) - len(kept)} run but not certified, {refused} "
        f"refused before the run, {broken} broken; {sum(o.violated for o in run)} violations"
    ]
    if run:
        looseness = [o.certified / o.true for o in run if o.true > 0]
        lines.append(f"certified over true error: {_quantiles(looseness)}")
        lines.append(f"counted cost over the cheapest setting's: {_quantiles(_ratios(run))}")
        lines.append(
            f"at most {_DEAR:g} times the cheapest: {_share_of_cheap(run):.1%} of {len(_ratios(run))}"
        )
        for what in ("choose_seconds", "certify_seconds", "run_seconds"):
            title = what.replace("_seconds", "").replace("run", "whole run")
            lines.append(f"CPU seconds, {title}: {_quantiles([getattr(o, what) for o in run])}")
    dearest = sorted(run, key=lambda o: -o.ratio if math.isfinite(o.ratio) else 0.0)[:5]
    lines += [f"dearest: {o.line.strip()}" for o in dearest if o.ratio > _DEAR]
    spent = [o.cpu_seconds for o in outcomes]
    return [*lines, f"CPU seconds of the study, a scene: mean {np.mean(spent):.2g}, most {max(spent):.2g}"]


def _ratios(run: Sequence[Outcome]) -> list[float]:
    return [o.ratio for o in run if math.isfinite(o.ratio)]


def _share_of_cheap(run: Sequence[Outcome]) -> float:
    return float(np.mean(np.array(_ratios(run)) <= _DEAR)) if _ratios(run) else math.nan


def _quantiles(values: Sequence[float]) -> str:
    if not values:
        return "none"
    shown = ((0.5, "50 %"), (0.75, "75 %"), (0.9, "90 %"), (1.0, "most"))
    return ", ".join(f"{name} {np.quantile(values, q):.3g}" for q, name in shown)


def checks(outcomes: Sequence[Outcome]) -> list[Check]:
    """What was asked for, held against what was found."""
    run = [o for o in outcomes if o.ran]
    broken = sum(bool(o.broken) for o in outcomes)
    beyond = sum(not o.true <= o.certified for o in run)
    promised = sum(o.kept and not o.true <= o.asked for o in run)
    kept = sum(o.kept for o in run) / len(run) if run else math.nan
    wrong = sum(bool(o.cheapest) for o in outcomes if o.refused)
    dear = 1 - _share_of_cheap(run)
    source = "quadruple precision, 60 digits or closed form"
    asked = "asked for: nine in ten within a factor of 2"
    allowed = 1 - _SHARE + 1e-12
    return [
        Check("scenes whose true error exceeds the certificate", beyond, 0, 0.0, "1", source, "absolute"),
        Check("scenes certified that miss the accuracy", promised, 0, 0.0, "1", source, "absolute"),
        Check("scenes refused that a setting could do", wrong, 0, 0.0, "1", "full search", "absolute"),
        Check("scenes that broke", broken, 0, 0.0, "1", "none may", "absolute"),
        Check("share of runs certified within the accuracy", kept, 1.0, 0.02, "1", "every run", "absolute"),
        Check("share of runs dearer than twice the cheapest", dear, 0.0, allowed, "1", asked, "absolute"),
    ]


def _figure(outcomes: Sequence[Outcome], out: Path) -> None:
    run = [o for o in outcomes if o.ran]
    figure = common.new_figure(12, 5.2, "An accuracy asked for is kept, certified, and cheap")
    left, right = figure.subplots(1, 2)
    asked = np.array([o.asked for o in run])
    ends = np.array([asked.min() / 3, asked.max() * 3])
    left.loglog(ends, ends, color=common.GREY, linewidth=1, label="accuracy asked for")
    left.vlines(
        asked, [max(o.true, 1e-40) for o in run], [o.certified for o in run], color="#cccccc", linewidth=0.8
    )
    left.loglog(asked, [o.certified for o in run], "v", color=common.ORANGE, markersize=4, label="certified")
    left.loglog(asked, [o.true for o in run], "o", color=common.BLUE, markersize=3, label="true")
    common.tidy(
        left, "attitude error asked for, rad", "attitude error, rad", "true <= certified <= asked for"
    )
    left.legend(frameon=False, loc="upper left")
    ratios = [o.ratio for o in run if math.isfinite(o.ratio)]
    right.hist(np.clip(ratios, 1.0, 19.9), bins=np.geomspace(1, 20, 41), color=common.BLUE)
    right.set_xscale("log")
    right.axvline(_DEAR, color=common.RED, linewidth=1, label="twice the cheapest")
    share = np.mean(np.array(ratios) <= _DEAR)
    title = f"{share:.0%} of {len(ratios)} runs cost at most twice the cheapest setting of a full search"
    common.tidy(right, "counted cost over the cheapest", "runs", title)
    right.legend(frameon=False)
    common.save(figure, out, NAME)


def _numbers(arguments: argparse.Namespace) -> list[int]:
    """Of the scenes asked for."""
    first = arguments.first or 0
    count = arguments.count or (_FULL if arguments.full else _REDUCED) - first
    share, _, of = arguments.share.partition("/")
    if not (share.isdecimal() and of.isdecimal() and 1 <= int(share) <= int(of)) or first < 0 or count < 1:
        raise SystemExit("give --share as 1/2 or 2/2, --first from 0 on, --count from 1 on")
    return list(range(first, first + count))[int(share) - 1 :: int(of)]


def main(argv: Sequence[str] | None = None) -> int:
    """The command; returns its exit code."""
    parser = argparse.ArgumentParser(prog=f"python -m experiments.{NAME}")
    common.add_arguments(parser)
    parser.add_argument("--first", type=int, metavar="N", help="number of the first scene (default 0)")
    parser.add_argument("--count", type=int, metavar="M", help="how many scenes (default: to the last)")
    parser.add_argument("--share", default="1/1", metavar="K/N", help="every Nth of these, from the Kth on")
    parser.add_argument("--calibrate", action="store_true", help="measure what counted costs rest on instead")
    arguments = parser.parse_args(argv)
    if arguments.calibrate:
        units = calibrate()
        print("in steps of double precision at its epsilon")
        print("\n".join(unit.line for unit in units))
        return int(any(unit.off for unit in units))
    found = campaign(arguments.full, arguments.out, _numbers(arguments))
    print(common.table(found, NAME))
    print(f"figure: {arguments.out / NAME}.png")
    return int(not all(check.passed for check in found))


if __name__ == "__main__":
    raise SystemExit(main())
