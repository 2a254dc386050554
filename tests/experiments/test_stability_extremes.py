"""The study of extremes: random scenes are never wrong in silence, and it sees one that is."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from experiments import stability_extremes as study
from experiments.extremes import judging
from experiments.extremes.random_scenes import random_case
from experiments.extremes.scenes import ANY, Extreme, all_scenes

SCENES = {f"{scene.row}, {scene.name}": scene for scene in all_scenes(False)}


@pytest.mark.slow
@settings(max_examples=15, derandomize=True, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_random_extremes_are_never_wrong_in_silence(data: st.DataObject) -> None:
    def uniform(low: float, high: float) -> float:
        return data.draw(st.floats(low, high))

    scene, column, precision, hold = random_case(uniform)
    verdict = judging.judge(scene, column, precision, hold=hold)
    assert verdict.kind in ("right", "announced", "refused"), verdict.line


@pytest.mark.parametrize(
    ("name", "column", "kind"),
    [
        ("separatrix, on it", "rates", "announced"),
        ("separatrix, on it", "closed_form", "right"),
        ("middle axis, off by 1e-15", "quaternion", "announced"),
        ("moment ratio 1e-15, fast spin", "quaternion", "right"),
        ("moment ratio 1e-15, tumbling", "canonical", "announced"),
        ("moments that differ by 1e-15, nearly a sphere", "rotation_matrix", "right"),
        ("rates 1e15 and 1e-15, 1e-15", "euler_angles", "right"),
        ("singularity: starts in it, zxz, 0", "euler_angles", "right"),
        ("singularity: starts in it, zxz, 0", "canonical", "refused"),
        ("singularity: spins through it, xyz, 90 deg", "euler_angles", "right"),
        ("zero spin, at rest", "rates", "right"),
        ("denormal inputs, one rate", "canonical", "refused"),
        ("1e9 rad, ", "closed_form", "right"),
    ],
)
def test_what_survives_what(name: str, column: str, kind: str) -> None:
    verdict = judging.judge(SCENES[name], column, "double")
    assert verdict.kind == kind, verdict.line


def test_every_extreme_that_was_asked_for_is_in_the_table() -> None:
    rows = {scene.row for scene in SCENES.values()}
    for wanted in ("separatrix", "moment ratio 1e-15", "moments that differ by 1e-15", "rates 1e15 and 1e-15",
                   "inertia 1e200 and 1e-200", "1e-3 rad", "1e9 rad", "zero spin", "denormal inputs",
                   "tolerance 1 and 0.1", "tolerance 1e-17 to 1e-300", "spin about one axis"):  # fmt: skip
        assert any(wanted == row for row in rows), wanted
    for start in ("starts in it", "spins through it", "passes it"):
        met = {scene.sequence for scene in SCENES.values() if scene.row == f"singularity: {start}"}
        assert len(met) == 12
    assert {column for scene in SCENES.values() for column in scene.columns} == set(ANY)


@pytest.mark.slow
def test_a_wrong_answer_in_silence_is_seen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Held against a body whose middle moment is larger by 1e-11, everything is wrong."""
    right = judging.reference
    body = 'principal_moments = [3, "6.00000000006", 8]'

    def other(scene: Extreme) -> object:
        return right(study_scene(body))

    def study_scene(given_body: str) -> Extreme:
        return Extreme("row", "name", given_body, (0.3, 1, 0.2), 64.0)

    scene = study_scene("principal_moments = [3, 6, 8]")
    monkeypatch.setattr(study, "all_scenes", lambda full: [scene])
    assert study.main(["--out", str(tmp_path)]) == 0
    monkeypatch.setattr(judging, "reference", other)
    found = study.examine([scene], study.WAYS, lambda text: None)
    assert {v.kind for verdicts in found.values() for v in verdicts} == {"SILENT"}
    assert study.main(["--out", str(tmp_path)]) == 1
    assert (tmp_path / "stability_extremes.png").exists()


def test_what_breaks_down_counts_as_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(study, "judge", broken)
    assert study.guarded(SCENES["zero spin, at rest"], "rates", "double").kind == "SILENT"
