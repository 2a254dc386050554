"""Files may have any name that the file system takes: emoji, other scripts, quotes, spaces.

Truth: the numbers in the file, by numpy, and Python's own reader of TOML.
"""

import random
import tomllib
from pathlib import Path

import numpy as np
import pytest
import support
from made_by_commands import called
from support import seeds

import rigidsim

SIGNS = "aZ09 _-+,;=()[]{}!#$%&'~^\"\\é\u0301ßøЖ日本語ﷺ\u200d🪐🛰️👩‍🚀𝛚\U0010fffd"
ROWS = [0, 0.25, 0.5, 1.75]


@pytest.mark.parametrize("seed", seeds(1, 25))
def test_a_table_of_any_name_is_read(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    draw = random.Random(seed)
    for _ in range(4):
        name = "t" + "".join(draw.choice(SIGNS) for _ in range(draw.randint(1, 12))) + ".csv"
        config = "c" + "".join(draw.choice(SIGNS) for _ in range(3)) + ".toml"
        np.savetxt(name, np.array(ROWS), header="time", comments="", fmt="%.17g")
        text = support.config(time="TIMES", name="odd")
        quoted = name.replace("\\", "\\\\").replace('"', '\\"')
        Path(config).write_text(text.replace("TIMES", f'times = "{quoted}"'), encoding="utf-8")
        experiment = rigidsim.load(config)
        ((stored, table),) = tomllib.loads(experiment.text)["tables"].items()
        assert stored == name
        assert np.array_equal(np.loadtxt(table["text"].splitlines(), skiprows=1), ROWS)
        assert {path.name for path in experiment.files} == {name, config}
        found = rigidsim.load(config, overrides=["name=other"])
        assert found.config.name == "other"
        again = rigidsim.parse(experiment.text)
        assert again.config.tables == experiment.config.tables
        checked = called(["check", config])
        assert checked.exit_code == 0, checked.output


def test_bytes_that_are_no_text_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("free.toml").write_text(support.config(name="free"))
    result = called(["check", "free.toml", "--set", 'description="\udcff"'])
    assert result.exit_code == 2
    assert "rigidsim: free.toml: 1 problem" in result.output
