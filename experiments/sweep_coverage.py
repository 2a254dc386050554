"""Are the announced errors of a sweep's members true?

Question: members of a sweep run side by side, and what each is announced to be wrong by is measured by
neighbours that are carried along in batches. Is it, whatever the motion?

Method: random members of several kinds of sweeps: free bodies, among them some near the separatrix,
satellites on eccentric orbits, planar spins in a chaotic sea, tops, bodies that are damped and driven, bodies
that fly past what attracts them. Each is run again with 80 bits, whose errors are two thousand times smaller,
and its last attitude (and position) compared.

Held against: the rules of ``experiments/error_coverage.py``: the true error is at most three times the
announced one in 99 % of the members, in none more than ten times without a warning, and announced errors are
at most twenty times the true one in the median.

Run: python -m experiments.sweep_coverage [--members 60] [--seed 1] [--only KIND ...]
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

if not __package__:  # as a script
    sys.path.insert(0, str(Path(__file__).parents[1]))

import mpmath
import numpy as np

from experiments.common import Check, table
from experiments.coverage.judging import gone_through
from rigidsim.scene.config import Experiment, parse
from rigidsim.scene.sweeps.sweep import Sweep
from rigidsim.session.members import warning_bits
from rigidsim.solve.problem import prepare
from rigidsim.solve.status import Status
from rigidsim.workflows.sweeps.members import run_members

_GONE = warning_bits(["attitude_uncertain"])
_MOST_RATIO, _WORST_RATIO, _MOST_CAUTION = 3.0, 10.0, 20.0
_FEW = 0.01
_SEEN = 1e-15
"""rad, or of the way: what is compared is rounded itself."""

_HEAD = """
name = "{kind}"
[output]
record = [{record}]
timeline = false
[sweep]
mode = "zip"
seed = {seed}
keep = ["final"]
tile = 64
"""
_FREE = """
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.1, 1, 0.05]
[time]
end = {end}
samples = 2
"""
_ORBIT = """
[body]
principal_moments = [1, 1.5, 1.8]
[initial]
angular_velocity = [0.1, 0.2, 1.1]
euler_angles = [0.3, 0.1, 0]
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = 1
orbit = {{semi_major_axis = 1, eccentricity = 0.1, inclination = 0.2, mean_anomaly = 0.4}}
[time]
end = {end}
samples = 2
{more}
"""
_PLANAR = """
[body]
principal_moments = [34021, 49096, 57125]
[initial]
euler_angles = [0, 0, 0]
angular_velocity = [0, 0, 1]
[[loads]]
kind = "gravity_gradient"
gravitational_parameter = 1
orbit = {{semi_major_axis = 1, eccentricity = 0.1}}
[time]
end = {end}
samples = 2
[integrator]
formulation = "planar"
tolerance = {tolerance}
"""
_TOP = """
[body]
principal_moments = [1, {second}, 0.5]
mass = 1
center_of_mass = [0, 0, 0.3]
[initial]
angular_velocity = [0.1, 0.2, 5]
euler_angles = [0, 0.5, 0]
[[loads]]
kind = "uniform_gravity"
acceleration = [0, 0, -9.8]
[time]
end = {end}
samples = 2
"""
_DRIVEN = """
[parameters]
k = 0.1
n = 1
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.1, 0.2, 1]
[[loads]]
kind = "torque"
components = ["k*sin(n*t)", "k*cos(n*t)^2/3", "-k*wz/9"]
frame = "body"
[time]
end = {end}
samples = 2
"""
_FLIGHT = """
[body]
principal_moments = [1, 1.6, 2]
mass = 1
[initial]
angular_velocity = [0.01, 0.02, 0.03]
position = [30, 0, 0]
velocity = [0, 0.05, 0]
[[loads]]
kind = "central_gravity"
gravitational_parameter = 1
[time]
end = {end}
samples = 2
"""


@dataclass(frozen=True)
class Kind:
    """Sweeps of one kind.

    Attributes:
        text: of the config, with places for what it is given.
        axes: dotted keys and what they take, but for the count.
        given: for the places.
    """

    text: str
    axes: dict[str, str]
    given: dict[str, str]
    recorded: tuple[str, ...] = ("quaternion",)

    def sweep(self, kind: str, members: int, seed: int) -> Sweep:
        """The sweep of so many random members."""
        record = ", ".join(f'"{name}"' for name in self.recorded)
        lines = [
            f'axes."{key}" = {{{spec}, count = {members}, name = "axis_{n}"}}'
            for n, (key, spec) in enumerate(self.axes.items())
        ]
        head, output = _HEAD.format(kind=kind, record=record, seed=seed).split("[output]")
        return Sweep.of(parse(head + self.text.format(**self.given) + "[output]" + output + "\n".join(lines)))


_RATES = {"initial.angular_velocity": "uniform = [[-1, -1, -1], [1, 1, 1]]"}
_MOMENT = {"body.principal_moments[1]": "uniform = [1.55, 2.45]"}
_SATELLITES = {
    "initial.angular_velocity": "uniform = [[-1, -1, 0.2], [1, 1, 2]]",
    "loads[0].orbit.eccentricity": "uniform = [0, 0.6]",
    "body.principal_moments[1]": "uniform = [1.05, 1.75]",
}
_TOPS = {"initial.angular_velocity[2]": "uniform = [1, 9]", "initial.euler_angles[1]": "uniform = [0.1, 2.5]"}
_SPINS = {"initial.euler_angles[2]": "uniform = [0, 3]", "initial.angular_velocity[2]": "uniform = [0, 3]"}
KINDS = {
    "free": Kind(_FREE, _RATES | _MOMENT, {"end": "1000"}),
    "free, short": Kind(_FREE, _RATES | _MOMENT, {"end": "5"}),
    "free, middle axis": Kind(
        _FREE, {"initial.angular_velocity": "normal = [[0, 1, 0], [1e-4, 0, 1e-4]]"} | _MOMENT, {"end": "100"}
    ),
    "satellites": Kind(_ORBIT, _SATELLITES, {"end": "60", "more": ""}),
    "satellites, long": Kind(_ORBIT, _SATELLITES, {"end": "600", "more": ""}),
    "satellites, 1e-9": Kind(_ORBIT, _SATELLITES, {"end": "60", "more": "[integrator]\ntolerance = 1e-9"}),
    "planar": Kind(_PLANAR, _SPINS, {"end": "100", "tolerance": '"auto"'}),
    "planar, long": Kind(_PLANAR, _SPINS, {"end": "628", "tolerance": '"auto"'}),
    "planar, 1e-9": Kind(_PLANAR, _SPINS, {"end": "100", "tolerance": "1e-9"}),
    "tops": Kind(_TOP, _TOPS, {"end": "60", "second": "1"}),
    "tops, asymmetric": Kind(_TOP, _TOPS, {"end": "20", "second": "1.2"}),
    "driven": Kind(_DRIVEN, _RATES | {"parameters.n": "uniform = [0.1, 2]"}, {"end": "200"}),
    "flights": Kind(
        _FLIGHT,
        {
            "initial.velocity": "uniform = [[-0.02, 0.1, -0.05], [0.02, 0.17, 0.05]]",
            "initial.angular_velocity": "uniform = [[-0.05, -0.05, -0.05], [0.05, 0.05, 0.05]]",
        },
        {"end": "3000"},
        ("quaternion", "position"),
    ),
}  # fmt: skip


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
        run_members(which, everybody[:1], ["final"])  # compiled
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


def main(argv: Sequence[str] | None = None) -> int:
    """Run all kinds; exit code 1 if a promise was broken."""
    parser = argparse.ArgumentParser(prog="python -m experiments.sweep_coverage")
    parser.add_argument("--members", type=int, default=60, help="of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=list(KINDS), choices=list(KINDS))
    arguments = parser.parse_args(argv)
    everything: list[Found] = []
    print(
        "kind                      members  >3x  >10x unwarned  worst  median announced/true  gone  CPU ratio"
    )
    for kind in arguments.only:
        for what, found in found_of(kind, arguments.members, arguments.seed):
            print(line(kind, what, found), flush=True)
            if what == "attitude":
                everything.append(found)
    checks = judged(everything)
    print(table(checks, "sweep_coverage"))
    return int(not all(check.passed for check in checks))


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
        ("share of true errors above 3 x announced", (ratio > _MOST_RATIO).mean(), _FEW),
        ("above 10 x without a warning", ((ratio > _WORST_RATIO) & ~warned).sum(), 0.5),
        ("announced over true, median", np.median(announced[sound] / true[sound]), _MOST_CAUTION),
    ]
    return [Check(name, float(value), 0, most, "1", asked, "absolute") for name, value, most in rows]


if __name__ == "__main__":
    sys.exit(main())
