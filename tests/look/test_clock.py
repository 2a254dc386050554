"""Integer times of the viewer: exact, in range, for any scale of time."""

from __future__ import annotations

import numpy as np
import pytest

from rigidsim.look.clock import build_clock
from rigidsim.look.thinning import thinned_indices


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
