"""Phobos' ready scene beside the planar equation of motion."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from experiments import phobos_and_vesta as study
from experiments.common import simulate


def test_phobos_turns_as_the_planar_equation_says() -> None:
    """a'' = -(3/2) (B - A)/C G M/r^3 sin 2(a - f) on the ellipse; over 70 rad."""
    result = simulate(study.PHOBOS, "output.record=['quaternion']", "output.estimate=false", "time.end=4 day")
    days, q = result.values("time") / study.DAY, result.values("quaternion")
    e, pull = study.ECCENTRICITY, 1.5 * study.GAMMA * study.MARS / study.AXIS**3 * study.DAY**2

    def rates(day: float, state: np.ndarray) -> list[float]:
        mean = study.ANOMALISTIC * day
        eccentric = mean
        for _ in range(12):
            eccentric -= (eccentric - e * math.sin(eccentric) - mean) / (1 - e * math.cos(eccentric))
        seen = 2 * math.atan(math.sqrt((1 + e) / (1 - e)) * math.tan(eccentric / 2))
        seen += math.radians(0.435227) * day
        near = (1 - e * math.cos(eccentric)) ** 3
        return [state[1], -pull / near * math.sin(2 * (state[0] - seen))]

    spin = math.radians(1107.03)
    truth = solve_ivp(rates, (0, 4), [0, spin], "DOP853", days, rtol=1e-13, atol=1e-13).y[0]
    turned = np.unwrap(2 * np.arctan2(q[:, 3], q[:, 0]))
    assert np.abs(turned - truth).max() < 1e-11


@pytest.mark.slow
def test_a_year_of_vesta_nods_by_two_arcseconds() -> None:
    settings = ("output.record=['obliquity']", "output.estimate=false", "time.end=1325.5 day")
    values = simulate(study.VESTA, *settings).dataset["obliquity"].sel(axis="figure").values
    assert np.ptp(values) / study.MAS == pytest.approx(2 * 2086, rel=0.2)
