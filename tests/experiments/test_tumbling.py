"""Periods of many tumbling bodies at once, and the members that a Monte Carlo draws of Apophis."""

from __future__ import annotations

import tomllib

import mpmath
import numpy as np
import pytest

from experiments import apophis_flyby as apophis
from experiments.closed_forms import free_top
from experiments.tumbling import excitation_of, tumbling_of


def test_periods_are_those_of_the_closed_form() -> None:
    moments = np.array([[1.0, 2.0, 2.5], [0.61, 0.965, 1.0], [1.0, 1.5, 2.0]])
    rates = np.array([[0.2, 0.3, 1.0], [0.05, -0.1, 1.2], [1.0, 0.2, 0.1]])
    found = tumbling_of(moments, rates)
    assert found.short.tolist() == [True, True, False]
    for i in range(3):
        told = free_top([mpmath.mpf(x) for x in moments[i]], [mpmath.mpf(x) for x in rates[i]])
        assert found.rotation[i] == pytest.approx(float(told.period), rel=1e-13)
        assert found.precession[i] == pytest.approx(float(2 * mpmath.pi / abs(told.precession)), rel=1e-13)
        assert found.momentum[i] == pytest.approx(float(told.momentum), rel=1e-15)


def test_the_published_ratios_and_periods_of_apophis_have_the_published_excitation() -> None:
    found = excitation_of(np.array([[0.61, 0.965, 1.0]]), np.array([263 / 27.38]))
    assert found[0] == pytest.approx(1.024, abs=0.0005)  # its last digit; Pravec et al. 2014
    assert np.isnan(excitation_of(np.array([[0.61, 0.965, 1.0]]), np.array([5.0]))[0])  # faster than any


def test_the_ready_config_holds_the_first_members_that_the_study_draws() -> None:
    drawn, ready = apophis.draws(16), tomllib.loads(apophis.CONFIG.read_text())
    axes = ready["sweep"]["axes"]
    moments = np.array(axes["body.principal_moments"]["values"]) / apophis.LARGEST_MOMENT
    assert moments == pytest.approx(drawn.moments, rel=1e-11)
    rates = np.array(axes["initial.angular_velocity"]["values"])
    assert rates == pytest.approx(drawn.rates, rel=1e-9, abs=1e-15)  # 12 digits of each; bisection
    attitudes = np.array(axes["initial.quaternion"]["values"])
    assert attitudes == pytest.approx(drawn.quaternions, abs=1e-9)
    place, speed = apophis.hyperbola(-apophis.DAYS * 86400)
    assert ready["initial"]["position"] == pytest.approx(place.tolist(), rel=1e-11)
    assert ready["initial"]["velocity"] == pytest.approx(speed.tolist(), rel=1e-11)
    periods = tumbling_of(drawn.moments, rates)
    assert periods.rotation / 3600 == pytest.approx(np.full(16, 263.0), abs=3 * 6 / 3)


def test_the_hyperbola_passes_where_and_as_fast_as_horizons_says() -> None:
    place, speed = apophis.hyperbola(0.0)
    assert np.linalg.norm(place) == pytest.approx(3.801148649e7, rel=1e-12)
    assert np.linalg.norm(speed) == pytest.approx(7422.49, abs=0.05)  # CNEOS close approaches: 7.42249 km/s
    far = np.linalg.norm(apophis.hyperbola(86400 * 1e4)[1])
    assert far == pytest.approx(5841.36, abs=0.5)  # the same table: 5.84136 km/s at infinity
