"""Every config of configs/: invariants hold, and the attitude is right."""

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from support import CONFIGS, EPSILON, amplification, angle_between, cases, law, tried

import rigidsim

pytestmark = pytest.mark.optimised  # they are long

Ready = Callable[..., rigidsim.Run]
ATTITUDE = 'output.record=["angular_velocity", "quaternion"]'
AVERAGED = [path for path in CONFIGS if rigidsim.load(path).config.model.reduced]
CONFIGS = [path for path in CONFIGS if path not in AVERAGED]
NAMES = [path.stem for path in CONFIGS]
# one in each suite, four others a day in the long one
USUAL = ["intermediate_axis"]
SCENES = cases(CONFIGS, [path for path in CONFIGS if path.stem in USUAL], daily=4)
MODELLING = {
    # second order in the nutation that was averaged away: some 1e-5 rad, or 1e-10 of the precession's
    # 2 pi a turn, and first order in the precession's rate over the spin's, 1e-7 of it
    "earth_precession_averaged": 2 * np.pi * 1e-6,
    # first order in the torque: it turns the momentum by up to 2e-6 rad/s (1.5 n^2 (C - A) / L, n = 1.1e-3
    # rad/s, at the end), over 0.25 rad/s of spin, on a way of some 6 rad, and windows of 0.3 of 90 days don't
    # resolve growth by less than their own 1e-5 rad in each, twice (the margin)
    "detumbling_cubesat": 6 * 2e-6 / 0.25 + 2 * 1e-5 * 90 / 0.3,
}
GROWING = (
    *("intermediate_axis", "heavy_top_sleeping_unstable", "water_molecule"),  # unstable
    "j2_orbit",  # an error of the semi-major axis moves the place along the orbit, and so the torque
    "lageos_spin_decay",  # an error of the first fast turns stays while the rate, the law's measure, decays
)


@lru_cache(maxsize=1)
def reference(path: Path) -> np.ndarray:
    """Quaternions of the same scene in 80-bit arithmetic: rounding errors 2048 times smaller."""
    high, low = tried(path.read_text(), "extended").attitudes
    return high.astype(np.longdouble) + low


@lru_cache(maxsize=1)
def sensitivity(path: Path) -> float:
    return amplification(rigidsim.load(path, overrides=[ATTITUDE]))


@pytest.mark.parametrize("path", SCENES, ids=NAMES)
def test_all_invariants_hold_and_the_attitude_is_right(path: Path, ready: Ready) -> None:
    run = ready(path)
    assert_invariants_hold(run)
    if run.summary["formulation"] != "quaternion" or "quaternion" not in run.dataset:
        run = ready(path, ATTITUDE, 'integrator.formulation="quaternion"')
    assert_attitude_is_right(run, path)
    # and the summary promises no more than it keeps
    accuracy = run.summary["accuracy"]
    assert largest_error(run, path) <= 3 * accuracy["estimated_attitude_error"]
    assert (accuracy["amplification"] > 1) == (path.stem in GROWING)


@pytest.mark.slow  # full motions beside averaged ones
@pytest.mark.parametrize("path", AVERAGED, ids=[path.stem for path in AVERAGED])
def test_averaged_scenes_say_how_far_they_are_from_the_full_motion(path: Path, ready: Ready) -> None:
    run = ready(path)
    assert run.status == "finished"
    assert run.summary["warnings"] == []
    for name, row in run.summary["invariants"].items():
        # rounding and a tolerance of 1024 epsilon as a random walk
        assert row["bound"] == 50 * 2.0**-42 * np.sqrt(run.summary["cost"]["steps"])
        assert 0 <= row["largest_drift"] <= row["bound"], name
    modelling = run.summary["modelling"]
    assert len(modelling["windows"]) == 3
    assert 1e-10 < modelling["momentum_axis"] < MODELLING[path.stem]


def assert_invariants_hold(run: rigidsim.Run) -> None:
    assert run.status == "finished"
    assert run.summary["warnings"] == []
    assert run.summary["invariants"]
    for name, row in run.summary["invariants"].items():
        # 50 eps sqrt(steps): rounding as a random walk, a few roundings per step
        assert row["bound"] == 50 * 2.0**-52 * np.sqrt(run.summary["cost"]["steps"])
        assert 0 <= row["largest_drift"] <= row["bound"], name
        assert float(np.abs(run.dataset[f"{name}_drift"]).max()) == row["largest_drift"]


def both(run: rigidsim.Run, path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Quaternions of the run and of 80-bit arithmetic at the same times."""
    exact = reference(path)
    ours = run.dataset["quaternion"].values
    return ours[:: (len(ours) - 1) // (len(exact) - 1)], exact


def largest_error(run: rigidsim.Run, path: Path) -> float:
    ours, exact = both(run, path)
    return float(angle_between(ours.astype(np.longdouble), exact).max())


def assert_attitude_is_right(run: rigidsim.Run, path: Path) -> None:
    ours, exact = both(run, path)
    steps = run.summary["cost"]["steps"]
    fastest = np.sqrt((run.dataset["angular_velocity"].values ** 2).sum(axis=1)).max()
    duration = float(run.dataset["time"][-1])
    # three times the law; where the motion is unstable its own amplification (from the variational
    # equations) takes the place of the stable motion's linear growth |w| t / sqrt 3
    bound = 3 * law(EPSILON["double"], steps, fastest, duration)
    unstable = 3 * EPSILON["double"] / 2 * np.sqrt(steps) * sensitivity(path)
    assert largest_error(run, path) <= max(bound, unstable)
    # the sign is continuous as well: no sample is its reference's negative, or all are, where angles begin so
    products = np.einsum("ij,ij->i", ours, exact.astype(float))
    begins = np.sign(products[0]) if run.summary["formulation"] == "euler_angles" else 1.0
    assert (products * begins > 0).all()
