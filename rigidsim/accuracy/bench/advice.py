"""Advice from a measurement: the cheapest setting for each decade of accuracy."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rigidsim.accuracy.bench.dataset import trusted_error
from rigidsim.accuracy.bench.measure import RowStatus
from rigidsim.accuracy.setting import Setting, precision_titled

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class BestSetting:
    """For an attitude error of at most ``at_most`` and more than ``more_than``: the cheapest setting.

    Attributes:
        error: its largest attitude error, rad.
        cost: CPU time relative to the default setting's.
        seconds: length of the motion over which this was measured, s.
        less: whether that is less than for the other settings, so that costs don't compare.
        keys: lines of ``[integrator]``.
    """

    at_most: float
    more_than: float
    title: str
    error: float
    cost: float
    seconds: float
    less: bool
    keys: tuple[str, ...]


def advice(dataset: xarray.Dataset) -> list[BestSetting]:
    """For each decade of accuracy from 1 rad on, the cheapest setting that reaches it.

    A setting that was measured over less of the motion is named only if no other reaches the accuracy.
    """
    error, cost = trusted_error(dataset), dataset["cpu_ratio"].values
    status = dataset["status"].values
    known = np.isfinite(error) & np.isfinite(cost)
    if not known.any():
        return []
    smallest = max(float(error[known].min()), 1e-60)
    found: list[tuple[int, int, bool]] = []  # exponent, setting, measured over less
    for exponent in range(0, math.floor(math.log10(smallest)) - 1, -1):
        for kind in (RowStatus.MEASURED, RowStatus.SHORT):
            fit = np.nonzero(known & (status == kind.value) & (error <= 10.0**exponent))[0]
            if len(fit):
                found.append((exponent, int(min(fit, key=lambda n: cost[n])), kind is RowStatus.SHORT))
                break
    result: list[BestSetting] = []
    for position, (exponent, n, less) in enumerate(found):
        if position and found[position - 1][1] == n:
            continue
        last = exponent
        for later, other, _ in found[position:]:
            if other != n:
                break
            last = later
        result.append(_advice_of(dataset, n, exponent, last, less, float(error[n])))
    return result


def _advice_of(
    dataset: xarray.Dataset, n: int, first: int, last: int, less: bool, error: float
) -> BestSetting:
    one = dataset.isel(setting=n)
    return BestSetting(
        at_most=10.0**first,
        more_than=10.0 ** (last - 1),
        title=str(one["setting"].item()),
        error=error,
        cost=float(one["cpu_ratio"]),
        seconds=float(one["measured_time"]),
        less=less,
        keys=_keys(one),
    )


def _keys(one: xarray.Dataset) -> tuple[str, ...]:
    """The setting as lines for ``[integrator]``."""
    precision = precision_titled(str(one["precision"].item()))
    keys = [f"precision = {precision}" if isinstance(precision, int) else f'precision = "{precision}"']
    default, method, tolerance = Setting(precision), one["method"].item(), float(one["tolerance"])
    if method != default.method:
        keys.append(f'method = "{method}"')
    if math.isfinite(tolerance) and tolerance != default.step_tolerance:
        keys.append(f"tolerance = {tolerance:.0e}")
    if one["formulation"].item() != default.formulation:
        keys.append(f'formulation = "{one["formulation"].item()}"')
    if one["held"].item():
        keys.append("hold_invariants = true")
    return tuple(keys)
