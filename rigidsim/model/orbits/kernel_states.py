"""Positions of a kernel's bodies, carried as states.

In each block of a series, of length L, with u from -1 to 1,

    u' = 2 / L,    x' = sum over k of c_k (2 / L) T_k'(u),

whose coefficients are parameters: the kernel's own doubles, times a power of two. Where a block ends a step
ends as well; u and x are then put on the next block's values, so that nothing adds up. Series of one block
length share u and the polynomials. Where a load asks for derivatives of a place, they are states, too:

    x' = v,    v' = a,    a' = sum over k of c_k (2 / L)^3 T_k'''(u).

The derivatives of T_k are Gegenbauer's polynomials: T_k^(n) = 2^(n-1) (n-1)! k C_(k-n)^(n) (Abramowitz &
Stegun 1964, 22.5.34 and 22.7.3).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property, lru_cache
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.orbits.pieces import PieceSeries
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder, Scaling
from rigidsim.model.state_blocks import StateBlock
from rigidsim.model.two_part import as_factor, rounded
from rigidsim.scene.kernels.ephemeris import Ephemeris
from rigidsim.scene.kernels.reading import RelativeEphemeris
from rigidsim.scene.kernels.series import BlockSeries, chebyshev, exactly
from rigidsim.scene.scene import Scene
from rigidsim.scene.space_axes import ECLIPTIC, obliquity, to_ecliptic

_AXES = "xyz"
_RATES = ("", "v", "a", "j")
_BEYOND = 100  # blocks after the end of a run, whose own steps go past its last sample


@dataclass
class _Blocks:
    """Series of one block length."""

    tag: str
    first: int  # index of the first parameter
    begin: Fraction  # of the first block, seconds since J2000
    length: Fraction
    series: list[tuple[BlockSeries, int]] = field(default_factory=list)  # and the highest derivative carried
    _polynomials: dict[int, list[Symbolic]] = field(default_factory=dict)

    @property
    def past(self) -> str:
        """Name of the state u."""
        return f"kernel_part{self.tag}"

    @property
    def parameters(self) -> int:
        """Number of parameters."""
        return sum(3 * (one.terms - order - 1) for one, order in self.series)


class KernelStates:
    """States of the series that a scene's loads see, as expressions; parameters follow from ``first`` on."""

    def __init__(
        self,
        ephemeris: Ephemeris,
        given: Sequence[tuple[RelativeEphemeris, int]],
        scaling: Scaling,
        start: Any,
        context: Any,
        number: Rounder,
        first: int,
    ) -> None:
        self.ephemeris, self._exponent, self._start = ephemeris, scaling.time, start
        self._scaling = scaling
        self._context, self._number = context, number
        self.sights = list(dict.fromkeys(sight for sight, _ in given))
        orders: dict[int, int] = {}
        found: dict[int, BlockSeries] = {}
        for sight, order in given:
            for _, series in sight.links:
                found[id(series)] = series
                orders[id(series)] = max(orders.get(id(series), 0), order)
        self._groups: list[_Blocks] = []
        self._group_of: dict[int, tuple[_Blocks, int, int]] = {}  # and first parameter, and order
        for one in sorted(found.values(), key=lambda x: (x.length, x.begin % x.length)):
            group = self._groups[-1] if self._groups else None
            if group is None or one.length != group.length or (one.begin - group.begin) % one.length:
                past = first if group is None else group.first + group.parameters
                group = _Blocks(str(len(self._groups) + 1), past, one.begin, one.length)
                self._groups.append(group)
            self._group_of[id(one)] = group, group.first + group.parameters, orders[id(one)]
            group.series.append((one, orders[id(one)]))

    # --- expressions --------------------------------------------------------------------------------------

    def seen(self, sight: RelativeEphemeris, order: int = 0) -> list[Symbolic]:
        """Vector of a sight in space axes, in units of 2^``sight.exponent`` km, or a derivative of it per
        internal unit of time.

        Derivatives beyond those that a load asks for (``SceneLoad.sights``) are no functions of the states:
        equations may use them, what is recorded may not.
        """
        rows: list[list[Symbolic]] = [[], [], []]
        for factor, series in sight.links:
            size = self._rounded(exactly(self._context, factor), series.exponent - sight.exponent)
            for row, axis in zip(rows, range(3), strict=True):
                row.append(size * self._component(series, axis, order))
        found = [row[0] if len(row) == 1 else hy.sum(row) for row in rows]
        if self.ephemeris.axes != ECLIPTIC:
            return found
        c, s = (self._rounded(value) for value in obliquity(self._context))
        return to_ecliptic(found, (c, s))

    def _rounded(self, value: Any, exponent: int = 0) -> Symbolic:
        return as_factor(rounded(self._number(self._context.ldexp(value, exponent))))

    def _component(self, series: BlockSeries, axis: int, order: int) -> Symbolic:
        group, first, carried = self._group_of[id(series)]
        if order <= carried:
            return hy.make_vars(_name(series, axis, order))
        values = self._polynomials(group, order)
        at = first + axis * (series.terms - carried - 1) - carried - 1
        return hy.sum([hy.par[at + k] * values[k] for k in range(order, series.terms)])

    def _polynomials(self, group: _Blocks, order: int) -> list[Symbolic]:
        """(2 / L)^n T_k^(n)(u) of a group's largest number of terms; zeros up to k = n - 1."""
        known = group._polynomials
        if order not in known:
            n, u = order, hy.make_vars(group.past)
            terms = max(series.terms for series, _ in group.series)
            own = [hy.expression(1.0), 2.0 * n * u]
            for j in range(2, terms - n):
                one, two = (self._ratio(x, j) for x in (2 * (j + n - 1), j + 2 * n - 2))
                own.append(one * (u * own[j - 1]) - two * own[j - 2])
            power = exactly(self._context, self._rate(group) ** n * 2 ** (n - 1) * math.factorial(n - 1))
            known[order] = [hy.expression(0.0)] * n + [
                self._rounded(power * (k + n)) * value for k, value in enumerate(own[: terms - n])
            ]
        return known[order]

    def _ratio(self, numerator: int, denominator: int) -> Symbolic:
        return self._rounded(exactly(self._context, Fraction(numerator, denominator)))

    def _rate(self, group: _Blocks) -> Fraction:
        """u', per internal unit of time."""
        return Fraction(2) ** (self._exponent + 1) / group.length

    # --- states -------------------------------------------------------------------------------------------

    @property
    def names(self) -> str:
        """What the series that are carried place, for reasons."""
        targets = [series.target for group in self._groups for series, _ in group.series]
        words = {"earth_moon": "Earth-Moon barycentre", "earth_moon_barycenter": "Earth-Moon barycentre"}
        return ", ".join(words.get(target, target.replace("_", " ").capitalize()) for target in targets)

    def block(self) -> StateBlock:
        """All states, with their equations and values at the start."""
        names: list[str] = []
        derivatives: list[Symbolic] = []
        initial: list[Any] = []
        context, now = self._context, self._start + exactly(self._context, self.ephemeris.ahead)
        for group in self._groups:
            number = group.series[0][0].block_at(now)
            begin = exactly(context, group.series[0][0].begin + number * group.length)
            names.append(group.past)
            derivatives.append(self._rounded(exactly(context, self._rate(group))))
            initial.append(2 * (now - begin) / exactly(context, group.length) - 1)
            for series, carried in group.series:
                for order in range(carried + 1):
                    shift = order * self._exponent - series.exponent
                    names += [_name(series, axis, order) for axis in range(3)]
                    derivatives += [self._component(series, axis, order + 1) for axis in range(3)]
                    initial += [context.ldexp(x, shift) for x in series.at(context, now, order)]
        return StateBlock(
            names,
            [hy.expression(x) for x in derivatives],
            initial,
            why=f"positions of {self.names} by {self.ephemeris.kernel.name}, and the time within their "
            "blocks",
        )

    def pieces(self) -> list[PieceSeries]:
        """What is set at the edges of blocks."""
        return [self._pieces(group) for group in self._groups]

    def _pieces(self, group: _Blocks) -> BlockPieces:
        context, ahead = self._context, self.ephemeris.ahead
        now, one = self._start + exactly(context, ahead), group.series[0][0]
        begun, back = one.block_at(now), self._scaling.direction < 0
        end = one.block_at(self.ephemeris.run[1] + exactly(context, ahead))
        if back:
            first = max(math.ceil((series.begin - one.begin) / one.length) for series, _ in group.series)
            edges = range(begun, max(first, end - _BEYOND), -1)
        else:
            last = min(math.ceil((series.end - one.begin) / one.length) for series, _ in group.series)
            edges = range(begun + 1, min(last, end + _BEYOND))
        times = (exactly(context, one.begin + edge * group.length - ahead) for edge in edges)
        knots = [self._number(self._scaling.internal(time, context)) for time in times]
        return BlockPieces(group, begun, knots, self._scaling, context, self._number)


