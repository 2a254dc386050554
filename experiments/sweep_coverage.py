"""Are the announced errors of a sweep's members true?

Question: members of a sweep run side by side, and what each is announced to be wrong by is measured by
neighbours that are carried along in batches. Is it, whatever the motion?

Method: random members of several kinds of sweeps: free bodies, among them some near the separatrix,
satellites on eccentric orbits, planar spins in a chaotic sea, tops, bodies that are damped and driven, bodies
that fly past what attracts them. Each is run again with 80 bits, whose errors are two thousand times smaller,
and its last attitude (and position) compared.

Held against: the rules of ``experiments/error_coverage.py``: the true error is at most three times the
announced one in 99 % of the members, in none more than ten times without a warning, and announced errors are
at most twenty times the true one in the median. Among fewer than a hundred members 1 % is one of them.

Run: python -m experiments.sweep_coverage [--members 60] [--seed 1] [--only KIND ...] [--out DIR]
"""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import mpmath
import numpy as np

from experiments.common import Answer, Check, Curve, Panel, Picture, Study
from experiments.coverage.judging import gone_through
from experiments.coverage.sweep_kinds import KINDS
from rigidsim.scene.config import Experiment, parse
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.session.members import warning_bits
from rigidsim.solve.problem import prepare
from rigidsim.solve.status import Status
from rigidsim.workflows.sweeps.members import run_members

_MEMBERS, _SEED = 60, 1
_CHEAP, _FEW_MEMBERS = ("free, short", "planar", "tops", "driven", "flights"), 8
_WARM = 16  # members, in batches of up to 8; one alone would leave their compilation to whoever is first
_GONE = warning_bits(["attitude_uncertain"])
_MOST_RATIO, _WORST_RATIO, _MOST_CAUTION = 3.0, 10.0, 20.0
_FEW = 0.01
_SEEN = 1e-15
"""rad, or of the way: what is compared is rounded itself."""


@dataclass(frozen=True)
class Found:
    """What came of a kind, (members,) each.

    Attributes:
        true, announced: errors at the end, rad or m.
        warned: whether the member says that its digits are gone.
        side_by_side: how many ran in batches.
        seconds: of CPU a member, without and with estimates.
    """

    true: np.ndarray
    announced: np.ndarray
    warned: np.ndarray
    side_by_side: int
    seconds: tuple[float, float]

    @property
    def ratio(self) -> np.ndarray:
        """True over announced; of what is seen no more, what is seen."""
        return np.asarray(np.maximum(self.true - _SEEN, 0) / self.announced)


def found_of(kind: str, members: int, seed: int) -> list[tuple[str, Found]]:
    """Run a kind's members, side by side and better; attitude first, then position where there is one."""
    sweep = KINDS[kind].sweep(kind.replace(", ", "_").replace(" ", "_").replace("-", "_"), members, seed)
    everybody = range(sweep.count)
    silent = Sweep.of(parse(sweep.experiment.text.replace("[output]", "[output]\nestimate = false")))
    seconds = []
    for which in (silent, sweep):
        run_members(which, everybody[:_WARM], ["final"])  # compiled, for whole batches
        before = time.process_time()
        results = run_members(which, everybody, ["final"])
        seconds.append((time.process_time() - before) / members)
    ran = sum(number for engine, number in results.engines.items() if engine != "alone")
    truths = [_better(sweep.experiment_of(member), KINDS[kind].recorded) for member in everybody]
    warned = (results.kept["warnings"].values & _GONE) > 0
    told = []
    for name, (what, apart) in {"quaternion": ("attitude", _angle), "position": ("position", _way)}.items():
        if name in KINDS[kind].recorded:
            last = results.kept[f"{name}_final"].values
            true = [apart(mine, truth[name]) for mine, truth in zip(last, truths, strict=True)]
            told.append((what, np.array(true), results.kept[f"{what}_error"].values))
    return [
        (what, Found(true, announced, warned, ran, (seconds[0], seconds[1])))
        for what, true, announced in told
    ]


def _better(experiment: Experiment, names: Sequence[str]) -> dict[str, list[mpmath.mpf]]:
    """The last sample of what is recorded, by a run with 80 bits."""
    better = ['integrator.precision="extended"', 'integrator.tolerance="auto"', "output.estimate=false"]
    prepared = prepare(experiment.having([*better, 'integrator.formulation="quaternion"']))
    compact = replace(prepared, precision=replace(prepared.precision, compact=True))
    seen, progress, *_ = gone_through(compact)
    assert progress.status is Status.FINISHED
    return {name: seen.exact(name)[-1] for name in names}


