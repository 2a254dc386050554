"""Pieces of the equations between times at which parameters and states are set, where steps have to end.

Rows of a table of elements and blocks of an ephemeris are such times. Each ``PieceSeries`` numbers its own
pieces, the one that contains the start being 0; ``Pieces`` joins several, and their parameters.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

_AT_ONCE = 32  # pieces of a series whose numbers are worked out together
_KEPT = 8  # such groups of each series: motions that are followed at the same time may be in different ones


class PieceSeries(Protocol):
    """Pieces of one kind.

    Attributes:
        knots: times (ascending, internal units, working precision) at which pieces 1, 2, ... begin.
    """

    knots: list[Any]

    @property
    def states(self) -> list[str]:
        """Names of the states that are set where a piece begins."""

    def numbers(self, first: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        """Of pieces first ... stop-1, in working precision: their parameters, (pieces, parameters), and the
        values on which states are set where they begin, (pieces, states).
        """


class Pieces:
    """Pieces of several series together: one begins wherever one of a series does.

    Attributes:
        knots: as in ``PieceSeries``.
    """

    def __init__(self, parts: Sequence[PieceSeries]) -> None:
        self._parts = parts
        found = sorted((knot, place) for place, part in enumerate(parts) for knot in part.knots)
        self.knots: list[Any] = []
        self._numbers = [[0] * len(parts)]  # of each part's piece, for each piece
        for knot, place in found:
            if not self.knots or knot > self.knots[-1]:  # several parts may have knots at the same time
                self.knots.append(knot)
                self._numbers.append(list(self._numbers[-1]))
            self._numbers[-1][place] += 1
        self._known: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}

    def number_at(self, time: Any) -> int:
        """Number of the piece that begins at or contains a time (internal units, working precision)."""
        return bisect_right(self.knots, time)

    def parameters(self, number: int) -> np.ndarray:
        """All parameters of a piece, working precision."""
        return np.concatenate([self._of(place, own)[0] for place, own in enumerate(self._numbers[number])])

    def states(self, number: int) -> dict[str, Any]:
        """Values, by name, of the states that are set where a piece begins, working precision."""
        if number == 0:
            return {}
        changed: dict[str, Any] = {}
        pairs = zip(self._numbers[number - 1], self._numbers[number], strict=True)
        for place, (before, now) in enumerate(pairs):
            if now != before:
                changed.update(zip(self._parts[place].states, self._of(place, now)[1], strict=True))
        return changed

    def _of(self, place: int, own: int) -> tuple[np.ndarray, np.ndarray]:
        """Parameters, and values of states, of one part's own piece."""
        group, row = divmod(own, _AT_ONCE)
        if (place, group) not in self._known:
            if len(self._known) >= _KEPT * len(self._parts):
                del self._known[next(iter(self._known))]
            part, first = self._parts[place], group * _AT_ONCE
            stop = min(first + _AT_ONCE, len(part.knots) + 1)
            self._known[place, group] = part.numbers(first, stop)
        parameters, states = self._known[place, group]
        return parameters[row], states[row]
