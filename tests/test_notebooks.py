"""The documentation's notebooks run from top to bottom, and are kept without outputs."""

from __future__ import annotations

import json
import shutil
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


@pytest.mark.slow
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda p: p.stem)
def test_they_run(notebook: Path, tmp_path: Path) -> None:
    """In a kernel of their own, in an empty folder; they assert what they claim."""
    nbclient = pytest.importorskip("nbclient", reason="pip install -e '.[docs]'")
    nbformat = pytest.importorskip("nbformat", reason="pip install -e '.[docs]'")
    shutil.copy(notebook, tmp_path)
    book = nbformat.read(tmp_path / notebook.name, as_version=4)
    nbclient.NotebookClient(book, timeout=600, resources={"metadata": {"path": tmp_path}}).execute()
    code = [cell for cell in book.cells if cell.cell_type == "code"]
    assert all(cell.execution_count for cell in code)
    pictures = [o for cell in code for o in cell.outputs if "image/png" in o.get("data", {})]
    assert len(pictures) >= 2
