"""Fits as nobody means them: data given twice, estimates at a wall, priors that are none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rigidsim
from rigidsim.errors import ConfigError
from rigidsim.workflows.fit.estimation import Linear, iterate

LAMINA = """
name = "lamina"
[body]
principal_moments = [1, 2, 3]
[initial]
angular_velocity = [0.1, 0.5, 0.2]
[time]
end = 10
[fit]
parameters = ["body.principal_moments[2]"]
"""


def rates(folder: Path, moments: list[float]) -> None:
    """Exact rates of a body, in a table."""
    text = LAMINA.split("[fit]")[0]
    text = text.replace("[1, 2, 3]", str(moments)).replace("end = 10", "end = 10\nsamples = 11")
    found = rigidsim.run(rigidsim.parse(text), out=None).dataset
    rows = np.column_stack([found.time, found.angular_velocity])
    np.savetxt(folder / "rates.csv", rows, "%.17g", ",", header="time,x,y,z", comments="")


RATES = """
[[fit.data]]
file = "rates.csv"
observable = "angular_velocity"
columns = ["x", "y", "z"]
sigma = 1e-3
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_fit_that_stops_at_a_wall_has_not_converged() -> None:
    def beside_a_wall(values: np.ndarray, fresh: bool = True) -> Linear | None:
        if values[0] > 1:
            return None
        residuals, none = 100 * (np.array([2.0, 1.0]) - values), np.zeros(2)
        return Linear(residuals, 100 * np.eye(2), np.zeros((2, 0)), none, none, none)

    ended = iterate(np.zeros(2), beside_a_wall)
    assert ended is not None
    assert not ended.converged
    assert ended.barred
    assert ended.values[0] == pytest.approx(1)


def test_what_bars_a_fit_is_told(here: Path) -> None:
    # Columns that are mixed up ask of a lamina for a largest moment beyond the sum of the others.
    rates(here, [1, 2, 2.5])
    text = LAMINA + RATES.replace('"x", "y", "z"', '"y", "x", "z"')
    found = rigidsim.fit(rigidsim.parse(text))
    assert not found.converged
    assert any("refused: principal moments" in text and "I1 + I2 >= I3" in text for text in found.told)


def test_observations_that_are_given_twice_are_told(here: Path) -> None:
    rates(here, [1, 2, 2.5])
    text = LAMINA.replace("2, 3]", "2, 2.4]")
    once, twice = (rigidsim.fit(rigidsim.parse(text + n * RATES)) for n in (1, 2))
    assert not once.told
    assert any("data 1 and 2 have rows" in told and "(11)" in told for told in twice.told)


def test_a_prior_without_a_width_is_refused_for_that_alone(here: Path) -> None:
    rates(here, [1, 2, 2.5])
    text = LAMINA + 'prior."body.principal_moments[2]" = {sigma = 0}\n' + RATES
    with pytest.raises(ConfigError) as error:
        rigidsim.fit(rigidsim.parse(text))
    (problem,) = error.value.problems
    assert problem.where == '[fit] prior."body.principal_moments[2]"'
    assert "above zero" in problem.what


def test_units_in_the_names_of_columns_count(here: Path) -> None:
    rates(here, [1, 2, 2.5])
    rows = np.loadtxt("rates.csv", delimiter=",", skiprows=1)
    rows = np.column_stack([rows[:, 0] / 60, np.rad2deg(rows[:, 1:]), np.full(len(rows), np.rad2deg(1e-3))])
    names = ["t_min", "wx [deg/s]", "wy [deg/s]", "wz [deg/s]", "s [deg/s]"]
    np.savetxt("degrees.csv", rows, "%.17g", ",", header=",".join(names), comments="")
    told = RATES.replace("rates.csv", "degrees.csv").replace('["x", "y", "z"]', str(names[1:4]))
    told = told.replace("sigma = 1e-3", 'sigma = "s [deg/s]"\ntime = "t_min"')
    text = LAMINA.replace("2, 3]", "2, 2.4]")
    one, other = (rigidsim.fit(rigidsim.parse(text + data)) for data in (RATES, told))
    assert other.value("body.principal_moments[2]") == pytest.approx(2.5, abs=1e-9)
    assert other.sigma("body.principal_moments[2]") == pytest.approx(one.sigma("body.principal_moments[2]"))


def test_columns_in_several_units_are_refused(here: Path) -> None:
    (here / "mixed.csv").write_text("time,a_deg_s,b_rad_s,c_rad_s\n1,1,1,1\n2,1,2,1\n")
    data = RATES.replace("rates.csv", "mixed.csv").replace('"x", "y", "z"', '"a_deg_s", "b_rad_s", "c_rad_s"')
    with pytest.raises(ConfigError, match=r"columns in several units \(deg/s, rad/s\)"):
        rigidsim.fit(rigidsim.parse(LAMINA + data))


def test_single_precision_which_would_tell_moments_apart_by_rounding_is_refused() -> None:
    text = LAMINA.replace("[fit]", '[integrator]\nprecision = "single"\n[fit]') + RATES
    with pytest.raises(ConfigError, match=r"\[integrator\] precision: .*\"double\" is allowed"):
        rigidsim.fit(rigidsim.parse(text))


@pytest.mark.parametrize("sigma", ["1e300", "1e-300", "0", "inf", "nan"])
def test_a_sigma_whose_square_is_no_number_is_refused(here: Path, sigma: str) -> None:
    rates(here, [1, 2, 2.5])
    with pytest.raises(ConfigError, match=r"sigma: given .*; a standard deviation above zero|finite"):
        rigidsim.fit(rigidsim.parse(LAMINA + RATES.replace("1e-3", sigma)))
