"""Fits of recorded angles for labels: mean rates, secular parts and the leading ellipse.

Quick estimates for labels and for removing trends; `rigidsim analyse` has the digits.
"""

from dataclasses import dataclass

import numpy as np

from rigidsim.look.solids import Array

_TURN = 2 * np.pi
_LINES, _ENOUGH = 4, 64  # sinusoids that are fitted beside a straight line, to so many samples or more
_REFINEMENTS, _LEAST_CYCLES = 6, 1.2  # of the lines' frequencies; fewer cycles are like a straight line
_UNIFORM = 0.1  # by which the rates of both halves of a run may differ: swings within a turn do so, too


@dataclass(frozen=True)
class SecularLine:
    """The secular part of an angle, ``at_start + rate * (t - t[0])``."""

    at_start: float
    rate: float
    start: float

    def at(self, time: Array) -> Array:
        """Values (rows,) at given times."""
        return np.asarray(self.at_start + self.rate * (time - self.start))


def secular(time: Array, angle: Array, *, level: bool = False) -> SecularLine:
    """Straight line through an angle (rows,) that swings about it; if `level`, only its mean.

    Evenly sampled, its strongest sinusoids of at least 1.5 periods are fitted with it, their periods too, so
    that a broken swing at the ends doesn't tilt it; all is weighted by a Hann window.
    """
    finite = np.isfinite(angle)
    t, y = time[finite], angle[finite]
    if len(t) < 3 or t[-1] == t[0]:
        return SecularLine(float(y.mean()) if len(y) else 0.0, 0.0, float(time[0]) if len(time) else 0.0)
    s = (t - t[0]) / (t[-1] - t[0])
    weight = np.sin(np.pi * s) ** 2 * np.gradient(s)
    weight /= weight.sum()
    columns = [np.ones_like(s)] if level else [np.ones_like(s), s - 0.5]
    polynomial, lines = len(columns), list[float]()
    root = np.sqrt(weight)
    middle = float(y[len(y) // 2])  # large angles lose fewer digits
    found = _solve(columns, y - middle, root)
    if len(t) >= _ENOUGH and np.ptp(np.diff(t)) < 1e-3 * (s[1] * (t[-1] - t[0])):
        for _ in range(_LINES):
            rest = y - middle - np.stack(columns, axis=1) @ found
            cycles = _peak(rest * weight)
            if cycles is None:
                break
            lines.append(cycles)
            columns = [*columns[:polynomial], *_sinusoids(lines, s)]
            found = _solve(columns, y - middle, root)
        found = _refined(columns[:polynomial], lines, found, s, y - middle, root)
    slope = 0.0 if level else float(found[1])
    rate = slope / (t[-1] - t[0])
    return SecularLine(middle + float(found[0]) - slope * 0.5 + rate * (time[0] - t[0]), rate, float(time[0]))


def _sinusoids(lines: list[float], s: Array) -> list[Array]:
    """Cosine and sine of each line, of so many cycles over the whole."""
    return [wave(2 * np.pi * cycles * s) for cycles in lines for wave in (np.cos, np.sin)]


def _refined(
    base: list[Array], lines: list[float], found: Array, s: Array, values: Array, root: Array
) -> Array:
    """Coefficients with the frequencies fitted as well (Gauss-Newton): lines pull at each other's peaks."""

    def misfit(columns: list[Array], coefficients: Array) -> float:
        return float(np.linalg.norm(root * (values - np.stack(columns, axis=1) @ coefficients)))

    if not lines:
        return found
    left = misfit([*base, *_sinusoids(lines, s)], found)
    for _ in range(_REFINEMENTS):
        waves = _sinusoids(lines, s)
        a, b = found[len(base) :: 2], found[len(base) + 1 :: 2]
        slopes = [2 * np.pi * s * (b[k] * waves[2 * k] - a[k] * waves[2 * k + 1]) for k in range(len(lines))]
        shifts = _solve([*base, *waves, *slopes], values, root)[-len(lines) :]
        moved = [c + float(np.clip(d, -0.5, 0.5)) for c, d in zip(lines, shifts, strict=True)]
        columns = [*base, *_sinusoids(moved, s)]
        better = _solve(columns, values, root)
        now = misfit(columns, better)
        if not now < left or min(moved) < _LEAST_CYCLES:
            break
        lines, found, left = moved, better, now
    return found


def _solve(columns: list[Array], values: Array, root: Array) -> Array:
    return np.asarray(
        np.linalg.lstsq(np.stack(columns, axis=1) * root[:, None], values * root, rcond=None)[0]
    )


def _peak(windowed: Array) -> float | None:
    """Cycles over the whole series of the strongest sinusoid; None if it has less than 1.5."""
    padded = 8 * len(windowed)
    power = np.abs(np.fft.rfft(windowed, padded)) ** 2
    k = int(power[1:-1].argmax()) + 1
    if k < 12 or power[k] == 0:
        return None
    return _maximum(power, k) * (len(windowed) - 1) / padded


def _maximum(power: Array, k: int) -> float:
    """Place of the maximum next to index k, by the parabola through three logarithms."""
    left, mid, right = np.log(power[k - 1 : k + 2] + 1e-300)
    bend = left - 2 * mid + right
    shift = 0.5 * (left - right) / bend if bend < 0 else 0.0
    return k + float(np.clip(shift, -0.5, 0.5))


def circulation(time: Array, plane: Array) -> float | None:
    """Mean rate, rad/s, at which a point of a plane (rows, 2) goes about the origin; counterclockwise > 0.

    None if it doesn't, completes less than one turn, keeps speeding up or slowing down, or was sampled too
    sparsely to tell.
    """
    finite = np.isfinite(plane).all(axis=1)
    phase = np.arctan2(plane[finite, 1], plane[finite, 0])
    steps = np.diff(phase)
    steps -= _TURN * np.round(steps / _TURN)
    if len(steps) < 4 or np.abs(steps).max() > 0.9 * np.pi:
        return None
    angle = np.concatenate([[0.0], np.cumsum(steps)])
    if abs(angle[-1]) < 0.95 * _TURN:
        return None
    half = len(angle) // 2
    rates = [secular(time[finite][part], angle[part]).rate for part in (slice(half), slice(half, None))]
    if abs(rates[0] - rates[1]) > _UNIFORM * max(map(abs, rates)):
        return None
    return secular(time[finite], angle).rate or None


@dataclass(frozen=True)
class FittedEllipse:
    """``forward exp(i w t) + backward exp(-i w t)`` from the first sample on; `rate` is w > 0, rad/s."""

    forward: complex
    backward: complex
    rate: float

    @property
    def semi_axes(self) -> tuple[float, float]:
        """The larger and the smaller semi-axis."""
        a, b = abs(self.forward), abs(self.backward)
        return a + b, abs(a - b)

    def curve(self, points: int = 181) -> Array:
        """Points once around it, (points, 2)."""
        phase = np.exp(1j * np.linspace(0.0, _TURN, points))
        z = self.forward * phase + self.backward / phase
        return np.stack([z.real, z.imag], axis=1)


def leading_ellipse(time: Array, plane: Array) -> FittedEllipse | None:
    """The strongest periodic part of a point's motion in a plane (rows, 2), evenly sampled; None if it has
    less than 1.5 periods in the run, or none stands out.
    """
    steps = np.diff(time)
    if len(time) < 16 or not np.isfinite(plane).all() or np.ptp(steps) > 1e-3 * steps.mean():
        return None
    z = plane[:, 0] + 1j * plane[:, 1]
    z = z - z.mean()
    middle = (time - time.mean()) / (time[-1] - time[0])
    trend = middle * (middle @ z) / (middle @ middle)  # of a slower swing that the run has a part of
    window = np.sin(np.pi * (np.arange(len(z)) + 0.5) / len(z)) ** 2
    padded = 8 * len(z)
    power = np.abs(np.fft.fft((z - trend) * window, padded)) ** 2
    frequencies = np.fft.fftfreq(padded, steps.mean())
    both = power[1 : padded // 2] + power[:0:-1][: padded // 2 - 1]
    k = int(both.argmax()) + 1
    span = time[-1] - time[0]
    if abs(frequencies[k]) * span < 1.5 or k >= padded // 2 - 2:
        return None
    rate = _TURN * (_maximum(both, k - 1) + 1) / (padded * steps.mean())
    wave = np.exp(1j * rate * (time - time[0]))
    basis = np.stack([wave, wave.conj(), np.ones_like(wave), middle, middle**2], axis=1)
    found, *_ = np.linalg.lstsq(basis, z, rcond=None)
    return FittedEllipse(complex(found[0]), complex(found[1]), float(rate))
