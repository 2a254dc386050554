"""Fits, comparisons and derivatives before the start, after it, and on both sides, against DOP853."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from support import cases, config

import rigidsim
from rigidsim.workflows.fit.fitting import fitted_run
from rigidsim.workflows.sensitivity import Tangents

MOMENTS = np.array([1.0, 1.8, 2.3])
RATES = np.array([0.4, 1.1, -0.7])
SIGMA = 1e-3
LOADS = {
    "free": "",
    "pulled": 'kind = "gravity_gradient"\ngravitational_parameter = 1\norbit = {semi_major_axis = 1}',
    "kinked": 'kind = "torque"\ncomponents = ["0.3*abs(wx)", "0.1*sin(2*t)", "0"]',
}


def torque(load: str, t: float, y: np.ndarray) -> np.ndarray:
    """What the load's text says, body axes."""
    if load == "kinked":
        return np.array([0.3 * abs(y[4]), 0.1 * np.sin(2 * t), 0])
    towards = Rotation.from_quat(y[[1, 2, 3, 0]]).inv().apply([np.cos(t), np.sin(t), 0])
    return np.cross(towards, MOMENTS * towards) * 3 * (load == "pulled")


def truth(times: np.ndarray, load: str = "free", **given: Any) -> np.ndarray:
    """Quaternions (w x y z, body to space) and rates (body axes) at ascending times, (rows, 7)."""
    moments, parts = given.get("moments", MOMENTS), []

    def slopes(t: float, y: np.ndarray) -> np.ndarray:
        q, w = y[:4], y[4:]
        turn = np.array([-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))]) / 2
        return np.concatenate([turn, (torque(load, t, y) - np.cross(w, moments * w)) / moments])

    start = np.array([1, 0, 0, 0, *given.get("rates", RATES)])
    tolerance = given.get("tolerance", 1e-13)
    for side in (times[times < 0][::-1], times[times >= 0]):
        if len(side) and side[-1] == 0:
            parts.append(start[None])
        elif len(side):
            made = solve_ivp(slopes, (0, side[-1]), start, "DOP853", side, rtol=tolerance, atol=tolerance)
            parts.append(made.y.T[np.argsort(side)])
    return np.concatenate(parts)


def text_of(load: str, end: float = 6.0) -> str:
    return config(
        "principal_moments = [1, 1.8, 2.3]", "angular_velocity = [0.4, 1.1, -0.7]", LOADS[load],
        time=f"end = {end}\nsamples = 3",
    )  # fmt: skip


def fitted(here: Path, times: np.ndarray, load: str, end: float, sign: int = 1, **more: Any) -> Any:
    """A fit to rates with noise, from a start that is off; mirrored in time with ``sign`` -1."""
    noise = np.random.default_rng(7).normal(0, SIGMA, (len(times), 3))
    rows = sign * np.column_stack([times, truth(times, load)[:, 4:] + noise])
    np.savetxt(here / "rates.csv", rows, "%.17g", ",", header="time,x,y,z", comments="")
    (here / "fit.toml").write_text(
        text_of(load, end) + '[fit]\nparameters = ["initial.angular_velocity", "body.principal_moments[1]"]\n'
        '[[fit.data]]\nfile = "rates.csv"\nobservable = "angular_velocity"\n'
        f'columns = ["x", "y", "z"]\nsigma = {SIGMA}\n'
    )
    start = (sign * (RATES + np.array([0.01, -0.02, 0.015]))).tolist()
    changes = {"initial.angular_velocity": start, "body.principal_moments[1]": 1.83}
    return rigidsim.fit(here / "fit.toml", changes=changes, **more)


SIDES = {
    "both": np.linspace(-5, 6, 45),
    "before": np.linspace(-6, -0.5, 40),
    "to the start": np.linspace(-6, 0, 40),
}
EVERY = [(load, side, end) for load in LOADS for side in SIDES for end in (6.0, -6.0)]


