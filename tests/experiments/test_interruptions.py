"""The campaign of interruptions, on as little as shows that it can fail."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments import interruptions
from experiments.interruptions import Ending, interrupted, scenes, situations


def test_what_is_late_is_told() -> None:
    assert Ending(130, 0.4, 3.0, "").prompt
    assert Ending(0, None, 3.0, "").prompt  # it came to its end before
    assert not Ending(130, 0.6, 0.6, "").prompt
    assert not Ending(2, 0.1, 0.1, "it holds no finished dataset").prompt


@pytest.mark.slow
def test_commands_and_scenes_end_in_time(capsys: pytest.CaptureFixture[str]) -> None:
    assert situations("verify") == []
    assert scenes([1], 1) == []  # its turns are counted by an engine that takes seconds to compile
    assert "2 interruptions" in capsys.readouterr().out


@pytest.mark.slow
def test_what_heeds_no_signal_is_late(tmp_path: Path) -> None:
    """A promise that can't be kept is found to be broken."""
    situation = interruptions.SITUATIONS['"double", dense']
    (tmp_path / "scene.toml").write_text(f'name = "scene"\n{situation.text}')
    found = interrupted(["run", "scene.toml"], tmp_path, situation.line, situation.seconds)
    assert found.code == 130
    assert not found.within(0.0)
