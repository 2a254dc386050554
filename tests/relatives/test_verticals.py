"""Gravity in any units, as expressions and of several fields: figures and timelines have its own vertical.

The truth: a table of units by hand, and numpy. A body held at its centre of mass is no top, since gravity has
no torque on it; one with a position flies.
"""

import numpy as np
import pytest
from support import config, run_text, seeds

from rigidsim.look.figures.catalogue import available
from rigidsim.look.record import scene_of
from rigidsim.look.stages.registry import build_picture

UNITS = {"m/s^2": 1.0, "cm/s^2": 0.01, "km/s^2": 1000.0, "mm/s^2": 0.001, "": 1.0}
TEXT = config(
    "principal_moments = [1, 1, 0.5]\nmass = 2\ncenter_of_mass = {arm}",
    "{start}\nangular_velocity = [0.1, 0, 5]\n{loads}",
    time="end = 0.5\nsamples = 11",
    output='record = ["quaternion", "angular_velocity"{more}]',
)


def component(rng: np.random.Generator) -> tuple[str, float]:
    """A number as people write it, and its value in m/s^2."""
    unit = list(UNITS)[rng.integers(len(UNITS))]
    size = float(f"{rng.uniform(-9, 9) / UNITS[unit]:.4g}")
    kind = rng.integers(3)
    if kind == 0:
        return f'"{size!r} {unit}"', size * UNITS[unit]
    if kind == 1:
        return '"pi"', np.pi
    return f'"{size!r}*pi/3 {unit}"', size * np.pi / 3 * UNITS[unit]


@pytest.mark.parametrize("seed", seeds(1, 60))
def test_random_fields(seed: int) -> None:
    rng = np.random.default_rng(seed)
    fields = [[component(rng) for _ in range(3)] for _ in range(rng.integers(1, 3))]
    loads = "".join(
        f'[[loads]]\nkind = "uniform_gravity"\nacceleration = [{", ".join(text for text, _ in field)}]\n'
        for field in fields
    )
    pull = np.sum([[value for _, value in field] for field in fields], axis=0)
    kind = ("top", "balanced", "flight")[rng.integers(3)]
    arm = "[0, 0, 0.3]" if kind == "top" else "[0, 0, 0]"
    start, more = "", ""
    if kind == "flight":
        start, more = "position = [0, 0, 0]\nvelocity = [3, 0, 4]", ', "position"'
    dataset = run_text(TEXT.format(arm=arm, start=start, loads=loads, more=more)).dataset
    up = -pull / np.linalg.norm(pull)
    assert scene_of(dataset).vertical == pytest.approx(up, abs=1e-12)
    assert ("tip" in available(dataset)) == (kind == "top")
    picture = build_picture(dataset)[0]
    drawn = [part for stage in picture.stages for part in stage.parts if part.words == "gravity"]
    titles = {"top": "top on a fixed point", "flight": "flight in a uniform gravity"}
    assert (picture.kind == titles.get(kind)) == (kind != "balanced")
    assert len(drawn) == (kind != "balanced")
    for part in drawn:
        way = part.values / np.linalg.norm(part.values)
        assert way == pytest.approx(-up, abs=1e-9)
