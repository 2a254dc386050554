"""What h5py writes is what the netCDF libraries take for their own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
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


def test_it_is_what_h5netcdf_writes(path: Path, tmp_path: Path) -> None:
    """Types, spaces, layouts and attributes of everything in it, but the writer's name."""
    import h5netcdf

    other = tmp_path / "other.h5"
    with h5netcdf.File(other, "w") as file:
        file.attrs.update({"title": "a text, grüße", "empty": "", "count": 3, "size": 0.1})
        file.attrs["many"] = np.array([1.0, 2.5])
        file.dimensions = {"time": 10, "axis": 3}
        names = file.create_variable("axis", ("axis",), h5py.string_dtype())
        names[...] = np.array(["x", "y", "z"], dtype=object)
        names.attrs["long_name"] = "an axis"
        options = {"compression": "gzip", "compression_opts": 4, "shuffle": True}
        time = file.create_variable("time", ("time",), "<f8", chunks=(4,), **options)
        time[...] = VALUES[:, 0]
        time.attrs["units"] = "s"
        rates = file.create_variable("rates", ("time", "axis"), "<f8", chunks=(4, 3), **options)
        rates[...] = VALUES
        rates.attrs["units"] = "rad s-1"
        file.dimensions["event"] = 2
        file.create_variable("event_rates", ("event", "axis"), "<f8")[...] = VALUES[:2]
        file.dimensions["none"] = 0
        file.create_variable("nothing", ("none", "axis"), "<f8", chunks=(1024, 3)).attrs["event"] = "none"
    found, expected = structure(path), structure(other)
    assert sorted(found) == sorted(expected)
    for name in set(expected) - {"nothing"}:  # h5netcdf gives it no _Netcdf4Dimid, netCDF's own library does
        assert found[name] == expected[name], name


def structure(path: Path) -> dict[str, Any]:
    """Each object's type, extent, layout and filters, and its attributes' types, extents and values."""
    with h5py.File(path, "r") as file:
        return {"/": _attributes(file), **{name: _object(file[name]) for name in file}}


def _object(dataset: h5py.Dataset) -> tuple[Any, ...]:
    how = dataset.id.get_create_plist()
    filters = [how.get_filter(number)[:3] for number in range(how.get_nfilters())]
    return (
        *(dataset.dtype, dataset.shape, dataset.maxshape, dataset.chunks, filters),
        *(how.get_attr_creation_order(), how.get_obj_track_times(), how.fill_value_defined()),
        _attributes(dataset),
    )


def _attributes(owner: Any) -> list[tuple[Any, ...]]:
    found = []
    for name in sorted(set(owner.attrs) - {"_NCProperties"}):
        of = owner.attrs.get_id(name)
        kind = of.get_type()
        text = (kind.is_variable_str(), kind.get_cset()) if isinstance(kind, h5py.h5t.TypeStringID) else None
        value: Any = owner.attrs[name]
        if name == "DIMENSION_LIST":
            value = [[owner.file[reference].name for reference in axis] for axis in value]
        elif name == "REFERENCE_LIST":
            value = sorted((owner.file[reference].name, int(axis)) for reference, axis in value)
        found.append(
            (name, str(of.dtype), text, of.get_space().get_simple_extent_type(), of.shape, repr(value))
        )
    return found
