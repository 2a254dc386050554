"""Pieces of the equations between times at which parameters and states are set, where steps have to end.

Rows of a table of elements and blocks of an ephemeris are such times. Each ``PieceSeries`` numbers its own
pieces, the one that contains the start being 0; ``Pieces`` joins several, and their parameters.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from typing import Any, Protocol


class PieceSeries(Protocol):
    """Pieces of one kind.

    Attributes:
        knots: times (ascending, internal units, working precision) at which pieces 1, 2, ... begin.
    """

    knots: list[Any]

    def parameters(self, number: int) -> Sequence[Any]:
        """Its parameters in a piece, working precision; as many in each."""

    def states(self, number: int) -> dict[str, Any]:
        """Values, by name, of the states that are set where a piece begins, working precision."""


class Pieces:
    """Pieces of several series together: one begins wherever one of a series does.

    Attributes:
        knots: as those of ``PieceSeries``.
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
        self._known: dict[int, tuple[int, Sequence[Any]]] = {}  # of each part the latest piece

    def number_at(self, time: Any) -> int:
        """Number of the piece that begins at or contains a time (internal units, working precision)."""
        return bisect_right(self.knots, time)

    def parameters(self, number: int) -> list[Any]:
        """All parameters of a piece, working precision."""
        found: list[Any] = []
        for place, own in enumerate(self._numbers[number]):
            known = self._known.get(place)
            if known is None or known[0] != own:  # the latest is asked for again and again
                known = self._known[place] = own, self._parts[place].parameters(own)
            found += known[1]
        return found

    def states(self, number: int) -> dict[str, Any]:
        """Values, by name, of the states that are set where a piece begins, working precision."""
        if number == 0:
            return {}
        changed: dict[str, Any] = {}
        pairs = zip(self._numbers[number - 1], self._numbers[number], self._parts, strict=True)
        for before, now, part in pairs:
            if now != before:
                changed |= part.states(now)
        return changed
