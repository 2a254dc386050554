"""Averaged models near hyperbolic Cassini states, where differences grow exponentially: the announced error
covers the distance from the full model at a tight tolerance.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support import run_estimated, run_text

import rigidsim
from experiments.coverage.families import FAMILIES, coverage_scene
from experiments.coverage.hyperbolic import HYPERBOLIC
from rigidsim.accuracy.models.carrying import Carrying

FAULTS = Path(__file__).parents[1] / "data" / "faults"
AXES = ("momentum_axis", "figure_axis")
# a share of the study, whose counts are in experiments/README.md
NUMBERS = [list(FAMILIES).index(HYPERBOLIC) + n * len(FAMILIES) for n in range(6)]


def beyond(run: rigidsim.Run, truth: rigidsim.Run) -> float:
    """Largest ratio of a true error of an axis to the announced one."""
    found = run.summary["modelling"]
    apart = {x: run.dataset[x].values - truth.dataset[x].values for x in AXES}
    return max(float(np.linalg.norm(apart[x], axis=1).max()) / found[x] for x in AXES)


def full(text: str, level: str) -> rigidsim.Run:
    """The full model, at double precision's own tolerance."""
    return run_text(text.replace(f'level = "{level}"', 'level = "full"').replace("accuracy_axis", "# "))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cassini_separatrix", "accuracy_axis_cassini"])
def test_the_faulty_scenes_are_covered(name: str) -> None:
    text = (FAULTS / f"{name}.toml").read_text(encoding="utf-8")
    run = run_estimated(text, "output.record=['momentum_axis','figure_axis']")
    truth = full(text, "auto" if "axis" in name else "spin_averaged")
    if run.summary["modelling"] is not None:
        assert beyond(run, truth) <= 1.0
        assert run.summary["modelling"]["momentum_axis"] < 1.0
    if "axis" in name:
        apart = [run.dataset[x].values - truth.dataset[x].values for x in AXES]
        assert max(float(np.linalg.norm(x, axis=1).max()) for x in apart) <= 2e-3
        assert run.summary["accuracy"]["certified"] <= 2e-3


@pytest.mark.slow
@pytest.mark.parametrize("number", NUMBERS)
def test_announced_errors_cover_true_ones(number: int) -> None:
    text = coverage_scene(number, seed=3).text
    level = "spin_averaged" if '"spin_averaged"' in text else "orbit_averaged"
    run = run_estimated(text, "output.record=['momentum_axis','figure_axis']")
    truth = full(text, level)
    assert beyond(run, truth) <= 3.0 or "model_uncertain" in run.summary["warning_codes"]


def test_errors_are_carried_steadily_in_proportion_to_time_and_exponentially() -> None:
    """Closed forms: constant errors a along the path and b across it, for a time T, under a shear s grow to
    (a T + b s T^2 / 2, b T), under an exponential rate g to (a + b) / 2 (e^(g T) - 1) / g along the growing
    direction.
    """
    count, total, rate = 1000, 3.0, 2.0
    step = total / count
    sheared = np.repeat([[[1.0, rate * step], [0.0, 1.0]]], count, axis=0)
    still = np.repeat(np.eye(2)[None], count, axis=0)
    cosh, sinh = np.cosh(rate * step), np.sinh(rate * step)
    saddle = np.repeat([[[cosh, sinh], [sinh, cosh]]], count, axis=0)
    a, b = 1e-4, 2e-4
    assert Carrying(step, still).grown(a, b) == pytest.approx(np.hypot(a, b) * total, rel=1e-9)
    expected = np.hypot(a * total + b * rate * total**2 / 2, b * total)
    assert Carrying(step, sheared).grown(a, b) == pytest.approx(expected, rel=1e-5)
    # errors of one sign: both components are (a + b) / 2 of the growing direction, +-(a - b) / 2 of the other
    growing = (a + b) / 2 * np.expm1(rate * total) / rate
    other = (a - b) / 2 * -np.expm1(-rate * total) / rate
    expected = np.hypot(growing + other, growing - other)
    assert Carrying(step, saddle).grown(a, b) == pytest.approx(expected, rel=1e-5)
