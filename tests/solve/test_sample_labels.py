"""A sample's label is the number that the config means, rounded once, and its time of integration is too."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import run_text

import rigidsim
from rigidsim.solve.problem import prepare

SPIN = """
name = "spin"
[body]
principal_moments = [1, 2, 3]
[initial]
angular_velocity = [0.5, 0.25, 1]
[time]
"""

PRECISIONS = {"single": 24, "double": 53, "extended": 64, "quadruple": 113, "50": 169}


def clock_of(text: str, precision: str) -> Any:
    asked = precision if precision.isdigit() else f'"{precision}"'
    return prepare(rigidsim.parse(SPIN + text + f"\n[integrator]\nprecision = {asked}")).clock


def check(clock: Any, wanted: list[Fraction], first: int, bits: int) -> None:
    """Labels are doubles nearest to the times, and with their residuals numbers nearest in the precision."""
    times = clock.internal(first, first + len(wanted))
    parts = clock.parts(first, times)
    assert parts[0].tolist() == [float(t) for t in wanted]
    for i, time in enumerate(wanted):
        found = sum((Fraction(float(part[i])) for part in parts), Fraction(0))
        assert abs(found - time) <= abs(time) * Fraction(1, 2**bits)  # half a unit in the last place at most
        assert float(times[i]) * 2.0**clock.exponent == pytest.approx(float(found), rel=2.0**-23)


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize(
    ("start", "every", "end"),
    [
        ("-0.3", "0.1", "10"),
        ("1/7", "1/3", "40"),
        ("0", "0.000123456789012345678901234567", "0.05"),  # too long for one division, but in quadruple
        ("-1234567.8901234567890123456789", "17.000000000000000000000001", "0"),
    ],
)
def test_each_label_is_the_exact_time_rounded_once(precision: str, start: str, every: str, end: str) -> None:
    clock = clock_of(f'start = "{start}"\nevery = "{every}"\nend = "{end}"', precision)
    for first in (0, clock.count // 2, max(0, clock.count - 100)):
        rows = range(first, min(first + 100, clock.count))
        wanted = [Fraction(start) + i * Fraction(every) for i in rows]
        check(clock, wanted, first, PRECISIONS[precision])


@pytest.mark.parametrize("precision", ["double", "extended", "quadruple"])
def test_labels_halfway_between_two_doubles_go_to_the_even_one(precision: str) -> None:
    begin = 2**53 + 1
    clock = clock_of(f'start = "{begin}"\nevery = 4\nend = "{begin + 400}"', precision)
    check(clock, [Fraction(begin + 4 * i) for i in range(101)], 0, PRECISIONS[precision])


decimals = st.decimals(-(10**6), 10**6, allow_nan=False, places=9)


@settings(max_examples=40, deadline=None)
@given(
    start=decimals,
    span=st.decimals(1, 10**6, allow_nan=False, places=9),
    count=st.integers(2, 10**7),
    place=st.floats(0, 1),
)
def test_samples_of_an_interval_too(start: object, span: object, count: int, place: float) -> None:
    begin, length = Fraction(str(start)), Fraction(str(span))
    clock = clock_of(f'start = "{start}"\nend = "{begin + length}"\nsamples = {count}', "extended")
    first = int(place * (clock.count - 2))
    step = length / (clock.count - 1)
    check(clock, [begin + i * step for i in range(first, min(first + 5, clock.count))], first, 64)


@pytest.mark.parametrize("precision", ["single", "double", "extended"])
def test_a_decimal_finds_its_sample(precision: str) -> None:
    text = SPIN + f'start = -0.3\nevery = 0.1\nend = 1\n[integrator]\nprecision = "{precision}"'
    dataset = run_text(text).dataset
    for time in (-0.3, -0.2, -0.1, 0, 0.1, 0.7, 1.0):
        assert dataset["quaternion"].sel(time=time).shape == (4,)


def test_a_list_has_exact_labels_in_single_precision_too() -> None:
    text = SPIN + 'times = [0, 0.1, "1/3"]\n[integrator]\nprecision = "single"'
    dataset = run_text(text).dataset
    assert dataset["time"].values.tolist() == [0, 0.1, 1 / 3]
    narrow = np.array([0, 0.1, 1 / 3], dtype=np.float32).astype(float)
    np.testing.assert_array_equal(dataset["time"].values + dataset["time_lo"].values, narrow)
