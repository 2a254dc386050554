"""A run in memory has the dataset that its file would have, as xarray reads it."""

from pathlib import Path

import pytest
import xarray
from support import CONFIGS, cases, config, same_bits
from test_fingerprints import shortened

import rigidsim

OF_ONE_RUN = ("run_id", "started_at", "finished_at", "wall_seconds", "cpu_seconds")
PRECISIONS = ("single", "double", "extended", "quadruple")
USUAL = [path for path in CONFIGS if path.stem in ("moon_mean_axis", "skater")]  # dates, and "work"
EXTRAS = (
    '[[events]]\nname = "found"\nexpression = "wx"\n[[events]]\nname = "never"\nexpression = "1 + t"\n'
    '[[rotors]]\nname = "a"\naxis = [1, 0, 0]\nmoment = 0.1\nrate = 3\n'
    '[[rotors]]\nname = "longer"\naxis = [0, 1, 0]\nmoment = 0.2\nrate = 2\n'
)
STOP = '[[events]]\nname = "soon"\nexpression = "t - 0.5"\naction = "stop"'
OF_ONE_SUMMARY = ("cost", "dataset_sha256", "provenance")


@pytest.mark.parametrize("path", cases(USUAL, USUAL[:1]), ids=lambda path: path.stem)
def test_a_run_in_memory_has_the_dataset_of_the_file(path: Path, tmp_path: Path) -> None:
    precision = PRECISIONS[CONFIGS.index(path) % 4]
    asked = ["output.timeline=false", f'integrator.precision="{precision}"', *shortened(path)]
    assert_the_same(rigidsim.load(path, overrides=asked), tmp_path)


def test_events_dates_names_and_exponents_are_the_same(tmp_path: Path) -> None:
    """And of a run without samples nothing."""
    time = 'end = 9\nsamples = 5\nepoch = "2016-12-31T23:59:58 UTC"'
    wide = 'precision = "extended"'
    text = config(time=time, integrator=wide, output="lyapunov = true", more=EXTRAS)
    assert_the_same(rigidsim.parse(text), tmp_path / "with")
    text = config(time="times = [1, 2]", integrator=wide, more=STOP)
    assert_the_same(rigidsim.parse(text), tmp_path / "without")


def assert_the_same(experiment: rigidsim.Experiment, folder: Path) -> None:
    ran = rigidsim.run(experiment, out=folder), rigidsim.run(experiment, out=None)
    summaries = [{k: v for k, v in run.summary.items() if k not in OF_ONE_SUMMARY} for run in ran]
    assert summaries[0] == summaries[1]
    with xarray.open_dataset(next(folder.glob("*/dataset.h5"))) as opened:
        saved = opened.load()
    kept = ran[1].dataset
    for dataset in (kept, saved):
        for name in OF_ONE_RUN:
            del dataset.attrs[name]
    xarray.testing.assert_identical(kept, saved)
    same_bits(kept, saved)
    assert (list(kept.data_vars), list(kept.coords)) == (list(saved.data_vars), list(saved.coords))
    assert list(kept.attrs) == list(saved.attrs)
    for one, other in ((kept, saved), *((kept[name], saved[name]) for name in kept.variables)):
        assert [type(value) for value in one.attrs.values()] == [
            type(value) for value in other.attrs.values()
        ]
        for key in ("dtype", "units", "calendar", "coordinates"):
            assert one.encoding.get(key) == other.encoding.get(key), key
