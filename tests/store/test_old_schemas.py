"""Files of the schema of 1.0 are read for good; those of any other are refused with the reason."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray
from support import config, run_text
from typer.testing import CliRunner

import rigidsim
from rigidsim import RunFolderError
from rigidsim.cli.app import app
from rigidsim.store.seal import seal
from rigidsim.store.variables import SCHEMA_VERSION

pytestmark = pytest.mark.optimised

KEPT = Path(__file__).parents[1] / "data" / f"schema_{SCHEMA_VERSION}.h5"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "runs" / "tiny"
    path.mkdir(parents=True)
    shutil.copy(KEPT, path / "dataset.h5")
    return path


def test_a_kept_dataset_is_read(folder: Path) -> None:
    with rigidsim.open_run(folder).dataset as dataset:
        assert dataset.time.values.tolist() == [0, 0.5, 1, 1.5, 2]
        assert dataset.angular_velocity.sel(body_axis="y").values[0] == 1.0
        assert (np.abs(dataset.energy_drift) < 1e-17).all()  # it was integrated in 80 bits
        # from 1.5 s before 2017, in UTC, with a leap second from 1.5 s on
        dates = [np.datetime64("2016-12-31T23:59:58.5"), np.datetime64("2016-12-31T23:59:59")]
        assert dataset.date.values[:2].tolist() == [d.astype("M8[ns]").astype(int) for d in dates]
        assert np.isnat(dataset.date.values).tolist() == [False, False, False, True, True]
    with xarray.open_dataset(KEPT) as dataset:
        assert list(dataset.quaternion.dims) == ["time", "quaternion_component"]
    for command in (
        ["info"],
        ["plot", "--what", "drift"],
        ["export", "--format", "csv", "--out", str(folder / "t.csv")],
    ):
        result = CliRunner().invoke(app, [command[0], str(folder), *command[1:]])
        assert result.exit_code == 0, result.output


@pytest.mark.slow
def test_it_embeds_the_experiment_that_gives_the_same_numbers(folder: Path) -> None:
    """To a few roundings: bits are promised for the same versions and CPU features alone."""
    result = CliRunner().invoke(app, ["run", "--from", str(KEPT), "--out", str(folder)])
    assert result.exit_code == 0, result.output
    with rigidsim.open_run(folder / "tiny").dataset as again, xarray.open_dataset(KEPT) as dataset:
        for name in ("angular_velocity", "quaternion", "energy"):
            np.testing.assert_allclose(again[name], dataset[name], rtol=0, atol=1e-15)


def of_schema(path: Path, version: int) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: content.rindex(b"\nrigidsim sha256 ")])
    with h5py.File(path, "r+") as file:
        file.attrs.modify("schema_version", version)
    seal(path)


def opened(path: Path) -> Any:
    return rigidsim.open_run(path).dataset


@pytest.mark.parametrize(
    ("version", "remedy"),
    [(SCHEMA_VERSION - 1, "run its config again"), (SCHEMA_VERSION + 1, "update rigidsim")],
)
def test_other_schemas_are_refused(version: int, remedy: str, folder: Path, tmp_path: Path) -> None:
    """Unfinished runs, too, whose segments stay where they are."""
    cut = run_text(config(time="end = 60\nevery = 0.5"), "limits.max_steps=20", out=tmp_path)
    (segment,) = cut.folder.segments.iterdir()
    attempts: list[tuple[Callable[[Path], Any], Path]] = [
        *((what, folder) for what in (opened, rigidsim.verify)),
        *((what, cut.folder.path) for what in (opened, rigidsim.resume)),
    ]
    for path in (folder / "dataset.h5", segment):
        of_schema(path, version)
    for attempt, place in attempts:
        with pytest.raises(RunFolderError, match=rf"has schema version {version}, .*; {remedy}"):
            attempt(place)
    assert segment.exists()
