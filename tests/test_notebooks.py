"""The documentation's notebooks are kept without outputs; `python docs/build.py` runs them."""

import json
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[1] / "docs" / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda p: p.stem)
def test_they_are_kept_without_outputs(notebook: Path) -> None:
    """What they print would grow old unnoticed."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    assert [
        c["id"] for c in cells if c["cell_type"] == "code" and (c["outputs"] or c["execution_count"])
    ] == []
