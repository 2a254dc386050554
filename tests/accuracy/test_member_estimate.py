"""Announced errors of members that run side by side: true, their own, and no bit of the motion moves."""

import numpy as np
import pytest
from support import cases

from experiments.sweep_coverage import KINDS, Found, found_of
from rigidsim import parse
from rigidsim.scene.sweep import Sweep
from rigidsim.workflows.sweeps.members import MemberResults, run_members, warning_bits

MEMBERS = 6


def results_of(kind: str, which: list[int] | None = None, output: str = "") -> MemberResults:
    text = KINDS[kind].sweep("members", MEMBERS, 3).experiment.text
    sweep = Sweep.of(parse(text.replace("[output]", f"[output]\n{output}")))
    return run_members(sweep, which or list(range(MEMBERS)), ["final"])


@pytest.fixture(scope="module")
def satellites() -> MemberResults:
    return results_of("satellites")


@pytest.mark.slow
def test_estimates_move_no_bit_of_the_motion(satellites: MemberResults) -> None:
    without = results_of("satellites", output="estimate = false")
    assert np.isnan(without.kept["attitude_error"].values).all()
    assert not without.estimating < 0 < satellites.estimating
    apart = {"attitude_error", "warnings"}
    assert without.kept.keys() == satellites.kept.keys() > apart
    for name in without.kept.keys() - apart:
        assert without.kept[name].values.tobytes() == satellites.kept[name].values.tobytes(), name


@pytest.mark.slow
def test_a_tolerance_is_part_of_the_error(satellites: MemberResults) -> None:
    """At 1e-9 the members lose digits, and what each announces covers what it lost."""
    loose, full = results_of("satellites, 1e-9").kept, satellites.kept
    apart = [
        np.linalg.norm(loose["quaternion_final"].values + sign * full["quaternion_final"].values, axis=1)
        for sign in (-1, 1)
    ]
    true = 2 * np.minimum(*apart)
    assert (true > full["attitude_error"].values).all()
    assert (loose["attitude_error"].values > true / 3).all()


@pytest.mark.slow
def test_a_member_whose_digits_are_gone_says_so() -> None:
    kept = results_of("satellites, long").kept
    gone = kept["attitude_error"].values > 1e-2
    assert gone.any()
    assert (kept["attitude_error"].values <= np.pi).all()
    warned = kept["warnings"].values & warning_bits(["attitude_uncertain"])
    np.testing.assert_array_equal(warned > 0, gone)


@pytest.mark.parametrize("kind", cases([*KINDS], [], daily=1))
def test_announced_errors_are_true(kind: str) -> None:
    """As `experiments/sweep_coverage.py` has it, of few members: none may be more than ten times as wrong."""
    for _, found in found_of(kind, 16, 5):
        assert isinstance(found, Found)
        assert found.side_by_side == 16
        assert (found.ratio[~found.warned] < 10).all()
        sound = ~found.warned & (found.true > 0)
        assert np.median(found.announced[sound] / found.true[sound]) < 20
