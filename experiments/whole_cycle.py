"""The Earth's whole precession at three levels of model: how far are they apart, and what does each cost?

``configs/earth_precession_averaged.toml`` with every rotation resolved, averaged over the rotation, and
over the orbits as well, with and without short-period terms: 25,760 years with --full, 56 otherwise.
Besides, under a Sun and a Moon that are integrated (``configs/bodies/earth_moon_sun.toml``).
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.common import CONFIGS, Answer, Check, Curve, Panel, Picture, Result, Study, covered, simulate

CONFIG = CONFIGS / "earth_precession_averaged.toml"
INTEGRATED = CONFIGS / "bodies" / "earth_moon_sun.toml"
YEAR = 31557600.0
AXES = ("momentum_axis", "figure_axis", "obliquity", "node_longitude")
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


def run(level: Level, end: str, every: str, scene: Path = CONFIG, record: Sequence[str] = AXES) -> Result:
    """One of them; what the averaged ones announce is measured after their run."""
    return simulate(
        scene,
        f'model.level="{level.name}"',
        f"model.short_period={str(level.short_period).lower()}",
        f'time.end="{end}"',
        f'time.every="{every}"',
        f"output.estimate={str(level.bound is not None).lower()}",
        f"output.record={list(record)!r}",
    ).told(level.label)


def integrated(years: int) -> Check:
    """Under a Sun and a Moon that are integrated: the average from every rotation, over what is announced."""
    full, averaged = (
        run(level, f"{years} yr", f"{2 * years} day", INTEGRATED, ["momentum_axis"])
        for level in (FULL, AVERAGED[0])
    )
    title = "spin_averaged, Sun and Moon integrated: momentum's direction"
    return covered(title, averaged.apart(full), averaged.announced())


def picture(resolved: Result, results: dict[Level, Result]) -> Picture:
    """Differences along time, of both axes: momentum and figure lie apart by a nutation of 1e-8 rad."""
    years = resolved.values("time")[1:] / YEAR
    return Picture("The whole precession: averaged motions less the full one", "ab", [
        Panel("", "time (yr)", f"{words}, difference (rad)", [
            Curve(years, np.abs(result.values(name) - resolved.values(name)).max(axis=1)[1:], level.label,
                  level.color, ".", 0.5)
            for level, result in results.items()
        ], "y", legend="lower right")
        for name, words in SHOWN.items()
    ], (11.5, 5.2))  # fmt: skip


@Study
def study(full: bool) -> Answer:
    """All levels beside the full motion; see the module's text."""
    span = ("25760 yr", "28 yr") if full else ("56 yr", "0.2 yr")
    resolved = run(FULL, *span)
    results = {level: run(level, *span) for level in AVERAGED}
    checks = []
    for level, result in results.items():
        for name, words in SHOWN.items():
            largest = float(np.abs(result.values(name) - resolved.values(name)).max())
            if level.bound is None:
                print(f"{level.label:32s} {words}: at most {largest:.2g} rad apart", file=sys.stderr)
                continue
            title = f"{level.label}: {words}, from the full motion"
            source = "what was asked, over the whole cycle"
            checks.append(Check(title, largest, 0.0, level.bound, "rad", source, "absolute"))
        if level.bound is not None:
            checks += [
                covered(f"{level.label}: {axis}", result.apart(resolved, axis), result.announced(axis))
                for axis in ("momentum_axis", "figure_axis")
            ]
    return [*checks, integrated(40 if full else 4)], picture(resolved, results)
