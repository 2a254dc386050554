"""Sweeps whose members are fits: each is the fit of its config; data, failures, resumption, pictures."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from support import config

import rigidsim
from rigidsim.errors import RigidsimError
from rigidsim.look.figures.sweeps import sweep_figure
from rigidsim.store.sweeps.saved import open_sweep
from rigidsim.workflows.sweeps.members import single_member
from rigidsim.workflows.sweeps.sweep import resume_sweep
from rigidsim.workflows.verify import verify

SIGMA = 0.01  # rad/s
SPUN = config(initial="angular_velocity = [0.3, 1.0, -0.4]", time="end = 10\nsamples = 21", name="nights")
FIT = """
[fit]
parameters = ["initial.angular_velocity", "body.principal_moments[1]"]
[[fit.data]]
file = "seen/0.csv"
observable = "angular_velocity"
columns = ["x", "y", "z"]
sigma = 0.01
"""
NIGHTS = """
[sweep]
axes."fit.data[0].file" = {values = ["seen/0.csv", "seen/1.csv", "seen/2.csv"], name = "night"}
"""


def observed(folder: Path) -> None:
    """Rates on three nights, each with noise of its own."""
    times = np.linspace(0, 10, 21)
    rates = rigidsim.run(rigidsim.parse(SPUN), out=None).dataset["angular_velocity"].values
    (folder / "seen").mkdir()
    for night in range(3):
        noise = SIGMA * np.random.default_rng(night).standard_normal(rates.shape)
        rows = np.column_stack([times, rates + noise])
        np.savetxt(
            folder / f"seen/{night}.csv", rows, delimiter=",", header="time,x,y,z", comments="", fmt="%.6f"
        )
    (folder / "nights.toml").write_text(SPUN + FIT + NIGHTS)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The config with its data, and the finished sweep."""
    folder = tmp_path_factory.mktemp("nights")
    observed(folder)
    rigidsim.sweep(folder / "nights.toml", out=folder / "runs")
    return folder


@pytest.fixture
def here(place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A copy of it, in which the config is named without a folder."""
    shutil.copytree(place, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_members_are_single_fits_with_labels(place: Path) -> None:
    saved = open_sweep(place / "runs/nights")
    with saved.dataset as dataset:
        assert list(dataset["night"].values) == ["seen/0.csv", "seen/1.csv", "seen/2.csv"]
        one = rigidsim.fit(single_member(rigidsim.load(place / "nights.toml"), 1)).dataset
        member = dataset.sel(night="seen/1.csv")
        for name in ("value", "sigma", "scaled_sigma", "start", "covariance"):
            np.testing.assert_array_equal(member[name].values, one[name].values)
        for name in ("parameter", "parameter_unit", "other_parameter"):
            assert list(member[name].values) == list(one[name].values)
        assert float(member["chi_square"]) == one.attrs["chi_square"]
        assert dataset["converged"].values.tolist() == [1, 1, 1]
        apart = dataset["value"].sel(parameter="body.principal_moments[1]").values - 2
        assert (np.abs(apart) < 3 * dataset["sigma"].values[:, 3]).all()
        assert len(set(apart)) == 3
    told = saved.outcome.fitted["body.principal_moments[1]"]
    assert (told.members, told.unit) == (3, "kg m^2")
    assert told.median == pytest.approx(2, abs=0.01)


def test_a_sweep_of_fits_goes_on_from_its_own_copies(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the same bits, wherever and without the originals; verify repeats it."""
    folder = here / "runs/nights"
    before = open_sweep(folder).dataset.load()
    tile = sorted((folder / "tiles").glob("*.h5"))[1]
    for path in (folder / "dataset.h5", folder / "summary.json", tile):
        path.unlink()
    shutil.rmtree(here / "seen")
    (here / "elsewhere").mkdir()
    monkeypatch.chdir(here / "elsewhere")
    again = resume_sweep(folder)
    assert again.dataset.equals(before)
    assert verify(folder, members=1).identical
    for path in (folder / "data").iterdir():
        path.unlink()
    tile.unlink()
    with pytest.raises(RigidsimError, match=r"names as \"seen/0.csv\""):
        resume_sweep(folder)


def test_fits_that_fail_are_told_with_their_reason(here: Path) -> None:
    """Beside others: one of another day, and one that tells moments from no ratio."""
    (here / "seen/1.csv").write_text("time,x,y,z\n20,1,1,1\n")
    free = FIT.replace('"body.principal_moments[1]"', '"body.principal_moments"')
    text = (SPUN + free + NIGHTS).replace('"nights"', '"failing"').replace(', "seen/2.csv"', "")
    found = rigidsim.sweep(rigidsim.parse(text), out=here / "runs")
    with found.dataset as dataset:
        assert "no row lies as near to the run's start as its end" in str(dataset["failed_reason"].values[0])
        assert np.isnan(dataset["value"].values[1]).all()
        assert np.isfinite(dataset["value"].values[0]).all()
        assert np.isnan(dataset["sigma"].values[0, 3:]).all()
        assert dataset["undetermined"].values.tolist() == [1, 0]
        sweep_figure(dataset)
    assert found.outcome.outcomes == {"finished": 1, "failed": 1}
    assert found.outcome.warning_codes == ["members_failed", "fits_undetermined"]
    assert found.outcome.fitted["body.principal_moments[0]"].sigma is None
