"""Integer times of the viewer: exact, in range, for any scale of time."""

from __future__ import annotations

import numpy as np
import pytest

from rigidsim.look.clock import build_clock
from rigidsim.look.thinning import thinned_indices


def test_milliseconds_are_exact_nanoseconds() -> None:
    clock = build_clock(np.arange(100_001) * 0.001)
    assert clock.duration
    assert clock.name == "time"
    np.testing.assert_array_equal(clock.ticks, np.arange(100_001) * 1_000_000)


def test_a_year_of_seconds_keeps_every_nanosecond_that_float64_has() -> None:
    times = 3.15576e7 + np.array([0.0, 0.25, 0.5])
    assert build_clock(times).ticks.tolist() == [
        31_557_600_000_000_000,
        31_557_600_250_000_000,
        31_557_600_500_000_000,
    ]


def test_whole_nanoseconds_stay_a_duration_below_the_resolution() -> None:
    clock = build_clock(np.arange(50) * 1e-9)
    assert clock.duration
    np.testing.assert_array_equal(clock.ticks, np.arange(50))


@pytest.mark.parametrize("step", [1e-13, 3e-12, 1.7e-9, 2.5037e-7, 1.0, 1e9, 1e14, 1e22])
def test_steps_of_any_size_are_resolved_to_a_thousandth(step: float) -> None:
    times = np.arange(1001) * step
    clock = build_clock(times)
    back = clock.ticks * clock.seconds_per_tick
    assert clock.ticks.dtype == np.int64
    assert (np.diff(clock.ticks) > 0).all()
    # Half a tick, and float64's own rounding of the product.
    np.testing.assert_allclose(back, times, rtol=1e-15, atol=0.5001 * clock.seconds_per_tick)
    assert clock.seconds_per_tick <= 1e-3 * step * (1 + 1e-9)


def test_femtosecond_steps_name_their_unit() -> None:
    clock = build_clock(np.arange(11) * 1e-13)
    assert not clock.duration
    assert clock.name == "time [as]"
    np.testing.assert_array_equal(clock.ticks, np.arange(11) * 100_000)


def test_horizon_beyond_292_years_leaves_nanoseconds() -> None:
    inside = build_clock(np.array([0.0, 9.1e9]))
    beyond = build_clock(np.array([0.0, 9.3e9]))
    assert inside.duration
    assert not beyond.duration
    assert beyond.ticks[-1] * beyond.seconds_per_tick == 9.3e9


@pytest.mark.parametrize(("symbol", "unit"), [("yr", 31_557_600.0), ("d", 86_400.0)])
def test_long_runs_of_whole_years_or_days_count_these(symbol: str, unit: float) -> None:
    times = 4 * unit * np.arange(0, 500_000, 7)
    clock = build_clock(times)
    assert (clock.name, clock.duration, clock.seconds_per_tick) == (f"time [{symbol}]", False, unit)
    np.testing.assert_array_equal(clock.ticks, 4 * np.arange(0, 500_000, 7))
    assert build_clock(times * (1 + 1e-12)).name != clock.name  # not whole ones


def test_small_steps_on_a_long_horizon_fit_62_bits() -> None:
    clock = build_clock(np.array([0.0, 1e-9, 1e14]))
    assert 0 < clock.ticks[-1] <= 2**62
    assert clock.ticks[-1] * clock.seconds_per_tick == pytest.approx(1e14, rel=1e-15)


def test_negative_times_keep_their_order() -> None:
    clock = build_clock(np.array([-1.5, -0.25, 0.0, 2.0]))
    assert clock.ticks.tolist() == [-1_500_000_000, -250_000_000, 0, 2_000_000_000]


def test_time_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match="must be finite"):
        build_clock(np.array([0.0, np.nan]))


@pytest.mark.parametrize("count", [1, 2, 3, 7, 99, 100, 101, 1000, 12_345, 10**8])
@pytest.mark.parametrize("rows", [2, 3, 10, 100])
def test_thinning_keeps_first_and_last_evenly(count: int, rows: int) -> None:
    indices = thinned_indices(count, rows)
    assert indices[0] == 0
    assert indices[-1] == count - 1
    assert len(indices) <= rows
    steps = np.diff(indices)
    assert (steps[:-1] == steps[:1]).all()  # only the last step may be shorter
    assert len(steps) == 0 or 0 < steps[-1] <= steps[0]
    if count <= rows:
        np.testing.assert_array_equal(indices, np.arange(count))


def test_thinning_to_less_than_two_rows_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 2"):
        thinned_indices(10, 1)
