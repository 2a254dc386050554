"""What is in the recording, read back from the file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

pytest.importorskip("rerun")

import rigidsim
from rigidsim.look.plots import plan_plots
from rigidsim.look.thinning import thin
from rigidsim.look.timeline import write_timeline
from rigidsim.look.timeline.writing import CHUNK
from rigidsim.scene.parts_of_values import parts_in

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


def test_attitude_is_the_datasets_to_float32(symmetric_top: Build, read_back: Read, tmp_path: Path) -> None:
    dataset = symmetric_top()
    assert write_timeline(dataset, tmp_path / "t.rrd") == 1001
    rows = read_back(tmp_path / "t.rrd", "/scene/body")
    wanted = dataset["quaternion"].values[:, [1, 2, 3, 0]]
    # Half a unit in the last place of float32 numbers below 1.
    np.testing.assert_allclose(rows["Transform3D:quaternion"], wanted, rtol=0, atol=2.0**-25)
    np.testing.assert_array_equal(rows["step"], np.arange(1001))


def test_times_are_exact_nanoseconds(symmetric_top: Build, read_back: Read, tmp_path: Path) -> None:
    write_timeline(symmetric_top(), tmp_path / "t.rrd")
    rows = read_back(tmp_path / "t.rrd", "/plots/angular_velocity")
    np.testing.assert_array_equal(
        rows["time"].astype("timedelta64[ns]").astype(np.int64), np.arange(1001) * 20_000_000
    )


def test_values_of_plots_are_float64(symmetric_top: Build, read_back: Read, tmp_path: Path) -> None:
    dataset = symmetric_top()
    write_timeline(dataset, tmp_path / "t.rrd")
    rows = read_back(tmp_path / "t.rrd", "/plots/angular_velocity")
    np.testing.assert_array_equal(rows["Scalars:scalars"], dataset["angular_velocity"].values)
    drift = read_back(tmp_path / "t.rrd", "/plots/drift/all")["Scalars:scalars"]
    np.testing.assert_allclose(drift[100:], np.log10(1e-16 * np.arange(100, 1001)), rtol=1e-12)
    assert np.isfinite(drift[0])  # the drift of zero at the start


def test_thinned_run_keeps_its_first_and_last_rows(
    symmetric_top: Build, read_back: Read, tmp_path: Path
) -> None:
    dataset = symmetric_top(count=9998)
    assert write_timeline(dataset, tmp_path / "t.rrd", rows=1000) == 910
    rows = read_back(tmp_path / "t.rrd", "/scene/body")
    steps = rows["step"]
    assert (len(steps), steps[0], steps[-1]) == (910, 0, 9997)
    wanted = dataset["quaternion"].values[steps][:, [1, 2, 3, 0]]
    np.testing.assert_allclose(rows["Transform3D:quaternion"], wanted, rtol=0, atol=2.0**-25)


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
    np.testing.assert_array_equal(rows["Scalars:scalars"], dataset["angular_velocity"].values)
    sizes = [len(chunk) for chunk in RrdReader(tmp_path / "t.rrd").stream()]
    assert max(sizes) == CHUNK  # what the viewer reads well


def test_trail_joins_each_row_to_the_one_before(
    symmetric_top: Build, read_back: Read, tmp_path: Path
) -> None:
    count = CHUNK + 10
    dataset = symmetric_top(count=count)
    write_timeline(dataset, tmp_path / "t.rrd")
    rows = read_back(tmp_path / "t.rrd", "/poinsot/body/polhode/recent")
    strips = rows["LineStrips3D:strips"].reshape(count, 2, 3)
    np.testing.assert_array_equal(strips[1:, 0], strips[:-1, 1])
    rates = dataset["angular_velocity"].values
    # in units of the largest semi-axis of the ellipsoid of energy, sqrt(2 T / A), with A = 1
    factor = 1 / np.sqrt(np.mean(rates**2 @ [1, 1, 2]))
    np.testing.assert_allclose(strips[:, 1], rates * factor, atol=1e-6)


def test_arrows_are_in_space_axes_and_longer_than_the_body(
    symmetric_top: Build, read_back: Read, tmp_path: Path
) -> None:
    dataset = symmetric_top()
    write_timeline(dataset, tmp_path / "t.rrd")
    momentum = read_back(tmp_path / "t.rrd", "/scene/centre/angular_momentum")["Arrows3D:vectors"]
    np.testing.assert_allclose(momentum, np.tile([0, 0, 1.6], (1001, 1)), atol=1e-6)
    velocity = read_back(tmp_path / "t.rrd", "/scene/centre/angular_velocity")["Arrows3D:vectors"]
    assert np.linalg.norm(velocity, axis=1).max() == pytest.approx(1.6, rel=1e-6)
    # A symmetric top's angular velocity keeps its angle to L: L.w = 2T.
    np.testing.assert_allclose(velocity[:, 2], velocity[0, 2], rtol=1e-6)


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


def test_body_that_moves_a_little_carries_its_arrows_along(
    symmetric_top: Build, read_back: Read, tmp_path: Path
) -> None:
    dataset = symmetric_top(size=2.0)
    position = np.outer(np.linspace(0, 8, 1001), [1.0, 0.0, 0.5])
    write_timeline(with_position(dataset, position), tmp_path / "t.rrd")
    body = read_back(tmp_path / "t.rrd", "/scene/body")
    assert len(body["Transform3D:quaternion"]) == len(body["Transform3D:translation"]) == 1001
    centre = read_back(tmp_path / "t.rrd", "/scene/centre")["Transform3D:translation"]
    np.testing.assert_array_equal(centre, body["Transform3D:translation"])
    reach = float(page(tmp_path / "t.rrd", "picture").split("reach: 1 unit = ")[1].split()[0])
    np.testing.assert_allclose(centre * reach, position, atol=1e-5)


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


def test_a_variable_nobody_foresaw_gets_a_plot(symmetric_top: Build, read_back: Read, tmp_path: Path) -> None:
    dataset = symmetric_top(count=20)
    dataset["kovalevskaya_constant"] = ("time", np.arange(20.0), {"units": "s^-4"})
    dataset["tensor"] = (("time", "a", "b"), np.arange(80.0).reshape(20, 2, 2))
    dataset["flag"] = ("time", np.arange(20) % 2 == 0)
    dataset["note"] = ("time", np.array(["text"] * 20))
    dataset["energy_lo"] = ("time", np.zeros(20), {"residual_of": "energy"})
    write_timeline(dataset, tmp_path / "t.rrd")
    rows = read_back(tmp_path / "t.rrd", "/plots/kovalevskaya_constant")
    np.testing.assert_array_equal(rows["Scalars:scalars"], np.arange(20.0))
    tensor = read_back(tmp_path / "t.rrd", "/plots/tensor")["Scalars:scalars"]
    np.testing.assert_array_equal(tensor, np.arange(80.0).reshape(20, 4))
    found = entities(tmp_path / "t.rrd")
    assert "/plots/flag" in found
    assert not {"/plots/note", "/plots/energy_lo"} & found


def test_one_sample_is_a_picture_too(symmetric_top: Build, tmp_path: Path) -> None:
    assert write_timeline(symmetric_top().isel(time=[0]), tmp_path / "t.rrd") == 1


def test_run_that_ended_in_nan_is_still_shown(symmetric_top: Build, tmp_path: Path) -> None:
    dataset = symmetric_top(count=50).copy(deep=True)
    for name in ("quaternion", "angular_velocity", "angular_momentum", "energy_drift"):
        dataset[name][-3:] = np.nan
    assert write_timeline(dataset, tmp_path / "t.rrd") == 50


def test_page_states_the_config_and_the_largest_drift(symmetric_top: Build, tmp_path: Path) -> None:
    write_timeline(symmetric_top(), tmp_path / "t.rrd")
    text = page(tmp_path / "t.rrd")
    assert text.startswith("**Free symmetric top**: a free top")
    assert 'name = "top"' in page(tmp_path / "t.rrd", "config")
    assert "| invariant | energy |" in text
    assert "| initial | 0.4 J |" in text
    assert "| largest drift | 1.00e-13 |" in text
    assert "of the rows shown" not in text
    write_timeline(symmetric_top(), tmp_path / "t.rrd", rows=100)
    assert "largest drift of the rows shown" in page(tmp_path / "t.rrd")


def test_dataset_without_samples_is_refused(symmetric_top: Build, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no samples"):
        write_timeline(symmetric_top().isel(time=slice(0, 0)), tmp_path / "t.rrd")
    assert not list(tmp_path.iterdir())


# ---- which variables of a recorded run are shown as variables of their own


@pytest.mark.parametrize(("digits", "parts"), [("50", 4)])
def test_no_residual_is_a_variable_of_its_own(
    digits: str, parts: int, free_body: Callable[..., str], tmp_path: Path
) -> None:
    """However many float64 numbers a value takes: 50 digits are 169 bits, four times 53 with room."""
    run = rigidsim.run(rigidsim.parse(free_body("end = 1\nsamples = 4", precision=digits)), out=tmp_path)
    with run.dataset as dataset:
        assert len(parts_in(dataset, "angular_velocity")) == parts
        shown = thin(dataset, 10)
        assert {"angular_velocity", "quaternion", "energy", "energy_drift"} <= set(shown)
        assert not any("_lo" in str(name) for name in shown)


@pytest.mark.parametrize("unit", ["rad/s", "rad s-1"])
@pytest.mark.parametrize(
    ("size", "shown", "factor"), [(7.3e-5, "µrad/s", 1e6), (2.0, "rad/s", 1.0), (1e-20, "rad/s", 1.0)]
)
def test_rates_have_prefixes_as_datasets_write_their_unit(
    unit: str, size: float, shown: str, factor: float
) -> None:
    rates = np.linspace(0.5, 1.0, 4) * size
    (plot,) = plan_plots(xarray.Dataset({"rate": ("time", rates, {"units": unit})}))
    assert plot.title == f"Rate [{shown}]"
    np.testing.assert_allclose(plot.series[0].values[:, 0], rates * factor, rtol=1e-14)
