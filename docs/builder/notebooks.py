"""Notebooks as pages of the site: their texts, their code, and what it printed and drew when it was run.

Notebooks are kept without outputs, which would grow old unnoticed; the site runs them when it is built.
"""

from __future__ import annotations

import base64
import json
import re
import tempfile
from pathlib import Path
from typing import Any

SECONDS = 600  # for a cell, on a busy machine
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")


def as_page(notebook: Path, pictures: Path | None = None) -> str:
    """A notebook in Markdown.

    Args:
        pictures: folder for its pictures, beside which the page will lie; the notebook is run. None for texts
            and code alone.

    Raises:
        nbclient.exceptions.CellExecutionError: a cell failed.
    """
    book = json.loads(notebook.read_text(encoding="utf-8"))
    cells = book["cells"] if pictures is None else _executed(notebook)
    parts = [f"The same as a notebook: [{notebook.name}]({notebook.name})."]
    drawn = 0
    for cell in cells:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        parts.append(f"```python\n{source}\n```")
        for output in cell.get("outputs", []):
            picture = output.get("data", {}).get("image/png")
            if picture is not None and pictures is not None:
                drawn += 1
                pictures.mkdir(parents=True, exist_ok=True)
                name = f"{notebook.stem}_{drawn}.png"
                (pictures / name).write_bytes(base64.b64decode(picture))
                parts.append(
                    f"```{{image}} {pictures.name}/{name}\n:alt: picture {drawn} of this notebook\n```"
                )
            elif text := _text_of(output):
                parts.append(f"```text\n{text}\n```")
    parts[0], parts[1] = parts[1], parts[0]  # the title comes first
    return "\n\n".join(parts) + "\n"


def _executed(notebook: Path) -> list[dict[str, Any]]:
    import nbclient
    import nbformat

    book = nbformat.read(notebook, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        resources = {"metadata": {"path": folder}}
        nbclient.NotebookClient(book, timeout=SECONDS, resources=resources).execute()
    return list(book.cells)


def _text_of(output: dict[str, Any]) -> str:
    """What was printed, or the value of the last line; progress on stderr isn't part of it."""
    if output.get("name") == "stderr":
        return ""
    text = output.get("text") or output.get("data", {}).get("text/plain", "")
    return _COLOURS.sub("", "".join(text)).strip("\n")
