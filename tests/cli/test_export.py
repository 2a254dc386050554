"""Exports hold every number of the run, in files that other tools read."""

from collections.abc import Callable
from decimal import Decimal, localcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

import rigidsim

Config = Callable[..., str]
Command = Callable[..., Any]
FLIGHT = {
    "body": "principal_moments = [1, 2, 2.5]\nmass = 2",
    "initial": "angular_velocity = [0.3, 1.0, 0.5]\nposition = [1, 2, 3]\nvelocity = [0.5, 0, 7]",
    "loads": 'kind = "uniform_gravity"',
}


@pytest.fixture
def exported(config: Config, rigidsim_command: Command) -> Callable[..., list[Path]]:
    """Runs a small flight and exports it; returns the files."""

    def export(precision: str, *formats: str, **more: str) -> list[Path]:
        given = {"time": "end = 2\nsamples = 9", "integrator": f'precision = "{precision}"', **FLIGHT, **more}
        assert rigidsim_command("run", config("throw", **given)).exit_code == 0
        for file_format in formats:
            result = rigidsim_command("export", "runs/throw", "--format", file_format)
            assert result.exit_code == 0, result.output
            assert result.output.splitlines()[0] == f"throw.{file_format}"
        return [Path(f"throw.{file_format}") for file_format in formats]

    return export


def exact(dataset: Any, name: str, row: int, column: int) -> Decimal:
    """The sum of a value and its residuals, with every digit."""
    with localcontext() as context:
        context.prec = 2000
        parts = [name, f"{name}_lo", f"{name}_lo2"]
        values = [Decimal(float(dataset[p].values[row, column])) for p in parts if p in dataset]
        return sum(values, Decimal(0))


def test_csv_and_parquet_hold_every_digit(exported: Callable[..., list[Path]]) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    path, other = exported("quadruple", "csv", "parquet")
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    names = lines[0].split(",")
    rows = [dict(zip(names, line.split(","), strict=True)) for line in lines[1:]]
    table = parquet.read_table(other)
    with rigidsim.open_run("runs/throw").dataset as dataset:
        assert len(rows) == dataset.sizes["time"] == 9
        for row in range(9):
            for column, axis in enumerate("wxyz"):
                told = Decimal(rows[row][f"quaternion_{axis}"])
                true = exact(dataset, "quaternion", row, column)
                # nearer than half the last bit: it rounds back to the same number
                assert abs(told - true) <= abs(true) / 2**113
        for part in ("", "_lo", "_lo2"):
            expected = dataset[f"angular_velocity{part}"].sel(body_axis="y")
            np.testing.assert_array_equal(table[f"angular_velocity{part}_y"].to_numpy(), expected)
    assert "velocity_X [m s-1]" in path.read_text().split("time,")[0]
    assert table.schema.field("energy").metadata[b"units"] == b"J"


def test_zarr_is_the_dataset(exported: Callable[..., list[Path]]) -> None:
    pytest.importorskip("zarr")
    [path] = exported("extended", "zarr")
    with xarray.open_zarr(path) as store, rigidsim.open_run("runs/throw").dataset as dataset:
        assert set(store.variables) == set(dataset.variables)
        for name in dataset.variables:
            np.testing.assert_array_equal(store[name].values, dataset[name].values)
            assert store[name].attrs == dataset[name].attrs
        assert store.attrs["config"] == dataset.attrs["config"]


@pytest.mark.slow
def test_independent_readers_read_messages(exported: Callable[..., list[Path]]) -> None:
    """Epochs, frames and numbers as ``oem`` and ``brahe`` see them; not ``ccsds-ndm`` 3.1, which raises a
    KeyError on every AEM 2.0 with quaternions.
    """
    time = 'end = 2\nsamples = 9\nepoch = "2029-04-13T21:46:00 TDB"'
    exported("double", "aem", "oem", time=time, rest='[frame]\naxes = "EME2000"\n')
    sky = rigidsim.open_run("runs/throw").dataset
    state = np.hstack([sky.position.values, sky.velocity.values]) / 1000
    oem = pytest.importorskip("oem").OrbitEphemerisMessage.open("throw.oem")
    about = oem.segments[0].metadata
    assert (about["REF_FRAME"], about["TIME_SYSTEM"]) == ("EME2000", "TDB")
    assert [str(s.epoch)[:23] for s in oem.states] == [str(moment)[:23] for moment in sky.date.values]
    assert {s.epoch.scale for s in oem.states} == {"tdb"}
    found = [[*s.position, *s.velocity] for s in oem.states]
    np.testing.assert_allclose(found, state, rtol=1e-15, atol=1e-18)
    segment = pytest.importorskip("brahe.ccsds").AEM.from_file("throw.aem").segments[0]
    frames = (segment.ref_frame_a, segment.ref_frame_b, segment.time_system)
    assert tuple(map(str, frames)) == ("EME2000", "SC_BODY_1", "TDB")
    found = [[q.w, q.x, q.y, q.z] for q in (row.quaternion for row in segment.states)]
    expected = sky.quaternion.values / np.linalg.norm(sky.quaternion.values, axis=1)[:, None]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15)  # it normalises
    assert str(segment.states[1].epoch) == "2029-04-13 21:46:00.250 TDB"


def test_what_a_format_can_not_hold_is_said(config: Config, rigidsim_command: Command) -> None:
    rates = config("rates", rest='record = ["angular_velocity"]')
    assert rigidsim_command("run", rates).exit_code == 0
    for file_format, what in (("aem", "quaternion"), ("oem", "position")):
        result = rigidsim_command("export", "runs/rates", "--format", file_format)
        assert result.exit_code == 2
        assert what in result.output
        assert not Path(f"rates.{file_format}").exists()
    result = rigidsim_command("export", "runs/rates", "--format", "xml")
    assert result.exit_code == 2
    assert "csv, parquet, zarr, aem, apm, oem" in result.output
    result = rigidsim_command("export", "runs/rates", "--format", "aem", "--epoch", "yesterday")
    assert result.exit_code == 2
