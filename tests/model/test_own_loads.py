"""Loads given from Python: the example of the documentation, and how such runs are marked."""

import re
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from equations import CLOSE, matrix

ROOT = Path(__file__).parents[2]


def example() -> str:
    (code,) = re.findall(
        r"<!-- test: own load -->\n```python\n(.*?)```", (ROOT / "docs/howto/own_load.md").read_text(), re.S
    )
    return str(code)


@pytest.fixture
def names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What the example defines, run in an empty folder."""
    (tmp_path / "configs").symlink_to(ROOT / "configs")
    monkeypatch.chdir(tmp_path)
    found: dict[str, Any] = {}
    printed = StringIO()
    with redirect_stdout(printed):
        exec(compile(example(), "own_load.md", "exec"), found)
    return found | {"printed": printed.getvalue()}


@pytest.mark.slow
def test_the_example_of_the_readme(names: dict[str, Any]) -> None:
    run = names["run"]
    assert float(names["printed"]) == run.summary["invariants"]["energy"]["largest_drift"]
    row = run.summary["invariants"]["energy"]
    assert run.status == "finished"
    assert 0 < row["largest_drift"] <= row["bound"]
    assert "angular_momentum" not in run.summary["invariants"]  # a torque acts
    potential = run.dataset["potential_energy"].values
    assert np.ptp(potential) > 0.1
    first_row = np.array([matrix(q)[0] for q in run.dataset["quaternion"].values[:100]])
    np.testing.assert_allclose(potential[:100], -0.3 * first_row[:, 2], rtol=0, atol=CLOSE)
    momentum = run.dataset["angular_momentum"].values
    assert np.ptp(momentum, axis=0)[1:].max() > 0.1
    assert np.ptp(momentum[:, 0]) < 1e-11  # no torque about the field
    with h5py.File(run.folder.dataset) as file:
        assert file.attrs["python_loads"] == "Magnet"
    assert run.summary["bit_for_bit"]["claim"] is False
    assert "Python" in run.summary["bit_for_bit"]["holds_for"]
