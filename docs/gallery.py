"""The gallery: every ready config with its picture, what to look for in it, and its numbers.

``python -m docs.gallery [NAME...]`` runs the configs, draws what ``rigidsim plot`` draws of each (or of those
named) into docs/figures/gallery, and writes docs/gallery.md. ``--timelines`` draws their timelines instead,
as ``rigidsim view --png`` does, for which the rerun viewer needs a renderer (a software one will do).
``--table`` prints the table of numbers alone, which the tests compare with the one on the page.
"""

from __future__ import annotations

import io
import re
import sys
import tempfile
import textwrap
import tomllib
from pathlib import Path
from typing import Any

import rigidsim

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "gallery.md"
PICTURES = ROOT / "docs" / "figures" / "gallery"
CONFIGS = [
    config
    for folder in ("", "bodies", "tables")
    for config in sorted((ROOT / "configs" / folder).glob("*.toml"))
]
_DOTS_PER_INCH = 100
_COLOURS = 256  # of a picture's palette
_TIMELINE_WIDTH = 1200
_WIDTH = 140  # of a line of text
_JOINED = "\0"
_COLUMNS = (
    "config",
    "states",
    "precision",
    "steps",
    "samples",
    "attitude uncertain by, rad",
    "largest drift",
    "of what rounding explains",
)
SWEPT_STUDIES = ("apophis_flyby", "flip_sphere", "round_off")
"""Sweeps whose picture is their study's."""


def numbers(run: rigidsim.Run) -> list[str]:
    """The row of a run."""
    summary = run.summary
    drifts = [(row["largest_drift"] or 0.0, row["bound"]) for row in summary["invariants"].values()]
    largest, bound = max(drifts, default=(0.0, 1.0))
    error = summary["accuracy"]["estimated_attitude_error"]
    uncertain = "no attitude" if error is None else f"{error:.1e}"
    if (averaged := run.dataset.attrs.get("modelling_error")) is not None:
        uncertain = f"axes {averaged:.1e} (model)"
    return [
        f"`{summary['name']}`",
        str(len(summary["states"])),
        summary["precision"],
        str(summary["cost"]["steps"]),
        str(summary["samples"]),
        uncertain,
        f"{largest:.1e}",
        f"{largest / bound:.1e}",
    ]


def table(rows: list[list[str]]) -> str:
    """All rows below their columns."""
    lines = [_COLUMNS, ["---"] * len(_COLUMNS), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def described(config: Path) -> tuple[str, str]:
    """Description of a config, and what to look for, from its own comments."""
    text = config.read_text(encoding="utf-8")
    comment = re.match(r"(?:#[^\n]*\n)+", text)
    words = " ".join((line.lstrip("#").strip() for line in comment[0].splitlines()) if comment else ())
    look = words.partition("What to look for: ")[2] or words
    return tomllib.loads(text).get("description", ""), (look[:1].upper() + look[1:]).replace("|", "\\|")


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
    """What the viewer shows of a run, small.

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


def page(rows: list[list[str]]) -> str:
    """docs/gallery.md."""
    parts = [
        "<!-- blocks: slow -->\n# Gallery",
        "Two commands run and draw any config of `configs/` (`python -m docs.gallery` generates this page):",
        "```sh\nrigidsim run configs/heavy_top_nutating.toml\nrigidsim plot runs/heavy_top_nutating\n```",
        "Each config has two pictures: the timeline at one moment (`rigidsim view runs/heavy_top_nutating "
        "--png timeline.png`), and the figure of `plot`. On the documentation's site a *Play* button below "
        "some pictures loads the scene into rerun's viewer (14 MB once, and 1 MB for each scene).",
        "## Numbers",
        "The table gives the announced error of the attitude at the end, the largest drift of any invariant, "
        "and this drift relative to the rounding bound (50 tolerance sqrt(steps)). An averaged model has the "
        "error of its axes. A large error with a tiny drift means that the motion amplifies errors: the body "
        "flips, or falls.",
        "<!-- slow output: python -m docs.gallery --table -->\n" + table(rows),
    ]
    for config in CONFIGS:
        description, look = described(config)
        parts.append(f"## {config.stem}")
        path = config.relative_to(ROOT).as_posix()
        parts.append(f"*{description}.* [{config.name}](../{path})")
        parts.append(look)
        parts.append(f"![Its timeline](figures/gallery/{config.stem}_timeline.png)")
        parts.append(f"![Figure drawn by rigidsim plot](figures/gallery/{config.stem}.png)")
    parts.append("## Sweeps")
    for config in sorted((ROOT / "configs" / "sweeps").glob("*.toml")):
        description, _ = described(config)
        parts.append(
            f"*{description}.* [{config.name}](../configs/sweeps/{config.name}), by `rigidsim sweep`."
        )
        drawn_by = "its study" if config.stem in SWEPT_STUDIES else "rigidsim plot"
        parts.append(f"![Figure drawn by {drawn_by}](figures/{config.stem}.png)")
    parts.append(
        "[Studies](../experiments/README.md) answer questions about such scenes, each with one command."
    )
    return "\n\n".join(_wrapped(part) for part in parts) + "\n"


def _wrapped(part: str) -> str:
    """A paragraph in lines as long as those of other pages; anything else as it is."""
    if part.startswith(("<!--", "#", "```", "![")):
        return part
    # a dash or a sum must not begin a line, which would make a list of it
    kept = re.sub(r" (?=[-+*] )", _JOINED, part)
    return textwrap.fill(kept, _WIDTH, break_long_words=False, break_on_hyphens=False).replace(_JOINED, " ")


def main(given: list[str]) -> None:
    """Run, draw and write; or print the table alone."""
    alone, timelines = "--table" in given, "--timelines" in given
    named = {name for name in given if not name.startswith("-")}
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for config in CONFIGS:
            print(config.stem, file=sys.stderr, flush=True)
            wanted = not named or config.stem in named
            run = rigidsim.run(config, out=folder, changes={"output.timeline": timelines and wanted})
            rows.append(numbers(run))
            if timelines and wanted:
                timeline(run, Path(folder), config.stem)
            elif not alone and wanted:
                picture(run, config.stem)
    if alone:
        print(table(rows))
    else:
        PAGE.write_text(page(rows), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
