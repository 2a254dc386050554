"""Exports hold every number of the run, in files that other tools read."""

from __future__ import annotations

import re
from collections.abc import Callable
from decimal import Decimal, localcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rigidsim

Config = Callable[..., str]
Command = Callable[..., Any]
FLIGHT = {
    "body": "principal_moments = [1, 2, 2.5]\nmass = 2",
    "initial": "angular_velocity = [0.3, 1.0, 0.5]\nposition = [1, 2, 3]\nvelocity = [0.5, 0, 7]",
    "loads": 'kind = "uniform_gravity"',
}


@pytest.fixture
def exported(config: Config, rigidsim_command: Command) -> Callable[..., Path]:
    """Runs a small flight and exports it; returns the file."""

    def export(file_format: str, integrator: str = "", *options: str) -> Path:
        name = config("throw", time="end = 2\nsamples = 9", integrator=integrator, **FLIGHT)
        assert rigidsim_command("run", name, "--force").exit_code == 0
        result = rigidsim_command("export", "runs/throw", "--format", file_format, *options)
        assert result.exit_code == 0, result.output
        assert result.output.splitlines()[0] == f"throw.{file_format}"
        return Path(f"throw.{file_format}")

    return export


def exact(dataset: Any, name: str, row: int, column: int) -> Decimal:
    """The sum of a value and its residuals, with every digit."""
    with localcontext() as context:
        context.prec = 2000
        parts = [name, f"{name}_lo", f"{name}_lo2"]
        values = [Decimal(float(dataset[p].values[row, column])) for p in parts if p in dataset]
        return sum(values, Decimal(0))


@pytest.mark.parametrize(("precision", "bits"), [("double", 53), ("extended", 64), ("quadruple", 113)])
def test_csv_holds_every_digit(precision: str, bits: int, exported: Callable[..., Path]) -> None:
    path = exported("csv", f'precision = "{precision}"')
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    names = lines[0].split(",")
    rows = [dict(zip(names, line.split(","), strict=True)) for line in lines[1:]]
    with rigidsim.open_run("runs/throw").dataset as dataset:
        assert len(rows) == dataset.sizes["time"] == 9
        for row in range(9):
            for column, axis in enumerate("wxyz"):
                told = Decimal(rows[row][f"quaternion_{axis}"])
                true = exact(dataset, "quaternion", row, column)
                # nearer than half the last bit: it rounds back to the same number
                assert abs(told - true) <= abs(true) / 2**bits
    if precision == "double":  # and comes back as the very same numbers
        pandas = pytest.importorskip("pandas")
        table = pandas.read_csv(path, comment="#")
        with rigidsim.open_run("runs/throw").dataset as dataset:
            np.testing.assert_array_equal(table["position_Z"], dataset.position.sel(space_axis="Z"))
    assert "velocity_X [m s-1]" in path.read_text().split("time,")[0]


def test_parquet_holds_values_and_residuals(exported: Callable[..., Path]) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(exported("parquet", 'precision = "quadruple"'))
    with rigidsim.open_run("runs/throw").dataset as dataset:
        for part in ("", "_lo", "_lo2"):
            column = table[f"angular_velocity{part}_y"].to_numpy()
            expected = dataset[f"angular_velocity{part}"].sel(body_axis="y")
            np.testing.assert_array_equal(column, expected)
    assert table.schema.field("energy").metadata[b"units"] == b"J"


def test_zarr_is_the_dataset(exported: Callable[..., Path]) -> None:
    pytest.importorskip("zarr")
    import xarray

    path = exported("zarr", 'precision = "extended"')
    with xarray.open_zarr(path) as store, rigidsim.open_run("runs/throw").dataset as dataset:
        assert set(store.variables) == set(dataset.variables)
        for name in dataset.variables:
            np.testing.assert_array_equal(store[name].values, dataset[name].values)
            assert store[name].attrs == dataset[name].attrs
        assert store.attrs["config"] == dataset.attrs["config"]


def keywords(text: str) -> dict[str, str]:
    """KEY = VALUE lines, each at most once."""
    pairs = re.findall(r"^([A-Z_]+) = (.+)$", text, re.MULTILINE)
    assert len({key for key, _ in pairs}) == len(pairs)
    return dict(pairs)


