"""Pictures and numbers of the gallery: every ready config is run for them.

``python -m docs.gallery [NAME...]`` runs the configs, draws the figure of ``rigidsim plot`` for all, or for
the named ones, into docs/figures/gallery, and writes the table of docs/gallery.md. ``--timelines`` draws
timelines instead, as ``rigidsim view --png`` does; the rerun viewer needs a renderer for it (a software one
suffices). ``--films`` draws four seconds of the scenes that the site plays, into docs/figures/films.
``--table`` only prints the table, which a test compares with the page. The site adds a section for each
config (``docs/builder/sections.py``).
"""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path
from typing import Any

import rigidsim
from docs.builder import scenes
from docs.builder.sections import CONFIGS, ROOT
from rigidsim.look.signals import is_averaged

PAGE = ROOT / "docs" / "gallery.md"
PICTURES = ROOT / "docs" / "figures" / "gallery"
_DOTS_PER_INCH = 100
_COLOURS = 256  # of a picture's palette
_TIMELINE_WIDTH = 1200
FILMS = ROOT / "docs" / "figures" / "films"
_FILM_SECONDS, _FILM_WIDTH, _FILM_COLOURS = 4.0, 480, 64  # some 100 to 400 kB
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
    if is_averaged(run.dataset.attrs):
        averaged = run.dataset.attrs.get("modelling_error")
        uncertain = "axes not estimated" if averaged is None else f"axes {averaged:.1e} (model)"
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


def film(run: rigidsim.Run, folder: Path, name: str) -> None:
    """A run's scene as a small film.

    Args:
        folder: for the film at its full size.
    """
    from PIL import Image, ImageSequence

    from rigidsim.workflows.view import render

    whole = folder / f"{name}.gif"
    render([(name, run)], whole, seconds=_FILM_SECONDS, part="scene")
    drawn = Image.open(whole)
    size = _FILM_WIDTH, round(drawn.height * _FILM_WIDTH / drawn.width)
    small = [
        one.convert("RGB").resize(size, Image.Resampling.LANCZOS) for one in ImageSequence.Iterator(drawn)
    ]
    # rare colours, as of arrows, keep a place
    palette = small[len(small) // 2].quantize(_FILM_COLOURS, method=Image.Quantize.MAXCOVERAGE, kmeans=8)
    first, *rest = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in small]
    FILMS.mkdir(parents=True, exist_ok=True)
    options = {"save_all": True, "append_images": rest, "duration": drawn.info["duration"], "loop": 0}
    first.save(FILMS / f"{name}.gif", optimize=True, **options)


def _save(drawn: Any, file: str) -> None:
    from PIL import Image

    # colours of thin lines keep a place in the palette, and k-means moves it to where colours are
    image = drawn.convert("RGB").quantize(_COLOURS, method=Image.Quantize.MAXCOVERAGE, kmeans=8)
    PICTURES.mkdir(parents=True, exist_ok=True)
    image.save(PICTURES / file, optimize=True)


def main(given: list[str]) -> None:
    """Run, draw and write; or only print the table."""
    alone, timelines, films = (f"--{what}" in given for what in ("table", "timelines", "films"))
    named = {name for name in given if not name.startswith("-")}
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for config in CONFIGS:
            print(config.stem, file=sys.stderr, flush=True)
            wanted = config.stem in (named or (scenes.PLAYED if films else {config.stem}))
            if films and not wanted:
                continue
            run = rigidsim.run(config, out=folder, changes={"output.timeline": timelines and wanted})
            rows.append(numbers(run, config))
            if films:
                film(run, Path(folder), config.stem)
            elif timelines and wanted:
                timeline(run, Path(folder), config.stem)
            elif not alone and wanted:
                picture(run, config.stem)
    if alone:
        print(table(rows))
    elif not films:
        text = PAGE.read_text(encoding="utf-8")
        lines = [line for line in text.splitlines() if line.startswith("|")]
        PAGE.write_text(text.replace("\n".join(lines), table(rows)), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
