"""A sample's label is the number that the config means, rounded once, and its time of integration is too."""

import random
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
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
        assert float(times[i]) * clock.unit == pytest.approx(float(found), rel=2.0**-23)


GRIDS = [
    ("-0.3", "0.1", "10"),
    ("1/7", "1/3", "40"),
    ("0", "0.000123456789012345678901234567", "0.05"),  # too long for one division, but in quadruple
    ("-1234567.8901234567890123456789", "17.000000000000000000000001", "0"),
]


@pytest.mark.parametrize("precision", PRECISIONS)
def test_each_label_is_the_exact_time_rounded_once(precision: str) -> None:
    """Halfway between two doubles it is the even one; samples of an interval, at random places, too."""
    for start, every, end in GRIDS:
        clock = clock_of(f'start = "{start}"\nevery = "{every}"\nend = "{end}"', precision)
        for first in (0, clock.count // 2, max(0, clock.count - 100)):
            rows = range(first, min(first + 100, clock.count))
            wanted = [Fraction(start) + i * Fraction(every) for i in rows]
            check(clock, wanted, first, PRECISIONS[precision])
    if precision != "single":  # whose numbers are further apart there
        begin = 2**53 + 1
        clock = clock_of(f'start = "{begin}"\nevery = 4\nend = "{begin + 400}"', precision)
        check(clock, [Fraction(begin + 4 * i) for i in range(101)], 0, PRECISIONS[precision])
    if precision == "extended":
        chance = random.Random(4)
        for _ in range(8):
            start, span = (str(round(chance.uniform(1, 10**6), 9)) for _ in range(2))
            count, length = chance.randint(8, 10**7), Fraction(span)
            clock = clock_of(
                f'start = "{start}"\nend = "{Fraction(start) + length}"\nsamples = {count}', precision
            )
            first, step = chance.randrange(count - 7), length / (count - 1)
            check(clock, [Fraction(start) + i * step for i in range(first, first + 5)], first, 64)


# ---- samples lie where they were asked for, however they are asked for


def times(text: str, precision: str = "double") -> np.ndarray:
    prepared = prepare(rigidsim.parse(SPIN + text + f'\n[integrator]\nprecision = "{precision}"'))
    clock = prepared.clock
    return clock.internal(0, clock.count).astype(float) * clock.unit


def test_samples_lie_where_they_are_written() -> None:
    assert np.array_equal(times("end = 100\nevery = 0.1"), times("end = 100\nsamples = 1001"))
    assert times("end = 1.05\nevery = 0.1")[-1] == 1.0  # an end off the grid isn't sampled
    assert times("times = [0, 0.1, 0.25, 7]").tolist() == [0, 0.1, 0.25, 7]
    assert times('times = ["1 h", "1 d"]').tolist() == [3600, 86400]
    assert run_text(SPIN + "times = [5]").dataset["time"].values.tolist() == [5]


@pytest.mark.parametrize("integrator", ["", 'method = "closed_form"'])
def test_the_motion_begins_at_start_and_not_at_the_first_sample(integrator: str) -> None:
    text = SPIN + "{}\n[integrator]\n" + integrator
    late = run_text(text.format("times = [12.5, 25]"), 'name="a"').dataset
    grid = run_text(text.format("end = 25\nsamples = 3"), 'name="b"').dataset
    np.testing.assert_array_equal(late["quaternion"], grid["quaternion"][1:])
    before = run_text(text.format("start = -12.5\ntimes = [0, 12.5]"), 'name="c"').dataset
    # the same motion on a clock that is 12.5 s behind: times are exact in both
    assert np.abs(before["quaternion"].values - grid["quaternion"].values[1:]).max() < 1e-14
