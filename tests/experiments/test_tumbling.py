"""Periods of many tumbling bodies at once, and the members that a Monte Carlo draws of Apophis."""

import mpmath
import numpy as np
import pytest

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
