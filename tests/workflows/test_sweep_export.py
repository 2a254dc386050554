"""Exports of sweeps: every number of the dataset, by member, in files that other tools read."""

import csv
from decimal import Decimal, localcontext
from pathlib import Path

import numpy as np
import pytest
import xarray
from support import config
from typer.testing import CliRunner, Result

from rigidsim import SavedSweep, parse
from rigidsim import sweep as run_sweep
from rigidsim.cli.app import app

CONFIG = config(
    initial="angular_velocity = [0.1, 1, 0.05]",
    time="end = 10\nsamples = 11",
    integrator='formulation = "rates"\nprecision = "extended"',
    output='record = ["angular_velocity", "energy"]',
    more="""\
[[events]]
name = "middle"
expression = "wx"
[sweep]
keep = ["final", "events", "section", "series"]
most_events = 3
axes."initial.angular_velocity" = {values = [[0.1, 1, 0.3], [-0.3, 1, 0.1]], name = "w"}
axes."body.principal_moments[2]" = {linspace = [2.25, 2.75, 3], name = "C"}
""",
    name="box",
)
ZIPPED = config(
    initial="angular_velocity = [0.1, 1, 0.05]",
    loads='kind = "torque"\ncomponents = ["0", "0", "wz^3"]',
    time="end = 2\nsamples = 3",
    output='record = ["nutation_angle"]',
    more="""\
[sweep]
mode = "zip"
keep = ["final", "series"]
axes."integrator.precision" = {values = ["double", "extended", "quadruple"]}
axes."time.end" = {values = [2, 2, 1]}
axes."initial.angular_velocity[2]" = {values = [0.1, 3, 0.2], name = "w3"}
""",
    name="pairs",
)


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def exported(sweep: SavedSweep, file_format: str, folder: Path, *options: str) -> Result:
    to = str(folder / f"out.{file_format}")
    return CliRunner().invoke(
        app, ["export", str(sweep.place), "--format", file_format, "--out", to, *options]
    )


def written(sweep: SavedSweep, file_format: str, folder: Path, *options: str) -> list[Path]:
    told = exported(sweep, file_format, folder, *options)
    assert told.exit_code == 0, told.output
    return [Path(line) for line in told.stdout.splitlines()]


@pytest.fixture(scope="module")
def box(tmp_path_factory: pytest.TempPathFactory) -> SavedSweep:
    return run_sweep(parse(CONFIG), out=tmp_path_factory.mktemp("sweeps"))


@pytest.fixture(scope="module")
def pairs(tmp_path_factory: pytest.TempPathFactory) -> SavedSweep:
    return run_sweep(parse(ZIPPED), out=tmp_path_factory.mktemp("sweeps"))


def test_csv_has_a_row_per_member_with_every_digit(box: SavedSweep, tmp_path: Path) -> None:
    paths = written(box, "csv", tmp_path)
    assert [path.name for path in paths] == ["out.csv", "out.time.csv", "out.middle_occurrence.csv"]
    dataset, found = box.dataset, rows(paths[0])
    assert list(found[0])[:8] == [
        "member", "w_value_0", "w_value_1", "w_value_2", "C", "status", "warnings", "steps",
    ]  # fmt: skip
    assert [int(row["member"]) for row in found] == list(range(6))
    assert [row["C"] for row in found] == ["2.25", "2.5", "2.75"] * 2
    assert [row["w_value_0"] for row in found] == ["0.1"] * 3 + ["-0.3"] * 3
    assert any(dataset.angular_velocity_final_lo.values.ravel())
    for number, row in enumerate(found):
        cell = dataset.isel(w=number // 3, C=number % 3)
        assert int(row["status"]) == int(cell.status) == 0
        assert int(row["steps"]) == int(cell.steps)
        assert int(row["middle_count"]) == int(cell.middle_count)
        assert row["middle_first"] == repr(float(cell.middle_first))
        for axis in "xyz":
            value = cell.sel(body_axis=axis)
            with localcontext() as context:
                context.prec = 400
                whole = Decimal(float(value.angular_velocity_final))
                whole += Decimal(float(value.angular_velocity_final_lo))
                error = abs(Decimal(row[f"angular_velocity_final_{axis}"]) - whole)
                assert error < abs(whole) * Decimal(2) ** -65  # half of the spacing of 64 bits
    head = [line for line in paths[0].read_text().splitlines() if line.startswith("#")]
    assert head[0] == "# box: 6 members along w, C"
    assert "# axes: w_value is initial.angular_velocity, C is body.principal_moments[2]" in head
    assert any(line.startswith("# status: 0 finished, 1 finished_event, ") for line in head)
    assert any(line.startswith("# warnings: 1 drift, 2 singularity, ") for line in head)


@pytest.mark.slow
def test_texts_failures_and_angles(pairs: SavedSweep, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    dataset = pairs.dataset
    assert dataset.failed_member.values.tolist() == [1]  # which spins up beyond all bounds
    path, series = written(pairs, "csv", tmp_path, "--angle-unit", "deg")
    assert series.name == "out.sample.csv"  # members have times of their own
    assert [row["time"] for row in rows(series) if row["member"] == "2"] == ["0.0", "0.5", "1.0"]
    found = rows(path)
    assert [row["precision"] for row in found] == ["double", "extended", "quadruple"]
    assert [row["w3"] for row in found] == ["0.1", "3.0", "0.2"]
    assert [row["failed_reason"] for row in found] == ["", str(dataset.failed_reason.values[0]), ""]
    np.testing.assert_allclose(
        [float(row["nutation_angle_final_deg"]) for row in found],
        np.rad2deg(dataset.nutation_angle_final.values),
        rtol=4e-16,
    )
    path, _ = written(pairs, "parquet", tmp_path)
    read = parquet.read_table(path)
    assert read["precision"].to_pylist() == ["double", "extended", "quadruple"]
    assert str(read.schema.field("status").type) == str(read.schema.field("member").type) == "int64"
    pytest.importorskip("zarr")
    (path,) = written(pairs, "zarr", tmp_path)
    with xarray.open_zarr(path) as store:
        assert store.precision.values.tolist() == ["double", "extended", "quadruple"]
        assert store.failed_reason.values.tolist() == dataset.failed_reason.values.tolist()


def test_what_makes_no_sense_is_refused(box: SavedSweep, tmp_path: Path) -> None:
    for file_format in ("aem", "oem"):
        told = exported(box, file_format, tmp_path)
        assert told.exit_code == 2
        assert f"given {file_format}, which holds a single motion" in told.output
        assert "allowed: csv, parquet, zarr. rigidsim run" in told.output
        assert "--member N" in told.output
    told = exported(box, "csv", tmp_path, "--epoch", "J2000")
    assert told.exit_code == 2
    assert "leave them out" in told.output
    assert list(tmp_path.iterdir()) == []
    written(box, "csv", tmp_path)
    assert "--force replaces it" in exported(box, "csv", tmp_path).output
