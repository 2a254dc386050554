"""Mean motions, circulations and leading ellipses of recorded angles, as `analysis` finds them.

Pictures and ``rigidsim analyse`` thus have one source of rates and periods. Samples that can't be analysed
(few, uneven, with gaps) have a straight line taken off, whose rate is only said to be about right.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import xarray

from rigidsim.analysis.analyse import analyse_dataset
from rigidsim.analysis.result import SignalAnalysis
from rigidsim.errors import RigidsimError
from rigidsim.look.signals import need, optional
from rigidsim.look.solids import Array
from rigidsim.scene.readable import period_text

_TURN = 2 * np.pi
_LINES = 6  # that free a rate from swings to more digits than pictures show
_UNIFORM = 0.1  # by which the rates of both halves of a run may differ: swings within a turn do so, too
_LEAST_CYCLES = 1.5  # of a swing that an ellipse is drawn of


@dataclass(frozen=True)
class SecularLine:
    """The secular part of an angle, ``value + rate * (t - middle)``; `known`, with the rate's `error`, unless
    it is a straight line through samples that can't be analysed.
    """

    value: float
    rate: float
    middle: float
    known: bool
    error: float = 0.0

    def at(self, time: Array) -> Array:
        """Values (rows,) at given times."""
        return np.asarray(self.value + self.rate * (time - self.middle))

    @property
    def about(self) -> str:
        """What stands before its rate in a text."""
        return "" if self.known else "about "


def turn_text(mean: SecularLine, attributes: Mapping[str, Any]) -> str:
    """The time that a mean motion needs for a turn, to at most five digits, as many as its error leaves;
    "about" so long if these are fewer than three.
    """
    digits = math.log10(abs(mean.rate) / max(mean.error, 1e-9 * abs(mean.rate)))
    about = "about " if digits < 3 or not mean.known else ""
    return about + period_text(_TURN / abs(mean.rate), attributes, int(np.clip(digits, 3, 5)))


def secular(time: Array, angle: Array) -> SecularLine:
    """The secular part of an angle (rows,), rad, that swings about it, at times in s."""
    found = _analysed(time, angle)
    if found is not None:
        rows = _even(time)
        middle = (time[rows][0] + time[rows][-1]) / 2
        return SecularLine(
            float(found.value.real), float(found.rate.real), float(middle), True, found.rate_error
        )
    known = np.isfinite(angle)
    t, y = time[known], angle[known]
    if len(t) < 3 or t[-1] == t[0]:
        return SecularLine(float(y.mean()) if len(y) else 0.0, 0.0, 0.0, False)
    middle = (t[0] + t[-1]) / 2
    rate, value = np.polyfit(t - middle, y, 1)
    return SecularLine(float(value), float(rate), float(middle), False)


def _even(time: Array) -> slice:
    """Rows that are equidistant: of thinned ones the last can be closer to the one before."""
    uneven = len(time) > 2 and abs((time[-1] - time[-2]) / (time[1] - time[0]) - 1) > 1e-6
    return slice(None, -1 if uneven else None)


def _analysed(time: Array, angle: Array) -> SignalAnalysis | None:
    rows = _even(time)
    return _analysis_of(time[rows].tobytes(), angle[rows].tobytes())


@lru_cache(maxsize=16)  # panels share their angles
def _analysis_of(time: bytes, angle: bytes) -> SignalAnalysis | None:
    angles = xarray.DataArray(np.frombuffer(angle), dims="time", attrs={"units": "rad"})
    dataset = xarray.Dataset({"angle": angles}, {"time": np.frombuffer(time)})
    try:
        return analyse_dataset(dataset, lines=_LINES)["angle"]
    except RigidsimError:
        return None


@optional
def circulation(time: Array, plane: Array) -> SecularLine:
    """The mean motion of a point of a plane (rows, 2) about the origin; counterclockwise > 0. Its error is
    what a narrower window makes of it.

    None if it doesn't go round, completes less than one turn, keeps speeding up or slowing down, or was
    sampled too sparsely to decide.
    """
    finite = np.isfinite(plane).all(axis=1)
    time, angle = time[finite], np.unwrap(np.arctan2(plane[finite, 1], plane[finite, 0]))
    need(len(angle) > 4 and np.abs(np.diff(angle)).max() <= 0.9 * np.pi)
    need(abs(angle[-1] - angle[0]) >= 0.95 * _TURN)
    half = len(angle) // 2
    rates = [_mean_rate(time[part], angle[part]) for part in (slice(half), slice(half, None))]
    need(abs(rates[0] - rates[1]) <= _UNIFORM * max(map(abs, rates)))
    rate, narrower = _mean_rate(time, angle), _mean_rate(time, angle, 2.0)
    need(rate != 0)
    return SecularLine(0.0, rate, 0.0, True, abs(rate - narrower))


def _mean_rate(time: Array, angle: Array, power: float = 1.0) -> float:
    """The mean rate of an angle that swings about its mean motion, weighted by a bump function: the swings'
    share falls faster than any power of their number (Das & Yorke 2018, Nonlinearity 31, 491).
    """
    place = ((time[1:] + time[:-1]) / 2 - time[0]) / (time[-1] - time[0])
    weight = np.exp(-power / (place * (1 - place)))
    # summed without BLAS, whose threads take a hundred times as long
    return float((weight * np.diff(angle)).sum() / (weight * np.diff(time)).sum())


@optional
def leading_ellipse(
    time: Array, longitude: Array, latitude: Array, shortened: float
) -> tuple[Array, tuple[float, float], float]:
    """The strongest line of a pole's longitude, `shortened` by the sine of its obliquity, and latitude
    together (rows,), rad: points (181, 2) of the ellipse, its semi-axes, and its rate, rad/s. None if neither
    has a line of 1.5 periods in the run, or they can't be analysed.
    """
    found = [(need(_analysed(time, longitude)), shortened), (need(_analysed(time, latitude)), 1.0)]
    span = abs(time[-1] - time[0])
    sizes = {
        float(line.frequency): scale * float(line.amplitude)
        for signal, scale in found
        for line in signal.lines
        if float(line.frequency) * span > _LEAST_CYCLES * _TURN
    }
    need(bool(sizes))
    rate, amplitudes = max(sizes, key=lambda one: sizes[one]), []
    for signal, scale in found:
        near = (x for x in signal.lines if abs(float(x.frequency) - rate) * span < _TURN / 2)
        line = next(near, None)
        amplitudes.append(scale * float(line.amplitude) * np.exp(1j * float(line.phase)) if line else 0j)
    across, up = amplitudes
    a, b = abs(across + 1j * up) / 2, abs(across - 1j * up) / 2
    turn = np.exp(1j * np.linspace(0.0, _TURN, 181))
    return np.stack([(across * turn).real, (up * turn).real], axis=1), (a + b, abs(a - b)), rate
