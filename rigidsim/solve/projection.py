"""Projection of invariants onto their initial values every few natural steps, which beats the round-off law.

Attitude errors grow like t^1.5 because round-off lets energy and momentum wander, and the motion's
frequencies with them (Brouwer 1937). Where these are projected back, only round-off along the motion itself
remains. Three measures make this work to the last bit:

- Residuals are evaluated one precision higher, against initial values known to as many digits.
- The least correction of the state (Gauss-Newton, in the scaled states, where every component is of order
  one) is rounded like everything else, so that no invariant is restored exactly. What moves the
  phase is the residual's integral over time; that is what is driven to zero: each correction aims at the
  small offset that will cancel the integral so far. It removes the bias of corrections below half a last
  bit, and that of an invariant that drifts to one side between corrections.
- Coefficients are carried in two parts (``rigidsim.model.two_part``): a rounded one is a wrong frequency.
  Where projection begins late the equations stay as they are, and nothing is compiled anew: what they lack,
  f(x) with all digits of the coefficients less f(x) with the rounded ones, is added at each correction for
  the time since the last. It is taken at places all over the motion, so that its mean is right.

Where gradients are nearly parallel (spin about a principal axis) the ill-determined direction is left to
itself, by a damping as large as the effect of the residuals' own rounding there. A state that stands
exactly where it began is left alone: what is zero for good stays zero.
"""

from collections.abc import Sequence
from functools import cached_property, reduce
from typing import Any

import heyoka as hy
import mpmath
import numpy as np

from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Rounder
from rigidsim.model.system import System, projected_invariants
from rigidsim.solve.compiled import CompiledFunction, compiled_function
from rigidsim.solve.precision import Precision, Scalar, precision_of

LATE = 8192
"""Natural steps after which ``hold_invariants = "auto"`` begins to project: some milliseconds of double
precision, in which errors of rounding are still small; what they did to the phase is known, and taken back. A
fixed count: a run that is prolonged past it is the run in one go.
"""

NOTED = 1024
"""Natural steps from one state that is noted before ``LATE`` to the next. What they say of the invariants is
worked out when projection begins, so that a shorter run compiles nothing for it.
"""

STEPS_BETWEEN = 128
"""Natural steps from one correction to the next, fixed so that bits depend on no clock. Errors grow in
proportion to it and cost falls: at 128 steps of double precision a correction (7 us) costs a twentieth of
them, and errors at 1e6 radians are some 5e-13 rad (with 64: 3e-13, a tenth; with 16: 1e-13, a half).
"""

LATE_BETWEEN = 512
"""The same for ``hold_invariants = "auto"``, whose errors have their share from before it began: for bodies
(3, 1, 2) and (1, 2, 3) at 1e6 units of time 1.4e-12 and 4.5e-12 rad (with 256: 3.2e-12 and 2.0e-12, with
1024: 6.2e-12 and 1.1e-11; 3.8e-8 and 2.5e-8 without), for a quarter of the corrections.
"""

_STEPS_BETWEEN_IN_SINGLE = 256  # whose steps cost a quarter as much


def steps_between(precision: Precision, *, late: bool = False) -> int:
    """Natural steps from one correction to the next."""
    if late:
        return LATE_BETWEEN
    return _STEPS_BETWEEN_IN_SINGLE if precision.scalar is np.float32 else STEPS_BETWEEN


_LARGEST = 2.0**-6  # largest correction; past it the state is no longer near the motion


def one_higher(precision: Precision) -> Precision:
    """The precision in which residuals are evaluated."""
    following = {"single": "double", "double": "extended", "extended": "quadruple"}
    if precision.name in following:
        return precision_of(following[precision.name])
    bits = precision.bits + 64
    return Precision(f"{bits} bits", bits, hy.real, cheap=False, compact=True)


def put_back_by_invariant(names: Sequence[str], rows: np.ndarray) -> dict[str, np.ndarray]:
    """Corrections put back, of rows (n, projected scalars), by invariant (n,): with their sign for a scalar,
    the norm for several components, as drifts are recorded. A row's bits depend on that row alone.
    """
    columns: dict[str, list[np.ndarray]] = {}
    for name, column in zip(names, rows.T, strict=True):
        columns.setdefault(name, []).append(column)
    return {name: found[0].copy() if len(found) == 1 else _norm(found) for name, found in columns.items()}


def _norm(columns: Sequence[np.ndarray]) -> np.ndarray:
    total = columns[0] * columns[0]
    for column in columns[1:]:
        total = total + column * column
    return np.asarray(np.sqrt(total))


