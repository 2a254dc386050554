"""Averaged models near hyperbolic Cassini states, where differences grow exponentially: the announced error
covers the distance from the full model at a tight tolerance.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from support import run_estimated, run_text

import rigidsim
from experiments.coverage.families import FAMILIES, coverage_scene
from experiments.coverage.hyperbolic import HYPERBOLIC
from rigidsim.accuracy.models.carrying import Carrying, carrying
from rigidsim.solve.problem import prepare

FAULTS = Path(__file__).parents[1] / "data" / "faults"
AXES = ("momentum_axis", "figure_axis")
RECORDED = "output.record=['momentum_axis','figure_axis']"
# a share of the study, whose counts are in experiments/README.md
NUMBERS = [list(FAMILIES).index(HYPERBOLIC) + n * len(FAMILIES) for n in range(4)]


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
    text = coverage_scene(number, seed=3).text
    level = "spin_averaged" if '"spin_averaged"' in text else "orbit_averaged"
    run = run_estimated(text, RECORDED)
    truth = full(text, level)
    assert beyond(run, truth) <= 3.0 or "model_uncertain" in run.summary["warning_codes"]


def test_tangent_maps_are_those_of_the_equations_by_another_code() -> None:
    """Neighbours by scipy, of Colombo's equations s' = a (n . s) (s x n) with a node that goes back: the
    largest stretching between start and end. Second order adds some per cent to a rate's derivatives.
    """
    text = (FAULTS / "cassini_separatrix.toml").read_text(encoding="utf-8")
    text = text.replace("spin_averaged", "orbit_averaged")
    problem = prepare(rigidsim.parse(text, overrides=["time.end=1000"]))
    average = problem.system.plan.average
    assert average is not None
    carried = carrying(problem, average)
    maps = np.linalg.multi_dot(list(carried.maps[::-1]))
    end = carried.seconds * len(carried.maps)
    spin, third, tilt, eccentricity = 34.49833546899108, 1.0, 0.39831366624973463, 0.2576998826557208
    moment, node_rate = 0.855311364497357, -0.003845317042969855
    size = 1.5 * (third - moment) / (third * spin) * (1 - eccentricity**2) ** -1.5

    def rates(t: float, s: np.ndarray) -> np.ndarray:
        node = node_rate * t
        normal = np.array([np.sin(tilt) * np.sin(node), -np.sin(tilt) * np.cos(node), np.cos(tilt)])
        return (size * (normal @ s) * np.cross(s, normal)).astype(float)

    start = np.array([float(x) for x in average.start])
    across = np.linalg.svd(start[None])[2][1:]
    ends = []
    for pushed in (start, *(start + 1e-7 * x for x in across)):
        ends.append(solve_ivp(rates, (0, end), pushed, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1])
    stretched = np.linalg.norm(np.array([(x - ends[0]) / 1e-7 for x in ends[1:]]), ord=2)
    assert np.linalg.norm(maps, ord=2) == pytest.approx(stretched, rel=0.1)
    assert stretched > 4
    # both are Hamiltonian, and keep areas on the sphere
    assert np.linalg.det(maps) == pytest.approx(1.0, abs=1e-3)


def test_errors_are_carried_steadily_in_proportion_to_time_and_exponentially() -> None:
    """Closed forms: constant errors a along the path and b across it, for a time T, under a shear s grow to
    (a T + b s T^2 / 2, b T), under an exponential rate g to (a + b) / 2 (e^(g T) - 1) / g along the growing
    direction.
    """
    count, total, rate = 300, 3.0, 2.0
    step = total / count
    sheared = np.repeat([[[1.0, rate * step], [0.0, 1.0]]], count, axis=0)
    still = np.repeat(np.eye(2)[None], count, axis=0)
    cosh, sinh = np.cosh(rate * step), np.sinh(rate * step)
    saddle = np.repeat([[[cosh, sinh], [sinh, cosh]]], count, axis=0)
    a, b = 1e-4, 2e-4
    assert Carrying(step, still).grown(a, b) == pytest.approx(np.hypot(a, b) * total, rel=1e-9)
    expected = np.hypot(a * total + b * rate * total**2 / 2, b * total)
    assert Carrying(step, sheared).grown(a, b) == pytest.approx(
        expected, rel=1e-4
    )  # (rate step)^2 / 12, the trapezoidal rule's
    # errors of one sign: both components are (a + b) / 2 of the growing direction, +-(a - b) / 2 of the other
    growing = (a + b) / 2 * np.expm1(rate * total) / rate
    other = (a - b) / 2 * -np.expm1(-rate * total) / rate
    expected = np.hypot(growing + other, growing - other)
    assert Carrying(step, saddle).grown(a, b) == pytest.approx(
        expected, rel=1e-4
    )  # (rate step)^2 / 12, the trapezoidal rule's
