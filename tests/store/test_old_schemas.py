"""A dataset that was written once stays readable: one small file of each schema version is kept."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray
from support import cases
from typer.testing import CliRunner

import rigidsim
from rigidsim import RunFolderError
from rigidsim.cli.app import app
from rigidsim.store.seal import seal
from rigidsim.store.variables import SCHEMA_VERSION

pytestmark = pytest.mark.optimised

KEPT = Path(__file__).parents[1] / "data"
VERSIONS = range(1, SCHEMA_VERSION + 1)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "runs" / "tiny"
    path.mkdir(parents=True)
    return path


@pytest.mark.parametrize("version", cases(VERSIONS, [1, SCHEMA_VERSION]))
def test_each_version_is_kept_and_read(version: int, folder: Path) -> None:
    shutil.copy(KEPT / f"schema_{version}.h5", folder / "dataset.h5")
    with rigidsim.open_run(folder).dataset as dataset:
        assert dataset.attrs["schema_version"] == version
        assert dataset.sizes["time"] == 5
        assert dataset.time.values.tolist() == [0, 0.5, 1, 1.5, 2]
        assert dataset.angular_velocity.sel(body_axis="y").values[0] == 1.0
        assert (np.abs(dataset.energy_drift) < 1e-17).all()  # it was integrated in 80 bits
        assert ("date" in dataset.coords) == (version >= 4)
        if version >= 4:  # from 1.5 s before 2017, in UTC, with a leap second from 1.5 s on
            dates = [np.datetime64("2016-12-31T23:59:58.5"), np.datetime64("2016-12-31T23:59:59")]
            assert dataset.date.values[:2].tolist() == [d.astype("M8[ns]").astype(int) for d in dates]
            assert np.isnat(dataset.date.values).tolist() == [False, False, False, True, True]
    for command in (
        ["info"],
        ["plot", "--what", "drift"],
        ["export", "--format", "csv", "--out", str(folder / "t.csv")],
    ):
        result = CliRunner().invoke(app, [command[0], str(folder), *command[1:]])
        assert result.exit_code == 0, result.output


@pytest.mark.parametrize("version", VERSIONS)
def test_any_reader_opens_it_alone(version: int) -> None:
    with xarray.open_dataset(KEPT / f"schema_{version}.h5") as dataset:
        assert list(dataset.quaternion.dims) == ["time", "quaternion_component"]


@pytest.mark.parametrize("version", cases(VERSIONS, [1]))
def test_it_embeds_the_experiment_that_gives_the_same_numbers(version: int, folder: Path) -> None:
    """To a few roundings: bits are promised for the same versions and CPU features alone."""
    kept = KEPT / f"schema_{version}.h5"
    result = CliRunner().invoke(app, ["run", "--from", str(kept), "--out", str(folder)])
    assert result.exit_code == 0, result.output
    with rigidsim.open_run(folder / "tiny").dataset as again, xarray.open_dataset(kept) as dataset:
        for name in ("angular_velocity", "quaternion", "energy"):
            np.testing.assert_allclose(again[name], dataset[name], rtol=0, atol=1e-15)


def test_a_newer_version_is_refused(folder: Path) -> None:
    path = folder / "dataset.h5"
    shutil.copy(KEPT / f"schema_{SCHEMA_VERSION}.h5", path)
    with h5py.File(path, "r+") as file:
        file.attrs["schema_version"] = SCHEMA_VERSION + 1
    seal(path)
    with pytest.raises(RunFolderError, match=rf"schema version {SCHEMA_VERSION + 1}"):
        _ = rigidsim.open_run(folder).dataset