def _angle(mine: np.ndarray, there: list[mpmath.mpf]) -> float:
    with mpmath.workdps(40):
        chord = min(
            mpmath.norm([float(a) - s * b for a, b in zip(mine, there, strict=True)]) for s in (1, -1)
        )
        return float(4 * mpmath.asin(min(chord / 2, mpmath.mpf(1))))


def _way(mine: np.ndarray, there: list[mpmath.mpf]) -> float:
    with mpmath.workdps(40):
        return float(mpmath.norm([float(a) - b for a, b in zip(mine, there, strict=True)]))


@Study
def study(full: bool, members: int = 0, seed: int = _SEED, only: str = "") -> Answer:
    """All kinds, or some members of the cheap ones; the figure, the checks."""
    members = members or (_MEMBERS if full else _FEW_MEMBERS)
    told: list[tuple[str, Found]] = []
    print(
        "kind                      members  >3x  >10x unwarned  worst  median announced/true  gone  CPU ratio"
    )
    for kind in only.split() or (KINDS if full else _CHEAP):
        for what, found in found_of(kind, members, seed):
            print(line(kind, what, found), flush=True)
            told.append((what, found))
    return judged([found for what, found in told if what == "attitude"]), picture(told)


def picture(told: Sequence[tuple[str, Found]]) -> Picture:
    """True errors over the announced ones, attitudes beside positions."""
    panels = []
    for what, unit in (("attitude", "rad"), ("position", "m")):
        mine = [found for name, found in told if name == what]
        if not mine:
            continue
        announced, true, warned = (np.concatenate([getattr(found, part) for found in mine])
                                   for part in ("announced", "true", "warned"))  # fmt: skip
        seen = np.maximum(true, _SEEN)
        ends = np.array([min(announced.min(), seen.min()) / 2, 2 * max(announced.max(), seen.max())])
        panels.append(Panel(f"{what} at the end", f"announced error ({unit})", f"true error ({unit})", [
            Curve(announced[~warned], seen[~warned], "members", "blue", "."),
            Curve(announced[warned], seen[warned], "that say no digits are left", "grey", "x"),
            Curve(ends, ends, "as announced", "grey"),
            Curve(ends, _MOST_RATIO * ends, "three times that", "orange"),
        ], "xy", legend="upper left"))  # fmt: skip
    title = "True errors of sweeps' members stay below three times the announced ones"
    return Picture(title, "ab"[: len(panels)], panels)


def line(kind: str, what: str, found: Found) -> str:
    """Of the table."""
    ratio, warned = found.ratio, found.warned
    caution = (
        np.median(found.announced[~warned] / np.maximum(found.true[~warned], 1e-300))
        if (~warned).any()
        else math.nan
    )
    beyond = int(((ratio > _WORST_RATIO) & ~warned).sum())
    name = kind if what == "attitude" else f"{kind}: {what}"
    above = int((ratio > _MOST_RATIO).sum())
    return (
        f"{name:25s} {found.side_by_side:3d}/{len(ratio):3d}  {above:3d}  {beyond:13d}  "
        f"{float(np.nanmax(ratio)):5.2g}  {caution:21.3g}  {int(warned.sum()):4d}  "
        f"{found.seconds[1] / found.seconds[0]:9.2f}"
    )


def judged(found: Sequence[Found]) -> list[Check]:
    """The promises, over all kinds."""
    ratio, warned, true, announced = (
        np.concatenate([getattr(one, name) for one in found])
        for name in ("ratio", "warned", "true", "announced")
    )
    asked = "as of single runs (error_coverage)"
    sound = ~warned & (true > 0)
    rows = [
        ("members without an announced error", np.isnan(announced).sum(), 0.5),
        ("share of true errors above 3 x announced", (ratio > _MOST_RATIO).mean(), max(_FEW, 1 / len(ratio))),
        ("above 10 x without a warning", ((ratio > _WORST_RATIO) & ~warned).sum(), 0.5),
        ("announced over true, median", np.median(announced[sound] / true[sound]), _MOST_CAUTION),
    ]
    return [Check(name, float(value), 0, most, "1", asked, "absolute") for name, value, most in rows]


if __name__ == "__main__":
    raise SystemExit(study.main())
