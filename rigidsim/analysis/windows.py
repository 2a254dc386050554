"""Hann windows of order p, their spectra, and the strongest line in one.

The window (1 + cos(pi x))^p on -1 < x < 1 (Laskar 1993, Physica D 67, 257; section 2.2) leaves of a line D
bins (of one turn over the whole length) away a share of p!^2 / (pi D^(2p+1)), at the price of a main lobe
that is p + 1 bins wide on either side.
"""

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_POINTS, _FINE = 1024, 1 << 17  # of the quadrature behind ``moments``
_REACH = 200.0  # bins beyond which lines don't feel each other while steps are computed
_ASIDE = 256  # spectral points to either side whose median is the noise next to a line


@lru_cache(maxsize=2)
def positions(count: int) -> Reals:
    """Positions of samples on -1 < x < 1."""
    x = (2.0 * np.arange(count) - (count - 1)) / count
    x.flags.writeable = False
    return np.asarray(x)


@lru_cache(maxsize=2)
def hann(count: int, order: int) -> Reals:
    """Hann window of an order at so many samples, with mean 1."""
    weights = (1 + np.cos(np.pi * positions(count))) ** order
    weights /= weights.mean()
    weights.flags.writeable = False
    return np.asarray(weights)


@lru_cache(maxsize=16)
def _table(order: int, power: int) -> Complexes:
    """Mean of the window times x^power exp(i pi D x), for D = 0, 1/128, 2/128, ... up to the reach."""
    x = positions(_POINTS)
    values = np.zeros(_FINE, dtype=np.complex128)
    values[:_POINTS] = hann(_POINTS, order) * x**power
    # with numpy's sign: conj(fft(real)) has exp(+i)
    found = np.conj(np.fft.fft(values))[: int(_REACH * _FINE / _POINTS) + 2] / _POINTS
    distance = np.arange(len(found)) * _POINTS / _FINE
    return np.asarray(found * np.exp(1j * np.pi * distance * x[0]))


def moments(order: int, power: int, distance: Reals) -> Complexes:
    """Mean of the window times x^power exp(i pi D x), to some 1e-5, D in bins: a line at another."""
    table = _table(order, power)
    place = np.abs(distance) * (_FINE / _POINTS)
    low = np.minimum(place.astype(np.int64), len(table) - 2)
    part = place - low
    value = table[low] * (1 - part) + table[low + 1] * part
    value = np.where(np.abs(distance) < _REACH, value, 0)
    return np.asarray(np.where(distance < 0, np.conj(value), value))


@dataclass(frozen=True)
class Spectrum:
    """Amplitude spectrum of so many windowed samples: frequencies in turns per sample, ascending; sizes, of
    which a line at such a frequency has exactly its own; the complex amplitudes at the first sample.
    """

    frequencies: Reals
    sizes: Reals
    turned: Complexes
    count: int

    def amplitude(self, at: int) -> complex:
        """Complex amplitude of one point, at the middle of the samples."""
        return complex(self.turned[at] * np.exp(1j * np.pi * self.frequencies[at] * (self.count - 1)))

    def around(self, frequency: float, reach: float) -> slice:
        """Points within ``reach`` bins of a frequency."""
        ends = frequency - reach / self.count, frequency + reach / self.count
        return slice(*np.searchsorted(self.frequencies, ends).tolist())

    def noise(self, at: int, reach: float) -> float:
        """Median size next to a point, without points within ``reach`` bins."""
        near = self.around(float(self.frequencies[at]), reach)
        beside = np.concatenate(
            [self.sizes[max(near.start - _ASIDE, 0) : near.start], self.sizes[near.stop : near.stop + _ASIDE]]
        )
        return float(np.median(beside)) if len(beside) > 8 else 0.0


def spectrum(values: Complexes, order: int, *, real: bool) -> Spectrum:
    """Spectrum with two points per bin; of a real signal the positive half, with amplitudes of exp(i w t)."""
    count = len(values)
    # the next number without prime factors above 5, which transforms fast
    size = next(n for n in itertools.count(2 * count) if pow(30, 64, n) == 0)
    weights = hann(count, order) / count
    if real:
        found = np.fft.rfft(values.real * weights, size)
        frequencies = np.arange(len(found)) / size
    else:
        found = np.fft.fftshift(np.fft.fft(values * weights, size))
        frequencies = (np.arange(size) - size // 2) / size
    return Spectrum(frequencies, np.abs(found), found, count)


def peak(found: Spectrum, at: int) -> float:
    """Frequency of the maximum next to a point, from the parabola through the logarithms of three sizes."""
    if not 0 < at < len(found.frequencies) - 1:
        return float(found.frequencies[at])
    with np.errstate(divide="ignore"):
        a, b, c = np.log(found.sizes[at - 1 : at + 2])
    bend = a - 2 * b + c
    shift = 0.5 * (a - c) / bend if np.isfinite(bend) and bend < 0 else 0.0
    return float(
        found.frequencies[at] + np.clip(shift, -1, 1) * (found.frequencies[1] - found.frequencies[0])
    )
