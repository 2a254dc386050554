"""Pictures of the gallery.

``python -m docs.gallery [NAME...]`` runs all ready configs, or the named ones, and draws the figure of
``rigidsim plot`` into docs/figures/gallery. ``--timelines`` draws timelines instead, as ``rigidsim view
--png`` does; the rerun viewer needs a renderer for it (a software one suffices). ``--films`` draws four
seconds of the scenes that the site plays, into docs/figures/films. The site adds a section for each config
(``docs/builder/sections.py``).
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

PICTURES = ROOT / "docs" / "figures" / "gallery"
_DOTS_PER_INCH = 100
_COLOURS = 256  # of a picture's palette
_TIMELINE_WIDTH = 1200
FILMS = ROOT / "docs" / "figures" / "films"
_FILM_SECONDS, _FILM_WIDTH, _FILM_COLOURS = 4.0, 480, 64  # some 100 to 400 kB


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
    """Run and draw."""
    timelines, films = (f"--{what}" in given for what in ("timelines", "films"))
    named = {name for name in given if not name.startswith("-")} or (set(scenes.PLAYED) if films else None)
    with tempfile.TemporaryDirectory() as folder:
        for config in CONFIGS:
            if named is not None and config.stem not in named:
                continue
            print(config.stem, file=sys.stderr, flush=True)
            run = rigidsim.run(config, out=folder, changes={"output.timeline": timelines})
            if films:
                film(run, Path(folder), config.stem)
            elif timelines:
                timeline(run, Path(folder), config.stem)
            else:
                picture(run, config.stem)


if __name__ == "__main__":
    main(sys.argv[1:])
