"""Motion along switching surfaces, where the fields of both sides push onto them (Filippov 1988, section 4).

With the side s of each surface as a number between -1 and +1, the field f(s) that keeps to the surfaces is
the convex combination of the fields of the sides whose part across every surface is zero. Beside each other
several surfaces are resolved where their parts of the field add up: f = base + sum of s_j d_j.

Rest where two switching surfaces meet, in a quantity and in its rate, as with a relay and dry friction.

With u' = v and v' = r(sign u, sign v), such as a torque -a sign(psi) - b sign(w), the rate of u is zero on
both surfaces whatever the sides, so that no rule for one surface tells how it goes on. The swings come to
rest there, in infinitely many switches, where each is shorter than the one before: of the four values of r
those on the way out brake and those on the way back drive, and the product of the ways back over the ways out
is below 1. Zero lies in the convex hull of the four fields then, and being in it the motion stays (Filippov
1988, section 4). Fields of which several combinations keep to both surfaces give different motions in general
(Dieci & Lopez 2009); here all give the same one, or nothing is decided: what the two sides add to the field
has to be parallel.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations

import heyoka as hy
import numpy as np

from rigidsim.model.rotations import Symbolic
from rigidsim.model.step_limiter import slopes
from rigidsim.model.system import System
from rigidsim.solve.precision import Scalar
from rigidsim.solve.switching.sides import (
    HELD,
    PARALLEL,
    SLIDES,
    Continuation,
    SurfaceFunctions,
    SurfaceValues,
    contributions,
)

MOST_AT_ONCE = 3
"""Largest number of surfaces along which a motion slides at once."""


@dataclass(frozen=True)
class Sliding:
    """The motion along some surfaces, which it leaves when the value in place of its side is 1 or -1."""

    equations: list[tuple[Symbolic, Symbolic]]
    sides: list[Symbolic]


def sliding(
    system: System, along: Sequence[int], held: Mapping[int, tuple[int, int]] | None = None
) -> Sliding:
    """Equations along surfaces; ``held`` others have the side of a surface, or its opposite (-1)."""
    fields = {name: right for name, (_, right) in zip(system.states, system.equations, strict=True)}
    if held:
        tied = {hy.par[i]: float(sign) * hy.par[m] for i, (m, sign) in held.items()}
        fields = {
            name: hy.subs(right, tied) if _reads(right, list(held)) else right
            for name, right in fields.items()
        }

    def at(sides: dict[int, float]) -> dict[str, Symbolic]:
        values = {hy.par[j]: hy.expression(s) for j, s in sides.items()}
        return {
            name: hy.subs(right, values) if _reads(right, along) else right for name, right in fields.items()
        }

    above, below = at(dict.fromkeys(along, 1.0)), at(dict.fromkeys(along, -1.0))
    touched = [name for name, right in fields.items() if _reads(right, along)]
    base = {name: 0.5 * (above[name] + below[name]) if name in touched else above[name] for name in fields}
    parts = []
    for j in along:
        without = at({i: -1.0 if i == j else 1.0 for i in along})
        parts.append({name: 0.5 * (above[name] - without[name]) for name in touched})
    matrix, right_side = [], []
    for j in along:
        by_time, by_state = slopes(system.surfaces[j])
        right_side.append(-hy.sum([*by_time, *(slope * base[name] for name, slope in by_state.items())]))
        rows = [[slope * part[n] for n, slope in by_state.items() if n in part] for part in parts]
        matrix.append([hy.sum(row) if row else hy.expression(0.0) for row in rows])
    sides = _solved(matrix, right_side)
    equations = []
    for variable, name in zip(system.variables, system.states, strict=True):
        right = base[name]
        if name in touched:
            right = hy.sum([right, *(side * part[name] for side, part in zip(sides, parts, strict=True))])
        equations.append((variable, right))
    return Sliding(equations, sides)


def _reads(expression: Symbolic, along: Sequence[int]) -> bool:
    return bool({str(hy.par[j]) for j in along} & {str(p) for p in hy.get_params(expression)})


def _solved(matrix: list[list[Symbolic]], right: list[Symbolic]) -> list[Symbolic]:
    """Solution by Cramer's rule of one to three equations."""
    whole = _determinant(matrix)
    columns = range(len(right))
    replaced = [[[right[i] if j == k else matrix[i][j] for j in columns] for i in columns] for k in columns]
    return [_determinant(m) / whole for m in replaced]


