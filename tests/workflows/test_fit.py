"""``rigidsim.fit``: closed forms, symmetries, differences against variational equations, kills, bad data."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from support import seeds, unoptimised_code

import rigidsim
from rigidsim.errors import ConfigError, RigidsimError, RunFolderError
from rigidsim.workflows.fit import fitting
from rigidsim.workflows.fit.estimation import inverse_right_jacobian

SPIN = 0.7  # rad/s about z
SIGMA = 0.01  # rad
TIMES = np.linspace(0.5, 9.5, 19)
BALL = """
name = "ball"
[body]
principal_moments = [2, 2, 2]
[initial]
angular_velocity = [0, 0, 0.69]
[time]
end = 10
"""
FREE = """
name = "free"
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.3, 1.0, -0.4]
[time]
end = 10
epoch = "2016-12-31T23:59:55 UTC"
"""


def data(file: str, observable: str, columns: list[str], sigma: float | str, more: str = "") -> str:
    return (
        f'[[fit.data]]\nfile = "{file}"\nobservable = "{observable}"\nsigma = {sigma}\n'
        f"columns = {json.dumps(columns)}\n{more}\n"
    )


def table(path: Path, names: list[str], columns: list[Any]) -> None:
    rows = [",".join(names), *(",".join(map(str, row)) for row in zip(*columns, strict=True))]
    path.write_text("# observed\n" + "\n".join(rows) + "\n")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def turning(folder: Path) -> np.ndarray:
    """Noisy phases of a spin about z, as Euler angles in degrees across full turns."""
    noise = SIGMA * np.random.default_rng(5).standard_normal(len(TIMES))
    phases = SPIN * TIMES + noise
    zero = np.zeros(len(TIMES))
    table(folder / "turn.csv", ["time", "a", "b", "c"], [TIMES, np.rad2deg(phases) % 360, zero, zero])
    return phases


TURN = data("turn.csv", "euler_angles", ["a", "b", "c"], f'"{SIGMA} rad"', 'unit = "deg"')
LINE = np.stack([np.ones(len(TIMES)), TIMES], axis=1)  # phase = offset + rate t


def test_a_uniform_spin_is_a_straight_line_with_the_covariance_of_one(here: Path) -> None:
    phases = turning(here)
    keys = '[fit]\nparameters = ["initial.attitude[2]", "initial.angular_velocity[2]"]\n'
    found = rigidsim.fit(rigidsim.parse(BALL + keys + TURN))
    expected = np.linalg.inv(LINE.T @ LINE)
    values = expected @ LINE.T @ phases
    covariance = SIGMA**2 * expected
    assert found.converged
    assert not found.undetermined
    # steps end below 1e-3 sigmas; derivatives of this linear problem are right to rounding
    apart = np.array([one.value for one in found.parameters]) - values
    assert np.sqrt(apart @ np.linalg.solve(covariance, apart)) < 1e-3
    np.testing.assert_allclose(found.dataset["covariance"].values, covariance, rtol=1e-9)
    correlation = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert found.correlations[0][1] == pytest.approx(correlation, rel=1e-9)
    # the predicted uncertainty of the phase is that of the line, within the data and beyond
    along = np.stack([np.ones(201), found.dataset["time"].values], axis=1)
    spread = np.sqrt(np.einsum("ni,ij,nj->n", along, covariance, along))
    np.testing.assert_allclose(found.dataset["attitude_sigma"].values[:, 2], spread, rtol=1e-9)
    assert found.freedom == 3 * len(TIMES) - 2
    again = rigidsim.run(found.experiment, out=None).dataset
    assert float(again["angular_velocity"][0, 2]) == found.value("initial.angular_velocity[2]")
    assert found.experiment.config.fit is None


def test_a_considered_rate_and_a_prior_enter_as_their_formulas_say(here: Path) -> None:
    turning(here)
    known, prior = 0.02, 0.015
    text = (
        BALL + '[fit]\nparameters = ["initial.attitude[2]"]\n'
        f'consider."initial.angular_velocity[2]" = {{sigma = "{known} rad/s"}}\n'
        f'prior."initial.attitude" = {{sigma = {prior}}}\n'
    )
    found = rigidsim.fit(rigidsim.parse(text + TURN))
    plain = 1 / (len(TIMES) / SIGMA**2 + 1 / prior**2)
    effect = -plain * TIMES.sum() / SIGMA**2  # S = -M H' W H_c
    assert found.sigma("initial.attitude[2]") == pytest.approx(
        np.sqrt(plain + (effect * known) ** 2), rel=1e-9
    )
    assert found.considered[0].effect == [pytest.approx(effect, rel=1e-9)]


def test_residuals_of_attitudes_turn_as_the_logarithm_does() -> None:
    from scipy.spatial.transform import Rotation

    vectors = np.random.default_rng(1).uniform(-1.7, 1.7, (20, 3))  # below half a turn
    vectors[:2] *= 1e-6
    turn, step = np.array([0.3, -0.5, 0.8]), 1e-6
    ends = [
        (Rotation.from_rotvec(vectors) * Rotation.from_rotvec(-sign * step * turn)).as_rotvec()
        for sign in (1, -1)
    ]
    slopes = (ends[1] - ends[0]) / (2 * step)
    # central differences of 1e-6: 1e-12 cut off, some 1e-10 of rounding
    np.testing.assert_allclose(inverse_right_jacobian(vectors) @ turn, slopes, atol=2e-9)


RATES = data("rates.csv", "angular_velocity", ["x", "y", "z"], 1e-3)


@pytest.mark.slow
def test_two_misprints_of_toutatis_are_found_and_its_published_moments(here: Path) -> None:
    config = Path(__file__).parents[2] / "configs" / "fits" / "toutatis_1992.toml"
    found = rigidsim.fit(config)
    assert found.converged
    assert [(one.data, one.row) for one in found.outliers] == [(2, "line 8"), (2, "line 15")]
    assert np.rad2deg(found.data[0].rms) < 7.7  # the published solution's
    for index, published in enumerate((3.0836, 3.235)):
        one = found.parameters[6 + index]
        assert one.scaled_sigma is not None
        assert abs(one.value - published) < 3 * one.scaled_sigma


def killed_after(lines: int) -> Callable[[str], None]:
    left = [lines]

    def told(_: str) -> None:
        left[0] -= 1
        if not left[0]:
            raise KeyboardInterrupt

    return told


@pytest.mark.slow
def test_a_killed_fit_begins_again_with_the_same_bits_and_verifies(here: Path) -> None:
    turning(here)
    keys = '[fit]\nparameters = ["initial.attitude[2]", "initial.angular_velocity[2]"]\n'
    (here / "ball.toml").write_text(BALL.replace("0.69", "0.6") + keys + TURN)
    whole = rigidsim.fit("ball.toml", out="whole")
    with pytest.raises(KeyboardInterrupt):
        rigidsim.fit("ball.toml", out="fits", told=killed_after(2))
    folder = here / "fits" / "ball"
    with pytest.raises(RunFolderError, match="resume"):
        fitting.read_result(fitting.FitFolder(folder))
    (here / "turn.csv").unlink()  # it has its own copy
    again = fitting.resume_fit(folder)
    assert again.parameters == whole.parameters
    with xarray.open_dataset(folder / "dataset.h5") as saved:
        xarray.testing.assert_identical(saved.load(), xarray.load_dataset(here / "whole/ball/dataset.h5"))
    assert rigidsim.verify(folder).identical
    copy = folder / "data" / "1_turn.csv"
    copy.write_text(copy.read_text().replace("\n0.5,", "\n0.501,"))
    verdict = rigidsim.verify(folder)
    assert not verdict.identical
    assert "data: not the bytes" in verdict.problems[0]
    assert "residual_1" in verdict.differing
    with pytest.raises(RigidsimError, match="no such file"):
        rigidsim.fit("ball.toml", out="fits")
    turning(here)
    with pytest.raises(RunFolderError, match="finished fit"):
        rigidsim.fit("ball.toml", out="fits")


def test_dates_count_leap_seconds_and_rows_outside_are_told(here: Path) -> None:
    dates = ["2016-12-31T23:59:58", "2016-12-31T23:59:60.5Z", "2017-01-01T00:00:01", "2017-01-01T00:01"]
    table(here / "dates.csv", ["utc", "value"], [dates, [1.5, 2.75, 3.5, 99]])
    more = 'time = "utc"'
    text = FREE + '[fit]\nparameters = ["initial.angular_velocity[0]"]\n'
    found = rigidsim.fit(rigidsim.parse(text + data("dates.csv", "t/2", ["value"], 0.1, more)))
    np.testing.assert_array_equal(found.dataset["time_1"].values, [3.0, 5.5, 7.0])
    np.testing.assert_allclose(found.dataset["residual_1"].values[:, 0], 0.0, atol=1e-12)
    assert "1 of 4 rows lie farther from the run's start than its end" in found.told[0]
    assert "line 6" in found.told[0]
    assert found.undetermined[0].text == "initial.angular_velocity[0]: no row depends on it"


BAD: dict[str, tuple[list[Any], str, str]] = {
    "not finite": ([[0, 1], [1, "nan"]], "", r"line 3: x is no finite number \(\"nan\"\)"),
    "repeated": ([[0, 1], [2, 2], [0, 1]], "", r"line 4 repeats line 2"),
    "outside": ([[20, 1], [21, 2]], "", r"no row lies as near .* \(-10 to 10 s\)"),
    "a unit of another kind": ([[0, 1], [1, 2]], 'unit = "kg"', "kg"),
    "no column": ([[0, 1], [1, 2]], 'time = "utc"', 'has no column "utc"; its columns are time, x'),
    "no leap second": ([["2015-12-31T23:59:60", 1], ["2016-12-31T23:59:58", 1]], "", "no leap second then"),
}


ONE = FREE + '[fit]\nparameters = ["initial.angular_velocity[0]"]\n'


def test_bad_rows_are_refused_by_their_line(here: Path) -> None:
    for rows, more, message in BAD.values():
        lines = ["time,x", *(f"{t},{x}" for t, x in rows)]
        (here / "bad.csv").write_text("\n".join(lines) + "\n")
        with pytest.raises(RigidsimError, match=message):
            rigidsim.fit(rigidsim.parse(ONE + data("bad.csv", "energy", ["x"], 0.1, more)))


WRONG = {
    'parameters = ["body.moments"]': "principal_moments",
    'parameters = ["time.end"]': "no number of the motion",
    'parameters = ["initial.angular_velocity", "initial.angular_velocity[1]"]': "another key stands for",
    'parameters = ["initial.angular_velocity[0]"]\nprior."body.principal_moments" = {sigma = 1}': (
        "not among the parameters"
    ),
    'parameters = ["initial.angular_velocity[0]"]\nprior."initial.angular_velocity" = {sigma = "1 kg"}': "kg",
    'parameters = ["initial.angular_velocity[0]"]\nstarts = 3': "nothing to draw them from",
    'parameters = ["initial.position"]': "isn't given in the config",
}


SEEN = data("x.csv", "energy", ["x"], 1)
OBSERVED = (("enrgy", "no variable that can be recorded"), ("position", "no position"),
            ("quaternion", "has 4"), ("2*pi", "never changes"))  # fmt: skip


def test_wrong_keys_and_observables_are_refused(here: Path) -> None:
    (here / "x.csv").write_text("time,x\n1,1\n2,2\n")
    refused = [
        *((f"{FREE}[fit]\n{keys}\n{SEEN}", why) for keys, why in WRONG.items()),
        *((ONE + data("x.csv", observable, ["x"], 1), why) for observable, why in OBSERVED),
        (FREE, "it names parameters"),
    ]
    for text, message in refused:
        with pytest.raises(ConfigError, match=message):
            rigidsim.fit(rigidsim.parse(text))
    (here / "x.csv").write_text("day,x\n2017-01-01T00:00,1\n2017-01-01T00:00:02,2\n")
    undated = ONE.replace('epoch = "2016-12-31T23:59:55 UTC"', "")
    with pytest.raises(ConfigError, match="give it one"):
        rigidsim.fit(rigidsim.parse(undated + data("x.csv", "energy", ["x"], 1, 'time = "day"')))


# --- what nobody means --------------------------------------------------------------------------------------

SLOW = FREE.replace("[0.3, 1.0, -0.4]", "[0.1, 0.5, 0.2]")
LAMINA = SLOW.replace("[1, 2, 2.5]", "[1, 2, 3]") + '[fit]\nparameters = ["body.principal_moments[2]"]\n'


def seen_lamina(folder: Path) -> None:
    """Exact rates of a body whose largest moment is 2.5."""
    found = rigidsim.run(rigidsim.parse(SLOW, overrides=["time.samples=11"]), out=None).dataset
    table(
        folder / "rates.csv", ["time", "x", "y", "z"], [found.time.values, *found.angular_velocity.values.T]
    )


def test_what_bars_a_fit_is_told(here: Path) -> None:
    """Columns that are mixed up ask of a lamina for a largest moment beyond the sum of the others."""
    seen_lamina(here)
    found = rigidsim.fit(rigidsim.parse(LAMINA + RATES.replace('"x", "y", "z"', '"y", "x", "z"')))
    assert not found.converged
    assert any("refused: principal moments" in text and "I1 + I2 >= I3" in text for text in found.told)


def test_observations_that_are_given_twice_are_told(here: Path) -> None:
    seen_lamina(here)
    text = LAMINA.replace("2, 3]", "2, 2.4]")
    once, twice = (rigidsim.fit(rigidsim.parse(text + n * RATES)) for n in (1, 2))
    assert not once.told
    assert any("data 1 and 2 have rows" in told and "(11)" in told for told in twice.told)


NONE = r"sigma: given .*; a standard deviation above zero|finite"
MIXED = data("mixed.csv", "angular_velocity", ["a_deg_s", "b_rad_s", "c_rad_s"], 1e-3)
IMPOSSIBLE = {
    "no width": (RATES.replace("0.001", "inf"), NONE),
    "no square": (RATES.replace("0.001", "1e-300"), NONE),
    "a prior without a width": (
        'prior."body.principal_moments[2]" = {sigma = 0}\n' + RATES,
        r'prior\."body\.principal_moments\[2\]": .*above zero',
    ),
    "units": (MIXED, r"columns in several units \(deg/s, rad/s\)"),
}


def test_what_no_fit_can_be_made_of_is_refused(here: Path) -> None:
    seen_lamina(here)
    (here / "mixed.csv").write_text("time,a_deg_s,b_rad_s,c_rad_s\n1,1,1,1\n2,1,2,1\n")
    for more, message in IMPOSSIBLE.values():
        with pytest.raises(ConfigError, match=message) as error:
            rigidsim.fit(rigidsim.parse(LAMINA + more))
        assert len(error.value.problems) == 1
    # rounding would tell moments apart
    single = LAMINA.replace("[fit]", '[integrator]\nprecision = "single"\n[fit]') + RATES
    with pytest.raises(ConfigError, match=r"\[integrator\] precision: .*\"double\" is allowed"):
        rigidsim.fit(rigidsim.parse(single))


@pytest.mark.parametrize("seed", seeds(1, 30))
def test_the_late_clock_of_one_file_is_estimated_with_the_motion(here: Path, seed: int) -> None:
    """Rows of a free body with noise, by SciPy: attitudes in time, rates late. The offset is the true one
    within its sigma, which is that of the joint normal equations.
    """
    rng = np.random.default_rng(seed)
    moments, w = np.array([1.0, 2.0, 2.5]), rng.uniform(0.3, 1, 3)

    def moving(x: np.ndarray) -> tuple[Rotation, np.ndarray]:
        """Attitudes, and rates by a clock late by x[3]; x[:3] turns the start, x[4:] are its rates."""

        def slopes(_: float, y: np.ndarray) -> np.ndarray:
            q, w = y[:4], y[4:]
            turn = np.array([-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))]) / 2
            return np.concatenate([turn, -np.cross(w, moments * w) / moments])

        first = np.concatenate([np.roll(Rotation.from_rotvec(x[:3]).as_quat(), 1), x[4:]])
        known = solve_ivp(slopes, (0, 10), first, "DOP853", dense_output=True, rtol=1e-12, atol=1e-14).sol
        return Rotation.from_quat(np.roll(known(times)[:4].T, -1, axis=1)), known(times + x[3])[4:].T

    sigma, times = 1e-3, np.linspace(0.5, 9.5, 40)
    truth = np.array([0, 0, 0, rng.uniform(-0.3, 0.3), *w])
    attitude, rates = moving(truth)
    noise = sigma * rng.normal(size=(2, 40, 3))
    noisy = np.roll((attitude * Rotation.from_rotvec(noise[0])).as_quat(), 1, axis=1)
    names = [["time", "qw", "qx", "qy", "qz"], ["time", "wx", "wy", "wz"]]
    for name, columns, values in zip("qw", names, (noisy, rates + noise[1]), strict=True):
        table(here / f"{name}.csv", columns, [x.tolist() for x in (times, *values.T)])
    text = FREE.replace("[0.3, 1.0, -0.4]", str((w * 1.001).tolist()))
    text += '[fit]\nparameters = ["initial.attitude", "fit.data[1].offset", "initial.angular_velocity"]\n'
    for name, columns, one in zip("qw", names, ("quaternion", "angular_velocity"), strict=True):
        text += data(f"{name}.csv", one, columns[1:], sigma)
    with unoptimised_code():
        found = rigidsim.fit(rigidsim.parse(text))
    assert found.converged

    def observed(x: np.ndarray) -> np.ndarray:
        turned, spun = moving(x)
        return np.concatenate([(turned * attitude.inv()).as_rotvec(), spun])

    ends = [(observed(truth + s) - observed(truth - s)).ravel() / 2e-5 for s in 1e-5 * np.eye(7)]
    spreads = sigma * np.sqrt(np.diag(np.linalg.inv(np.array(ends) @ np.array(ends).T)))
    assert [one.sigma for one in found.parameters] == pytest.approx(spreads, rel=0.02)
    errors = np.array([one.value for one in found.parameters]) - truth
    assert (np.abs(errors) < 4.5 * spreads).all()
    late = float(found.dataset["time_2"][0]) - 0.5
    assert late == pytest.approx(found.value("fit.data[1].offset"))


def test_a_clock_and_the_whole_start_are_not_separated(here: Path) -> None:
    """Of a motion that depends on no date: later rows are an earlier start. Sets of a file share a clock."""
    turning(here)
    text = BALL + '[fit]\nparameters = ["initial.attitude[2]", "fit.data[0].offset"]\n' + TURN * 2
    found = rigidsim.fit(rigidsim.parse(text))
    [one] = found.undetermined
    assert one.keys == ["initial.attitude[2]", "fit.data[0].offset"]
    assert one.amounts[0] / one.amounts[1] == pytest.approx(-0.69, rel=1e-3)
    assert not any("another minimum" in note for note in found.told)
    alone = rigidsim.fit(rigidsim.parse(text.replace('"initial.attitude[2]", ', "").replace("0.69]", "-5]")))
    assert sum("begin near the first row's attitude" in note for note in alone.told) == 1
    with pytest.raises(ConfigError, match=r"fit\.data\[N\]\.offset are allowed"):
        rigidsim.fit(rigidsim.parse(text.replace("[0].offset", "[0].outliers")))
