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

FAULTS = Path(__file__).parents[1] / "data" / "faults"
AXES = ("momentum_axis", "figure_axis")
RECORDED = "output.record=['momentum_axis','figure_axis']"
# a share of the study, whose counts are in experiments/README.md
NUMBERS = [list(FAMILIES).index(HYPERBOLIC) + 42 * n for n in range(1)]  # as when there were 42 families


def beyond(run: rigidsim.Run, truth: rigidsim.Run) -> float:
    """Largest ratio of a true error of an axis to the announced one."""
    found = run.summary["modelling"]
    apart = {x: run.dataset[x].values - truth.dataset[x].values for x in AXES}
    return max(float(np.linalg.norm(apart[x], axis=1).max()) / found[x] for x in AXES)


def full(text: str, level: str) -> rigidsim.Run:
    """The full model, at double precision's own tolerance."""
    text = text.replace(f'level = "{level}"', 'level = "full"').replace("\naccuracy_axis", "\n# ")
    return run_text(text, RECORDED)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cassini_separatrix", "accuracy_axis_cassini"])
def test_the_faulty_scenes_are_covered(name: str) -> None:
    text = (FAULTS / f"{name}.toml").read_text(encoding="utf-8")
    run = run_estimated(text, RECORDED)
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
    text = coverage_scene(number, seed=3, name=HYPERBOLIC).text
    level = "spin_averaged" if '"spin_averaged"' in text else "orbit_averaged"
    run = run_estimated(text, RECORDED)
    truth = full(text, level)
    assert beyond(run, truth) <= 3.0 or "model_uncertain" in run.summary["warning_codes"]
