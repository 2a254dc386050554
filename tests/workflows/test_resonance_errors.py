"""Bodies that keep pace with their source: the error announced for their average, against every rotation."""

from __future__ import annotations

from pathlib import Path

import pytest
from support import config, run_estimated, run_text

import rigidsim
from experiments.averaging.resonances import TIMES, axes_of, members, sound
from rigidsim.accuracy.models.modelling import measure_modelling
from rigidsim.accuracy.models.side_by_side import Unmeasured
from rigidsim.cli.screens.verdicts import verdict_line
from rigidsim.session.verdict import Soundness, verdict_on
from rigidsim.solve.problem import prepare
from rigidsim.store.summary import Summary
from rigidsim.store.summary_parts import UnmeasuredCode, WarningCode

FAULT = Path(__file__).parents[1] / "data" / "faults" / "resonance_no_error.toml"


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
        summary = run.outcome
        assert isinstance(summary, Summary)
        assert summary.modelling is not None
        assert (summary.modelling.unmeasured, summary.modelling.momentum_axis) == (code, None)
        assert "isn't known" in verdict_line(summary)[0]
    with pytest.raises(Unmeasured) as ended:
        measure_modelling(prepare(rigidsim.parse(given)), go_on=lambda: False)
    assert ended.value.code is UnmeasuredCode.INTERRUPTED
    summary = known["not_asked"].outcome
    assert isinstance(summary, Summary)
    for code in (WarningCode.MODEL_UNMEASURED, WarningCode.MODEL_UNCERTAIN):
        warned = summary.having(warning_codes=[code.value])
        assert verdict_on(warned).soundness is Soundness.INACCURATE
        assert "see the warning" in verdict_line(warned)[0]


@pytest.mark.slow
def test_announced_errors_of_librating_bodies_are_true() -> None:
    """Eight of those that ``python -m experiments.averaging.resonances`` counts."""
    found = [axis for _, axes in members(8, seed=11) for axis in axes]
    assert len(found) >= 12
    assert sound(found)
