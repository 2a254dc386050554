"""What is in the recording, read back from the file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

pytest.importorskip("rerun")

from rigidsim.look.timeline import write_timeline
from rigidsim.look.timeline.writing import CHUNK

Build = Callable[..., xarray.Dataset]
Read = Callable[[Path, str], dict[str, np.ndarray]]


def entities(path: Path) -> set[str]:
    from rerun.chunk import RrdReader

    return {chunk.entity_path for chunk in RrdReader(path).stream()}


def component(path: Path, entity: str, name: str) -> list[object]:
    """What holds for all times."""
    from rerun.chunk import RrdReader

    (chunk,) = (c for c in RrdReader(path).stream() if c.entity_path == entity and c.is_static)
    return list(chunk.to_record_batch().column(name).to_pylist()[0])


def page(path: Path, name: str = "summary") -> str:
    return str(component(path, f"/{name}", "TextDocument:text")[0])


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
    drift = read_back(path, "/plots/drift/all")["Scalars:scalars"]
    np.testing.assert_allclose(drift[100:], np.log10(1e-16 * np.arange(100, 1001)), rtol=1e-12)
    assert np.isfinite(drift[0])  # the drift of zero at the start
    # arrows are in space axes, and longer than the body
    momentum = read_back(path, "/scene/centre/angular_momentum")["Arrows3D:vectors"]
    np.testing.assert_allclose(momentum, np.tile([0, 0, 1.6], (1001, 1)), atol=1e-6)
    velocity = read_back(path, "/scene/centre/angular_velocity")["Arrows3D:vectors"]
    assert np.linalg.norm(velocity, axis=1).max() == pytest.approx(1.6, rel=1e-6)
    np.testing.assert_allclose(velocity[:, 2], velocity[0, 2], rtol=1e-6)  # L.w = 2T


def test_only_the_rows_shown_are_read_from_a_file(symmetric_top: Build, tmp_path: Path) -> None:
    symmetric_top(count=5001).to_netcdf(tmp_path / "d.h5", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "d.h5", engine="h5netcdf") as dataset:
        assert write_timeline(dataset, tmp_path / "t.rrd", rows=100) == 100
        # xarray would keep what it had read of the whole variable.
        assert not dataset["quaternion"].variable._in_memory
    # A very long run is opened without an index, which would hold all its times in memory.
    with xarray.open_dataset(tmp_path / "d.h5", engine="h5netcdf", create_default_indexes=False) as dataset:
        assert write_timeline(dataset, tmp_path / "u.rrd", rows=100) == 100
        assert not dataset["time"].variable._in_memory


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


@pytest.mark.parametrize(("scale", "name"), [(1e-13 / 0.02, "time [as]"), (1e14 / 20.0, "time [1e6 s]")])
def test_extreme_times_get_a_sequence_with_physical_seconds(
    symmetric_top: Build, read_back: Read, tmp_path: Path, scale: float, name: str
) -> None:
    dataset = symmetric_top(scale=scale)
    write_timeline(dataset, tmp_path / "t.rrd")
    rows = read_back(tmp_path / "t.rrd", "/plots/time_seconds")
    np.testing.assert_array_equal(rows["Scalars:scalars"], dataset["time"].values)
    unit = {"time [as]": 1e-18, "time [1e6 s]": 1e6}[name]
    np.testing.assert_allclose(rows[name] * unit, dataset["time"].values, rtol=1e-15, atol=unit / 2)
    assert (np.diff(rows[name]) > 0).all()
    assert name in page(tmp_path / "t.rrd", "picture")


def test_rates_only_run_shows_the_body_in_its_own_axes(
    symmetric_top: Build, read_back: Read, tmp_path: Path
) -> None:
    dataset = symmetric_top()[["angular_velocity", "energy"]]
    write_timeline(dataset, tmp_path / "t.rrd")
    found = entities(tmp_path / "t.rrd")
    assert {"/scene/body/solids/0", "/scene/body/polhode/recent", "/plots/energy"} <= found
    assert not any("herpolhode" in entity for entity in found)
    assert read_back(tmp_path / "t.rrd", "/scene/body") == {}
    vectors = read_back(tmp_path / "t.rrd", "/scene/body/angular_velocity")["Arrows3D:vectors"]
    rates = dataset["angular_velocity"].values
    np.testing.assert_allclose(vectors, rates * (1.6 / np.linalg.norm(rates, axis=1).max()), atol=1e-6)
    assert "no attitude was recorded" in page(tmp_path / "t.rrd", "picture")


def with_position(dataset: xarray.Dataset, position: np.ndarray) -> xarray.Dataset:
    return dataset.assign(position=(("time", "space_axis"), position, {"units": "m"}))


def test_orbit_gets_a_track_view_with_the_body_enlarged(
    symmetric_top: Build, read_back: Read, tmp_path: Path
) -> None:
    angle = np.linspace(0, 2 * np.pi, 1001)
    orbit = 7e6 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    write_timeline(with_position(symmetric_top(), orbit), tmp_path / "t.rrd")
    path = read_back(tmp_path / "t.rrd", "/path/body")
    np.testing.assert_allclose(path["Transform3D:translation"], orbit / 7e6, atol=1e-6)
    assert "Transform3D:translation" not in read_back(tmp_path / "t.rrd", "/scene/body")
    assert "/path/origin" in entities(tmp_path / "t.rrd")
    assert "times too large" in page(tmp_path / "t.rrd", "picture")


def test_run_that_ended_in_nan_is_still_shown(symmetric_top: Build, tmp_path: Path) -> None:
    dataset = symmetric_top(count=50).copy(deep=True)
    for name in ("quaternion", "angular_velocity", "angular_momentum", "energy_drift"):
        dataset[name][-3:] = np.nan
    assert write_timeline(dataset, tmp_path / "t.rrd") == 50


def test_dataset_without_samples_is_refused(symmetric_top: Build, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no samples"):
        write_timeline(symmetric_top().isel(time=slice(0, 0)), tmp_path / "t.rrd")
    assert not list(tmp_path.iterdir())
