"""Tangents of a motion side by side: many times, one key a lane, in a batch integrator of compiled steps.

For motions in double precision whose equations stay the same from the start on: no tables, kernels or
switches. The motion itself is integrated at the precision's epsilon beside it. Each lane carries the motion
with a single tangent,

    y' = f(y, c),   d' = df/dy d + df/dc dc/dp,

made so small that step control doesn't see it: the equations are linear in it, so that its series have the
same radius of convergence, and its relative error is that of the motion in the lane.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import heyoka as hy
import numpy as np

from rigidsim.model.parametrised import Coefficients, Parametrised
from rigidsim.model.rotations import Symbolic
from rigidsim.solve.compiled import Kept, compiled_engine, compiled_function, evaluate_rows
from rigidsim.solve.precision import Precision, precision_of
from rigidsim.solve.tangent_states import jacobian_rows, moving_states
from rigidsim.solve.variational import LostTangents, Rows

WIDTH = 4
"""Lanes of a batch: the fastest for a motion with a tangent, even where registers hold eight."""
TOLERANCE = 1e-9
"""Of lanes, which take a third of the time then: derivatives that are right to some 1e-7."""
_SMALL = -80  # binary exponent of tangents in their lanes
_MOST = 20  # states, beyond which unrolled code takes long to compile
_BLOCK = 20_000  # rows that are held at once
_engines: Kept[Any] = Kept(8)


def fits_lanes(parametrised: Parametrised, precision: Precision) -> bool:
    """Whether a motion is one of those for lanes."""
    system = parametrised.plain
    alone = system.pieces is None and not system.clocked and not system.switches and parametrised.first == 0
    return precision.name == "double" and alone and not system.wide and len(system.states) <= _MOST


@dataclass
class _LaneNumbers:
    """Doubles of coefficients: (m,), (m, keys), (states,), (states, keys)."""

    values: np.ndarray
    slopes: np.ndarray
    initial: np.ndarray
    initial_slopes: np.ndarray

    @classmethod
    def of(cls, found: Coefficients) -> _LaneNumbers:
        keys = len(found.initial_slopes[0])

        def table(rows: list[list[Any]]) -> np.ndarray:
            return np.array([[float(x) for x in row] for row in rows]).reshape(len(rows), keys)

        values, initial = ([float(x) for x in row] for row in (found.values, found.initial))
        return cls(np.array(values), table(found.slopes), np.array(initial), table(found.initial_slopes))


class TangentLanes:
    """A parametrised motion and its tangents at ascending internal times."""

    def __init__(self, parametrised: Parametrised) -> None:
        self._made = parametrised
        system = parametrised.plain
        self._states, self._count, self._keys = len(system.states), parametrised.count, len(parametrised.keys)
        self._options = dict(precision_of("double").options)
        self._x = list(system.variables)
        self._plain = list(zip(self._x, parametrised.equations, strict=True))
        self._moving, tangents, self._slopes = self._tangents()
        self._d = list(tangents)
        self._both = [*self._plain, *tangents.items()]
        start = system.scene.context.ldexp(system.scene.start, -system.scaling.time)
        self._start = float(start)
        self._units = np.array(
            [math.ldexp(1.0, e) for one in parametrised.recorded for e in one.exponents], dtype=float
        )
        self._moved: tuple[bytes, np.ndarray] | None = None  # the latest motion, and all it depends on
        self.use(parametrised.coefficients)

    def use(self, coefficients: Coefficients) -> None:
        """Take coefficients and initial values; without derivatives of these there are none of the motion."""
        self._numbers = _LaneNumbers.of(coefficients)

    def _tangents(self) -> tuple[list[int], dict[Symbolic, Symbolic], list[Symbolic]]:
        """States with tangents, these with their equations, and derivatives of the outputs along them."""
        made = self._made
        expressions = [*made.equations, *made.outputs]
        jacobian = jacobian_rows(expressions, self._x)
        forcing = jacobian_rows(expressions, [hy.par[i] for i in range(self._count)])
        moving = moving_states(made, jacobian, forcing)
        d = {i: hy.make_vars(f"tangent_{made.states[i]}") for i in moving}

        def along(row: int) -> Symbolic:
            terms = [slope * d[i] for i, slope in jacobian[row].items() if i in d]
            terms += [slope * hy.par[self._count + m] for m, slope in forcing[row].items()]
            return hy.sum(terms) if terms else hy.expression(0.0)

        outputs = range(len(made.equations), len(expressions))
        return moving, {d[i]: along(i) for i in moving}, [along(row) for row in outputs]

    # --- motion and tangents ----------------------------------------------------------------------------

    def rows(self, times: np.ndarray, *, slopes: bool = True) -> Rows:
        """What is recorded, SI, and its derivatives, (n, keys, components), at internal times (n,).

        Raises:
            LostTangents: the motion or a tangent doesn't stay finite.
        """
        n = self._numbers
        values = self._function(self._made.outputs, self._x, self._motion(times), n.values[:, None], times)
        derivatives: list[np.ndarray] = []
        for first in range(0, self._keys if slopes else 0, WIDTH):
            keys = [min(first + i, self._keys - 1) for i in range(WIDTH)]
            derivatives += self._lanes(times, keys)[: self._keys - first]
        found = Rows({}, {})
        for one in self._made.recorded:
            part = slice(one.first, one.first + one.count)
            found.values[one.name] = values[:, part] * self._units[part]
            if derivatives:
                each = [derivative[:, part] for derivative in derivatives]
                found.slopes[one.name] = np.stack(each, axis=1) * self._units[part]
        return found

    def _motion(self, times: np.ndarray) -> np.ndarray:
        """States (n, states) by the scalar integrator."""
        n = self._numbers
        described = b"".join(x.tobytes() for x in (n.initial, n.values, times))
        if self._moved is not None and self._moved[0] == described:
            return self._moved[1]
        engine = compiled_engine(self._plain, np.zeros(self._states), **self._options)
        engine.time, engine.state[:], engine.pars[:] = self._start, n.initial, n.values[: len(engine.pars)]
        grid = times if times[0] == self._start else np.append(self._start, times)
        outcome, *_, states = engine.propagate_grid(grid)
        if outcome != hy.taylor_outcome.time_limit or not np.isfinite(states).all():
            raise LostTangents("the motion is no longer finite")
        self._moved = described, np.asarray(states[len(grid) - len(times) :])
        return self._moved[1]

    def _lanes(self, times: np.ndarray, keys: list[int]) -> list[np.ndarray]:
        """Derivatives of the outputs, (n, outputs), by the key of each lane."""
        n = self._numbers
        sizes = [np.abs(np.append(n.initial_slopes[:, j], n.slopes[:, j])).max(initial=0.0) for j in keys]
        scales = [math.ldexp(1.0, _SMALL - (math.frexp(size)[1] if size else 0)) for size in sizes]
        pars = np.concatenate([np.repeat(n.values[:, None], WIDTH, axis=1), n.slopes[:, keys] * scales])
        tangents = n.initial_slopes[np.ix_(self._moving, keys)] * scales
        state = np.concatenate([np.repeat(n.initial[:, None], WIDTH, axis=1), tangents])
        engine = self._engine()
        engine.set_time(self._start)
        engine.state[:] = state
        engine.pars[:] = pars[: len(engine.pars)]
        variables = [*self._x, *self._d]
        found: list[list[np.ndarray]] = [[] for _ in keys]
        for begin in range(0, len(times), _BLOCK):
            block = times[begin : begin + _BLOCK]
            first = float(engine.time[0])
            grid = block if block[0] == first else np.append(first, block)
            _, states = engine.propagate_grid(np.repeat(grid[:, None], WIDTH, axis=1))
            states = np.asarray(states)[len(grid) - len(block) :]
            if not np.isfinite(states).all():
                raise LostTangents("they are no longer finite")
            for lane, (part, scale) in enumerate(zip(found, scales, strict=True)):
                own = np.ascontiguousarray(states[:, :, lane])
                part.append(
                    self._function(self._slopes, variables, own, pars[:, lane : lane + 1], block) / scale
                )
        return [np.concatenate(part) for part in found]

    def _engine(self) -> Any:
        options = dict(self._options, tol=TOLERANCE)
        shape = (len(self._both), WIDTH)

        def make() -> Any:
            return hy.taylor_adaptive_batch(self._both, np.zeros(shape), **options)

        return _engines.get((self._both, WIDTH, sorted(options.items())), make)

    def _function(
        self, expressions: list[Symbolic], variables: list[Symbolic], states: np.ndarray, pars: np.ndarray,
        times: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """Values of expressions, (n, expressions)."""
        function = compiled_function(expressions, variables, **self._options)
        given = np.repeat(pars[: function.nparams], len(states), axis=1) if function.nparams else None
        return evaluate_rows(function, states, given, times).T
