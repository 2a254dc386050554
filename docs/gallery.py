"""Pictures and numbers of the gallery: every ready config is run for them.

``python -m docs.gallery [NAME...]`` runs the configs, draws the figure of ``rigidsim plot`` for all, or for
the named ones, into docs/figures/gallery, and writes the table of docs/gallery.md. ``--timelines`` draws
timelines instead, as ``rigidsim view --png`` does; the rerun viewer needs a renderer for it (a software one
suffices). ``--table`` only prints the table, which a test compares with the page. The site adds a section for
each config (``docs/builder/sections.py``).
"""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path
from typing import Any

import rigidsim
from docs.builder.sections import CONFIGS, ROOT

PAGE = ROOT / "docs" / "gallery.md"
PICTURES = ROOT / "docs" / "figures" / "gallery"
_DOTS_PER_INCH = 100
_COLOURS = 256  # of a picture's palette
_TIMELINE_WIDTH = 1200
_COLUMNS = (
    "config",
    "steps",
    "attitude uncertain by, rad",
)


def numbers(run: rigidsim.Run, config: Path) -> list[str]:
    """The row of a config's run."""
    summary = run.summary
    error = summary["accuracy"]["estimated_attitude_error"]
    uncertain = "no attitude" if error is None else f"{error:.1e}"
    if (averaged := run.dataset.attrs.get("modelling_error")) is not None:
        uncertain = f"axes {averaged:.1e} (model)"
    return [
        f"[{config.stem}](../{config.relative_to(ROOT).as_posix()})",
        str(summary["cost"]["steps"]),
        uncertain,
    ]


def table(rows: list[list[str]]) -> str:
    """Column names, and all rows below."""
    lines = [_COLUMNS, ["---"] * len(_COLUMNS), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def picture(run: rigidsim.Run, name: str) -> None:
    """The page that suits the scene, small."""
    from matplotlib import pyplot
    from PIL import Image

    figure = run.plot()
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=_DOTS_PER_INCH)
    pyplot.close(figure)
    data.seek(0)
    _save(Image.open(data), f"{name}.png")


def timeline(run: rigidsim.Run, folder: Path, name: str) -> None:
    """The viewer's picture of a run, small.

    Args:
        folder: for the picture at its full size.
    """
    from PIL import Image

    from rigidsim.workflows.view import render

    whole = folder / f"{name}.png"
    render([(name, run)], whole)
    drawn = Image.open(whole).convert("RGB")
    size = _TIMELINE_WIDTH, round(drawn.height * _TIMELINE_WIDTH / drawn.width)
    _save(drawn.resize(size, Image.Resampling.LANCZOS), f"{name}_timeline.png")


def _save(drawn: Any, file: str) -> None:
    from PIL import Image

    # colours of thin lines keep a place in the palette, and k-means moves it to where colours are
    image = drawn.convert("RGB").quantize(_COLOURS, method=Image.Quantize.MAXCOVERAGE, kmeans=8)
    PICTURES.mkdir(parents=True, exist_ok=True)
    image.save(PICTURES / file, optimize=True)


def main(given: list[str]) -> None:
    """Run, draw and write; or only print the table."""
    alone, timelines = "--table" in given, "--timelines" in given
    named = {name for name in given if not name.startswith("-")}
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for config in CONFIGS:
            print(config.stem, file=sys.stderr, flush=True)
            wanted = not named or config.stem in named
            run = rigidsim.run(config, out=folder, changes={"output.timeline": timelines and wanted})
            rows.append(numbers(run, config))
            if timelines and wanted:
                timeline(run, Path(folder), config.stem)
            elif not alone and wanted:
                picture(run, config.stem)
    if alone:
        print(table(rows))
    else:
        text = PAGE.read_text(encoding="utf-8")
        lines = [line for line in text.splitlines() if line.startswith("|")]
        PAGE.write_text(text.replace("\n".join(lines), table(rows)), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
