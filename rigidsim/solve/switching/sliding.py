"""Motion along switching surfaces, where the fields of both sides push onto them (Filippov 1988, section 4).

With the side s of each surface as a number between -1 and +1, the field f(s) that keeps to the surfaces is
the convex combination of the fields of the sides whose part across every surface is zero. Beside each other
several surfaces are resolved where their parts of the field add up: f = base + sum of s_j d_j.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import heyoka as hy

from rigidsim.model.rotations import Symbolic
from rigidsim.model.step_limiter import slopes
from rigidsim.model.system import System

MOST_AT_ONCE = 3
"""Largest number of surfaces along which a motion slides at once."""


@dataclass(frozen=True)
class Sliding:
    """The motion along some surfaces, which it leaves when the value in place of its side is 1 or -1."""

    equations: list[tuple[Symbolic, Symbolic]]
    sides: list[Symbolic]


def sliding(system: System, along: Sequence[int]) -> Sliding:
    """Equations along surfaces."""
    fields = {name: right for name, (_, right) in zip(system.states, system.equations, strict=True)}

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
