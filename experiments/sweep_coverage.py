"""Are the announced errors of a sweep's members true?

Random members of several kinds of sweeps run side by side, with neighbours in the same batches: free bodies,
some near the separatrix, satellites on eccentric orbits, planar spins in a chaotic sea, tops, damped and
driven bodies, flights. Each runs again with 80 bits, whose errors are two thousand times smaller, and its
last attitude (and position) is compared by the rules of ``error_coverage``. Among fewer than a hundred
members 1 % is one of them.

Run: python -m experiments.sweep_coverage [--members 60] [--seed 1] [--only "KIND KIND"] [--out DIR]
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mpmath
import numpy as np

from experiments.common import Answer, Check, Curve, Panel, Picture, Study
from experiments.coverage.judging import angle, apart, compactly, gone_through
from experiments.coverage.sweep_kinds import KINDS
from rigidsim.scene.config import Experiment
from rigidsim.solve.status import Status
from rigidsim.workflows.sweeps.members import run_members, warning_bits

_MEMBERS, _SEED = 60, 1
_CHEAP, _FEW_MEMBERS = ("free, short", "planar", "tops", "driven", "flights"), 8
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
    """

    true: np.ndarray
    announced: np.ndarray
    warned: np.ndarray
    side_by_side: int

    @property
    def ratio(self) -> np.ndarray:
        """True over announced; of what is seen no more, what is seen."""
        return np.asarray(np.maximum(self.true - _SEEN, 0) / self.announced)


def found_of(kind: str, members: int, seed: int) -> list[tuple[str, Found]]:
    """Run a kind's members, side by side and better; attitude first, then position where there is one."""
    sweep = KINDS[kind].sweep(kind.replace(", ", "_").replace(" ", "_").replace("-", "_"), members, seed)
    everybody = range(sweep.count)
    results = run_members(sweep, everybody, ["final"])
    ran = sum(number for engine, number in results.engines.items() if engine != "alone")
    truths = [_better(sweep.experiment_of(member), KINDS[kind].recorded) for member in everybody]
    warned = (results.kept["warnings"].values & _GONE) > 0
    found = []
    for name, (what, away) in {"quaternion": ("attitude", angle), "position": ("position", apart)}.items():
        if name in KINDS[kind].recorded:
            pairs = zip(results.kept[f"{name}_final"].values.tolist(), truths, strict=True)
            true = np.array([float(away([mine], [truth[name]])) for mine, truth in pairs])
            found.append((what, Found(true, results.kept[f"{what}_error"].values, warned, ran)))
    return found


def _better(experiment: Experiment, names: Sequence[str]) -> dict[str, list[mpmath.mpf]]:
    """The last sample of what is recorded, by a run with 80 bits."""
    better = ['integrator.precision="extended"', 'integrator.tolerance="auto"', "output.estimate=false"]
    better.append('integrator.formulation="quaternion"')
    seen, progress, _ = gone_through(compactly(experiment.with_overrides(better)))
    assert progress.status is Status.FINISHED
    return {name: seen.exact(name)[-1] for name in names}


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
    times = found.announced[~warned] / np.maximum(found.true[~warned], 1e-300)
    caution = np.median(times) if len(times) else math.nan
    beyond = int(((ratio > _WORST_RATIO) & ~warned).sum())
    name = kind if what == "attitude" else f"{kind}: {what}"
    above = int((ratio > _MOST_RATIO).sum())
    return (
        f"{name:25s} {found.side_by_side:3d}/{len(ratio):3d}  {above:3d}  {beyond:13d}  "
        f"{float(np.nanmax(ratio)):5.2g}  {caution:21.3g}  {int(warned.sum()):4d}"
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


@Study
def study(full: bool, members: int = 0, seed: int = _SEED, only: str = "") -> Answer:
    """All kinds, or some members of the cheap ones; the figure, the checks."""
    members = members or (_MEMBERS if full else _FEW_MEMBERS)
    told: list[tuple[str, Found]] = []
    print("kind                      members  >3x  >10x unwarned  worst  median announced/true  gone")
    for kind in only.split() or (KINDS if full else _CHEAP):
        for what, found in found_of(kind, members, seed):
            print(line(kind, what, found), flush=True)
            told.append((what, found))
    return judged([found for what, found in told if what == "attitude"]), picture(told)
