"""Configs from strangers: refused with one clear message, or read; no traceback and no hang."""

import resource
import time
from pathlib import Path

import pytest

import rigidsim
from rigidsim import ConfigError
from rigidsim.solve.problem import prepare

BASE = """
name = "base"
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.3, 1.0, 0.5]
[time]
end = 10
samples = 11
"""


def refused(text: str, match: str | None = None) -> None:
    """Quickly, and in one message of bounded length."""
    started = time.process_time()
    with pytest.raises(ConfigError, match=match) as caught:
        prepare(rigidsim.parse(text))
    assert len(str(caught.value)) < 20_000
    assert time.process_time() - started < 5  # CPU: others may share the machine


@pytest.mark.parametrize("name", ["../up", "/etc/passwd", "nul\\u0000", "~root"])
def test_a_name_can_not_leave_the_folder_of_runs(name: str, tmp_path: Path) -> None:
    text = BASE.replace('"base"', f'"{name}"')
    try:
        run = rigidsim.run(rigidsim.parse(text), out=tmp_path / "runs")
    except ConfigError:
        assert not (tmp_path / "runs").exists()
        return
    assert run.folder.path.resolve().parent == (tmp_path / "runs").resolve()


@pytest.mark.parametrize("key", ["samples = 1000000000000000000", "every = 1e-300"])
def test_absurd_sizes_are_refused_before_anything_is_allocated(key: str) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    refused(BASE.replace("samples = 11", key), r"\[time\]")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 50_000  # kB


BOMBS = {
    "a deep array": "x = " + "[" * 5000 + "]" * 5000,
    "many keys": "\n".join(f"k{i} = 1" for i in range(20_000)),
    "a tower of powers": BASE.replace("end = 10", 'end = "9^9^9^9^9"'),
    "a null byte": BASE + "\x00",
    "an escape sequence": BASE.replace("[body]", '[body]\n"\\u001b[31m" = 1'),
}


@pytest.mark.parametrize("bomb", BOMBS)
def test_bombs_are_refused(bomb: str) -> None:
    refused(BOMBS[bomb])


def test_control_characters_of_a_config_never_reach_the_terminal() -> None:
    with pytest.raises(ConfigError) as caught:
        rigidsim.parse(BOMBS["an escape sequence"])
    assert "\x1b" not in str(caught.value)
