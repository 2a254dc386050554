"""What is written is what the netCDF libraries take for their own."""

from __future__ import annotations

from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray

from rigidsim.store.netcdf import NetcdfFile, writing

VALUES = np.arange(30.0).reshape(10, 3)


def fill(file: NetcdfFile) -> None:
    """Every kind of thing that datasets hold."""
    file.attributes({"title": "a text, grüße", "empty": "", "count": 3, "size": 0.1, "many": [1.0, 2.5]})
    file.dimension("time", 10)
    file.texts("axis", "axis", ["x", "y", "z"], {"long_name": "an axis"})
    file.variable("time", ("time",), {"units": "s"}, chunk=(4,), gzip=4)[...] = VALUES[:, 0]
    rates = file.variable("rates", ("time", "axis"), {"units": "rad s-1"}, chunk=(4,), gzip=4)
    rates[:7] = VALUES[:7]
    rates[7:] = VALUES[7:]
    file.dimension("event", 2)  # without a coordinate of its own
    file.variable("event_rates", ("event", "axis"), {})[...] = VALUES[:2]
    file.dimension("none", 0)
    file.variable("nothing", ("none", "axis"), {"event": "none"})


@pytest.fixture
def path(tmp_path: Path) -> Path:
    made = tmp_path / "made.h5"
    with made.open("w+b") as target, writing(target) as file:
        fill(file)
    return made


def test_every_library_reads_dimensions_values_and_attributes(path: Path) -> None:
    with netCDF4.Dataset(path) as data:
        assert {name: len(dim) for name, dim in data.dimensions.items()} == {
            "time": 10, "axis": 3, "event": 2, "none": 0,
        }  # fmt: skip
        assert [name for name, dim in data.dimensions.items() if dim.isunlimited()] == ["none"]
        assert list(data.variables) == ["axis", "time", "rates", "event_rates", "nothing"]
        assert data["rates"].dimensions == ("time", "axis")
        np.testing.assert_array_equal(data["rates"][:], VALUES)
        np.testing.assert_array_equal(data["event_rates"][:], VALUES[:2])
        assert (data.title, data.empty, data.count, data.size) == ("a text, grüße", "", 3, 0.1)
        assert data.many.tolist() == [1.0, 2.5]
    for engine in ("netcdf4", "h5netcdf"):
        with xarray.open_dataset(path, engine=engine) as dataset:
            assert dict(dataset.sizes) == {"time": 10, "axis": 3, "event": 2, "none": 0}
            assert dataset.axis.values.tolist() == ["x", "y", "z"]
            assert dataset.rates.attrs == {"units": "rad s-1"}
            np.testing.assert_array_equal(dataset.rates.sel(axis="y"), VALUES[:, 1])
            np.testing.assert_array_equal(dataset.event_rates, VALUES[:2])
            assert dataset.nothing.shape == (0, 3)
