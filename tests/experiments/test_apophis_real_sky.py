"""Apophis' ready scene beside another integration of its flight."""

import numpy as np
import pytest

pytest.importorskip("de421")
from experiments import apophis_real_sky as study
from experiments.common import simulate
from experiments.real_bodies import apophis


@pytest.mark.slow
def test_perigee_is_where_the_published_elements_have_it() -> None:
    """Forwards, from where DOP853 came backwards: 3 m are 1e-11 of the way, 1000 times grown."""
    settings = ("time.end=2 day", "time.every=1 day", "output.record=['position']", "output.estimate=false")
    place = simulate(study.SCENE, *settings).values("position")[-1] / 1e3
    expected = apophis.equatorial(study.flyby.hyperbola(0.0)[0]) / 1e3
    assert np.linalg.norm(place - expected) < 0.003
    assert np.linalg.norm(place) == pytest.approx(study.HORIZONS, abs=0.1)