def test_an_attitude_message_turns_the_space_axes_into_the_body_axes(exported: Callable[..., Path]) -> None:
    """CCSDS 504.0-B-2: Q1 Q2 Q3 QC is the rotation of frame A onto frame B, QC = cos(half the angle)."""
    text = exported("aem", "", "--epoch", "2020-02-28T23:59:59.5", "--frame", "ICRF").read_text()
    header = keywords(text)
    assert header["CCSDS_AEM_VERS"] == "2.0"
    assert (header["REF_FRAME_A"], header["REF_FRAME_B"]) == ("ICRF", "SC_BODY_1")
    assert header["ATTITUDE_TYPE"] == "QUATERNION"
    assert header["START_TIME"] == "2020-02-28T23:59:59.5"
    assert header["STOP_TIME"] == "2020-02-29T00:00:01.5"
    assert all(len(line) <= 254 and line.isascii() for line in text.splitlines())
    body = re.search(r"^DATA_START\n(.*)^DATA_STOP$", text, re.MULTILINE | re.DOTALL)
    assert body is not None
    rows = [line.split() for line in body[1].splitlines()]
    values = np.array([[float(x) for x in row[1:]] for row in rows])
    with rigidsim.open_run("runs/throw").dataset as dataset:
        expected = dataset.quaternion.values[:, [1, 2, 3, 0]]
    assert np.abs(values - expected).max() < 1e-15  # 16 digits are what the standard allows


def test_an_orbit_message_is_in_kilometres(exported: Callable[..., Path]) -> None:
    text = exported("oem").read_text()
    header = keywords(text)
    assert header["TIME_SYSTEM"] == "TT"
    rows = [line.split() for line in text.split("META_STOP")[1].splitlines() if line.strip()]
    values = np.array([[float(x) for x in row[1:]] for row in rows])
    with rigidsim.open_run("runs/throw").dataset as dataset:
        expected = np.hstack([dataset.position.values, dataset.velocity.values]) / 1000
    np.testing.assert_allclose(values, expected, rtol=1e-15, atol=1e-18)


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
    assert "csv, parquet, zarr, aem, oem" in result.output
    result = rigidsim_command("export", "runs/rates", "--format", "aem", "--epoch", "yesterday")
    assert result.exit_code == 2


def test_nothing_is_overwritten_unasked(exported: Callable[..., Path], rigidsim_command: Command) -> None:
    path = exported("csv")
    path.write_text("mine")
    result = rigidsim_command("export", "runs/throw", "--format", "csv")
    assert result.exit_code == 2
    assert "--force" in result.output
    assert path.read_text() == "mine"
    assert rigidsim_command("export", "runs/throw", "--format", "csv", "--force").exit_code == 0
    assert "time," in path.read_text()


def test_a_partial_run_exports_what_it_has(config: Config, rigidsim_command: Command) -> None:
    name = config(time="end = 1e5\nevery = 1", rest="[limits]\nmax_steps = 300")
    assert rigidsim_command("run", name).exit_code == 3
    assert rigidsim_command("export", "runs/free", "--format", "csv").exit_code == 0
    rows = [line for line in Path("free.csv").read_text().splitlines() if line[:1].isdigit()]
    with rigidsim.open_run("runs/free").dataset as dataset:
        assert len(rows) == dataset.sizes["time"] > 50


def test_events_are_tables_of_their_own(config: Config, rigidsim_command: Command) -> None:
    rest = '[[events]]\nname = "flip"\nexpression = "wx"\n'
    assert rigidsim_command("run", config(time="end = 40\nsamples = 41", rest=rest)).exit_code == 0
    result = rigidsim_command("export", "runs/free", "--format", "csv")
    assert result.output.splitlines() == ["free.csv", "free.flip.csv"]
    rows = [line for line in Path("free.flip.csv").read_text().splitlines() if line[:1].isdigit()]
    with rigidsim.open_run("runs/free").dataset as dataset:
        assert [float(row.split(",")[0]) for row in rows] == dataset.flip_time.values.tolist()
        assert len(rows) > 2
