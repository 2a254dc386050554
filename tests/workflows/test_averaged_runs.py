"""Averaged runs against the full one, end to end: how near they are, and whether they say so."""

import numpy as np
import pytest
from support import config, run_text

import rigidsim
from rigidsim import ConfigError
from rigidsim.accuracy.choice import choose_level
from rigidsim.session.verdict import Soundness, verdict_on

FLATTENING, SPIN, ECCENTRICITY = 0.02, 60.0, 0.2
BODY = f"principal_moments = [{1 - FLATTENING}, {1 - FLATTENING}, 1]"
START = f'angular_velocity = [0, 0, {SPIN}]\neuler_angles = [0.3, "35 deg", 0]'
LOAD = f"""kind = "gravity_gradient"
gravitational_parameter = 1
orbit = {{semi_major_axis = 1, eccentricity = {ECCENTRICITY}, inclination = "10 deg", ascending_node = 1}}"""
TIME = "end = 100\nsamples = 301"
RECORD = 'record = ["momentum_axis", "figure_axis", "spin_axis", "obliquity", "node_longitude", "energy"]'
RATE = 3 * FLATTENING / SPIN * (1 - ECCENTRICITY**2) ** -1.5 / 2  # k/2 of a mean motion of 1
LEVELS = [
    ("spin_averaged", False),
    ("spin_averaged", True),
    ("orbit_averaged", False),
    ("orbit_averaged", True),
]


def text(level: str, *, short_period: bool = False, time: str = TIME, estimate: bool = False) -> str:
    model = f'[model]\nlevel = "{level}"\nshort_period = {str(short_period).lower()}'
    return config(BODY, START, LOAD, time, "", RECORD, model)


@pytest.fixture(scope="module")
def full() -> rigidsim.Run:
    return run_text(text("full"))


@pytest.fixture(scope="module")
def reduced() -> dict[tuple[str, bool], rigidsim.Run]:
    return {(level, more): run_text(text(level, short_period=more)) for level, more in LEVELS}


def apart(one: rigidsim.Run, other: rigidsim.Run, name: str) -> float:
    difference = one.dataset[name].values - other.dataset[name].values
    return float(np.linalg.norm(difference, axis=1).max())


Both = dict[tuple[str, bool], rigidsim.Run]


def test_each_level_is_as_near_as_its_order(full: rigidsim.Run, reduced: Both) -> None:
    precessed = 2 * RATE * 100  # at most
    # nearest: (1 - e)^-3
    nodding = 2 * RATE * (1 - ECCENTRICITY) ** -3
    errors = {key: apart(run, full, "momentum_axis") for key, run in reduced.items()}
    # the torque at the figure axis' true place: third order in the precession's rate over the spin's
    assert errors["spin_averaged", False] < precessed * (nodding / SPIN) ** 1.5
    assert errors["spin_averaged", False] == errors["spin_averaged", True]
    # third order in the nutation, whose size is nodding / n, and n / w of what a rotation leaves
    assert errors["orbit_averaged", True] < 10 * precessed * (nodding**2 + nodding / SPIN)
    # and without what was averaged away the nutation is there: not small, not larger
    assert 0.05 * nodding < errors["orbit_averaged", False] < nodding
    assert errors["orbit_averaged", True] < 0.05 * errors["orbit_averaged", False]


def test_the_announced_error_covers_the_true_one(full: rigidsim.Run) -> None:
    for level, more in (("spin_averaged", True), ("orbit_averaged", False)):
        run = run_text(text(level, short_period=more), estimate=True)
        found = run.summary["modelling"]
        assert (found["level"], found["short_period"]) == (level, more)
        true = apart(run, full, "momentum_axis")
        assert true <= found["momentum_axis"] <= 10 * true
        assert apart(run, full, "figure_axis") <= found["figure_axis"]
        assert run.summary["accuracy"]["estimated_attitude_error"] < 1e-9  # of the integration: apart from it


@pytest.mark.parametrize(
    ("level", "spin", "moments"),
    [("orbit_averaged", 3.0, [1, 1, 2]), ("spin_averaged", 0.9624, [1, 1, 1.05])],
    ids=["precessing as fast as the source goes round", "with a source as fast as the free precession"],
)
@pytest.mark.slow
@pytest.mark.unoptimised
def test_an_average_that_fails_within_an_orbit_is_found_by_measurement(
    level: str, spin: float, moments: list[float]
) -> None:
    start = START.replace(f"{SPIN}", f"{spin}")
    model = f'[model]\nlevel = "{level}"'
    body = f"principal_moments = {moments}"
    run = run_text(config(body, start, LOAD, "end = 400\nsamples = 101", "", "", model), estimate=True)
    assert run.summary["modelling"]["momentum_axis"] > 0.01
    assert verdict_on(run.outcome).soundness is Soundness.INACCURATE


def test_the_accuracy_of_axes_chooses_the_model() -> None:
    """The nutation of 1e-3 rad may stay or has to be resolved; and a quaternion takes every rotation."""
    given = text("auto", time="end = 20\nsamples = 21")
    levels = {}
    for asked in ("1e-2", "1e-4", "1e-8"):
        choice = choose_level(rigidsim.parse(given, overrides=[f"integrator.accuracy_axis={asked}"]))
        assert choice is not None
        levels[asked] = choice.level
        assert choice.considered[-1].level == choice.level
        assert (choice.considered[-1].error or 0) <= float(asked)
    assert levels == {"1e-2": "orbit_averaged", "1e-4": "spin_averaged", "1e-8": "full"}
    overrides = ["integrator.accuracy_axis=1e-2", 'output.record=["quaternion"]']
    choice = choose_level(rigidsim.parse(given, overrides=overrides))
    assert choice is not None
    assert choice.level == "full"
    assert "every rotation" in choice.considered[0].why_not
    with pytest.raises(ConfigError, match=r"\[model\] level: given \"auto\", but .*accuracy_axis says no"):
        run_text(given)


EARTH = config(
    'preset = "earth"',
    'angular_velocity = [0, 0, "7.292115e-5 rad/s"]\neuler_angles = ["180 deg", "84381.406 arcsec", 0]',
    'kind = "gravity_gradient"\ngravitational_parameter = "1.32712440018e20"\n'
    'orbit = {semi_major_axis = "1.495978707e11", eccentricity = 0.016709}',
    'end = "100000 yr"\nsamples = 101',
    "accuracy_axis = 1e-5",
    'record = ["figure_axis", "momentum_axis"]',
    '[model]\nlevel = "auto"\nshort_period = true',
)


@pytest.mark.slow
def test_the_accuracy_of_axes_is_kept_over_1e5_years_of_the_earth() -> None:
    """Against the motion averaged over the rotation alone, a hundred times nearer to the full one."""
    run = run_text(EARTH, estimate=True)
    assert run.summary["formulation"] == "orbit_averaged"
    announced = run.summary["modelling"]["momentum_axis"]
    assert announced <= 1e-5
    assert run.dataset.attrs["modelling_error"] == run.summary["modelling"]["figure_axis"] <= 1e-5
    nearer = run_text(EARTH, 'model.level="spin_averaged"', estimate=True)
    assert nearer.summary["modelling"]["momentum_axis"] < 0.05 * announced
    assert apart(run, nearer, "momentum_axis") <= announced
    assert apart(run, nearer, "figure_axis") <= run.summary["modelling"]["figure_axis"]
