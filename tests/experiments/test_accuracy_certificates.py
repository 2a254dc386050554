"""The certificates' study finds what it should, and would find a certificate that lies."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

import rigidsim  # noqa: E402
from experiments import accuracy_certificates as study  # noqa: E402
from experiments.random_scenes import KINDS, random_scene  # noqa: E402
from rigidsim import certify  # noqa: E402
from rigidsim.trial import Setting  # noqa: E402


def test_scenes_are_the_same_each_time_and_of_every_kind() -> None:
    scenes = [random_scene(number) for number in range(len(KINDS))]
    assert scenes == [random_scene(number) for number in range(len(KINDS))]
    assert {scene.kind for scene in scenes} == set(KINDS)
    assert scenes[0].text != random_scene(0, seed=1).text
    for scene in scenes:
        rigidsim.parse(scene.text)


def test_costs_rise_with_digits() -> None:
    costs = [
        study.counted(Setting(precision, tolerance), 100, 10)
        for precision, tolerance in (
            ("double", 1e-6),
            ("double", None),
            ("extended", None),
            ("quadruple", None),
        )
    ]
    assert costs == sorted(costs)


def test_a_scene_that_keeps_its_word(tmp_path: Path) -> None:
    outcome = study.examine(random_scene(3))
    assert 0 < outcome.true <= outcome.certified <= outcome.asked
    assert outcome.kept
    assert 0.5 < outcome.ratio <= 2
    study._figure([outcome], tmp_path)
    assert (tmp_path / f"{study.NAME}.png").stat().st_size > 10_000


def test_a_certificate_that_lies_fails_the_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sound = certify.certify

    def lying(*given: Any, **more: Any) -> Any:
        found = sound(*given, **more)
        assert found is not None
        return certify.Certificate(found.error / 100, found.end, found.how, found.times)

    monkeypatch.setattr(certify, "certify", lying)
    monkeypatch.setattr(study, "_REDUCED", 1)
    monkeypatch.setattr(study, "random_scene", lambda _: random_scene(7))
    checks = study.campaign(False, tmp_path)
    assert not checks[0].passed
    assert "exceeds the certificate" in checks[0].name
