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
from rigidsim.analysis.result import SignalAnalysis, SpectralLine
from rigidsim.errors import RigidsimError
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
    """The time that a mean motion needs for a turn, to at most five digits, as many as its error leaves."""
    sure = abs(mean.rate) / max(mean.error, 1e-9 * abs(mean.rate))
    digits = int(np.clip(math.log10(max(sure, 1.0)), 2, 5))
    return mean.about + period_text(_TURN / abs(mean.rate), attributes, digits)


def secular(time: Array, angle: Array) -> SecularLine:
    """The secular part of an angle (rows,), rad, that swings about it, at times in s."""
    found = _analysed(time, angle)
    if found is not None:
        rows = _even(time)
        middle = (time[rows][0] + time[rows][-1]) / 2
        return SecularLine(
            float(found.value.real), float(found.rate.real), float(middle), True, found.rate_error
        )
    finite = np.isfinite(angle)
    t, y = time[finite], angle[finite]
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


def circulation(time: Array, plane: Array) -> SecularLine | None:
    """The mean motion of a point of a plane (rows, 2) about the origin; counterclockwise > 0. Its error is
    what a narrower window makes of it.

    None if it doesn't go round, completes less than one turn, keeps speeding up or slowing down, or was
    sampled too sparsely to decide.
    """
    finite = np.isfinite(plane).all(axis=1)
    phase = np.arctan2(plane[finite, 1], plane[finite, 0])
    steps = np.diff(phase)
    steps -= _TURN * np.round(steps / _TURN)
    if len(steps) < 4 or np.abs(steps).max() > 0.9 * np.pi:
        return None
    angle = phase[0] + np.concatenate([[0.0], np.cumsum(steps)])
    if abs(angle[-1] - angle[0]) < 0.95 * _TURN:
        return None
    time, half = time[finite], len(angle) // 2
    rates = [_mean_rate(time[part], angle[part]) for part in (slice(half), slice(half, None))]
    if abs(rates[0] - rates[1]) > _UNIFORM * max(map(abs, rates)):
        return None
    rate, narrower = _mean_rate(time, angle), _mean_rate(time, angle, 2.0)
    middle = (time[0] + time[-1]) / 2
    value = float(np.mean(angle - rate * (time - middle)))
    return SecularLine(value, rate, float(middle), True, abs(rate - narrower)) if rate else None


def _mean_rate(time: Array, angle: Array, power: float = 1.0) -> float:
    """The mean rate of an angle that swings about its mean motion, weighted by a bump function: the swings'
    share falls faster than any power of their number (Das & Yorke 2018, Nonlinearity 31, 491).
    """
    place = ((time[1:] + time[:-1]) / 2 - time[0]) / (time[-1] - time[0])
    weight = np.exp(-power / (place * (1 - place)))
    return float(weight @ np.diff(angle) / (weight @ np.diff(time)))


@dataclass(frozen=True)
class FittedEllipse:
    """``across cos(w t) ...``: complex amplitudes of both coordinates of a point, and w > 0, rad/s."""

    across: complex
    up: complex
    rate: float

    @property
    def semi_axes(self) -> tuple[float, float]:
        """The larger and the smaller semi-axis."""
        a, b = abs(self.across + 1j * self.up) / 2, abs(self.across - 1j * self.up) / 2
        return a + b, abs(a - b)

    def curve(self, points: int = 181) -> Array:
        """Points once around it, (points, 2)."""
        phase = np.exp(1j * np.linspace(0.0, _TURN, points))
        return np.stack([(self.across * phase).real, (self.up * phase).real], axis=1)


def leading_ellipse(time: Array, longitude: Array, latitude: Array, shortened: float) -> FittedEllipse | None:
    """The strongest line of a pole's longitude, `shortened` by the sine of its obliquity, and latitude
    together (rows,), rad; None if neither has a line of 1.5 periods in the run, or they can't be analysed.
    """
    found = [_analysed(time, angle) for angle in (longitude, latitude)]
    if found[0] is None or found[1] is None:
        return None
    span = abs(time[-1] - time[0])
    lines = [
        (scale * float(line.amplitude), line)
        for signal, scale in zip(found, (shortened, 1.0), strict=True)
        if signal is not None
        for line in signal.lines
        if float(line.frequency) * span > _LEAST_CYCLES * _TURN
    ]
    if not lines:
        return None
    rate = float(max(lines, key=lambda one: one[0])[1].frequency)

    def part(signal: SignalAnalysis) -> complex:
        near = [x for x in signal.lines if abs(float(x.frequency) - rate) * span < _TURN / 2]
        return sum((_complex(x) for x in near[:1]), 0j)

    return FittedEllipse(shortened * part(found[0]), part(found[1]), rate)


def _complex(line: SpectralLine) -> complex:
    return complex(float(line.amplitude) * np.exp(1j * float(line.phase)))
