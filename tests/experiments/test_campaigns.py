"""The campaign of kills, full disks and damages: it can fail, tells on the way, and finds nothing lost."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rigidsim
from experiments import accuracy_certificates as study
from experiments import error_coverage, kill_campaign
from experiments.coverage.judging import Judged
from experiments.durability.judging import Tally, check_after, check_complete, saved_rows
from experiments.durability.scenes import same, text_of
from experiments.random_scenes import random_scene
from experiments.sweep_kill_campaign import WAYS, campaign
from rigidsim.accuracy.certificate import Certificate, certify
from rigidsim.store.folder import RunFolder

SHORT = text_of("double_driven").replace("end = 3000", "end = 30").replace("3001", "31")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    return rigidsim.run(rigidsim.parse(SHORT), out=tmp_path_factory.mktemp("runs")).folder


@pytest.mark.slow
def test_lost_rows_and_changed_bits_are_failures(finished: RunFolder) -> None:
    tally = Tally()
    with rigidsim.open_run(finished.path).dataset as dataset:
        whole = dataset.load()
    assert saved_rows(finished.path) == -1
    check_after(tally, finished.path, whole, 31, "whole")
    check_complete(tally, finished.path, whole, "whole")
    assert (tally.failures, tally.counts["completed runs identical"]) == ([], 1)
    check_after(tally, finished.path, whole, 32, "short")
    assert tally.failures == ["short: 31 rows, 32 acknowledged"]
    changed = whole.copy(deep=True)
    changed["energy"].values[30] = np.nextafter(changed["energy"].values[30], 9)
    assert same(whole, changed) == "energy"
    assert same(whole, changed, rows=30) == ""
    check_after(tally, finished.path, changed, 31, "changed")
    check_complete(tally, finished.path, changed, "changed")
    assert tally.failures[1:] == ["changed: energy differs", "changed: energy"]


@pytest.mark.campaign  # 40 s
def test_a_small_campaign(capfd: pytest.CaptureFixture[str]) -> None:
    arguments = "--kills 3 --full-disks 1 --read-only 1 --damages 6 --seconds 240"  # seconds at most
    assert kill_campaign.main(arguments.split()) == 0
    told = capfd.readouterr().out
    assert "kills: 3 of 3" in told
    assert "damages: 6 of 6; failures so far: 0" in told


# ---- the campaign of kills over sweeps, shortened


@pytest.mark.slow  # a sweep for each kill
def test_a_few_disturbances_of_each_kind_lose_nothing(tmp_path: Path) -> None:
    tally = Tally()
    campaign(tally, 4, random.Random(3), tmp_path, 600)
    assert tally.failures == []
    assert sum(tally.counts[way] for way in WAYS) >= 4


# ---- the coverage campaign: it goes on where it stopped, and a share of it keeps what estimates promise


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


# ---- the certificates' study finds what it should, and would find a certificate that lies


@pytest.mark.slow
def test_a_certificate_that_lies_fails_the_study(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = study.examine(random_scene(3))
    assert 0 < honest.true <= honest.certified <= honest.scene.accuracy
    assert all(check.passed for check in study.checks([honest]))

    def small(*given: Any, **more: Any) -> Any:
        found = certify(*given, **more)
        assert found is not None
        return Certificate(found.error / 100, found.end, found.how, found.times)

    monkeypatch.setattr("rigidsim.workflows.run.certify", small)
    lying = study.examine(random_scene(3))
    assert lying.violated
    assert "VIOLATION" in lying.line
    assert not all(check.passed for check in study.checks([lying]))
