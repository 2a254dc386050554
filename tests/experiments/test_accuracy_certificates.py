"""The certificates' study finds what it should, and would find a certificate that lies."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import mpmath
import pytest

import rigidsim
from experiments import accuracy_certificates as study
from experiments.certificates.calibration import BODY
from experiments.certificates.examining import Outcome, examine
from experiments.certificates.ledger import Ledger, code_version
from experiments.certificates.searching import Search, truth_setting
from experiments.random_scenes import KINDS, RandomScene, random_scene
from rigidsim.accuracy.certificate import Certificate, certify
from rigidsim.accuracy.cost import cost
from rigidsim.accuracy.setting import Setting
from rigidsim.accuracy.trial import try_setting


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


def test_a_search_stops_at_what_is_known_to_be_enough() -> None:
    """Nothing is cheaper than the cheapest: a second search below its cost finds nothing, by fewer trials."""
    scene = random_scene(3)
    experiment = rigidsim.parse(scene.text)
    last = float(experiment.config.time.end.rational)  # type: ignore[union-attr]
    times = [mpmath.mpf(last * n / 20) for n in range(1, 21)]
    truth = try_setting(experiment, truth_setting(experiment, Setting(), scene), times, compact=True)
    search = Search(experiment, scene.accuracy, times, truth)
    found = search.run(20)
    assert found is not None
    again = Search(experiment, scene.accuracy, times, truth, steps=found.steps, below=search.cost)
    assert again.run(20) is None
    assert again.cost == search.cost


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


@pytest.mark.slow
def test_a_campaign_goes_on_where_it_was_and_can_be_shared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    seen: list[int] = []

    def quick(scene: RandomScene) -> Outcome:
        seen.append(scene.number)
        return made_up(scene.number)

    monkeypatch.setattr(study, "examine", quick)
    arguments = ["--out", str(tmp_path), "--first", "4", "--count", "5"]
    assert study.main([*arguments, "--share", "2/2"]) == 0
    assert seen == [5, 7]
    lines = [line for line in capsys.readouterr().out.splitlines() if " rad  asked " in line]
    assert len(lines) == 2
    file = tmp_path / f"{study.NAME}.jsonl"
    file.write_text(file.read_text()[:-40])  # killed while it wrote of scene 7
    assert study.main(arguments) == 0
    assert seen == [5, 7, 4, 6, 7, 8]
    assert study.main(arguments) == 0
    assert len(seen) == 6
    monkeypatch.setattr(study, "code_version", lambda: "another")
    study.main(arguments)
    assert len(seen) == 11


def made_up(number: int, **more: Any) -> Outcome:
    good = Outcome(number, "needle", 10.0, 1e-9, certified=1e-10, true=1e-11, ratio=1.0, cpu_seconds=1.0)
    return replace(good, **more)


@pytest.mark.parametrize(
    ("bad", "count", "passes"),
    [
        ({"ratio": 2.1}, 10, True),
        ({"ratio": 2.1}, 11, False),
        ({"true": 2e-10}, 1, False),
        ({"certified": 1e-8, "true": 1e-9}, 1, True),
        ({"certified": 1e-8, "true": 1e-9}, 3, False),
        ({"refused": "no setting reaches it"}, 40, True),
        ({"refused": "no setting reaches it", "cheapest": "double"}, 1, False),
        ({"broken": "RuntimeError"}, 1, False),
    ],
    ids=lambda value: str(value),
)
def test_one_in_ten_may_be_dear_one_in_fifty_not_certified_and_none_wrong(
    bad: dict[str, Any], count: int, passes: bool
) -> None:
    outcomes = [made_up(n, **bad) if n < count else made_up(n) for n in range(100)]
    assert all(check.passed for check in study.checks(outcomes)) == passes
    assert study.summary(outcomes)


def test_a_ledger_keeps_every_field_and_not_a_number_too(tmp_path: Path) -> None:
    outcomes = [made_up(3, ratio=math.nan, certified=math.inf), made_up(4, refused="no\nline", true=math.nan)]
    ledger = Ledger(tmp_path / "a" / "l.jsonl", 0, "x")
    for outcome in outcomes:
        ledger.add(outcome)
    again = Ledger(ledger.path, 0, "x").outcomes
    assert [repr(again[n]) for n in (3, 4)] == [repr(o) for o in outcomes]
    assert not Ledger(ledger.path, 1, "x").outcomes


def test_counted_costs_are_of_what_the_engine_does() -> None:
    """The order of the series is heyoka's own, and rises with the digits."""
    for setting in (Setting("single"), Setting(tolerance=1e-8), Setting(), Setting("quadruple", 1e-20)):
        trial = try_setting(rigidsim.parse(BODY, overrides=["time.end=1", "time.samples=2"]), setting)
        assert trial.order == setting.taylor_order
    costs = [
        cost(Setting(p, t), 100, 10) for p, t in (("double", 1e-6), ("double", None), ("extended", None))
    ]
    assert costs == sorted(costs)
