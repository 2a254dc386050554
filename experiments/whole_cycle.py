"""The Earth's whole precession at three levels of model: how far are they apart, and what does each cost?

``configs/earth_precession_averaged.toml`` with every rotation resolved, averaged over the rotation, and
over the orbits as well, with and without short-period terms: 25,760 years with --full, 56 otherwise.
Besides, under a Sun and a Moon that are integrated (``configs/bodies/earth_moon_sun.toml``).
"""

import sys
from dataclasses import dataclass

import numpy as np

from experiments.common import CONFIGS, Answer, Check, Curve, Panel, Picture, Result, Study, simulate

CONFIG = CONFIGS / "earth_precession_averaged.toml"
INTEGRATED = CONFIGS / "bodies" / "earth_moon_sun.toml"
YEAR = 31557600.0
SHOWN = {"obliquity": "obliquity", "node_longitude": "longitude of the node"}


@dataclass(frozen=True)
class Level:
    """A model, and how it is drawn.

    Attributes:
        bound: on its differences from the full motion, rad; None without short-period terms, which are the
            nutation that averaging removes and differ by just that.
    """

    name: str
    short_period: bool
    color: str
    bound: float | None

    @property
    def label(self) -> str:
        """For tables and keys."""
        return self.name + (", short period" if self.short_period else "")


FULL = Level("full", False, "grey", None)
AVERAGED = (
    Level("spin_averaged", True, "blue", 1e-6),
    Level("spin_averaged", False, "green", None),
    Level("orbit_averaged", True, "orange", 1e-5),
    Level("orbit_averaged", False, "grey", None),
)


def run(level: Level, end: str, every: str) -> Result:
    """One of them; what the averaged ones announce is measured after their run."""
    return simulate(
        CONFIG,
        f'model.level="{level.name}"',
        f"model.short_period={str(level.short_period).lower()}",
        f'time.end="{end}"',
        f'time.every="{every}"',
        f"output.estimate={str(level.bound is not None).lower()}",
    )


def apart(averaged: Result, full: Result, name: str) -> np.ndarray:
    """Differences at the samples, rad, of the momentum's and of the figure's axis."""
    return np.asarray(averaged.values(name) - full.values(name))


def told(level: Level, result: Result) -> None:
    """Steps and CPU of a run, on stderr."""
    cost = result.summary["cost"]
    cpu = cost["cpu_by_phase"]["integrate_and_record"]
    print(f"{level.label:32s} {result.steps:12,d} steps, integrate and record {cpu:.3g} s", file=sys.stderr)


@Study
def study(full: bool) -> Answer:
    """All levels beside the full motion; see the module's text."""
    span = ("25760 yr", "28 yr") if full else ("56 yr", "0.2 yr")
    resolved = run(FULL, *span)
    told(FULL, resolved)
    results = {level: run(level, *span) for level in AVERAGED}
    checks = []
    for level, result in results.items():
        told(level, result)
        for name, words in SHOWN.items():
            largest = float(np.abs(apart(result, resolved, name)).max())
            if level.bound is None:
                print(f"{level.label:32s} {words}: at most {largest:.2g} rad apart", file=sys.stderr)
                continue
            title = f"{level.label}: {words}, from the full motion"
            source = "what was asked, over the whole cycle"
            checks.append(Check(title, largest, 0.0, level.bound, "rad", source, "absolute"))
        if level.bound is not None:
            axes = ("momentum_axis", "figure_axis")
            ratio = max(
                float(np.linalg.norm(apart(result, resolved, axis), axis=1).max())
                / float(result.summary["modelling"][axis])
                for axis in axes
            )
            title = f"{level.label}: axes from the full motion's, over what is announced"
            checks.append(Check(title, ratio, 0.0, 1.0, "1", "summary.json, modelling", "absolute"))
    figure = picture(resolved, results)
    return [*checks, integrated(40 if full else 4)], figure


def integrated(years: int) -> Check:
    """Under a Sun and a Moon that are integrated: the average from every rotation, over what is announced."""
    levels = (FULL, AVERAGED[0])
    found = [
        simulate(
            INTEGRATED,
            f'model.level="{level.name}"',
            f"model.short_period={str(level.short_period).lower()}",
            f'time.end="{years} yr"',
            f'time.every="{2 * years} day"',
            'output.record=["momentum_axis"]',
        )
        for level in levels
    ]
    for level, result in zip(levels, found, strict=True):
        told(level, result)
    largest = float(np.linalg.norm(apart(found[1], found[0], "momentum_axis"), axis=1).max())
    announced = float(found[1].summary["modelling"]["momentum_axis"])
    print(f"integrated orbits, {years} years: {largest:.2g} rad, {announced:.2g} announced", file=sys.stderr)
    title = "spin_averaged, Sun and Moon integrated: momentum from the full motion's, over what is announced"
    return Check(title, largest / announced, 0.0, 1.0, "1", "summary.json, modelling", "absolute")


def picture(resolved: Result, results: dict[Level, Result]) -> Picture:
    """Differences along time, of both axes: momentum and figure lie apart by a nutation of 1e-8 rad."""
    years = resolved.values("time")[1:] / YEAR
    return Picture("The whole precession: averaged motions less the full one", "ab", [
        Panel("", "time (yr)", f"{words}, difference (rad)", [
            Curve(years, np.abs(apart(result, resolved, name)).max(axis=1)[1:], level.label, level.color, ".",
                  0.5)
            for level, result in results.items()
        ], "y", legend="lower right")
        for name, words in SHOWN.items()
    ], (11.5, 5.2))  # fmt: skip


if __name__ == "__main__":
    raise SystemExit(study.main())
