"""Measured speed and accuracy: errors are the true ones, nothing is dropped or extrapolated in silence."""

import numpy as np
import pytest
import xarray
from hypothesis import given, settings
from hypothesis import strategies as st

from rigidsim.accuracy.bench import RowStatus, advice

EPSILON = 2.0**-52


def made_up(error: list[float], cost: list[float], status: list[str]) -> xarray.Dataset:
    n = len(error)
    values = {
        "attitude_error_largest": ("setting", np.array(error)),
        "reference_error": ("setting", np.full(n, 1e-45)),
        "cpu_ratio": ("setting", np.array(cost)),
        "cpu_seconds": ("setting", np.array(cost)),
        "status": ("setting", np.array(status, dtype=object)),
        "measured_time": ("setting", np.full(n, 10.0)),
    }
    coords = {
        "setting": [f"s{i}" for i in range(n)],
        "precision": ("setting", ["double"] * n),
        "tolerance": ("setting", np.full(n, EPSILON)),
        "formulation": ("setting", ["quaternion"] * n),
        "held": ("setting", np.zeros(n, dtype=np.int8)),
        "method": ("setting", ["taylor"] * n),
    }
    return xarray.Dataset(values, coords=coords)


POINTS = st.lists(
    st.tuples(
        st.floats(-30, 0).map(lambda x: 10**x),
        st.floats(-2, 4).map(lambda x: 10**x),
        st.sampled_from([RowStatus.MEASURED, RowStatus.MEASURED, RowStatus.SHORT]),
    ),
    min_size=1,
    max_size=12,
)


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(POINTS)
def test_the_advice_is_the_cheapest_that_keeps_the_accuracy(points: list[tuple[float, float, str]]) -> None:
    error, cost, status = (list(column) for column in zip(*points, strict=True))
    for row in advice(made_up(error, cost, status)):
        for level in np.arange(np.log10(row.at_most), np.log10(row.more_than) + 0.5, -1.0):
            allowed = 10.0 ** round(level)
            full = [c for e, c, s in points if s == RowStatus.MEASURED and e <= allowed]
            short = [c for e, c, s in points if s == RowStatus.SHORT and e <= allowed]
            assert row.error <= allowed
            assert row.less == (not full)
            assert row.cost == min(full or short)
