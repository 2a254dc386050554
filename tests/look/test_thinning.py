"""Long runs as pictures show them: fast motions keep their amplitude, whole spans their extremes."""

import numpy as np
import pytest
import xarray
from xarray.backends import BackendArray
from xarray.core import indexing

pytest.importorskip("matplotlib")

from rigidsim.look.thinning import Thinning, thin, thin_with_extremes

FAST = 0.039


def long_run(count: int = 400_001) -> xarray.Dataset:
    """A slow growth to 2, beside a swing of 0.039 with 37 samples to each."""
    row = np.arange(count)
    table = np.stack([2 * row / count, FAST * np.sin(2 * np.pi * row / 37), 0 * row], axis=1)
    data = {"angular_velocity": (("time", "body_axis"), table, {"units": "rad s-1"})}
    return xarray.Dataset(data, coords={"time": row * 0.1, "body_axis": list("xyz")})


def test_extremes_of_two_strides_stand_in_two_rows() -> None:
    dataset = long_run()
    plain, found = thin_with_extremes(dataset, 4001)
    xarray.testing.assert_identical(plain, thin(dataset, 4001))
    np.testing.assert_array_equal(found["time"], plain["time"])
    swing = found["angular_velocity"].values[1:-1, 1]  # 5 swings in two strides
    assert np.abs(np.abs(swing) - FAST).max() < 0.01 * FAST
    np.testing.assert_array_equal(found["angular_velocity"][[0, -1]], dataset["angular_velocity"][[0, -1]])
    growth = found["angular_velocity"].values[:, 0] - plain["angular_velocity"].values[:, 0]
    assert np.abs(growth).max() <= 2 * 100 * 2 / 400_001 * 1.01
    part = dataset.isel(time=slice(0, 4001))
    np.testing.assert_array_equal(
        thin_with_extremes(part, 4001)[1]["angular_velocity"], part["angular_velocity"]
    )


class OnDisk(BackendArray):
    """An array that is read where slices ask, as of a run whose samples are in several files."""

    def __init__(self, values: np.ndarray) -> None:
        self.values, self.shape, self.dtype = values, values.shape, values.dtype

    def __getitem__(self, key: indexing.ExplicitIndexer) -> np.ndarray:
        basic, read = indexing.IndexingSupport.BASIC, self.values.__getitem__
        return np.asarray(indexing.explicit_indexing_adapter(key, self.shape, basic, read))


@pytest.mark.parametrize("count", [9, 10, 21, 23])
def test_a_run_on_disk_that_goes_back_has_the_rows_of_one_in_memory(count: int) -> None:
    whole = long_run(count)
    lazy = indexing.LazilyIndexedArray(OnDisk(whole.angular_velocity.values))
    back = slice(None, None, -1)
    both = whole, whole.assign(angular_velocity=xarray.Variable(("time", "body_axis"), lazy))
    one, other = (thin_with_extremes(x.isel(time=back), 11)[0].angular_velocity.values for x in both)
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("seed", range(6))
def test_rows_that_arrive_in_pieces_give_the_same(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(9, 3000))
    rows = int(rng.integers(2, count // 2))
    table = rng.standard_normal((count, 2))
    table[rng.random((count, 2)) < 0.05] = np.nan
    dataset = xarray.Dataset({"x": (("time", "k"), table)}, coords={"time": np.arange(count) / 7})
    known = Thinning(count, rows)
    for piece in np.array_split(table, np.sort(rng.integers(0, count, 5))):
        known.add("x", piece)
    both = (
        thin_with_extremes(dataset, rows),
        thin_with_extremes(dataset.assign(x=0 * dataset["x"]), rows, known),
    )
    for one, other in zip(*both, strict=True):
        xarray.testing.assert_identical(one, other)
    stride = max(1, -(-(count - 1) // (rows - 1)))
    inner = both[0][1]["x"].values
    for k in range(2, len(inner) - 2, 2):  # each pair of rows has the extremes of two strides
        part = table[k * stride : (k + 2) * stride]
        np.testing.assert_array_equal(inner[k : k + 2], [np.fmin.reduce(part), np.fmax.reduce(part)])
