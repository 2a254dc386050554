"""The campaigns of kills and of announced errors: sweeps lose nothing, and a broken promise is found."""

import random
import time
from pathlib import Path

import mpmath
import pytest
from support import seeds

from experiments import error_coverage
from experiments.coverage.families import coverage_scene
from experiments.coverage.judging import Judged, apart, judge_reversal
from experiments.durability.judging import Tally
from experiments.durability.sweeps import WAYS, disturb_sweeps


@pytest.mark.slow  # a sweep for each kill
def test_a_few_disturbances_of_each_kind_lose_nothing(tmp_path: Path) -> None:
    tally = Tally()
    disturb_sweeps(tally, 4, random.Random(3), tmp_path, time.monotonic() + 600)
    assert tally.failures == []
    assert sum(tally.counts[way] for way in WAYS) >= 4


def judged(true: float, announced: float, *, gone: bool = False, number: int = 0) -> Judged:
    return Judged(number, "free body", "quaternion", "finished", true=true, announced=announced, gone=gone)


def test_broken_promises_are_found() -> None:
    kept = [judged(1e-12, 1e-12, number=n) for n in range(200)]
    assert not error_coverage.broken_promises(kept)
    silent = error_coverage.broken_promises([*kept, judged(1e-10, 1e-12, number=200)])
    assert any("without a warning: [200]" in line for line in silent)
    alarmed = error_coverage.broken_promises([*kept, judged(1e-6, 0.1, gone=True, number=201)])
    assert any("digits said to be gone" in line and "[201]" in line for line in alarmed)
    wide = [judged(1e-12, 1e-9, number=n) for n in range(200)]
    assert any("median announced over true" in line for line in error_coverage.broken_promises(wide))


@pytest.mark.parametrize("seed", seeds(2, 60))
@pytest.mark.slow
def test_random_scenes_go_forth_and_back_within_ten_times_what_both_ways_announce(seed: int) -> None:
    """In any precision, half of them into the past first; what is damped forwards may run away backwards."""
    found = judge_reversal(coverage_scene(seed, seed=2))
    if found.ended == "finished":
        assert not found.true > 10 * found.announced, found.line
    else:
        runaway = "more than" in found.warned or "finite" in found.warned
        assert runaway or "depends on the sign" in found.warned, found.line


def test_places_are_compared_in_all_their_digits() -> None:
    """An error of 3e-19 was judged as 2.2e-16, the last bit of a double."""
    with mpmath.workdps(40):
        one, other = mpmath.mpf(1) / 3, mpmath.mpf(1) / 3 + mpmath.mpf("3e-19")
    assert float(apart([[one]], [[other]])) == pytest.approx(3e-19, rel=1e-9)
