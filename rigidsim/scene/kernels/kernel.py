"""A kernel: bodies, the series that place them relative to each other, and constants."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.kernels.series import BlockSeries, exactly

J2000_DATE = Fraction(2451545)
DAY = 86400


class KernelError(ValueError):
    """A kernel can't be read, or lacks something; the message goes on from ``given "...",``."""


@dataclass(frozen=True)
class Sight:
    """One body of a kernel seen from another: the sum of series, each times an exact factor.

    Attributes:
        source, host: names of both.
        links: factors and series.
    """

    source: str
    host: str
    links: tuple[tuple[Fraction, BlockSeries], ...]

    @property
    def span(self) -> tuple[Fraction, Fraction]:
        """Times between which it is known, seconds since J2000."""
        series = [x for _, x in self.links]
        return max(x.begin for x in series), min(x.end for x in series)

    @property
    def exponent(self) -> int:
        """Exponent of a power of two of km of the distance's order."""
        return max(series.exponent for _, series in self.links)

    def at(self, context: Any, time: Any, order: int = 0) -> Vector:
        """Vector (mpf, km) at a time (mpf, seconds since J2000), or a derivative of it."""
        total = [context.zero] * 3
        for factor, series in self.links:
            vector, size = series.at(context, time, order), exactly(context, factor)
            total = [x + size * y for x, y in zip(total, vector, strict=True)]
        return total

    def sampled(self, times: np.ndarray) -> np.ndarray:
        """Vectors at times (n,), seconds since J2000, in double precision: (n, 3), km."""
        found = [float(factor) * series.sampled(times) for factor, series in self.links]
        return np.sum(found, axis=0)


class Kernel(ABC):
    """Bodies of one kernel.

    Attributes:
        name: as in the config, without its place.
        place: path of its file; None for an installed package.
    """

    name: str
    place: Path | None = None

    @property
    @abstractmethod
    def bodies(self) -> list[str]:
        """Names of the bodies, for messages."""

    @abstractmethod
    def known(self, body: str) -> bool:
        """Whether it places a body of a name."""

    @abstractmethod
    def path_of(self, body: str) -> list[tuple[Fraction, BlockSeries]]:
        """A body's place relative to the solar system's barycentre, as the links of a ``Sight``."""

    @abstractmethod
    def strength(self, body: str) -> Fraction | None:
        """Gravitational parameter of a body, m^3/s^2; None if the kernel has none."""

    @property
    @abstractmethod
    def digest(self) -> str:
        """SHA-256 of what was read of it."""

    def sight(self, source: str, host: str) -> Sight:
        """One body seen from another; ``host`` may be empty, which is the solar system's barycentre."""
        self._refuse_odd(*filter(None, (source, host)))
        return self._seen(source, host)

    def _refuse_odd(self, *bodies: str) -> None:
        """Refuse bodies of the solar system that aren't where they can be."""
        from rigidsim.scene.kernels.soundness import (
            refuse_misplaced,
            refuse_odd_moon,
        )  # few scenes have a kernel

        try:
            for body in bodies:
                found = self._seen(body, "")
                refuse_misplaced(body, found.span, found.sampled)
            if {"earth", "moon"} & set(bodies) and self.known("earth") and self.known("moon"):
                found = self._seen("moon", "earth")
                refuse_odd_moon(found.span, found.sampled)
        except ValueError as error:
            if isinstance(error, KernelError):
                raise
            what = f"whose positions are damaged, or those of other bodies ({error}); take the file anew"
            raise KernelError(what) from None

    def _seen(self, source: str, host: str) -> Sight:
        factors: dict[int, Fraction] = {}
        series: dict[int, BlockSeries] = {}
        paths = [(1, self.path_of(source)), *([(-1, self.path_of(host))] if host else [])]
        for sign, path in paths:
            for factor, one in path:
                series[id(one)] = one
                factors[id(one)] = factors.get(id(one), Fraction(0)) + sign * factor
        links = tuple((factors[key], series[key]) for key in series if factors[key] != 0)
        if not links:
            raise KernelError(f'which has "{source}" where "{host or "the barycentre"}" is')
        return Sight(source, host, links)
