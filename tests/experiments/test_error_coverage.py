"""The coverage campaign: it goes on where it stopped, and a share of it keeps what estimates promise."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments import error_coverage
from experiments.coverage.families import FAMILIES, coverage_scene
from experiments.coverage.judging import Judged


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


def test_families_take_turns_and_scenes_are_reproducible() -> None:
    names = [coverage_scene(n).family for n in range(len(FAMILIES))]
    assert names == list(FAMILIES)
    assert coverage_scene(5) == coverage_scene(5) != coverage_scene(5, seed=2)


@pytest.mark.slow(80)
def test_a_share_of_the_campaign(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    numbers = range(2 * len(FAMILIES))
    first = error_coverage.campaign(numbers, 1, tmp_path)
    assert not error_coverage.broken_promises(first)
    capsys.readouterr()
    again = error_coverage.campaign(numbers, 1, tmp_path)
    assert [one.true for one in again if one.true == one.true] == [o.true for o in first if o.true == o.true]
    assert not capsys.readouterr().out  # nothing was judged once more
