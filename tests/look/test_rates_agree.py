"""Figures, timelines and ``analyse`` say the same mean motions and periods."""

import re
from collections.abc import Callable

import numpy as np
import pytest

import rigidsim
from rigidsim.look.figures import figure
from rigidsim.look.stages.registry import build_picture
from rigidsim.scene.readable import YEAR

Ready = Callable[..., rigidsim.SavedRun]
_UNITS = {"d": 86400.0, "yr": YEAR, "kyr": 1e3 * YEAR, "s": 1.0, "min": 60.0, "h": 3600.0}
_ARCSEC = np.pi / 648000


def texts(dataset: object, what: str) -> str:
    """All titles, labels and notes of a figure."""
    page = figure(dataset, what)  # type: ignore[arg-type]
    found = [text for axes in page.axes for text in (axes.get_title(), axes.get_title("left"))]
    for axes in page.axes:
        legend = axes.get_legend()
        found += [text.get_text() for text in legend.get_texts()] if legend else []
        found += [text.get_text() for text in axes.texts]
    return "\n".join(found)


def period(text: str) -> float:
    number, unit = text.split()
    return float(number) * _UNITS[unit]


@pytest.mark.slow
def test_precession_and_nutation(ready: Ready) -> None:
    dataset = ready("mars_precession").dataset
    analysis = rigidsim.analyse(dataset, ["node_longitude.figure", "obliquity.figure"])
    node, tilt = analysis["node_longitude.figure"], analysis["obliquity.figure"]
    rate = float(node.rate.real)
    title = texts(dataset, "obliquity")
    drawn = re.search(r"mean motion,\s+(−?[\d.]+)(″|°)/yr", title)
    assert drawn is not None, title
    size = _ARCSEC if drawn[2] == "″" else np.pi / 180
    said = float(drawn[1].replace("−", "-"))
    assert said == float(f"{rate / size * YEAR:.3g}")
    leading = tilt.lines[0]
    ellipse = re.search(r"([\d.]+ \w+): semi-axes", texts(dataset, "nutation"))
    assert ellipse is not None
    assert period(ellipse[1]) == pytest.approx(leading.period, rel=5e-3)
    words = " ".join(part.words for stage in build_picture(dataset)[0].stages for part in stage.parts)
    once = re.search(r"once in ([\d.]+ \w+)", words)
    assert once is not None, words
    assert period(once[1]) == pytest.approx(2 * np.pi / abs(rate), rel=5e-3)


def test_polar_motion(ready: Ready) -> None:
    dataset = ready("earth_free_nutation").dataset
    pattern = r"once\s+round\s+in ([\d.]+ \w+)"
    said = re.search(pattern, texts(dataset, "polar_motion"))
    assert said is not None
    line = rigidsim.analyse(dataset, ["polar_motion"]).signals[0].lines[0]
    assert period(said[1]) == pytest.approx(line.period, rel=2e-4)
