"""What does accuracy cost: which precision, which tolerance, held invariants or not, for how long a run?

For five scenes and horizons of 1e2 to 1e6 radians of the fastest rate ``rigidsim.tradeoff`` measures every
setting in quaternions, as errors against the closed form or a finer reference, and CPU times over those of
double precision at a tolerance of its epsilon; the study names the cheapest setting for each accuracy.

Reduced: to 1e3 radians, speeds from one process, 90 s for each measurement; --full: to 1e6, from five, 240 s
(up to two hours). A row names the radians that were measured in this time.
"""

import math

import numpy as np
import xarray

import rigidsim
from experiments.common import CONFIGS, Answer, Check, Curve, Panel, Picture, Study
from rigidsim.accuracy.bench import trusted_error
from rigidsim.solve.problem import prepare

SCENES = {
    "asymmetric_top": "free asymmetric body",
    "heavy_top_nutating": "heavy symmetric top",
    "gravity_gradient_libration": "gravity-gradient satellite",
    "central_gravity_dumbbell": "dumbbell in orbit, six degrees",
    "kovalevskaya_top": "Kovalevskaya's top",
}
LEVELS = (1e-3, 1e-6, 1e-9, 1e-12, 1e-15)
COLORS = ("#fdae61", "#d7301f", "#7a0177", "#2b8cbe", "#08306b")


def measured(name: str, horizon: float, processes: int, budget: float) -> xarray.Dataset:
    """All settings of a scene of ``configs/`` over so many radians, with ``error`` (rad) and ``cost``."""
    experiment = rigidsim.load(CONFIGS / f"{name}.toml")
    end = horizon / float(prepare(experiment).system.rate_bound)
    given = rigidsim.load(CONFIGS / f"{name}.toml", overrides=[f"time.end={end!r}"])
    data = rigidsim.tradeoff(given, budget=budget, repeats=processes).dataset
    data["error"], data["cost"] = ("setting", trusted_error(data)), data["cpu_ratio"]
    chosen = (data.formulation == "quaternion") & (data.method == "taylor") & (data.status == "measured")
    return data.isel(setting=chosen.values)


def front(data: xarray.Dataset) -> np.ndarray:
    """Costs and errors (2, n) of the settings that no other beats in both, from the cheapest on."""
    pairs = np.array(sorted(zip(data.cost.values, data.error.values, strict=True))).T
    best = np.minimum.accumulate(np.nan_to_num(pairs[1], nan=np.inf))
    return pairs[:, np.diff(best, prepend=np.inf) < 0]


def row(title: str, horizon: float, data: xarray.Dataset) -> str:
    """Markdown: for each accuracy the cheapest setting and its cost."""
    cells = []
    for level in LEVELS:
        fit = data.isel(setting=(data.error <= level).values)
        if not fit.sizes["setting"]:
            cells.append("-")
            continue
        one = fit.isel(setting=int(np.argmin(fit.cost.values)))
        held = ", held" if one.held else ""
        cells.append(f"{one.precision.item()} {float(one.tolerance):.0e}{held} ({float(one.cost):.2g})")
    return f"| {title} | {horizon:.0e} | {' | '.join(cells)} |"


def floors(title: str, data: xarray.Dataset) -> list[Check]:
    """Rounding sets the floor of a precision: errors at tolerances of epsilon, the finest measured."""
    plain = data.isel(setting=(data.held == 0).values)
    names = ("single", "double", "extended")
    errors = {name: plain.error.values[(plain.precision == name).values] for name in names}
    floor = {name: float(values.min()) for name, values in errors.items() if len(values)}
    source = "floors go like epsilon, {} bits apart; two random walks, 4 bits each"
    return [
        Check(f"{title}: bits from {low} to {high}", math.log2(floor[low] / floor[high]), bits, 8.0, "1",
              source.format(bits), "absolute")
        for low, high, bits in (("single", "double", 29), ("double", "extended", 11))
        if low in floor and high in floor  # else the time budget was too short for them
    ]  # fmt: skip


@Study
def tradeoff(full: bool) -> Answer:
    """All scenes over all horizons; prints the table."""
    horizons = [10.0**n for n in range(2, 7 if full else 4)]
    checks, panels = [], []
    print("| scene | horizon, rad | " + " | ".join(f"{level:.0e} rad" for level in LEVELS) + " |")
    print("| --- " * (2 + len(LEVELS)) + "|")
    for name, title in SCENES.items():
        curves = []
        for horizon, color in zip(horizons, COLORS, strict=False):
            data = measured(name, horizon, 5 if full else 1, 240.0 if full else 90.0)
            reach = horizon * data.attrs["measured_seconds"] / data.attrs["horizon_seconds"]
            print(row(title, reach, data), flush=True)
            if horizon == horizons[0]:
                checks += floors(title, data)
            curves.append(Curve(*front(data), f"over {reach:.0e} rad", color, "o-", 1.5))
        panels.append(Panel(title, "CPU time over the default's", "largest attitude error, rad", curves,
                            log="xy"))  # fmt: skip
    return checks, Picture("What accuracy costs: attitude error against CPU time", "abc;de.", panels, (15, 9))