class Projection:
    """Puts the invariants of one system back to their initial values.

    Attributes:
        names: the invariant that each projected scalar belongs to.
        left_out: (invariant, why) of those not projected themselves.
        memory: all that later corrections depend on, changed in place and part of a checkpoint; float64
            (3 m + 3,): of each projected scalar its residual's integral over time, what was put back, and its
            residual after the latest correction; the time of that and the longest interval so far (internal
            units), and the count of corrections left out since they were not small; where it is ``late``,
            whether it has begun, and the states noted until then. It means the same in another chart.
    """

    def __init__(self, system: System, precision: Precision, start: Scalar, *, late: bool = False) -> None:
        self._low, self._high = precision, one_higher(precision)
        self._system, self._start, self._chart = system, float(start), 0
        projected, self.left_out = projected_invariants(system)
        self.names = [h.name for h in projected]
        n, m = len(system.states), len(projected)
        parts = len(precision.parts(precision.array(system.initial)))
        self._notes = np.zeros((LATE // NOTED if late else 0, n * parts + 2))
        self.memory = np.zeros(3 * m + 3 + late + self._notes.size)
        if late:
            self._notes = self.memory[-self._notes.size :].reshape(self._notes.shape)
        self.late, self._parts = late, parts
        self._sums, self._then = self.memory[: 2 * m], self.memory[2 * m : 3 * m]
        self._residuals_memory, self._times = self.memory[: 3 * m], self.memory[3 * m : 3 * m + 3 + late]
        self._times[0] = self._start
        self._functions: dict[int, tuple[CompiledFunction, CompiledFunction]] = {}
        # views into the compiled functions' input and output; a correction is a call of 7 us
        self._in = self._high.of_doubles(np.zeros(n + 2 + 3 * m))
        self._out = self._high.of_doubles(np.zeros(n + 2 * m + 1))
        self._state, self._clock, self._remembered = self._in[:n], self._in[n : n + 2], self._in[n + 2 :]
        self._left = self._high.of_doubles(np.zeros(m))
        self._result = np.zeros(n + 2 * m + 1)
        self._change, self._new_sums = self._result[:n], self._result[n:-1]
        if not late:
            self._then[:] = self.residuals(precision.array(system.initial))

    @cached_property
    def _wide(self) -> System:
        return self._system.rounded(self._high.number)

    @cached_property
    def _reference(self) -> np.ndarray:
        """Initial values of the projected scalars."""
        wide = self._wide
        projected, _ = projected_invariants(wide)
        values = compiled_function([h.expression for h in projected], wide.variables, **self._options)
        return np.asarray(values(self._high.array(wide.initial)))

    @property
    def holding(self) -> bool:
        """Whether it corrects, or only notes states."""
        return not self.late or self._times[3] == 1.0

    def note(self, state: np.ndarray, time: Scalar, number: int) -> None:
        """Note a state before projection begins, number 0 to ``LATE // NOTED`` - 1."""
        row = self._notes[number]
        row[0], row[1] = float(time), self._chart
        row[2:] = np.concatenate(self._low.parts(state))

    def begin(self, state: np.ndarray, time: Scalar) -> None:
        """Correct for the first time, with the residuals' integral over the noted states."""
        chart = self._chart
        self.use(0)
        self._then[:] = self.residuals(self._low.array(self._system.initial))
        for now, there, *values in self._notes.tolist():
            if now > self._times[0]:  # else none was taken
                self.use(int(there))
                parts = np.array(values).reshape(self._parts, -1)
                noted = _sum([self._low.of_doubles(part) for part in parts])
                self.project(noted.copy(), now)
                self._then[:] = self.residuals(noted)  # of a state that stayed as it was
        self.use(chart)
        self._times[1] = 0.0
        self.project(state, time)
        self._times[1] = 0.0  # what follows comes at intervals shorter than the one from the last note
        self._times[3] = 1.0

    def use(self, chart: int) -> None:
        """Correct from now on in the states of the system (0) or of its partner (1)."""
        self._chart = chart

    def load(self) -> None:
        """Compile the correction for the states in use, unless that is done."""
        if self._chart not in self._functions:
            self._functions[self._chart] = self._compile()

    def project(self, state: np.ndarray, time: Scalar) -> None:
        """Correct a state in place, at a natural step boundary; a function of it, the time and ``memory``."""
        self.load()
        residuals, correction = self._functions[self._chart]
        now, times = float(time), self._times
        elapsed = now - times[0]
        # the longest so far: an aim worked out for a shorter one than the next would overshoot
        interval = max(elapsed, times[1])
        pace = 1 / interval if interval > 0 else 0.0
        cheap = self._high.cheap
        if cheap:
            self._state[:] = state
            self._clock[0], self._clock[1] = elapsed, pace
            self._remembered[:] = self._residuals_memory
        else:
            self._state[:] = self._widened(state)
            self._clock[:] = self._high.of_doubles(np.array([elapsed, pace]))
            self._remembered[:] = self._high.of_doubles(self._residuals_memory)
        timed = correction.is_time_dependent  # by what the equations lack
        at = {"time": self._high.of_doubles(np.array([now]))[0]} if timed else {}
        correction(self._in, outputs=self._out, **at)
        self._result[:] = self._out
        if not self._result[-1] < _LARGEST**2:  # also where it is nan
            times[2] += 1
            return
        # float64 so far: at most 250 digits, for which 1e-250 is well in range
        state -= self._change if cheap else self._low.of_doubles(self._change)
        self._sums[:] = self._new_sums
        self._state[:] = state if cheap else self._widened(state)
        residuals(self._state, outputs=self._left)
        self._then[:] = self._left
        times[0], times[1] = now, interval

    def residuals(self, state: np.ndarray) -> np.ndarray:
        """(value - initial) / scale of each projected scalar, float64, evaluated one precision higher."""
        self.load()
        residuals, _ = self._functions[self._chart]
        return np.asarray(residuals(self._widened(state))).astype(np.float64)

    @property
    def corrections(self) -> np.ndarray:
        """Corrections so far, (scalars,), over the drifts' scales: to first order the drifts without them."""
        return self._sums[len(self.names) :].copy()

    # --- arithmetic -------------------------------------------------------------------------------------

    def _widened(self, state: np.ndarray) -> np.ndarray:
        """A state in the higher precision, exactly."""
        return _sum([self._high.of_doubles(part) for part in self._low.parts(state)])

    @property
    def _options(self) -> dict[str, Any]:
        return {"compact_mode": self._high.compact, **self._high.options}

    def _compile(self) -> tuple[CompiledFunction, CompiledFunction]:
        """Functions of the system in use at the higher precision: residuals, and correction with new sums."""
        low, high, wide = self._low, self._high, self._in_use(self._wide)
        projected, _ = projected_invariants(wide)
        residuals = [
            high.number(1 / h.scale) * (h.expression - hy.expression(value))
            for h, value in zip(projected, self._reference, strict=True)
        ]
        lacking = []
        if self.late:
            as_integrated = self._system.rounded(lambda value: high.number(low.exact(low.number(value))))
            lacking = coefficient_rounding_terms(wide, self._in_use(as_integrated))
        context = wide.scene.context
        damping = high.number(damping_between(low.bits, high.bits, context))
        freedoms = freedoms_of(wide, high.number)
        inputs, outputs = correction(wide.variables, freedoms, residuals, lacking, damping)
        return (
            compiled_function(residuals, wide.variables, **self._options),
            compiled_function(outputs, inputs, **self._options),
        )

    def _in_use(self, system: System) -> System:
        """A system, or its partner where that is the chart in use."""
        found = system if self._chart == 0 else system.partner
        assert found is not None
        return found


def _sum(parts: Sequence[np.ndarray]) -> np.ndarray:
    """The sum of parts, the smallest first."""
    return reduce(lambda total, part: total + part, reversed(parts))


# --- the correction as expressions --------------------------------------------------------------------------


def correction(
    states: Sequence[Symbolic],
    freedoms: Sequence[Symbolic],
    residuals: Sequence[Symbolic],
    lacking: Sequence[Symbolic],
    damping: Scalar,
) -> tuple[list[Symbolic], list[Symbolic]]:
    """What a correction is worked out from, and what comes of it.

    Residuals are (value - initial) / scale of each projected scalar; what is lacking of each state's
    derivative (``coefficient_rounding_terms``) may be empty. The inputs: states, the time since the latest
    correction, one over the interval that the next is expected within, and of each scalar its residual's
    integral until then, what was put back, and the residual that was left. The outputs: what to take off
    the states, the integrals, what was put back, and the square of the size of the part that puts invariants
    back.
    """
    m, x = len(residuals), list(states)
    elapsed, pace = hy.make_vars("elapsed", "pace_of_corrections")
    integrals, put_back, then = (
        [hy.make_vars(f"{name}_{j}") for j in range(m)] for name in ("integral", "put_back", "then")
    )
    new_integrals = [
        s + 0.5 * (elapsed * (a + b)) for s, a, b in zip(integrals, residuals, then, strict=True)
    ]
    new_put_back = [c + (a - b) for c, a, b in zip(put_back, residuals, then, strict=True)]
    tensors = hy.diff_tensors(residuals, x, diff_order=1)
    gradients = [
        [tensors[(j, *(int(k == i) for k in range(len(x))))] for i in range(len(x))] for j in range(m)
    ]
    wanted = [r + pace * s for r, s in zip(residuals, new_integrals, strict=True)]
    if lacking:  # along the invariants' level sets: what it would change of them is taken off at once
        across = [hy.sum([g * f for g, f in zip(row, lacking, strict=True)]) for row in gradients]
        wanted = [r + elapsed * a for r, a in zip(wanted, across, strict=True)]
    change = least_correction(
        [[free * g for free, g in zip(freedoms, row, strict=True)] for row in gradients], wanted, damping
    )
    size = hy.sum([c * c for c in change])
    change = [free * c for free, c in zip(freedoms, change, strict=True)]
    if lacking:
        change = [hy.sum([c, -(elapsed * f)]) for c, f in zip(change, lacking, strict=True)]
    return [*x, elapsed, pace, *integrals, *put_back, *then], [*change, *new_integrals, *new_put_back, size]


def freedoms_of(system: System, number: Rounder) -> list[Symbolic]:
    """How far a correction of order one moves each state: as far as 1 rad for an angle in a larger unit, in
    which the same change would look smaller than one of the spin. Not at all where the state stands exactly
    where it began: it has no drift to be put back, and a rate or a direction that is exactly zero for good
    would leave it, to grow about an unstable axis.
    """
    units = [0] * len(system.states)
    for i in system.angle_states:
        units[i] = system.angle_unit
    return [
        hy.select(hy.eq(x, hy.expression(number(start))), hy.expression(0.0), hy.expression(2.0**-unit))
        for x, start, unit in zip(system.variables, system.initial, units, strict=True)
    ]


def coefficient_rounding_terms(exact: System, integrated: System) -> list[Symbolic]:
    """What integrated equations lack of each derivative, since their coefficients are rounded; empty where
    they have parameters, which change along the motion: orbits by tables, which are rounded themselves. Both
    have the digits of the higher precision, ``integrated`` the digits of the integration in it.
    """
    pairs = zip(exact.equations, integrated.equations, strict=True)
    if hy.get_params([right for _, right in exact.equations]):
        return []
    return [right - rounded for (_, right), (_, rounded) in pairs]


def damping_between(low: int, high: int, context: mpmath.MPContext) -> mpmath.mpf:
    """Square of the sine between gradients below which a direction is left to itself.

    Residuals are known to some eps_high, so that the correction in a direction of singular value s is
    known to eps_high / s; damped by d it errs by at most eps_high / (2 sqrt d), which is to stay below
    an eighth of eps. The Gram matrix must stay positive after its own rounding.
    """
    two = context.mpf(2)
    return max(two ** (2 * (2 + low - high)), two ** (9 - high))


def least_correction(
    gradients: list[list[Symbolic]], wanted: list[Symbolic], damping: Scalar
) -> list[Symbolic]:
    """Least change of the state that removes residuals, J^T (J J^T + damping)^-1 r, with J of order one."""
    m = len(wanted)
    pairs = [[zip(gradients[a], gradients[b], strict=True) for b in range(m)] for a in range(m)]
    gram = [[hy.sum([x * y for x, y in pair]) for pair in row] for row in pairs]
    for a in range(m):
        gram[a][a] = gram[a][a] + damping
    weights = solve_positive(gram, wanted)
    states = range(len(gradients[0]))
    return [hy.sum([gradients[j][i] * weights[j] for j in range(m)]) for i in states]


def solve_positive(matrix: list[list[Symbolic]], right: list[Symbolic]) -> list[Symbolic]:
    """Solution of a symmetric positive system of expressions, by its L D L^T decomposition."""
    size = len(right)
    lower: list[list[Any]] = [[None] * size for _ in range(size)]
    pivots: list[Any] = []
    for j in range(size):
        known = [-(lower[j][k] * (lower[j][k] * pivots[k])) for k in range(j)]
        pivots.append(hy.sum([matrix[j][j], *known]))
        for i in range(j + 1, size):
            known = [-(lower[i][k] * (lower[j][k] * pivots[k])) for k in range(j)]
            lower[i][j] = hy.sum([matrix[i][j], *known]) / pivots[j]
    solution: list[Any] = []
    for i in range(size):
        solution.append(hy.sum([right[i]] + [-(lower[i][k] * solution[k]) for k in range(i)]))
    solution = [y / d for y, d in zip(solution, pivots, strict=True)]
    for i in reversed(range(size)):
        known = [-(lower[k][i] * solution[k]) for k in range(i + 1, size)]
        solution[i] = hy.sum([solution[i], *known])
    return solution
