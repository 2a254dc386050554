"""What a picture reads of a dataset is what xarray reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support import config, run_text

from rigidsim.errors import RunFolderError
from rigidsim.look.thinning import thin
from rigidsim.store.recorded_rows import recorded_rows
from rigidsim.store.validated_open import open_dataset

SCENE = config(
    time='end = 30\nsamples = 1001\nepoch = "J2000"',
    integrator='precision = "extended"',
    output='record = ["angular_velocity", "quaternion", "euler_angles", "energy"]',
    more='[[events]]\nname = "flip"\nexpression = "wy"\n',
)
OLD = sorted((Path(__file__).parents[1] / "data").glob("schema_*.h5"))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run_text(SCENE, out=tmp_path_factory.mktemp("runs")).folder.dataset


@pytest.mark.parametrize("path", [None, *OLD], ids=["new", *(path.stem for path in OLD)])
def test_names_numbers_and_labels_are_those_that_xarray_reads(path: Path | None, run: Path) -> None:
    path = path or run
    with open_dataset(path, indexed=False) as dataset, recorded_rows(path) as rows:
        assert list(rows.data_vars) == list(dataset.data_vars)
        assert set(rows.coords) == set(dataset.coords)
        assert rows.sizes == dict(dataset.sizes)
        assert rows.attrs == dataset.attrs
        for name in dataset.variables:
            read, wanted = rows[str(name)], dataset[name]
            assert (read.dims, read.shape, read.ndim) == (wanted.dims, wanted.shape, wanted.ndim)
            if wanted.dtype.kind == "M":  # a date, which stays seconds since the epoch
                continue
            assert read.attrs == wanted.attrs
            np.testing.assert_array_equal(read.values, wanted.values)
            if name not in dataset.data_vars:
                continue
            assert read.dtype == wanted.dtype
            assert set(read.coords) >= {dim for dim in wanted.dims if dim in dataset.coords}


@pytest.mark.parametrize(("shown", "at_once"), [(1001, 5000), (100, 5000), (100, 150), (2, 1)])
def test_thinned_rows_are_those_of_xarray(shown: int, at_once: int, run: Path) -> None:
    with open_dataset(run, indexed=False) as dataset, recorded_rows(run) as rows:
        wanted, read = thin(dataset, shown, at_once), thin(rows, shown, at_once)
        assert list(read.data_vars) == list(wanted.data_vars)
        assert "quaternion_lo" not in read
        for name in ("time", *wanted.data_vars):
            np.testing.assert_array_equal(read[name].values, wanted[name].values)


def test_what_is_no_dataset_is_refused(run: Path, tmp_path: Path) -> None:
    torn = tmp_path / "torn.h5"
    torn.write_bytes(run.read_bytes()[:5000])
    link = tmp_path / "link.h5"
    link.symlink_to(run)
    for path, why in ((torn, "can't be read"), (link, "is a symbolic link")):
        with pytest.raises(RunFolderError, match=why), recorded_rows(path):
            pass
