"""Figures, timelines and ``analyse`` say the same mean motions and periods."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support import CONFIGS, cases

import rigidsim
from rigidsim.look.figures import figure
from rigidsim.look.figures.catalogue import Shown
from rigidsim.look.pages import numbers, summary_page
from rigidsim.look.stages.registry import build_picture
from rigidsim.look.thinning import thin
from rigidsim.scene.readable import YEAR

Ready = Callable[..., rigidsim.SavedRun]
_UNITS = {"d": 86400.0, "yr": YEAR, "kyr": 1e3 * YEAR, "s": 1.0, "min": 60.0, "h": 3600.0}


def texts(dataset: object, what: str) -> str:
    """All titles, labels and notes of a figure."""
    page = figure(dataset, what)  # type: ignore[arg-type]
    found = [text for axes in page.axes for text in (axes.get_title(), axes.get_title("left"))]
    for axes in page.axes:
        legend = axes.get_legend()
        found += [text.get_text() for text in legend.get_texts()] if legend else []
        found += [text.get_text() for text in axes.texts]
    return "\n".join(found)


FOLDERS = [CONFIGS[0].parent / one for one in ("", "bodies", "tables")]
SCENES = [path for folder in FOLDERS for path in sorted(folder.glob("*.toml"))]
USUAL = [path for path in SCENES if path.stem == "earth_free_nutation"]
KINDS = {
    "free_symmetric_top": "free rotation", "heavy_top_fast": "top on a fixed point",
    "gravity_gradient_libration": "satellite on its orbit", "j2_orbit": "orbit about an attracting point",
    "earth_free_nutation": "rotation of the Earth", "detumbling_cubesat": "axes in space",
    "tossed_plate": "flight in a uniform gravity",
}  # fmt: skip
ONCE = re.compile(r"once\s+(?:round\s+)?in\s+((?:about )?[\d.]+ \w+)")
RATES = {"precession": "precession_angle", "figure axis precesses in": "node_longitude.figure"}
TURN = 2 * np.pi


@pytest.mark.parametrize("path", cases(SCENES, USUAL, daily=4), ids=[path.stem for path in SCENES])
def test_figures_timelines_and_analyse_say_the_same_digits(path: Path, ready: Ready) -> None:
    dataset = ready(path).dataset
    said = dict(numbers(Shown.of(dataset).rows))
    rows = thin(dataset, 100_000).assign_attrs(dataset.attrs)
    summary = summary_page(dataset, rows)
    assert all(words in summary and text in summary for words, text in said.items()), (said, summary)
    picture = build_picture(rows)[0]
    assert picture.kind == KINDS.get(path.stem, picture.kind)
    stage = " ".join(part.words for one in picture.stages for part in one.parts)
    for found in ONCE.findall(texts(dataset, "overview")) + ONCE.findall(stage):
        parts = {part for text in said.values() for part in re.split(", at the end | to ", text)}
        assert found in parts, (found, said)
    for words, signal in RATES.items():
        name = signal.split(".")[0]
        if "about" in said.get(words, "about") or not np.isfinite(dataset.get(name, np.nan)).all():
            continue  # few digits, or a top that goes through its vertical
        rate = abs(float(rigidsim.analyse(dataset, [signal])[signal].rate.real))
        number, unit = said[words].split()
        known = rate / TURN * _UNITS[unit.removeprefix("turns/")]
        digits = len(number.replace(".", "").lstrip("0"))
        assert number == f"{known if '/' in unit else 1 / known:.{digits}g}"


def period(text: str) -> float:
    number, unit = text.split()
    return float(number) * _UNITS[unit]


def test_polar_motion(ready: Ready) -> None:
    dataset = ready("earth_free_nutation").dataset
    pattern = r"once\s+round\s+in ([\d.]+ \w+)"
    said = re.search(pattern, texts(dataset, "polar_motion"))
    assert said is not None
    line = rigidsim.analyse(dataset, ["polar_motion"]).signals[0].lines[0]
    assert period(said[1]) == pytest.approx(line.period, rel=2e-4)
