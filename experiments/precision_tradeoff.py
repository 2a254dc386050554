"""What does accuracy cost: which precision, which tolerance, held invariants or not, for how long a run?

Question: for five scenes and horizons of 1e2 to 1e6 radians of the fastest rate, which setting reaches an
attitude error at the least CPU time?
Method: as ``rigidsim tradeoff``: every setting against the closed form to 50 digits, or where there is none
against an integration one precision higher with held invariants; speeds per natural step in fresh processes,
in turn, as ratios to double precision at a tolerance of its epsilon, in quaternions. One run gives all
horizons.
Quadruple precision goes to a hundredth of the longest, and no further than 1e3 rad without a closed form.

Run: python -m experiments.precision_tradeoff [--full] [--out DIR]
Reduced: to 1e3 radians, speeds from one process; --full: to 1e6, from five (half an hour).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

if not __package__:  # as a script
    sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from matplotlib.lines import Line2D

import rigidsim
from experiments.common import CONFIGS, Check, main, new_figure, save, tidy
from rigidsim.accuracy.bench.measure import Measurement, Row, measure
from rigidsim.accuracy.bench.plan import DEFAULT, Plan
from rigidsim.accuracy.error_law import exact_method
from rigidsim.accuracy.setting import Setting
from rigidsim.solve.problem import prepare

NAME = "precision_tradeoff"
SCENES = {
    "asymmetric_top": "free asymmetric body",
    "heavy_top_nutating": "heavy symmetric top",
    "gravity_gradient_libration": "gravity-gradient satellite",
    "central_gravity_dumbbell": "dumbbell in orbit, six degrees",
    "kovalevskaya_top": "Kovalevskaya's top",
}
SAMPLES = 1000
"""That a run records: what closed forms cost is in proportion to it."""
LEVELS = (1e-3, 1e-6, 1e-9, 1e-12, 1e-15)
_COLORS = ("#fdae61", "#d7301f", "#7a0177", "#2b8cbe", "#08306b")
_MARKERS = {"single": "v", "double": "o", "extended": "s", "quadruple": "D"}


def settings(exact: str) -> list[Setting]:
    """Quaternions throughout: ``rigidsim tradeoff`` shows that other formulations cost more."""
    loose = [Setting("double", t) for t in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14)]
    rest = [Setting("single"), Setting("extended"), Setting("extended", 1e-16), Setting("quadruple"),
            Setting("quadruple", 1e-24)]  # fmt: skip
    plain = [DEFAULT, *loose, *rest]
    held = [Setting(s.precision, s.tolerance, hold_invariants=True) for s in plain]
    precise = [Setting(p, method=exact) for p in ("double", "quadruple")] if exact else []
    return [*plain, *held, *precise]


@dataclass(frozen=True)
class Point:
    """One setting over one horizon.

    Attributes:
        error: largest attitude error up to the horizon, not below the reference's own, rad.
        cost: CPU time over that of the default setting.
    """

    setting: Setting
    error: float
    cost: float


Points = dict[float, list[Point]]
"""By horizon in radians."""


def measure_scene(name: str, *, to: float, processes: int) -> Points:
    """Measure a scene of ``configs/`` over horizons from 1e2 radians to ``to``."""
    experiment = rigidsim.load(CONFIGS / f"{name}.toml")
    prepared = prepare(experiment)
    rate, start = float(prepared.system.rate_bound), float(prepared.scene.start)
    exact, why = exact_method(prepared.scene)
    decades = range(2, round(math.log10(to)) + 1)
    horizons = [10.0**n for n in decades]
    last = len(horizons) if exact else min(len(horizons), 2)  # what a reference in quadruple can do
    wide = max(len(horizons) - 2, 1)
    first = _plan(horizons[:last], wide, rate, start, exact, why)
    measured = measure(experiment, budget=3600.0, repeats=processes, plan=first, settings=settings(exact))
    points = _points(measured, horizons[:last])
    if last < len(horizons):
        longer = _plan(horizons, wide, rate, start, exact, why)
        chosen = [s for s in settings(exact) if s.precision in ("double", "extended", "single")]
        further = measure(
            experiment, budget=3600.0, repeats=1, plan=longer, settings=chosen, reference="extended"
        )
        for row in further.rows:  # the speeds of more processes
            same = next(r for r in measured.rows if r.setting == row.setting)
            row.unit_seconds, row.default_seconds = same.unit_seconds, same.default_seconds
        points |= {h: p for h, p in _points(further, horizons).items() if h not in points}
    return points


def _plan(horizons: Sequence[float], wide: int, rate: float, start: float, exact: str, why: str) -> Plan:
    """Eight samples to each decade, the horizons among them; single precision means them exactly."""
    wide = min(wide, len(horizons))
    ends = [h / rate for h in horizons]
    moments = {float(np.float32(start + end * 10 ** (-k / 8))) for end in ends for k in range(8)}
    times = tuple(sorted({start, *moments}))
    short_end = float(np.float32(start + ends[wide - 1]))
    count = sum(t <= short_end for t in times)
    end = start + ends[-1]
    return Plan(start, end, 0.0, 1.0, ends[wide - 1] / ends[-1], times, count, exact, why, SAMPLES)


def _points(measured: Measurement, horizons: Sequence[float]) -> Points:
    times = np.array(measured.plan.times) - measured.plan.start
    longest = horizons[-1]
    found: Points = {}
    for horizon in horizons:
        reach = (times <= times[-1] * horizon / longest * 1.0001).sum()
        found[horizon] = []
        for row in measured.rows:
            if not row.measured or len(row.attitudes[0]) < reach or not row.unit_seconds:
                continue
            errors, own = measured.errors(row)
            if len(errors) < reach:
                continue
            error = max(float(errors[:reach].max()), float(own[reach - 1]))
            found[horizon].append(Point(row.setting, error, _cost(measured, row, horizon / longest)))
    return found


def _cost(measured: Measurement, row: Row, part: float) -> float:
    """Of a closed form: its samples cost the same over any horizon."""
    cost = measured.cost(row)[0]
    return cost if row.setting.has_steps else cost / part


def front(points: Sequence[Point]) -> list[Point]:
    """Those that no other beats in both, from the cheapest on."""
    best, found = math.inf, []
    for point in sorted(points, key=lambda p: (p.cost, p.error)):
        if point.error < best:
            best = point.error
            found.append(point)
    return found


def cheapest(points: Sequence[Point], error: float) -> Point | None:
    """The cheapest setting that keeps an error; None where none does."""
    return min((p for p in points if p.error <= error), key=lambda p: p.cost, default=None)


def draw(scenes: dict[str, Points], out: Path) -> Path:
    """A panel for each scene: the front of each horizon, with and without held invariants."""
    figure = new_figure(15, 9, "What accuracy costs: attitude error against CPU time")
    panels = figure.subplots(2, 3).ravel()
    horizons = sorted({h for points in scenes.values() for h in points})
    colors = dict(zip(horizons, _COLORS[: len(horizons)], strict=True))
    for axes, (name, points) in zip(panels, scenes.items(), strict=False):
        for horizon, some in points.items():
            stepping = [p for p in some if p.setting.method == "taylor"]
            plain = front([p for p in stepping if not p.setting.hold_invariants])
            axes.plot(
                [p.cost for p in plain], [p.error for p in plain], "--", color=colors[horizon], linewidth=1
            )
            best = front(stepping)
            axes.plot(
                [p.cost for p in best], [p.error for p in best], "-", color=colors[horizon], linewidth=1.6
            )
            for point in best:
                color, held = colors[horizon], point.setting.hold_invariants
                marker = _MARKERS[str(point.setting.precision)]
                face = color if held else "white"
                axes.plot(point.cost, point.error, marker, color=color, markersize=5, markerfacecolor=face)
            for point in (p for p in some if not p.setting.has_steps):
                axes.plot(point.cost, point.error, "*", color=colors[horizon], markersize=10, alpha=0.9)
        axes.set_xscale("log")
        axes.set_yscale("log")
        tidy(axes, "CPU time over the default's", "largest attitude error, rad", SCENES[name])
    _legend(panels[-1], colors)
    return save(figure, out, NAME)


def _legend(axes, colors: dict[float, str]) -> None:  # type: ignore[no-untyped-def]
    axes.axis("off")
    handles = [Line2D([], [], color=c, linewidth=2, label=f"over {h:.0e} rad") for h, c in colors.items()]
    handles += [
        Line2D([], [], color="#444444", linewidth=1.6, label="best settings"),
        Line2D([], [], color="#444444", linewidth=1, linestyle="--", label="best without held invariants"),
    ]
    grey = {"linestyle": "none", "color": "#444444"}
    handles += [
        Line2D([], [], marker=m, markerfacecolor="white", label=p, **grey) for p, m in _MARKERS.items()
    ]
    handles += [
        Line2D([], [], marker="o", label="filled: invariants projected", **grey),
        Line2D([], [], marker="*", markersize=10, label=f"closed form, {SAMPLES} samples", **grey),
    ]
    axes.legend(handles=handles, loc="center", fontsize=10.5, frameon=False)
    axes.set_title("default: double precision, tolerance 2.2e-16, quaternions", fontsize=10.5)


def markdown(scenes: dict[str, Points]) -> str:
    """For each scene, horizon and accuracy the cheapest setting of Taylor's method and its cost."""
    head = " | ".join(f"{level:.0e} rad" for level in LEVELS)
    lines = [f"| scene | horizon, rad | {head} |", "| --- | --- |" + " --- |" * len(LEVELS)]
    for name, points in scenes.items():
        for horizon, some in points.items():
            cells = []
            for level in LEVELS:
                point = cheapest([p for p in some if p.setting.method == "taylor"], level)
                cells.append("-" if point is None else f"{_short(point.setting)} ({point.cost:.2g})")
            lines.append(f"| {SCENES[name]} | {horizon:.0e} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _short(setting: Setting) -> str:
    tolerance = "" if setting.tolerance is None else f" {setting.tolerance:.0e}"
    return f"{setting.precision}{tolerance}{', held' if setting.hold_invariants else ''}"


def checks(scenes: dict[str, Points]) -> list[Check]:
    """What theory says of any scene: rounding sets the floor of a precision, and the closed form has none."""
    found = []
    for name, points in scenes.items():
        horizon = min(points)
        by = {p.setting: p for p in points[horizon]}
        for low, high, bits in (("single", "double", 29), ("double", "extended", 11)):
            ratio = math.log2(by[Setting(low)].error / by[Setting(high)].error)
            source = f"floors go like epsilon, {bits} bits apart; two random walks, 4 bits each"
            found.append(
                Check(f"{SCENES[name]}: bits from {low} to {high}", ratio, bits, 8.0, "1", source, "absolute")
            )
    return found


def precision_tradeoff(full: bool, out: Path) -> list[Check]:
    """Measure all scenes, draw them, print the table."""
    scenes = {}
    for name in SCENES:
        print(name, file=sys.stderr, flush=True)
        scenes[name] = measure_scene(name, to=1e6 if full else 1e3, processes=5 if full else 1)
    draw(scenes, out)
    print(markdown(scenes))
    return checks(scenes)


if __name__ == "__main__":
    sys.exit(main(precision_tradeoff, NAME))
