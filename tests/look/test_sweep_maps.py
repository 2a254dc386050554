"""Which picture of a sweep is drawn where none is asked for."""

from __future__ import annotations

import numpy as np
import pytest
import xarray

pytest.importorskip("matplotlib")

from rigidsim.look.figures.sweep_maps import drawable, sweep_figure


def swept(moments: int) -> xarray.Dataset:
    """First times of an event, ln(1/x)/moment, over 21 disturbances and so many moments."""
    push, moment = np.logspace(-6, -1, 21), np.linspace(2.5, 3.0, moments)
    first = np.log(1 / push)[:, None] / moment
    members = ("push", "moment")
    return xarray.Dataset(
        {
            "status": (members, np.zeros((21, moments), dtype=np.int8)),
            "spin_final": ((*members, "body_axis"), np.ones((21, moments, 3)), {"units": "rad/s"}),
            "flip_count": (members, np.ones((21, moments), dtype=np.int32), {"units": "1"}),
            "flip_first": (members, first, {"units": "s", "long_name": "first time of flip"}),
        },
        coords={"push": push, "moment": moment, "body_axis": list("xyz")},
        attrs={"title": "flips"},
    )


def test_the_first_time_of_an_event_comes_first_with_a_line_for_each_of_few_values() -> None:
    dataset = swept(3)
    assert drawable(dataset)[0] == "flip_first"
    (axes,) = sweep_figure(dataset).axes
    assert [line.get_label() for line in axes.get_lines()] == ["moment 2.5", "moment 2.75", "moment 3"]
    for line, values in zip(axes.get_lines(), dataset["flip_first"].values.T, strict=True):
        np.testing.assert_array_equal(line.get_xdata(), dataset["push"].values)
        np.testing.assert_array_equal(line.get_ydata(), values)
    assert axes.get_xscale() == "log"
    assert len(sweep_figure(dataset, "spin_final[1]").axes[0].get_lines()) == 3


def test_an_axis_of_many_values_makes_a_map() -> None:
    page = sweep_figure(swept(12))
    assert not page.axes[0].get_lines()
    assert len(page.axes[0].collections) == 1
