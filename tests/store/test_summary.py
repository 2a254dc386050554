"""``summary.json``: what is written is what is read; what isn't a summary is refused."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import rigidsim
from rigidsim import RunFolderError
from rigidsim.store.summary import Brief, read_summary

# hundreds of turns between samples, of a quaternion that matrices don't carry: a warning is certain
BLURRED = (
    "[body]\nprincipal_moments = [1, 2, 2.5]\n[initial]\nangular_velocity = [0.3, 1.0, 0.5]\n"
    '[time]\nend = 3000\nsamples = 3\n[output]\ntimeline = false\nrecord = ["quaternion"]\n'
    '[integrator]\nformulation = "rotation_matrix"\n'
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> rigidsim.Run:
    text = 'name = "blurred"\n' + BLURRED
    return rigidsim.run(rigidsim.parse(text), out=tmp_path_factory.mktemp("runs"))


def test_what_a_run_returns_is_what_it_wrote(run: rigidsim.Run) -> None:
    written = json.loads(run.folder.summary.read_text())
    assert run.summary == written
    assert list(run.summary) == list(written)
    opened = rigidsim.open_run(run.folder.path)
    assert opened.summary == written
    assert opened.outcome == run.outcome


def test_an_older_summary_is_read_and_written_again_as_it_is(run: rigidsim.Run, tmp_path: Path) -> None:
    older = {**run.summary, "of_another_version": [1, {"x": 2.5}]}
    for key in ("warning_codes", "method", "hold_invariants", "lyapunov", "events", "chart_changes"):
        older.pop(key)
    path = tmp_path / "summary.json"
    path.write_text(json.dumps(older))
    assert read_summary(path).as_dict() == older


DAMAGES: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "a text for a number": (lambda s: s["cost"].update(steps="7"), "'cost.steps': Input should be"),
    "no number": (lambda s: s["invariants"]["energy"].update(scale=math.nan), "invariants.energy.scale"),
    "nothing": (lambda s: s.pop("invariants"), "'invariants': Field required"),
    "no seconds": (lambda s: s["cost"]["seconds"].pop("engine"), "'cost.seconds': "),
    "a digest": (lambda s: s.update(dataset_sha256="x"), "'dataset_sha256': "),
    "a status": (lambda s: s.update(status="\x1b[31m"), "'status': "),
}  # fmt: skip


@pytest.mark.parametrize("what", DAMAGES)
def test_a_damaged_one_is_refused_by_its_place(what: str, run: rigidsim.Run, tmp_path: Path) -> None:
    content = json.loads(json.dumps(run.summary))
    DAMAGES[what][0](content)
    path = tmp_path / "summary.json"
    path.write_text(json.dumps(content))
    with pytest.raises(RunFolderError, match="is damaged or no summary of rigidsim") as refusal:
        read_summary(path)
    assert DAMAGES[what][1] in str(refusal.value)


def test_a_run_under_way_says_no_more_than_that(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    path.write_text('{"status": "running"}')
    found = read_summary(path)
    assert type(found) is Brief
    assert found.dataset_digest is None
    assert found.as_dict() == {"status": "running"}
