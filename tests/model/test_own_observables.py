"""An observable of one's own: the documentation's example is recorded by its name like those of rigidsim."""

import re
from collections.abc import Iterator
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

import rigidsim
from rigidsim.scene.registry import OBSERVABLES

ROOT = Path(__file__).parents[2]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[rigidsim.Run]:
    """What the example leaves behind, run in an empty folder; the observable is gone afterwards."""
    (code,) = re.findall(
        r"<!-- test: own observable -->\n```python\n(.*?)```",
        (ROOT / "docs/howto/own_observable.md").read_text(),
        re.S,
    )
    (tmp_path / "configs").symlink_to(ROOT / "configs")
    monkeypatch.chdir(tmp_path)
    known = dict(OBSERVABLES)
    with redirect_stdout(StringIO()):
        exec(compile(code, "own_observable.md", "exec"), {})
    yield rigidsim.open_run("runs/asymmetric_top")
    OBSERVABLES.clear()
    OBSERVABLES.update(known)


def test_the_example_of_the_readme(run: rigidsim.Run) -> None:
    dataset = run.dataset
    axis = dataset["nose"]
    assert axis.dims == ("time", "space_axis")
    assert (axis.attrs["units"], axis.attrs["long_name"], axis.attrs["frame"]) == (
        "1",
        "body axis x",
        "space axes",
    )
    # its length is the square of the quaternion's norm, which drifts like sqrt(steps)
    allowed = 2 * run.summary["invariants"]["quaternion_norm"]["bound"]
    assert np.abs(np.linalg.norm(axis.values, axis=1) - 1).max() <= allowed
    of_invariants = {n for n in dataset.data_vars if n.endswith(("_drift", "_put_back"))}
    assert set(dataset.data_vars) - of_invariants == {"nose"}
