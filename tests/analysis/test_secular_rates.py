"""Announced errors of secular rates beside what is neither a line nor a polynomial of degree one."""

from itertools import product

import numpy as np
import pytest
import xarray
from support import cases

import rigidsim

KINDS = ("decay", "growth", "slow", "quadratic", "cubic", "noise", "decay in noise")


def _share(seed: int, kind: str) -> float:
    """True error of a random signal's secular rate over the announced one."""
    rng = np.random.default_rng([25, 3, seed])
    count = int(rng.integers(200, 1200))
    x = (2 * np.arange(count) - (count - 1)) / count
    rate, size = rng.uniform(-1, 1), 10 ** rng.uniform(-4, 0)
    values = rate * x
    for _ in range(rng.integers(0, 3)):
        bins = rng.uniform(8, 0.3 * count)
        values = values + 10 ** rng.uniform(-2, 0) * np.cos(np.pi * bins * x + rng.uniform(0, 6))
    scale = 10 ** rng.uniform(-1, 1)  # half lengths in which an exponential changes by e
    if kind.startswith(("decay", "growth")):
        values = values + size * np.exp(-(x + 1) / scale if kind != "growth" else (x - 1) / scale)
    if kind == "slow":  # 1.05 to 6 times as long as the samples
        values = values + size * np.cos(np.pi * x / rng.uniform(1.05, 6) + rng.uniform(0, 6))
    if kind == "quadratic":
        values = values + size * x**2
    if kind == "cubic":
        values = values + size * x**3
    if kind == "noise":
        values = values + size * rng.standard_normal(count)
    if kind == "decay in noise":  # which mustn't hide its curvature: of its slope nothing would be known
        curvature = size / scale**2 / 2 * np.exp(-1 / scale)
        values = values + curvature * np.sqrt(count) / 50 * rng.standard_normal(count)
    dataset = xarray.Dataset(
        {"x": ("time", values, {"units": "rad"})}, coords={"time": np.arange(float(count))}
    )
    signal = rigidsim.analyse(dataset, lines=8)["x"]
    true = rate * 2 / count
    off = abs(float(signal.rate.real) - true)
    return off / (signal.rate_error + 1e-16 * abs(true))


@pytest.mark.parametrize("case", cases(product(KINDS, range(16)), [(kind, 0) for kind in KINDS[::3]], 6))
def test_the_error_of_a_secular_rate_is_announced(case: tuple[str, int]) -> None:
    kind, seed = case
    assert _share(seed, kind) <= 3


def test_resolved_slow_lines_are_no_part_of_the_error() -> None:
    """Whatever else is left, from lines that weren't asked for."""
    count = 2000
    x = (2 * np.arange(count) - (count - 1)) / count
    faint = sum(1e-9 * np.cos(np.pi * k * x) for k in range(40, 80, 4))
    data = {"x": ("time", 0.7 * x + np.cos(2.3 * np.pi * x + 0.4) + faint, {"units": "rad"})}
    dataset = xarray.Dataset(data, coords={"time": np.arange(float(count))})
    signal = rigidsim.analyse(dataset, lines=3)["x"]
    off = abs(float(signal.rate.real) * count / 2 - 0.7)
    assert off < 3 * signal.rate_error * count / 2 < 1e-8
