"""Averaged runs under torques that do work, against the full one and against exact solutions."""

import re

import numpy as np
import pytest
from support import cases, config, run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.session.verdict import Soundness, verdict_on
from rigidsim.solve.problem import prepare

EPS = np.finfo(float).eps
START = 'angular_velocity = [0.4, 0.5, 1.2]\neuler_angles = [0.3, "35 deg", 0]'
BODY = "principal_moments = [1, 1.7, 2]"
GRADIENT = """kind = "gravity_gradient"
gravitational_parameter = 4e-5
orbit = {semi_major_axis = 1, eccentricity = 0.1, inclination = "20 deg"}"""
RECORD = 'record = ["momentum_axis", "angular_momentum_norm", "energy", "rotational_energy"]'


def viscous(size: float) -> str:
    return f'kind = "viscous_torque"\ncoefficients = [{size}, {2 * size}, {1.5 * size}]'


def text(level: str, loads: str, end: float, body: str = BODY) -> str:
    record = RECORD if level == "full" else RECORD.replace(', "rotational_energy"', "")
    return config(
        body, START, loads, f"end = {end}\nsamples = 401", "", record, f'[model]\nlevel = "{level}"'
    )


def values(run: rigidsim.Run, name: str) -> np.ndarray:
    return np.asarray(run.dataset[name].values)


def apart(reduced: rigidsim.Run, full: rigidsim.Run) -> dict[str, float]:
    """Largest differences: rad, and relative."""
    axes = values(reduced, "momentum_axis") - values(full, "momentum_axis")
    size = values(reduced, "angular_momentum_norm") / values(full, "angular_momentum_norm") - 1
    energy = values(reduced, "energy") / values(full, "rotational_energy") - 1
    return {
        "momentum_axis": float(np.linalg.norm(axes, axis=1).max()),
        "angular_momentum_norm": float(np.abs(size).max()),
        "energy": float(np.abs(energy).max()),
    }


@pytest.mark.parametrize("end", [1e5, -1e5])
def test_an_axisymmetric_body_decays_exactly(end: float) -> None:
    """w1, w2 = e^(-c t / A), w3 = e^(-d t / C): nothing is lost in averaging, nor anything in steps."""
    moments, damping = np.array([1.0, 1.0, 2.0]), np.array([1e-4, 1e-4, 1.5e-4])
    loads = f'kind = "viscous_torque"\ncoefficients = {damping.tolist()}'
    run = run_text(text("spin_averaged", loads, end, "principal_moments = [1, 1, 2]"))
    times = values(run, "time")
    rates = np.array([0.4, 0.5, 1.2])[:, None] * np.exp(-(damping / moments)[:, None] * times)
    size = np.linalg.norm(moments[:, None] * rates, axis=0)
    energy = (moments[:, None] * rates**2).sum(axis=0) / 2
    # ten e-foldings: the states err by the tolerance, relative to where they are largest
    bound = 1024 * EPS
    np.testing.assert_allclose(values(run, "angular_momentum_norm"), size, rtol=0, atol=bound * size.max())
    np.testing.assert_allclose(values(run, "energy"), energy, rtol=0, atol=bound * energy.max())
    assert np.abs(np.diff(values(run, "momentum_axis"), axis=0)).max() <= 4 * EPS
    assert run.summary["cost"]["steps"] < 100


@pytest.mark.parametrize("end", cases([4000, -4000], [4000]))
@pytest.mark.parametrize(
    "more", cases(["", f"\n[[loads]]\n{GRADIENT}"], [""]), ids=["alone", "with a gradient"]
)
def test_the_announced_errors_cover_the_true_ones(more: str, end: float) -> None:
    loads = viscous(1e-4) + more
    full = run_text(text("full", loads, end))
    run = run_text(text("spin_averaged", loads, end), estimate=True)
    assert run.summary["cost"]["steps"] < 0.03 * full.summary["cost"]["steps"]
    size = values(full, "angular_momentum_norm")
    assert np.ptp(size) > 0.2 * size.max()  # so that there is something to follow
    announced, true = run.summary["modelling"], apart(run, full)
    for name, error in true.items():
        assert error <= announced[name] <= 4 * error, name
    assert announced["whole"] == bool(more)
    assert list(run.summary["invariants"]) == ["momentum_axis_norm"]


def test_torques_too_strong_for_an_average_are_found_by_measurement() -> None:
    """They take a fortieth of the rotation within a wobble: the energy is lost, the momentum's size isn't."""
    loads = 'kind = "viscous_torque"\ncoefficients = [1e-4, 0.1, 1.5e-4]'
    run, full = (run_text(text(level, loads, 50), estimate=True) for level in ("spin_averaged", "full"))
    announced, true = run.summary["modelling"], apart(run, full)
    assert 0.01 < true["momentum_axis"] <= announced["momentum_axis"]
    assert announced["angular_momentum_norm"] < 0.01 < true["energy"] <= announced["energy"]
    assert verdict_on(run.outcome).soundness is Soundness.INACCURATE
    assert len(run.summary["warnings"]) == 2


@pytest.mark.slow
def test_a_rotation_that_dies_away_is_refused_from_then_on() -> None:
    """It was a division by zero."""
    loads = 'kind = "viscous_torque"\ncoefficients = [1e-3, 1e-3, 1.5e-3]'
    given = rigidsim.parse(text("spin_averaged", loads, 1e7, "principal_moments = [1, 1, 2]"))
    with pytest.raises(ConfigError, match=r"bring the body to rest after \d+ s .*: end the run by") as caught:
        prepare(given)
    found = re.search(r"after (\d+) s", str(caught.value))
    assert found is not None
    # the slower of the decays c / I goes on until 1e-150 of the momentum is left
    assert float(found[1]) == pytest.approx(150 * np.log(10) / 0.75e-3, rel=0.02)