@pytest.mark.parametrize("case", cases(EVERY, [("free", "both", 6.0)]), ids=str)
def test_a_fit_finds_the_truth_from_data_on_either_side(case: tuple[str, str, float], tmp_path: Path) -> None:
    load, side, end = case
    found, times = fitted(tmp_path, SIDES[side], load, end), SIDES[side]
    assert found.converged
    assert found.derivatives.startswith("central" if load == "kinked" else "variational")
    for key, value in zip(found.dataset.parameter.values, [*RATES, 1.8], strict=True):
        assert abs(found.value(key) - value) < 4 * found.sigma(key) < 20 * SIGMA
    assert found.data[0].used == len(times)
    along = found.dataset.time.values[[0, -1]]
    assert along.tolist() == [min(times[0], 0, end), max(0, end, times[-1])]
    shown = fitted_run(found.experiment, found.dataset).dataset
    np.testing.assert_array_equal(shown.time, found.dataset.time)


@pytest.mark.slow
@pytest.mark.unoptimised
def test_a_free_body_seen_before_is_the_mirrored_one_seen_after(tmp_path: Path) -> None:
    """Time mirrored is the spin reversed, where nothing damps."""
    before, after = (
        fitted(tmp_path, SIDES["before"], "free", 6.0, sign, out=tmp_path / f"fits{sign}") for sign in (1, -1)
    )
    signs = [-1, -1, -1, 1]
    np.testing.assert_allclose(after.dataset.value, signs * before.dataset.value, rtol=1e-9)
    np.testing.assert_allclose(after.dataset.sigma, before.dataset.sigma, rtol=1e-6)
    assert rigidsim.verify(tmp_path / "fits-1" / "scene").identical


def test_derivatives_are_those_of_dop853_at_times_in_any_order() -> None:
    times, step = np.array([2.0, -1.5, 0.0, -3.0, -1.5, 0.5]), 1e-5
    keys = ["initial.angular_velocity[1]"]
    found = Tangents(rigidsim.parse(text_of("pulled")), keys).at({}, times)
    each, places = np.unique(times, return_inverse=True)
    less, more = (truth(each, "pulled", rates=RATES + np.array([0, s, 0]))[places] for s in (-step, step))
    expected = (more - less)[:, 4:] / (2 * step)
    np.testing.assert_allclose(found.slopes["angular_velocity"][:, 0], expected, rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.values["quaternion"], truth(each, "pulled")[places, :4], atol=1e-11)


def compared(load: str, times: np.ndarray, end: float, tmp_path: Path, **given: Any) -> Any:
    """A comparison with rows of DOP853, x y z w, in the order of a tool that goes backwards."""
    rows = np.column_stack([times, truth(times, load, **given)[:, [1, 2, 3, 0, 4, 5, 6]]])[::-1]
    header = "t,q1,q2,q3,q4,wx,wy,wz"
    np.savetxt(tmp_path / "theirs.csv", rows, "%.17g", ",", header=header, comments="")
    experiment = rigidsim.parse(text_of(load, end))
    return rigidsim.compare(experiment, tmp_path / "theirs.csv")


@pytest.mark.parametrize("case", cases(EVERY, [("free", "before", -6.0)]), ids=str)
def test_trajectories_on_either_side_are_judged(case: tuple[str, str, float], tmp_path: Path) -> None:
    load, side, end = case
    times = np.linspace(SIDES[side][0], SIDES[side][-1], 121)
    found = compared(load, times, end, tmp_path)
    assert found.verdict == "agrees" if load != "kinked" else found.attitude_error.largest < 1e-8
    assert found.convention.order == "xyzw"
    assert found.dataset.time.values.tolist() == times.tolist()
    worst = int(np.argmax(found.dataset.attitude_error.values))
    assert found.attitude_error.row == f"line {2 + 120 - worst}"  # as the file counts it
    if load != "kinked":
        assert compared(load, times, end, tmp_path, tolerance=1e-6).verdict == "integration_error"
        assert compared(load, times, end, tmp_path, moments=MOMENTS * [1, 1.001, 1]).verdict == "wrong_model"


def test_a_motion_that_ends_on_the_way_back_is_compared_as_far(tmp_path: Path) -> None:
    """It ends where a stopping event is met, three seconds before the start."""
    stop = '[[events]]\nname = "far"\nexpression = "t + 3"\naction = "stop"\n'
    times = np.linspace(-5, 6, 111)
    rows = dict(zip(["t", "qw", "qx", "qy", "qz"], np.column_stack([times, truth(times)]).T, strict=False))
    found = rigidsim.compare(rigidsim.parse(text_of("free") + stop), rows)
    assert found.verdict == "agrees"
    assert found.dataset.time.values.tolist() == times[times >= -3].tolist()
    assert "rows beyond that aren't compared" in " ".join(found.told)
