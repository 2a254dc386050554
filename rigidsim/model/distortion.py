"""How tides and spin distort a tensor of inertia, with a delay; for expressions and for numbers alike.

With the Love number k, the radius R and a delay tau, the tensor of inertia gains D = d(t - tau),

    d = -k (R^5/G) sum of G M' (u u^T - 1/3) / r^3 + k R^5/(3 G) (w w^T - w^2/3) + const,

where u is the direction to a source and r its distance, all in the body axes of then (Munk & MacDonald 1960,
The Rotation of the Earth, ch. 5; Williams et al. 2001, J. Geophys. Res. 106, 27933). It is expanded,

    D = d - tau d' + tau^2/2 d'',

with w' of the undistorted body under its own gyroscopic torque and that of the sources.

The momentum M = (I + D) w determines w. In D stands the rate w* of a body without delay, which solves
M = (I + d(w*)) w*; it is found from w0 = I^-1 M, the rate of the undistorted body, by as many iterations of
w = w0 - (I + d(w))^-1 d(w) w0 as the precision takes. So nothing is implicit, M' = M x w + N is exact, and
without a delay so is everything else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import heyoka as hy

from rigidsim.scene.arithmetic import Matrix, cross

Linear = Callable[[list[Any]], list[Any]]
"""A constant tensor times a vector."""


@dataclass(frozen=True)
class SeenTide:
    """A source that raises tides, in a unit of length of its own and internal units of time.

    Attributes:
        place, velocity, acceleration: of the source in space, as components along the body axes.
        inverse: 1 / distance.
        lift: k R^5 M' over the unit of length to the third, internal units of inertia.
        pull: 3 G M' over the same, internal units.
    """

    place: list[Any]
    velocity: list[Any]
    acceleration: list[Any]
    inverse: Any
    lift: Any
    pull: Any

    @property
    def fifth(self) -> Any:
        """1 / distance^5."""
        return self.inverse**3 * (self.inverse * self.inverse)


def total(terms: Sequence[Any]) -> Any:
    """Sum of numbers or of expressions."""
    if any(isinstance(x, hy.expression) for x in terms):
        return hy.sum([hy.expression(x) for x in terms])
    found = terms[0]
    for x in terms[1:]:
        found = found + x
    return found


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return total([x * y for x, y in zip(a, b, strict=True)])


def _plus(*vectors: Sequence[Any]) -> list[Any]:
    return [total(parts) for parts in zip(*vectors, strict=True)]


def _times(factor: Any, vector: Sequence[Any]) -> list[Any]:
    return [factor * x for x in vector]


@dataclass(frozen=True)
class Distortion:
    """The elastic body; constants are numbers of the arithmetic in which it is asked.

    Attributes:
        spin: k R^5 / (3 G), internal units.
        delay: tau, internal units; 0 for none.
        third: one third.
        offset: constant part of the distortion.
        tensor: of what turns with the body, undistorted.
        turning, solved: that tensor, and its inverse, times a vector.
        massive: tensor of the mass distribution, undistorted, times a vector.
        iterations: of the rate without delay.
    """

    spin: Any
    delay: Any
    third: Any
    offset: Matrix
    tensor: Matrix
    turning: Linear
    solved: Linear
    massive: Linear
    iterations: int

    def found(self, bare: list[Any], tides: Sequence[SeenTide]) -> tuple[Matrix, list[Any]]:
        """D, and what the angular velocity differs by from ``bare`` (w0)."""
        rate, fixed = self._without_delay(bare, tides)
        found = self._joined(fixed, _outer(rate, None, self.spin))
        if self.delay != 0:
            found = self._delayed(rate, tides)
        return found, self.slip(found, bare)

    def _without_delay(self, bare: list[Any], tides: Sequence[SeenTide]) -> tuple[list[Any], Matrix | None]:
        """The rate w*, and the tides' part of the tensor with its trace."""
        fixed = self._sum([_outer(tide.place, tide.fifth, -tide.lift) for tide in tides])
        rate = bare
        for _ in range(self.iterations):
            slip = self.slip(self._joined(fixed, _outer(rate, None, self.spin)), bare)
            rate = _plus(bare, slip)
        return rate, fixed

    def slip(self, distortion: Matrix, bare: list[Any]) -> list[Any]:
        """-(I + D)^-1 D w0, by the adjugate."""
        (a, f, e), (_, b, d), (_, _, c) = [
            [total([x, y]) if x != 0 else y for x, y in zip(*rows, strict=True)]
            for rows in zip(self.tensor, distortion, strict=True)
        ]
        minors = [
            [b * c - d * d, d * e - c * f, d * f - b * e],
            [d * e - c * f, a * c - e * e, e * f - a * d],
            [d * f - b * e, e * f - a * d, a * b - f * f],
        ]
        pushed = [_dot(row, bare) for row in distortion]
        factor = -1.0 / total([a * minors[0][0], f * minors[0][1], e * minors[0][2]])
        return [factor * _dot(row, pushed) for row in minors]

    # --- the tensors ----------------------------------------------------------------------------------------

    def _followed(
        self, rate: list[Any], tides: Sequence[SeenTide]
    ) -> tuple[list[Any], list[Any], list[list[Any]]]:
        """First and second derivative of a rate w* along the undistorted motion, and for each tide those of x
        in body axes, and 1 / r^5 with its own.
        """
        momentum = self.turning(rate)
        torque, change = [cross(momentum, rate)], []
        for tide in tides:
            torque.append(tide_torque(tide, self.massive))
        turning = self.solved(_plus(*torque))
        found = []
        for tide in tides:
            x, v, inverse = tide.place, tide.velocity, tide.inverse
            moved = _plus(v, cross(x, rate))
            again = _plus(tide.acceleration, cross(_plus(v, moved), rate), cross(x, turning))
            squared, fifth = inverse * inverse, tide.fifth
            grown = 2.0 * _dot(x, v) * squared  # (r^2)' / r^2
            faster = 2.0 * total([_dot(v, v), _dot(x, tide.acceleration)]) * squared - grown * grown
            first = -2.5 * grown * fifth
            second = (6.25 * grown * grown - 2.5 * faster) * fifth
            found.append([moved, again, fifth, first, second])
            into = cross(moved, self.massive(x)), cross(x, self.massive(moved))
            tugged = _times(first, cross(x, self.massive(x)))
            change.append(_times(tide.pull, _plus(tugged, *(_times(fifth, y) for y in into))))
        change += [cross(self.turning(turning), rate), cross(momentum, turning)]
        return turning, self.solved(_plus(*change)), found

    def _delayed(self, rate: list[Any], tides: Sequence[SeenTide]) -> Matrix:
        """D for a rate w*, to second order in the delay."""
        late, half = -self.delay, self.delay * self.delay * 0.5
        turning, jerk, followed = self._followed(rate, tides)
        parts = []
        for tide, (moved, again, fifth, first, second) in zip(tides, followed, strict=True):
            both = total([fifth, late * first])
            scale = total([both, half * second]), 2.0 * both, 2.0 * fifth
            series = tide.place, _times(late, moved), _times(half, again)
            parts.append(_scaled(_expanded(series, scale, fifth), -tide.lift))
        series = rate, _times(late, turning), _times(half, jerk)
        parts.append(_scaled(_expanded(series, (1.0, 2.0, 2.0), 1.0), self.spin))
        return self._joined(self._sum(parts), None)

    def power(self, bare: list[Any], tides: Sequence[SeenTide]) -> Any:
        """-T : D' / 2 with T the tidal tensor, sum of pull (x x^T - r^2/3) / r^5, and D' to first order in
        the delay, whose second contributes nothing to a mean.
        """
        late, rate = -self.delay, self._without_delay(bare, tides)[0]
        turning, jerk, followed = self._followed(rate, tides)
        changes = []  # symmetric parts of a p^T, and c e e^T
        for tide, (moved, again, fifth, first, second) in zip(tides, followed, strict=True):
            terms = (total([first, late * second]), tide.place), (2.0 * fifth + 4.0 * late * first, moved)
            along = _plus(*(_times(c, x) for c, x in (*terms, (2.0 * late * fifth, again))))
            changes.append((-tide.lift, tide.place, along, 2.0 * late * fifth, moved))
        along = _plus(_times(2.0, turning), _times(2.0 * late, jerk))
        changes.append((self.spin, rate, along, 2.0 * late, turning))
        found = []
        for tide in tides:
            x, third = tide.place, self.third / (tide.inverse * tide.inverse)
            for size, a, p, c, e in changes:
                drawn = total([_dot(x, a) * _dot(x, p), c * (_dot(x, e) * _dot(x, e))])
                trace = total([_dot(a, p), c * _dot(e, e)])
                found.append(-0.5 * tide.pull * tide.fifth * size * (drawn - third * trace))
        return total(found)

    def _sum(self, parts: Sequence[Matrix]) -> Matrix | None:
        if not parts:
            return None
        return [[total([part[i][j] for part in parts]) for j in range(3)] for i in range(3)]

    def _joined(self, one: Matrix | None, other: Matrix | None) -> Matrix:
        """Their sum without its trace, plus the constant part."""
        found = self._sum([x for x in (one, other) if x is not None])
        assert found is not None
        mean = -self.third * total([found[i][i] for i in range(3)])
        rows = []
        for i in range(3):
            row = list(found[i])
            row[i] = total([row[i], mean])
            rows.append([total([x, y]) if y != 0 else x for x, y in zip(row, self.offset[i], strict=True)])
        return rows


