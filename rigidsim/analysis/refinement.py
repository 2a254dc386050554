"""Newton's method for a sum of lines and a polynomial: all frequencies, amplitudes and coefficients at once.

The steps are computed in double precision, the remainder in the signal's own; see ``decomposition``.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rigidsim.analysis.exponentials import Complexes, Grid, Reals, Sum
from rigidsim.analysis.windows import hann, moments, positions

_MOST_STEPS = 25
CLOSEST = 0.6  # bins between lines below which Newton's method can't separate them


@dataclass(frozen=True)
class SignalSamples:
    """Equidistant samples of a signal: real and imaginary parts (n,), summed over the list.

    The mpmath context has more than the precision's bits. By so much of a spacing samples are late, (n,):
    times are rounded, in a pattern that would show up as lines.
    """

    parts: tuple[tuple[Reals, Reals], ...]
    real: bool
    bits: int
    context: Any
    late: Reals | None = None

    @property
    def count(self) -> int:
        """Number of samples."""
        return len(self.parts[0][0])


def mirrored(total: Sum, real: bool) -> Sum:
    """The sum together with the mirror images of a real signal's lines."""
    if not real:
        return total
    context = total.context
    return replace(
        total,
        frequencies=(*total.frequencies, *(-f for f in total.frequencies)),
        amplitudes=(*total.amplitudes, *(context.conj(a) for a in total.amplitudes)),
    )


def apart(distance: Reals, count: int) -> Reals:
    """Distances of frequencies, in bins, on the circle of ``count`` bins."""
    return np.asarray(distance - count * np.round(distance / count))


def folded(total: Sum) -> Sum:
    """The sum with frequencies within half a turn per sample.

    A whole turn per sample changes nothing at whole numbers, but samples are counted from the middle: of an
    even count by halves, where each turn changes the sign.
    """
    turns = [int(total.context.nint(f)) if abs(f) > 0.5 else 0 for f in total.frequencies]
    if not any(turns):
        return total
    odd = [n * (total.count - 1) % 2 for n in turns]
    return replace(
        total,
        frequencies=tuple(f - n for f, n in zip(total.frequencies, turns, strict=True)),
        amplitudes=tuple(-a if o else a for a, o in zip(total.amplitudes, odd, strict=True)),
    )


def remainder(samples: SignalSamples, total: Sum) -> Complexes:
    """The remainder of a signal, in double precision."""
    whole = mirrored(total, samples.real)
    left = whole.left_of(samples.parts, samples.bits)
    if samples.late is not None and samples.bits <= 53 and (whole.frequencies or whole.polynomial):
        left = left - samples.late * whole.slope().values()
    return np.asarray(left.real + 0j if samples.real else left, dtype=np.complex128)


def settled(samples: SignalSamples, total: Sum, order: int) -> Sum:
    """The refined sum; lines that come too close to Nyquist's frequency are held there (``at_nyquist``)."""
    held = -1
    while (now := sum(at_nyquist(total, samples.real))) > held:
        held = now
        total = _held(folded(refined(samples, total, order)), samples.real)
    return total


def at_nyquist(total: Sum, real: bool) -> list[bool]:
    """Which lines stand for what is too near Nyquist's frequency to be separated from its mirror image.

    There a real signal only shows the line's amplitude times the cosine of its phase.
    """
    return [real and f == 0.5 for f in total.frequencies]


def _held(total: Sum, real: bool) -> Sum:
    """The sum with lines near Nyquist's frequency moved to it, with the amplitude that the samples show."""
    context, count = total.context, total.count
    frequencies, amplitudes = list(total.frequencies), list(total.amplitudes)
    for n, (frequency, amplitude) in enumerate(zip(frequencies, amplitudes, strict=True)):
        if real and 2 * abs(0.5 - abs(frequency)) * count < CLOSEST:
            amplitude = context.conj(amplitude) if frequency < 0 else amplitude
            frequencies[n] = context.mpf(0.5)
            # the exponential is real at samples counted by whole numbers, imaginary at those by halves
            amplitudes[n] = context.mpc(amplitude.real, 0) if count % 2 else context.mpc(0, amplitude.imag)
    return replace(total, frequencies=tuple(frequencies), amplitudes=tuple(amplitudes))


