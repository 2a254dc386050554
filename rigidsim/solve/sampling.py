"""Sample times in the run's own precision: ``start + i * span / intervals``, never by adding up."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rigidsim.errors import ConfigError, Problem
from rigidsim.scene.scene import SampleTimes
from rigidsim.solve.precision import Mpf, Precision, Scalar, precision_of


class SampleClock:
    """Times of the samples, block by block.

    Attributes:
        start: of the motion, a scalar of the precision: a list of times may begin later.

    Args:
        samples: where they lie (mpf, seconds).
        precision: of the run.
        exponent: binary exponent of the internal unit of time.

    Raises:
        ConfigError: neighbouring samples fall on the same number of this precision.
    """

    def __init__(self, samples: SampleTimes, precision: Precision, exponent: int) -> None:
        self.count = samples.count
        self.exponent = exponent
        self._precision = precision
        unit = samples.start.context.mpf(2) ** exponent
        if samples.times is not None:
            self._list: np.ndarray | None = precision.array([t / unit for t in samples.times])
        else:
            self._list = None
            wide = _double_or(precision)
            self._start = wide(samples.start / unit)
            self._span = wide(samples.span / unit)
            self._intervals = wide(samples.start.context.mpf(samples.intervals))
            self._end = wide((samples.start + samples.span) / unit)
            self._last_index = samples.intervals
        self.start = precision.number(samples.start / unit) if self._list is not None else self.at(0)
        self._refuse_coinciding(samples)

    def internal(self, first: int, stop: int) -> np.ndarray:
        """Times of samples first ... stop-1 in internal units, shape (stop - first,)."""
        if self._list is not None:
            return self._list[first:stop]
        numbers = self._precision.indices(first, stop)
        times = self._start + (numbers * self._span) / self._intervals
        if first <= self._last_index < stop:
            times[self._last_index - first] = self._end
        return times.astype(self._precision.scalar) if self._precision.narrow else times

    def at(self, index: int) -> Scalar:
        """One sample's time in internal units, a scalar of the precision."""
        return self.internal(index, index + 1)[0]

    def label(self, index: int) -> float:
        """One sample's time in seconds, as the dataset's coordinate has it."""
        return self.seconds(self.at(index))

    def seconds(self, time: Scalar) -> float:
        """A time in internal units as the nearest double, seconds."""
        alone = np.array([time], dtype=self._precision.scalar)
        return float(np.ldexp(self._precision.parts(alone)[0][0], self.exponent))

    def _refuse_coinciding(self, samples: SampleTimes) -> None:
        """The spacing is resolved worst at the time of largest size."""
        candidates = {0, max(0, self.count - 2)}
        if self._list is not None:
            candidates = set(range(self.count - 1))
        for i in candidates:
            if i + 1 < self.count:
                pair = self.internal(i, i + 2)
                if not pair[0] < pair[1]:
                    seconds = float(samples.last)
                    raise ConfigError(
                        Problem(
                            "[time]",
                            f"samples {i} and {i + 1} are closer together than {self._precision.name} "
                            f"precision resolves near {seconds:g} s; sample less often, shift start, or "
                            "choose a higher precision",
                        )
                    )


def _double_or(precision: Precision) -> Callable[[Mpf], Scalar]:
    """Conversion for grids: single precision computes them in double, since i alone may not fit 24 bits."""
    if not precision.narrow:
        return precision.number

    return lambda value: np.float64(precision_of("double").number(value))