def _determinant(matrix: list[list[Symbolic]]) -> Symbolic:
    terms = []
    for order in permutations(range(len(matrix))):
        swaps = sum(a > b for i, a in enumerate(order) for b in order[i + 1 :])
        product = hy.prod([matrix[i][j] for i, j in enumerate(order)])
        terms.append(-product if swaps % 2 else product)
    return hy.sum(terms)


_NEAR = 4.0
"""Roundings of its argument within which a rate is zero."""
_DIFFERENCES = 64.0
"""Bound of the error of a derivative by differences of that size, in units of the square root of epsilon."""
_GROWING = "swings about it grow from nothing, so that what follows isn't unique"
_BLENDS = (
    "it comes to rest there with another surface, and what either side adds to the motion points in "
    "different directions, so that what follows isn't unique"
)

ValuesAt = Callable[[Mapping[int, int], np.ndarray, Scalar], SurfaceValues]
"""Function from sides by number, a state and a time to a ``SurfaceValues``."""


@dataclass(frozen=True)
class Meeting:
    """Surfaces that meet at a state; ``at`` looks at them on given sides and at states nearby."""

    at: ValuesAt
    probe: SurfaceFunctions
    state: np.ndarray
    time: Scalar
    epsilon: float

    def rest(self, on: Sequence[int], kept: Mapping[int, int]) -> Continuation | None:
        """How the motion keeps to surfaces on which it lies, or which it could leave only by growing swings.

        None if it does neither on two of them, or if surfaces other than those that it already keeps to take
        part.
        """
        for held, rate in permutations(on, 2):
            others = [j for j in on if j not in (held, rate)]
            if held in kept or any(j not in kept for j in others):
                continue
            sign = self._sign(held, rate, others)
            if isinstance(sign, str):
                return Continuation(None, sign)
            if sign:
                return Continuation(
                    {held: sign * (HELD + rate), rate: SLIDES, **{j: kept[j] for j in others}}
                )
        return None

    def _sign(self, i: int, m: int, others: Sequence[int]) -> int | str:
        """Side of surface i at rest: that of m (1), the opposite (-1); 0 for no rest; a text if undecided."""
        fixed = dict.fromkeys(others, 1)
        looks: dict[tuple[int, ...], SurfaceValues] = {
            (s, t): self.at({**fixed, i: s, m: t}, self.state, self.time)
            for s, t in ((1, 1), (1, -1), (-1, 1), (-1, -1))
        }
        here = looks[1, 1]
        slope = self._slope(i, m, here)
        rates = [float(look.rate(i)) for look in looks.values()]
        noise = max(self.probe.rate_noise(look, i) for look in looks.values())
        known = _NEAR * abs(slope) * float(self.probe.swing_noises(here, self.state)[m]) + noise
        if slope == 0 or max(map(abs, rates)) > known or max(rates) - min(rates) > noise:
            return 0
        # v = slope u_m near the surface, and v' by the sides of u and v
        way = 1 if slope > 0 else -1
        pull = {(si, way * sm): slope * float(look.rate(m)) for (si, sm), look in looks.items()}
        brakes = pull[1, 1] < 0 < pull[-1, -1]
        returns = pull[1, -1] < 0 < pull[-1, 1]
        if not (brakes and returns) or any(self._felt(j, (i, m), fixed) for j in others):
            return 0
        back, out = pull[1, -1] * pull[-1, 1], pull[1, 1] * pull[-1, -1]
        if abs(back - out) <= self._tolerance * abs(out):
            return 0
        if back < out:
            return _GROWING
        base, (of_i, of_m), add_up = contributions(looks)
        if not add_up:
            return 0
        gradient = here.gradients[m].astype(np.float64)
        share = float(gradient @ of_i) / float(gradient @ of_m)
        sign = 1 if share > 0 else -1
        side = -float(here.by_time[m] + gradient @ base) / float(gradient @ (of_m + sign * of_i))
        if abs(side) > 1 - self._tolerance:  # it is being pulled off, or all but
            return 0
        field = self._kept_to(others, base + side * (of_m + sign * of_i), (i, m))
        strongest = max(map(abs, pull.values()))
        leaves = abs(self._drift(i, {**fixed, i: 1, m: 1}, field)) > self._tolerance * strongest
        if leaves:
            return 0
        alike = np.linalg.norm(of_i - share * of_m) <= PARALLEL * np.linalg.norm(of_i)
        return sign if alike else _BLENDS

    @property
    def _tolerance(self) -> float:
        return _DIFFERENCES * self.epsilon**0.5

    def _kept_to(self, others: Sequence[int], field: np.ndarray, pair: tuple[int, int]) -> np.ndarray:
        """A field for sides 1 of other surfaces kept to, converted to the sides with which they are."""
        plain = dict.fromkeys((*others, *pair), 1)
        here = self.at(plain, self.state, self.time)
        parts, felt = [], []
        for j in others:
            there = self.at({**plain, j: -1}, self.state, self.time)
            part = (here.field.astype(np.float64) - there.field.astype(np.float64)) / 2
            if abs(float(here.gradients[j].astype(np.float64) @ part)) > self.probe.rate_noise(here, j):
                parts.append(part)
                felt.append(j)
        if not felt:
            return field
        gradients = np.array([here.gradients[j].astype(np.float64) for j in felt])
        base = field - sum(parts)
        across = gradients @ np.array(parts).T
        by_time = np.array([float(here.by_time[j]) for j in felt])
        sides = np.linalg.lstsq(across, -(by_time + gradients @ base), rcond=None)[0]
        kept: np.ndarray = base + np.array(parts).T @ sides
        return kept

    def _slope(self, i: int, m: int, here: SurfaceValues) -> float:
        """Derivative of the rate of surface i by the argument of m, by a finite difference."""
        gradient = here.gradients[m].astype(np.float64)
        length = float(np.linalg.norm(gradient))
        if length == 0:
            return 0.0
        by = self._difference(i, {i: 1, m: 1}, gradient / length, 0.0)
        return by / length

    def _drift(self, i: int, sides: Mapping[int, int], field: np.ndarray) -> float:
        """Derivative of the rate of surface i along a field; zero if the field keeps to both surfaces."""
        speed = max(float(np.linalg.norm(field)), 1.0)
        return self._difference(i, sides, field / speed, 1.0 / speed) * speed

    def _difference(self, i: int, sides: Mapping[int, int], way: np.ndarray, clock: float) -> float:
        step = self.epsilon**0.5
        kind = self.state.dtype.type
        there = []
        for sign in (1, -1):
            moved = self.state + np.array([kind(sign * step * x) for x in way], dtype=self.state.dtype)
            then = self.time + kind(sign * step * clock)
            there.append(float(self.at(sides, moved, then).rate(i)))
        return (there[0] - there[1]) / (2 * step)

    def _felt(self, j: int, pair: tuple[int, int], fixed: Mapping[int, int]) -> bool:
        """Whether a surface's side changes how the motion crosses a pair of others, or the reverse."""
        i, m = pair
        here, there = (self.at({**fixed, i: 1, m: 1, j: side}, self.state, self.time) for side in (1, -1))
        if abs(float(here.rate(m) - there.rate(m))) > self.probe.rate_noise(here, m):
            return True
        opposite = [self.at({**fixed, i: s, m: t}, self.state, self.time) for s, t in ((-1, 1), (1, -1))]
        return any(
            abs(float(here.rate(j) - other.rate(j))) > self.probe.rate_noise(here, j) for other in opposite
        )
