"""Digits: what a precision promises is what the dataset holds."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
import xarray
from support import run_text

from rigidsim.store.variables import parts_in

TOP = """
name = "top"
[body]
principal_moments = [2, 2, 3]
[initial]
angular_velocity = [0.1, 0, 0.7]
[time]
end = 20
samples = 5
"""


def exact_rates(digits: int, times: list) -> list[list]:
    """Rates of the free symmetric top: w1 = 0.1 cos(0.35 t), w2 = 0.1 sin(0.35 t), exactly."""
    with mpmath.workdps(digits + 20):
        rate = mpmath.mpf(7) / 20
        return [[mpmath.cos(rate * t) / 10, mpmath.sin(rate * t) / 10, mpmath.mpf(7) / 10] for t in times]


def summed(dataset: xarray.Dataset, name: str) -> list[list]:
    """All parts of a variable, smallest first, as mpf."""
    parts = [dataset[part].values for part in parts_in(dataset, name)]
    rows = []
    with mpmath.workprec(4000):
        for i in range(parts[0].shape[0]):
            rows.append(
                [sum(mpmath.mpf(float(p[i, k])) for p in reversed(parts)) for k in range(parts[0].shape[1])]
            )
    return rows


@pytest.mark.parametrize(
    ("precision", "digits", "bits"),
    [
        ("double", 16, 53),
        ("extended", 19, 64),
        ("quadruple", 34, 113),
        (25, 25, 86),
        (50, 50, 169),
        pytest.param(100, 100, 335, marks=pytest.mark.slow),
    ],
)
def test_rates_have_the_digits_of_the_precision(precision: str | int, digits: int, bits: int) -> None:
    """0.1 and 0.7 are no binary numbers: a double anywhere on the way would cost all digits past 16."""
    setting = precision if isinstance(precision, int) else f'"{precision}"'
    run = run_text(TOP, f"integrator.precision={setting}")
    exact = exact_rates(digits, [0, 5, 10, 15, 20])
    with mpmath.workprec(4000):
        error = max(
            abs(a - b) for x, y in zip(summed(run.dataset, "angular_velocity"), exact, strict=True)
            for a, b in zip(x, y, strict=True)
        )  # fmt: skip
        steps = run.summary["cost"]["steps"]
        # the rounding of amplitude 0.1 at each step, as a random walk, three standard deviations
        assert error <= 3 * 0.1 * mpmath.mpf(2) ** (1 - bits) * math.sqrt(steps)


def test_a_tenth_at_fifty_digits_is_one_tenth() -> None:
    run = run_text(TOP, "integrator.precision=50")
    first = summed(run.dataset, "angular_velocity")[0]
    with mpmath.workprec(4000):
        # half a unit in the last of 169 bits
        assert abs(first[0] - mpmath.mpf(1) / 10) <= mpmath.mpf(2) ** (-169 - 3)
    assert {"angular_velocity_lo", "angular_velocity_lo2", "angular_velocity_lo3"} <= set(run.dataset)


def test_tenths_as_sample_times_are_tenths_in_quadruple_precision() -> None:
    run = run_text(TOP, 'integrator.precision="quadruple"', "time.end=1", "time.samples=11")
    parts = [run.dataset[name].values for name in ("time", "time_lo", "time_lo2")]
    with mpmath.workprec(300):
        for i in range(11):
            value = sum(mpmath.mpf(float(p[i])) for p in reversed(parts))
            assert abs(value - mpmath.mpf(i) / 10) <= mpmath.mpf(2) ** -112


def test_tolerance_is_what_the_steps_obey() -> None:
    """A looser tolerance takes a lower order and gives a larger error, as asked."""
    errors, orders = [], []
    for tolerance in ("1e-6", "1e-9", "1e-12"):
        run = run_text(TOP, f"integrator.tolerance={tolerance}", "time.end=200")
        rates = run.dataset["angular_velocity"].values
        exact = np.array(exact_rates(20, list(run.dataset["time"].values)), dtype=float)
        errors.append(np.abs(rates - exact).max())
        orders.append(run.dataset.attrs["taylor_order"])
        # steps of local error tolerance, at worst all of one sign
        assert errors[-1] <= float(tolerance) * run.summary["cost"]["steps"]
    assert errors[0] > errors[1] > errors[2]
    assert orders == [8, 12, 15]
