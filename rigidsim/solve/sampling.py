"""Sample times: each is the number that the config means, rounded once, never a running sum.

Sample i of a grid lies at the rational number (a + i b) / d, with whole a, b and d. Where these fit the
significand, one division of two exact numbers is the nearest number to it, and a block of samples costs three
operations of arrays; elsewhere, and beyond 80 bits, each is a division of long integers.
"""

import math
from collections.abc import Iterator

import mpmath
import numpy as np
from mpmath.libmp import from_rational, round_nearest

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.scaling import Scaling
from rigidsim.scene.exact import rounded
from rigidsim.scene.sample_times import SampleTimes
from rigidsim.solve.precision import Precision, Scalar, precision_of

_BLOCK = 65536  # samples of a list that are looked at together


class SampleClock:
    """Times of the samples, block by block, as the scene has them and in internal time, which grows.

    Attributes:
        start: start of the motion, a scalar of the precision; a list of times may begin later.
        unit: seconds of the scene in one of internal time, a power of two; below zero in a run backwards.
        part_count: number of float64 that hold a label together with its residual to the integration's time.

    Raises:
        ConfigError: neighbouring samples fall on the same number of this precision.
    """

    def __init__(self, samples: SampleTimes, precision: Precision, scaling: Scaling) -> None:
        self.count = samples.count
        self._scaling, self.unit = scaling, float(scaling.seconds(1.0))
        self.precision = precision
        self.part_count = precision.part_count if precision.bits == 53 else max(2, precision.part_count)
        self._double = precision_of("double")
        self._samples = samples
        self._divisor = math.lcm(samples.begin.denominator, samples.step.denominator)
        self._first = int(samples.begin * self._divisor)
        self._step = int(samples.step * self._divisor)
        context = samples.context
        self._per_second = precision.number(scaling.internal(context.one, context))
        self.start = precision.number(scaling.internal(rounded(samples.begin, context), context))
        self._refuse_coinciding(samples)

    def internal(self, first: int, stop: int) -> np.ndarray:
        """Times of samples first ... stop-1 in internal units, shape (stop - first,), in the precision."""
        return self._seconds(first, stop, self.precision) * self._per_second

    @property
    def gaps(self) -> np.ndarray | None:
        """Spacing of a list's samples, s; None for a grid."""
        return None if self._samples.times is None else np.abs(np.diff(self._samples.doubles))

    def at(self, index: int) -> Scalar:
        """One sample's time in internal units, a scalar of the precision."""
        return self.internal(index, index + 1)[0]

    def seconds(self, time: Scalar) -> float:
        """The double nearest to a time in internal units, s."""
        alone = np.array([time], dtype=self.precision.scalar)
        return float(self._scaling.seconds(self.precision.parts(alone)[0][0]))

    def parts_of(self, times: np.ndarray) -> list[np.ndarray]:
        """Any times in internal units as float64 parts, s."""
        return [self._scaling.seconds(part) for part in self.precision.parts(times)]

    def labels(self, first: int, stop: int) -> np.ndarray:
        """The double nearest to the time of each sample first ... stop-1, s."""
        return self._seconds(first, stop, self._double)

    def parts(self, first: int, times: np.ndarray) -> list[np.ndarray]:
        """Labels of samples from ``first`` on (s) and residuals, which sum exactly to the time."""
        exact = times / self._per_second + self.precision.of_double(0.0)  # zero without a sign
        if self.precision.bits == 53:
            return [exact]
        parts = self.precision.parts(exact, self.labels(first, first + len(times)))
        if self.precision.bits < 53:
            parts.append(exact.astype(np.float64) - parts[0])
        return parts

    def _seconds(self, first: int, stop: int, precision: Precision) -> np.ndarray:
        """The number of a precision nearest to each time, s."""
        if precision.bits < 53:
            return self._narrowed(self._seconds(first, stop, self._double), first, precision)
        if precision.bits == 53 and self._samples.times is not None:
            return self._samples.doubles[first:stop]
        if self._samples.times is None:
            a, b, d, last = self._first, self._step, self._divisor, max(stop - 1, 0)
            if max(abs(a), abs(b), d, abs(b * last), abs(a + b * last)) <= 2**precision.bits:
                begin, step, divisor = (_nearest(n, 1, precision) for n in (a, b, d))
                return (begin + precision.indices(first, stop) * step) / divisor
        return np.array(
            [_nearest(n, d, precision) for n, d in self._rationals(first, stop)], dtype=precision.scalar
        )

    def _narrowed(self, doubles: np.ndarray, first: int, precision: Precision) -> np.ndarray:
        """The narrower numbers nearest to exact values, from the doubles nearest to them."""
        times = doubles.astype(precision.scalar)
        # rounding twice equals rounding once unless the first result lies halfway between two narrow numbers
        halfway = np.uint64(1) << np.uint64(52 - precision.bits)
        beyond = doubles.view(np.uint64) & (2 * halfway - np.uint64(1))
        for i in np.flatnonzero(beyond == halfway):
            [(n, d)] = self._rationals(first + int(i), first + int(i) + 1)
            times[i] = _nearest(n, d, precision)
        return times

    def _rationals(self, first: int, stop: int) -> Iterator[tuple[int, int]]:
        if self._samples.times is not None:
            yield from (time.as_integer_ratio() for time in self._samples.times[first:stop])
        else:
            yield from ((self._first + i * self._step, self._divisor) for i in range(first, stop))

    def _refuse_coinciding(self, samples: SampleTimes) -> None:
        """Refuse samples that coincide; spacing of a grid is resolved worst at the time of largest size."""
        if samples.times is None:
            spans = [(i, min(i + 2, self.count)) for i in sorted({0, max(0, self.count - 2)})]
        else:  # blocks share their ends, so that all neighbours meet
            spans = [(i, min(i + _BLOCK + 1, self.count)) for i in range(0, self.count, _BLOCK)]
        for first, stop in spans:
            times = self.internal(first, stop)
            together = np.flatnonzero(~(times[:-1] < times[1:]))
            if len(together):
                i = first + int(together[0])
                what = (
                    f"samples {i} and {i + 1} are closer together than {self.precision.name} precision "
                    f"resolves near {float(samples.last):g} s; sample less often, shift start, or choose a "
                    "higher precision"
                )
                raise ConfigError(Problem("[time]", what))


