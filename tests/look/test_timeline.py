"""What is in the recording, read back from the file."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

pytest.importorskip("rerun")

from rigidsim.look.timeline import write_timeline
from rigidsim.look.timeline.drawn import CHUNK

Build = Callable[..., xarray.Dataset]
Read = Callable[[Path, str], dict[str, np.ndarray]]


def test_the_recording_is_the_dataset(symmetric_top: Build, read_back: Read, tmp_path: Path) -> None:
    dataset, path = symmetric_top(), tmp_path / "t.rrd"
    assert write_timeline(dataset, path) == 1001
    rows = read_back(path, "/scene/body")
    wanted = dataset["quaternion"].values[:, [1, 2, 3, 0]]
    # half a unit in the last place of float32 numbers below 1
    np.testing.assert_allclose(rows["Transform3D:quaternion"], wanted, rtol=0, atol=2.0**-25)
    np.testing.assert_array_equal(rows["step"], np.arange(1001))
    plot = read_back(path, "/plots/angular_velocity")
    ticks = plot["time"].astype("timedelta64[ns]").astype(np.int64)
    np.testing.assert_array_equal(ticks, np.arange(1001) * 20_000_000)  # exact
    np.testing.assert_array_equal(plot["Scalars:scalars"], dataset["angular_velocity"].values)  # float64
    drift = read_back(path, "/plots/drift")["Scalars:scalars"]
    np.testing.assert_allclose(drift[100:], np.log10(1e-16 * np.arange(100, 1001)), rtol=1e-12)
    assert np.isnan(drift[0])  # zero has no logarithm
    # arrows are in space axes, and longer than the body
    momentum = read_back(path, "/scene/centre/angular_momentum")["Arrows3D:vectors"]
    np.testing.assert_allclose(momentum, np.tile([0, 0, 1.6], (1001, 1)), atol=1e-6)
    velocity = read_back(path, "/scene/centre/angular_velocity")["Arrows3D:vectors"]
    assert np.linalg.norm(velocity, axis=1).max() == pytest.approx(1.6, rel=1e-6)
    np.testing.assert_allclose(velocity[:, 2], velocity[0, 2], rtol=1e-6)  # L.w = 2T


def test_chunk_borders_lose_and_double_nothing(symmetric_top: Build, read_back: Read, tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    count = 2 * CHUNK + 1
    dataset = symmetric_top(count=count)
    write_timeline(dataset, tmp_path / "t.rrd")
    for entity in ("/scene/body", "/plots/angular_velocity"):
        rows = read_back(tmp_path / "t.rrd", entity)
        np.testing.assert_array_equal(rows["step"], np.arange(count))
    rates = dataset["angular_velocity"].values
    np.testing.assert_array_equal(rows["Scalars:scalars"], rates)
    sizes = [len(chunk) for chunk in RrdReader(tmp_path / "t.rrd").stream()]
    assert max(sizes) == CHUNK  # what the viewer reads well
    # a trail joins each row to the one before
    trail = read_back(tmp_path / "t.rrd", "/poinsot/body/polhode/recent")
    strips = trail["LineStrips3D:strips"].reshape(count, 2, 3)
    np.testing.assert_array_equal(strips[1:, 0], strips[:-1, 1])
    # in units of the largest semi-axis of the ellipsoid of energy, sqrt(2 T / A), with A = 1
    factor = 1 / np.sqrt(np.mean(rates**2 @ [1, 1, 2]))
    np.testing.assert_allclose(strips[:, 1], rates * factor, atol=1e-6)


def test_dataset_without_samples_is_refused(symmetric_top: Build, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no samples"):
        write_timeline(symmetric_top().isel(time=slice(0, 0)), tmp_path / "t.rrd")
    assert not list(tmp_path.iterdir())
