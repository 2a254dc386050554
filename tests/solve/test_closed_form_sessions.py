"""A run in closed form needs no Taylor engine, and goes on after a kill bit for bit."""

from pathlib import Path

import numpy as np
import pytest
from support import cases, config, loaded, run_text, same_bits

import rigidsim
from rigidsim.session.session import Observer, Tuning
from rigidsim.solve.sampler import Pacing, Progress
from rigidsim.store import netcdf
from rigidsim.store.segments import SegmentLimits

# blocks of a few samples, each followed by a segment
EAGER = Tuning(Pacing(chunk_seconds=0.0, patience=0.0, rows_at_once=8), SegmentLimits(seconds=0.0))
TOP = {
    "body": 'principal_moments = [1, 1, "0.3 kg m^2"]\nmass = 1\ncenter_of_mass = [0, 0, 0.2]',
    "initial": "angular_velocity = [0.1, 0.2, 9]\neuler_angles = [0.2, 0.6, 0.7]",
    "loads": 'kind = "uniform_gravity"',
    "time": "start = 1\nend = 4\nsamples = 61",  # so dense that the samples tell the turns
    "output": 'record = ["quaternion", "euler_angles"]',
    "name": "top",
}
PRECISIONS = ("single", "double", "extended", "quadruple", "30")


def top(precision: str, *, estimate: bool = False) -> rigidsim.Experiment:
    given = precision if precision.isdigit() else f'"{precision}"'
    integrator = f'method = "closed_form"\nprecision = {given}'
    return rigidsim.parse(config(**TOP, integrator=integrator, estimate=estimate))


class Killed(BaseException):
    """As sudden as a kill: nothing is saved after it."""


class KillsAt(Observer):
    """Ends the process's part once some samples are taken."""

    def progressed(self, progress: Progress) -> None:
        if progress.next_sample >= 24:
            raise Killed


def killed(experiment: rigidsim.Experiment, out: Path) -> Path:
    """The folder of a run that was killed after three of its eight blocks."""
    with pytest.raises(Killed):
        rigidsim.run(experiment, out=out, observer=KillsAt(), tuning=EAGER)
    folder = out / "top"
    assert (folder / "segments").is_dir()
    assert not (folder / "dataset.h5").exists()
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("precision", cases(PRECISIONS, ("double",)))
def test_a_killed_run_resumes_bit_for_bit(precision: str, tmp_path: Path) -> None:
    whole = rigidsim.run(top(precision), out=tmp_path / "whole")
    folder = killed(top(precision), tmp_path / "cut")
    done = rigidsim.resume(folder, tuning=EAGER)
    assert done.status == "finished"
    assert done.summary["cost"]["sessions"] == 2
    same_bits(whole, done)
    one, other = (netcdf.read_group(run.folder.checkpoint, "checkpoint") for run in (whole, done))
    assert sorted(one) == sorted(other)
    for name in set(one) - {"effort", "sessions"}:
        np.testing.assert_array_equal(one[name], other[name], name)


@pytest.mark.parametrize("precision", cases(PRECISIONS, ["double"]))
def test_no_bit_depends_on_which_samples_are_evaluated_together(precision: str) -> None:
    """A flight that begins with exact zeros in its attitude, where the working precision's last bits show."""
    given = precision if precision.isdigit() else f'"{precision}"'
    text = config(
        "principal_moments = [1, 2, 2.5]\nmass = 1",
        "angular_velocity = [0.3, 0.2, 1]\nposition = [0, 0, 0]\nvelocity = [1, 2, 30]",
        'kind = "uniform_gravity"',
        "end = 1000\nsamples = 41",
        f'method = "closed_form"\nprecision = {given}',
    )
    at_once = run_text(text)
    for rows in (5, 1):
        same_bits(at_once, run_text(text, tuning=Tuning(Pacing(rows_at_once=rows))))
    few, many = loaded(run_text(text, "time.samples=5")), loaded(at_once)
    for name in ("quaternion", "angular_velocity", "position"):  # a quaternion's sign is the nearer one
        np.testing.assert_array_equal(np.abs(few[name].values), np.abs(many[name].values[::10]))
