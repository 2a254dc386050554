"""Bodies that keep pace with their source: the error announced for their average, against every rotation."""

from pathlib import Path

import pytest
from support import config, run_estimated, run_text

import rigidsim
from experiments.averaged_motions import TIMES, axes_of, members, sound
from rigidsim.cli.screens.summary import verdict_line

FAULT = Path(__file__).parents[1] / "data" / "faults" / "resonance_no_error.toml"


@pytest.mark.slow
def test_a_window_follows_the_resonance_that_the_run_keeps() -> None:
    """Taken by itself, the window in the middle of this libration would be refused for another resonance."""
    for axis in axes_of(rigidsim.load(FAULT)):
        assert axis.ratio < TIMES


def test_what_is_not_measured_says_why_and_that_nothing_is_known() -> None:
    given = config(
        "principal_moments = [0.98, 0.98, 1]",
        'angular_velocity = [0, 0, 60]\neuler_angles = [0, "35 deg", 0]',
        'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {semi_major_axis = 1}',
        "end = 10\nsamples = 3",
        "",
        "",
        '[model]\nlevel = "spin_averaged"',
    )
    known = {"not_asked": run_text(given), "not_ended": run_estimated(given, "limits.max_steps=1")}
    for code, run in known.items():
        told = run.summary["modelling"]
        assert (told["unmeasured"], told.get("momentum_axis")) == (code, None)
        assert "isn't known" in verdict_line(run.outcome)[0]


@pytest.mark.campaign
def test_announced_errors_of_librating_bodies_are_true() -> None:
    """Four of those that ``python -m experiments.averaged_motions`` counts."""
    found = [axis for _, axes in members(4, seed=11) for axis in axes]
    assert len(found) >= 6
    assert sound(found)