class BlockPieces:
    """Blocks of series of one length (see ``rigidsim.model.orbits.pieces.PieceSeries``)."""

    def __init__(
        self, group: _Blocks, begun: int, knots: list[Any], scaling: Scaling, context: Any, number: Rounder
    ) -> None:
        self.knots, self._group, self._context, self._number = knots, group, context, number
        self._step = scaling.direction
        self._series = []
        for series, carried in group.series:
            behind = round((group.series[0][0].begin - series.begin) / group.length)
            self._series.append((series, carried, begun + behind))
        rate = exactly(context, Fraction(2) ** (scaling.time + 1) / group.length)
        entered = -scaling.direction * context.one  # u where blocks are entered
        self._ends = {
            (series.terms, order): [rate**order * x for x in chebyshev(context, entered, series.terms, order)]
            for series, carried, _ in self._series
            for order in range(carried + 1)
        }
        self._rounded_ends = {key: np.array(list(map(float, x))) for key, x in self._ends.items()}
        self._rows = [np.asarray(series.coefficients) for series, _ in group.series]  # a memmap is slow
        self._kind: Any = type(number(context.one))

    @cached_property
    def states(self) -> list[str]:
        """See ``PieceSeries``."""
        names = [self._group.past]
        for series, carried, _ in self._series:
            names += [_name(series, axis, order) for order in range(carried + 1) for axis in range(3)]
        return names

    def numbers(self, first: int, stop: int) -> tuple[np.ndarray, np.ndarray]:
        """See ``PieceSeries``: u is -1 where a block begins and 1 where it ends, and its parameters are the
        coefficients, each of which is a double times a power of two.
        """
        parameters, states = [], [self._exact(np.full((stop - first, 1), -float(self._step)))]
        for (series, carried, begun), rows in zip(self._series, self._rows, strict=True):
            blocks = rows[begun + self._step * np.arange(first, stop)]
            scaled = np.ldexp(blocks[:, :, carried + 1 :], -series.exponent)
            parameters.append(self._exact(scaled.reshape(len(blocks), -1)))
            states += [self._at_edges(series, blocks, order) for order in range(carried + 1)]
        return np.concatenate(parameters, axis=1), np.concatenate(states, axis=1)

    def _exact(self, values: np.ndarray) -> np.ndarray:
        if issubclass(self._kind, float | np.floating):
            return values.astype(self._kind)
        numbers = [self._number(self._context.mpf(float(x))) for x in values.flat]
        return np.array(numbers, dtype=self._kind).reshape(values.shape)

    def _at_edges(self, series: BlockSeries, blocks: np.ndarray, order: int) -> np.ndarray:
        """Values of three states where blocks are entered, rounded once; derivatives in double precision
        are sums of rounded products, since mpf take longer than all steps of a run.
        """
        rows, shape = blocks.reshape(-1, series.terms), blocks.shape[:2]
        if self._kind in (float, np.float64):
            sums = [math.fsum(row) for row in (rows * self._rounded_ends[series.terms, order]).tolist()]
            return np.ldexp(sums, -series.exponent).reshape(shape)
        weights, context = self._ends[series.terms, order], self._context
        found = []
        for row in rows:
            total = sum((context.mpf(float(c)) * w for c, w in zip(row, weights, strict=True)), context.zero)
            found.append(self._number(context.ldexp(total, -series.exponent)))
        return np.array(found, dtype=self._kind).reshape(shape)


@lru_cache(maxsize=512)
def _name(series: BlockSeries, axis: int, order: int) -> str:
    return f"kernel_{series.target}_{_RATES[order]}{_AXES[axis]}"


def sights_of(scene: Scene) -> list[RelativeEphemeris]:
    """The bodies of a kernel that a scene's loads see."""
    return list(dict.fromkeys(sight for load in scene.loads for sight, _ in load.sights))
