"""``dataset.h5``: every reader opens it, everything is labelled, every digit of every precision is in it."""

import re
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import h5py
import mpmath
import netCDF4
import numpy as np
import pytest
import xarray
from hypothesis import given, settings
from hypothesis import strategies as st

import rigidsim
from rigidsim.errors import RunFolderError
from rigidsim.solve.precision import Precision, precision_of
from rigidsim.store.netcdf import ChunkedVariable, reading, stored_rows

PRECISIONS = ['"double"', '"quadruple"']

# variable: (dims beside time, units, frame or None, invariant), from the interface's section 3
FREE = {
    "angular_velocity": (("body_axis",), "rad s-1", "body axes", False),
    "quaternion": (("quaternion_component",), "1", "body to space", False),
    "angular_momentum": (("space_axis",), "kg m2 s-1", "space axes", True),
    "angular_momentum_norm": ((), "kg m2 s-1", None, True),
    "energy": ((), "J", None, True),
}
LABELS = {
    "body_axis": ["x", "y", "z"],
    "space_axis": ["X", "Y", "Z"],
    "quaternion_component": ["w", "x", "y", "z"],
}


@pytest.fixture(scope="module", params=PRECISIONS)
def free(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, free_body: Callable[..., str]
) -> tuple[str, rigidsim.Run]:
    """A free body in each precision, with its name."""
    text = free_body(precision=request.param)
    return request.param, rigidsim.run(rigidsim.parse(text), out=tmp_path_factory.mktemp("free"))


def test_every_reader_reads_the_same(free: tuple[str, rigidsim.Run]) -> None:
    path = free[1].folder.dataset
    with (
        xarray.open_dataset(path) as plain,
        xarray.open_dataset(path, engine="h5netcdf") as other,
        netCDF4.Dataset(path) as old,
        h5py.File(path, "r") as raw,
        free[1].dataset as ours,
    ):
        assert ours.identical(other)
        assert ours.encoding["source"] == other.encoding["source"]
        assert {"time", *FREE} <= set(map(str, plain.variables))
        assert set(map(str, plain.variables)) == set(old.variables) == set(raw)
        for name in map(str, plain.variables):
            values = plain[name].values
            assert values.shape == tuple(len(LABELS.get(d, range(49))) for d in plain[name].dims)
            np.testing.assert_array_equal(values, other[name].values, strict=True)
            np.testing.assert_array_equal(values, old[name][:])
            if values.dtype == np.float64:
                np.testing.assert_array_equal(values, raw[name][:], strict=True)


def test_variables_carry_labels_and_attributes(free: tuple[str, rigidsim.Run]) -> None:
    with xarray.open_dataset(free[1].folder.dataset) as dataset:
        used = {dim for dims, *_ in FREE.values() for dim in dims}
        assert set(map(str, dataset.coords)) - {"time", "time_lo", "time_lo2", "time_lo3"} == used
        for dim in used:
            assert dataset[dim].values.tolist() == LABELS[dim]
        plain = [v for v in map(str, dataset.data_vars) if not re.search(r"_lo\d*$|_drift$", v)]
        assert set(plain) == set(FREE)
        for name, (dims, units, frame, invariant) in FREE.items():
            variable = dataset[name]
            assert variable.dims == ("time", *dims)
            assert variable.attrs["units"] == units
            assert len(variable.attrs["long_name"]) > 5
            assert variable.attrs.get("frame") == (frame if frame else None)
            assert variable.attrs.get("invariant", 0) == int(invariant)
            assert (f"{name}_drift" in dataset) == invariant


# Every digit


NAMES: list[str | int] = ["single", "extended", "quadruple", 50]


def _array(precision: Precision, values: list[Any]) -> np.ndarray:
    return np.array(values, dtype=precision.scalar)


def _number(precision: Precision, value: Fraction) -> Any:
    with mpmath.workprec(2000):
        return precision.number(mpmath.mpf(value.numerator) / value.denominator)


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_parts_are_exact(name: str | int, data: st.DataObject) -> None:
    precision = precision_of(name)
    bits = precision.bits
    # away from where float64 itself ends (2^-1074) or float32 does (2^-126, 2^128)
    lowest, highest = (-120, 120) if name == "single" else (-1000 + bits, 900)
    numbers = data.draw(
        st.lists(
            st.tuples(st.integers(-(2**bits) + 1, 2**bits - 1), st.integers(lowest, highest)),
            min_size=1,
            max_size=5,
        )
    )
    values = [Fraction(m) * Fraction(2) ** (e - bits) for m, e in numbers if e]
    if not values:
        return
    parts = precision.parts(_array(precision, [_number(precision, v) for v in values]))
    assert len(parts) == precision.part_count
    for part in parts:
        assert part.dtype == np.float64
    for i, value in enumerate(values):
        assert sum((Fraction(float(part[i])) for part in parts), Fraction(0)) == value
        assert float(parts[0][i]) == float(value)  # Fraction's conversion rounds correctly
        total = mpmath.mpf(0)
        with mpmath.workprec(bits):  # smallest first, in the working precision, as a reader would
            for part in reversed(parts):
                total += mpmath.mpf(float(part[i]))
            assert total == mpmath.mpf(value.numerator) / value.denominator


@pytest.mark.parametrize("seed", range(4))
def test_chunks_that_cannot_be_compressed_hold_the_same_numbers(seed: int, tmp_path: Path) -> None:
    rng, path = np.random.default_rng(seed), tmp_path / "chunks.h5"
    rows, width, height = int(rng.integers(1, 600)), int(rng.integers(1, 4)), int(rng.integers(1, 40))
    values = rng.standard_normal((rows, width))
    values[rows // 2 :] = np.round(values[rows // 2 :], int(rng.integers(0, 12)))  # some bytes repeat there
    values[rng.random(rows) < 0.1] = np.nan
    with h5py.File(path, "w") as file:
        filters = {"compression": "gzip", "shuffle": True, "chunks": (height, width)}
        chunks = ChunkedVariable(file.create_dataset("x", (rows, width), "<f8", **filters))
        for part in np.array_split(values, 5):
            chunks.add(part)
        chunks.finish()
    with h5py.File(path) as file:
        np.testing.assert_array_equal(file["x"][()], values)  # HDF5's own filters
        for _ in range(20):
            first, stop = sorted(rng.integers(0, rows + 1, 2).tolist())
            part = slice(first, stop, int(rng.integers(1, 90)))
            np.testing.assert_array_equal(stored_rows(file["x"], part), values[part])
    content = bytearray(path.read_bytes())
    with h5py.File(path) as file:
        content[file["x"].id.get_chunk_info(0).byte_offset + 5] ^= 64
    path.write_bytes(content)
    with pytest.raises(RunFolderError, match="can't be read"), reading(path) as file:
        stored_rows(file["x"], slice(None))
