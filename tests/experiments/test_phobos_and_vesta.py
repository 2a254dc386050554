"""Vesta's ready scene beside the published nutation."""

import numpy as np
import pytest

from experiments import phobos_and_vesta as study
from experiments.common import simulate


@pytest.mark.slow
def test_a_year_of_vesta_nods_by_two_arcseconds() -> None:
    settings = ("output.record=['obliquity']", "output.estimate=false", "time.end=1325.5 day")
    values = simulate(study.VESTA, *settings).dataset["obliquity"].sel(axis="figure").values
    assert np.ptp(values) / study.MAS == pytest.approx(2 * 2086, rel=0.2)