def refined(samples: SignalSamples, total: Sum, order: int, steps: int = _MOST_STEPS) -> Sum:
    """Apply Newton's method to a sum as long as it improves."""
    if not total.frequencies and not total.polynomial:
        return total
    last = math.inf
    for _ in range(steps):
        left = remainder(samples, total)
        change, moved, size = _step(samples, total, left, order)
        if not size < 0.7 * last and steps == _MOST_STEPS and last < 1e-3:
            break  # the last step was rounding already
        total, last = moved, size
        if change == 0:
            break
    return total


def _step(samples: SignalSamples, total: Sum, left: Complexes, order: int) -> tuple[float, Sum, float]:
    """The largest change of an amplitude, the sum after the step, and the step's size over the signal's."""
    context, count = total.context, total.count
    whole = mirrored(total, samples.real)
    lines, powers = len(whole.frequencies), len(whole.polynomial)
    right = _products(whole, left, order)
    matrix = _gram(whole, order)
    found = np.linalg.lstsq(matrix, right, rcond=1e-12)[0]
    polynomial = found[:powers]
    change, turning = found[powers : powers + lines], found[powers + lines :]
    own = lines // 2 if samples.real else lines
    held = at_nyquist(total, samples.real)
    frequencies, amplitudes = [], []
    for k in range(own):
        amplitude = complex(whole.amplitudes[k])
        # a exp(i pi D x), D in bins: the change with D is i pi x a exp(...)
        shift = (turning[k] / amplitude).imag / math.pi if amplitude and not held[k] else 0.0
        shift = float(np.clip(shift, -0.5, 0.5))
        frequencies.append(total.frequencies[k] + context.mpf(shift) / count)
        amplitudes.append(total.amplitudes[k] + context.mpc(complex(change[k])))
    coefficients = [
        c + context.mpc(complex(x.real if samples.real else x))
        for c, x in zip(total.polynomial, polynomial, strict=True)
    ]
    largest = max([abs(complex(a)) for a in (*amplitudes, *coefficients)], default=0.0)
    size = float(np.max(np.abs(found), initial=0.0))
    moved = replace(
        total,
        polynomial=tuple(coefficients),
        frequencies=tuple(frequencies),
        amplitudes=tuple(amplitudes),
    )
    return size, moved, size / largest if largest else 0.0


def _products(total: Sum, left: Complexes, order: int) -> Complexes:
    """Windowed means of a remainder times powers of x, conj(exp(i w t)) and x conj(exp(i w t))."""
    count = total.count
    x = positions(count)
    weighted = left * hann(count, order) / count
    powers = [np.sum(weighted * x**m) for m in range(len(total.polynomial))]
    if not total.frequencies:
        return np.array(powers, dtype=np.complex128)
    grid = Grid(count)
    first, within = grid.tables(total.frequencies)
    inner = [
        np.sum(np.conj(first) * (grid.blocks(values) @ np.conj(within)), axis=0)
        for values in (weighted, weighted * x)
    ]
    return np.concatenate([np.array(powers, dtype=np.complex128), *inner])


def _gram(total: Sum, order: int) -> Complexes:
    """Approximate windowed means of the products of all columns; the next step corrects the approximation."""
    count = total.count
    places = np.array([float(f) for f in total.frequencies]) * count
    powers, lines = len(total.polynomial), len(places)
    places = np.concatenate([np.zeros(powers), places, places])
    raised = np.concatenate([np.arange(powers), np.zeros(lines, int), np.ones(lines, int)])
    distance = places[None, :] - places[:, None]
    turns = np.round(distance / count)  # frequencies are on a circle: see ``apart`` and ``folded``
    power = raised[None, :] + raised[:, None]
    matrix = np.zeros(distance.shape, dtype=np.complex128)
    for m in np.unique(power):
        chosen = power == m
        matrix[chosen] = moments(order, int(m), (distance - turns * count)[chosen])
    return np.where(turns * (count - 1) % 2, -matrix, matrix)


def error_growth(total: Sum, order: int) -> Reals:
    """Factor by which the error of each column's coefficient exceeds a lone column's."""
    matrix = _gram(total, order)
    if not len(matrix):
        return np.empty(0)
    inverse = np.linalg.pinv(matrix, rcond=1e-12, hermitian=True)
    return np.sqrt(np.maximum(np.diag(inverse).real * np.diag(matrix).real, 1.0))
