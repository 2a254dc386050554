"""Fits as nobody means them: data given twice, estimates at a wall, priors that are none."""

from pathlib import Path

import numpy as np
import pytest

import rigidsim
from rigidsim.errors import ConfigError

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


REFUSED = {
    "no width": (RATES.replace("1e-3", "inf"), r"sigma: given .*; a standard deviation above zero|finite"),
    "no square": (
        RATES.replace("1e-3", "1e-300"),
        r"sigma: given .*; a standard deviation above zero|finite",
    ),
    "a prior without a width": (
        'prior."body.principal_moments[2]" = {sigma = 0}\n' + RATES,
        r'prior\."body\.principal_moments\[2\]": .*above zero',
    ),
    "units": (
        RATES.replace("rates.csv", "mixed.csv").replace('"x", "y", "z"', '"a_deg_s", "b_rad_s", "c_rad_s"'),
        r"columns in several units \(deg/s, rad/s\)",
    ),
}


def test_what_no_fit_can_be_made_of_is_refused(here: Path) -> None:
    rates(here, [1, 2, 2.5])
    (here / "mixed.csv").write_text("time,a_deg_s,b_rad_s,c_rad_s\n1,1,1,1\n2,1,2,1\n")
    for more, message in REFUSED.values():
        with pytest.raises(ConfigError, match=message) as error:
            rigidsim.fit(rigidsim.parse(LAMINA + more))
        assert len(error.value.problems) == 1
    # rounding would tell moments apart
    single = LAMINA.replace("[fit]", '[integrator]\nprecision = "single"\n[fit]') + RATES
    with pytest.raises(ConfigError, match=r"\[integrator\] precision: .*\"double\" is allowed"):
        rigidsim.fit(rigidsim.parse(single))
