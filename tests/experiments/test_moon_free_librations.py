"""The fits of free librations, on motions made of them."""

import math

import numpy as np
import pytest

from experiments.real_bodies import free_librations as free


def test_the_three_periods_are_found() -> None:
    """With monthly lines, a drift, and harmonics of the node beside them."""
    days = np.arange(0, 54000, 8.0)
    month = 2 * math.pi * days / free.MONTH

    def line(period: float, size: float, phase: float = 0.3) -> np.ndarray:
        return size * np.cos(2 * math.pi * days / period + phase)

    body = np.stack(
        [line(27260, 60) + 20 * np.sin(month), line(27260, 24, 1.87) + 20 * np.cos(month), line(1056.1, 95)],
        axis=1,
    )
    assert free.longitude(days, body) == pytest.approx(1056.1, abs=0.01)
    period, ratio = free.wobble(days, body)
    assert period == pytest.approx(27260, abs=1)
    assert ratio == pytest.approx(2.5, abs=1e-3)
    turning = np.exp(-2j * math.pi * days / 29500)
    turning = 60 * turning * (1 + 0.02 * np.exp(2j * math.pi * days / free.NODE)) + 20 * np.exp(1j * month)
    c, s = math.cos(free.ECLIPTIC), math.sin(free.ECLIPTIC)
    space = np.stack([turning.real, c * turning.imag, s * turning.imag], axis=1)
    assert free.latitude(days, space) == pytest.approx(1 / (-1 / 29500 - 1 / free.NODE), abs=1)


def test_the_start_is_de421s() -> None:
    pytest.importorskip("de421")
    from experiments import moon_free_librations as study

    attitude, rates = study.start()
    assert attitude.T @ attitude == pytest.approx(np.eye(3), abs=1e-14)
    assert np.linalg.norm(rates) == pytest.approx(0.22997, abs=2e-4)
    assert study.circular()[0] == pytest.approx(1045.3, abs=0.1)
