"""The certificates' study finds what it should, and would find a certificate that lies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import rigidsim
from experiments import accuracy_certificates as study
from experiments.certificates.examining import examine
from experiments.certificates.ledger import Ledger, code_version
from experiments.random_scenes import KINDS, random_scene
from rigidsim.accuracy.certificate import Certificate, certify


def test_scenes_are_the_same_each_time_and_of_every_kind() -> None:
    scenes = [random_scene(number) for number in range(len(KINDS))]
    assert scenes == [random_scene(number) for number in range(len(KINDS))]
    assert {scene.kind for scene in scenes} == set(KINDS)
    assert scenes[0].text != random_scene(0, seed=1).text
    for scene in scenes:
        rigidsim.parse(scene.text)


@pytest.mark.slow
def test_a_scene_that_keeps_its_word() -> None:
    outcome = examine(random_scene(3))
    assert 0 < outcome.true <= outcome.certified <= outcome.asked
    assert outcome.kept
    assert not outcome.violated
    assert 1 <= outcome.ratio <= 2  # the run's own setting is one of those searched
    assert outcome.choose_seconds + outcome.certify_seconds < outcome.run_seconds < outcome.cpu_seconds


def lying(monkeypatch: pytest.MonkeyPatch) -> None:
    """Certificates a hundred times too small from now on."""

    def small(*given: Any, **more: Any) -> Any:
        found = certify(*given, **more)
        assert found is not None
        return Certificate(found.error / 100, found.end, found.how, found.times)

    monkeypatch.setattr("rigidsim.workflows.certify.certify", small)


@pytest.mark.slow
def test_a_certificate_that_lies_fails_the_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lying(monkeypatch)
    assert study.main(["--out", str(tmp_path), "--first", "7", "--count", "1"]) == 1
    (outcome,) = Ledger(tmp_path / f"{study.NAME}.jsonl", study.SEED, code_version()).outcomes.values()
    assert outcome.violated
    assert "VIOLATION" in outcome.line
    (check,) = [c for c in study.checks([outcome]) if "exceeds the certificate" in c.name]
    assert not check.passed
