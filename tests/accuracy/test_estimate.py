"""Announced errors: of the attitude and of the path, at a run's end, against better solutions."""

import mpmath
import numpy as np
import pytest
from support import angles_between, config, unoptimised_code
from support import run_estimated as run_text

import rigidsim
from rigidsim.accuracy.comparison import Collected, try_setting
from rigidsim.accuracy.estimates import UNCERTAIN, estimate_errors
from rigidsim.accuracy.setting import Setting
from rigidsim.scene.parts_of_values import parts_in
from rigidsim.solve.problem import prepare

COVERED = 3.0  # the campaign's measure (experiments/error_coverage.py): true at most 3 times the announced
HONEST = 100.0  # and no scene of these is announced a hundred times as wrong as it is


def true_error(run: rigidsim.Run, text: str, precision: str = "extended") -> float:
    """Of the attitude at the end, rad, against more digits."""
    with run.dataset as dataset:
        last = mpmath.mpf(float(dataset["time"][-1]))
        ours = [dataset[part].values[-1:] for part in parts_in(dataset, "quaternion")]
    better = try_setting(rigidsim.parse(text), Setting(precision), [last], compact=True)
    return float(angles_between(ours, better.attitudes)[0])


def scene(moments: str, rates: str, end: str, loads: str = "", output: str = "") -> str:
    return config(
        f"principal_moments = {moments}",
        f"angular_velocity = {rates}",
        loads,
        f"end = {end}\nsamples = 2",
        output=output,
    )


GRADIENT = """kind = "gravity_gradient"
gravitational_parameter = 1
orbit = {semi_major_axis = 1, eccentricity = 0.1, inclination = 0.5}"""
PASSAGES = scene("[1, 1.0005, 1.01]", "[1e-4, 10, 1e-4]", "2500")
COMET = config(
    "principal_moments = [1, 1.3, 1.6]\nmass = 1",
    "angular_velocity = [1e-3, 2e-3, 3e-3]\nposition = [100, 0, 0]\nvelocity = [0, 0.022, 0.008]",
    'kind = "central_gravity"\ngravitational_parameter = 1',
    "end = 20000\nsamples = 2",
)


PUSH = 'kind = "torque"\ncomponents = ["0", "0", "1e-4"]'
"""Leaves no closed form, and amplifies no errors."""


def test_a_run_whose_every_step_is_followed_says_so() -> None:
    text = scene("[1, 2, 2.5]", "[0.5, 0.25, 1]", "100", PUSH)
    run = run_text(text)
    accuracy, true = run.summary["accuracy"], true_error(run, text)
    assert accuracy["examined_share"] == 1
    assert accuracy["estimated_how"].endswith(", over the run")
    assert true <= COVERED * accuracy["estimated_attitude_error"] <= COVERED * HONEST * true


@pytest.mark.slow
@pytest.mark.unoptimised
def test_errors_grow_in_a_passage_that_no_beginning_shows() -> None:
    """Near the middle axis, which is left after 500 s: announced at 1.8e-10, 3.7e-7 off."""
    run = run_text(PASSAGES)
    announced, true = run.summary["accuracy"]["estimated_attitude_error"], true_error(run, PASSAGES)
    assert true <= COVERED * announced <= COVERED * HONEST * true
    # neighbours alone, as where there is no closed form
    prepared = prepare(rigidsim.parse(PASSAGES))
    ran = Collected(prepared, [])
    followed = estimate_errors(prepared, ran.progress.steps, 2500.0, corrected=ran.parts.corrected)
    assert followed is not None
    assert followed.attitude is not None
    # errors shrink again after each passage, by more than distances in double precision can tell
    assert true <= COVERED * followed.attitude < COVERED * UNCERTAIN


CLOSE = "[0, 0.022, 0.008]"


@pytest.mark.parametrize("start", ["[0, 0.05, 0.02]", pytest.param(CLOSE, marks=pytest.mark.campaign)])
def test_the_path_past_pericentres_is_estimated_too(start: str) -> None:
    comet = COMET.replace(CLOSE, start)
    run = run_text(comet)
    with unoptimised_code():  # which takes a tenth of the time to compile
        better = run_text(comet, 'integrator.precision="extended"', "output.estimate=false")
    accuracy = run.summary["accuracy"]
    announced, true = accuracy["estimated_attitude_error"], true_error(run, comet)
    assert true <= COVERED * announced <= COVERED * HONEST * true
    with run.dataset as ours, better.dataset as theirs:
        for name in ("position", "velocity"):
            residual = theirs[f"{name}_lo"].values[-1]
            off = np.linalg.norm(ours[name].values[-1] - theirs[name].values[-1] - residual)
            assert off <= COVERED * accuracy[f"estimated_{name}_error"] <= COVERED * HONEST * off


@pytest.mark.parametrize(("offset", "end"), [("0", "2000"), ("1e-4", "200")])
def test_a_motion_that_keeps_its_digits_raises_no_alarm(offset: str, end: str) -> None:
    """Errors beside the middle axis grow in each passage and shrink after it; on it they have nothing to
    grow from. Either was announced as lost.
    """
    text = scene("[1, 2, 3]", f"[{offset}, 1, {offset}]", end)
    run = run_text(text)
    true = true_error(run, text, "quadruple")
    assert true <= COVERED * run.summary["accuracy"]["estimated_attitude_error"] < 1e-6
    assert not run.summary["warnings"]


def test_a_loose_tolerance_is_estimated_by_what_it_cuts_off() -> None:
    text = config(loads=GRADIENT, time="end = 60\nsamples = 2", integrator="tolerance = 1e-8")
    run = run_text(text)
    announced, true = run.summary["accuracy"]["estimated_attitude_error"], true_error(run, text, "double")
    assert true > 1e-12  # far above rounding
    assert true <= COVERED * announced <= COVERED * HONEST * true


def test_estimates_can_be_turned_off_and_change_no_bit() -> None:
    text = scene("[1, 2, 3]", "[0.5, 0.25, 1]", "50", GRADIENT)
    with_one = run_text(text)
    without = run_text(text, "output.estimate=false", 'name="without"')
    assert "estimate" in with_one.summary["cost"]["cpu_by_phase"]
    assert "estimate" not in without.summary["cost"]["cpu_by_phase"]
    accuracy = without.summary["accuracy"]
    assert accuracy["estimated_attitude_error"] is None
    assert accuracy["estimated_how"] == "not estimated: [output] estimate = false"
    with with_one.dataset as one, without.dataset as other:
        assert all(one[name].values.tobytes() == other[name].values.tobytes() for name in one.data_vars)


@pytest.mark.slow
@pytest.mark.unoptimised
def test_kinks_and_jumps_are_followed() -> None:
    """Neighbours come to switching surfaces at other times than the motion."""
    drag = 'kind = "torque"\ncomponents = ["-0.2*abs(wx)*wx", "-0.1*sign(wy)", "0.05*abs(wz)"]'
    text = scene("[1, 2, 3]", "[0.5, 0.25, 1]", "15", drag)
    run = run_text(text)
    announced, true = run.summary["accuracy"]["estimated_attitude_error"], true_error(run, text)
    assert true <= COVERED * announced < 1e-11