class Rows:
    """The samples of a clock, and rows between them: so many from sample to sample, where these are farthest
    apart, and fewer elsewhere.
    """

    def __init__(self, clock: SampleClock, parts: int = 1) -> None:
        self.clock = clock
        self._parts = max(1, parts)
        self._firsts: np.ndarray | None = None  # rows of a list's samples
        if parts > 1 and (gaps := clock.gaps) is not None:
            each = np.ceil(gaps / gaps.max() * parts).astype(np.int64)
            self._firsts = np.concatenate([[0], np.cumsum(np.maximum(each, 1))])
        self.count = self.row(clock.count - 1) + 1

    def row(self, sample: int) -> int:
        """The row of a sample."""
        return sample * self._parts if self._firsts is None else int(self._firsts[sample])

    def samples(self, row: int) -> int:
        """Number of samples before a row."""
        return -(-row // self._parts) if self._firsts is None else int(np.searchsorted(self._firsts, row))

    def are_samples(self, first: int, stop: int) -> np.ndarray:
        """Which of the rows first ... stop-1 are samples, (n,)."""
        rows = np.arange(first, stop)
        return rows % self._parts == 0 if self._firsts is None else np.isin(rows, self._firsts)

    def internal(self, first: int, stop: int) -> np.ndarray:
        """Times of rows first ... stop-1, as ``SampleClock.internal``."""
        if self._parts == 1 or stop <= first:
            return self.clock.internal(first, stop)
        begin = self.samples(first + 1) - 1
        end = min(self.samples(stop) + 1, self.clock.count)
        times, samples = self.clock.internal(begin, end), np.arange(begin, end)
        firsts = samples * self._parts if self._firsts is None else self._firsts[begin:end]
        rows = np.arange(first, stop)
        before = np.searchsorted(firsts, rows, side="right") - 1
        here, ahead = times[before], times[np.minimum(before + 1, len(times) - 1)]
        apart = firsts[np.minimum(before + 1, len(times) - 1)] - firsts[before]
        into = self.clock.precision.of_doubles((rows - firsts[before]) / np.maximum(apart, 1))
        return here + (ahead - here) * into


def _nearest(numerator: int, denominator: int, precision: Precision) -> Scalar:
    """The number of a precision nearest to a quotient, ties to even."""
    if precision.bits == 53:
        return numerator / denominator  # as Python divides whole numbers
    value = from_rational(numerator, denominator, precision.bits, round_nearest)
    return precision.number(mpmath.mp.make_mpf(value))