def tide_torque(tide: SeenTide, massive: Linear) -> list[Any]:
    """MacCullagh's torque of a source on the undistorted body."""
    return _times(tide.pull * tide.fifth, cross(tide.place, massive(tide.place)))


def _outer(vector: list[Any], factor: Any, scale: Any) -> Matrix:
    """scale factor v v^T; a factor of None is 1."""
    size = scale if factor is None else scale * factor
    scaled = _times(size, vector)
    return [[scaled[min(i, j)] * vector[max(i, j)] for j in range(3)] for i in range(3)]


def _expanded(series: Sequence[list[Any]], scale: Sequence[Any], least: Any) -> Matrix:
    """f x x^T to second order, from the terms of x and sums of those of f: with x = a + b + c it is the
    symmetric part of a (s0 a + s1 b + s2 c)^T, plus f b b^T.
    """
    a, b, _ = series
    d = _plus(*(_times(factor, x) for factor, x in zip(scale, series, strict=True)))
    rows: list[list[Any]] = [[None] * 3 for _ in range(3)]
    for i in range(3):
        for j in range(i, 3):
            mixed = a[i] * d[i] if i == j else 0.5 * total([a[i] * d[j], a[j] * d[i]])
            rows[i][j] = rows[j][i] = total([mixed, least * (b[i] * b[j])])
    return rows


def _scaled(matrix: Matrix, factor: Any) -> Matrix:
    return [_times(factor, row) for row in matrix]
