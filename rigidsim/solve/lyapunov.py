"""Lyapunov exponents of a motion, from its variational equations (Benettin et al. 1980, Meccanica 15, 9).

The tangent vectors of all states are integrated along with the motion and orthogonalised at equal intervals;
the logarithms of their lengths add up to the exponents. In double precision, whatever the run's: exponents
are known to their statistical error at best.

The spectrum is that of the body's motion. Other states that a scene carries have no tangent vectors:
neither those that only feed on the motion (the work of the loads, the pace of narrow functions), nor those
that drive it without feeling it (the position on an orbit), which stand for an explicit dependence on time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields

import heyoka as hy
import numpy as np

from rigidsim.model.rotations import Symbolic
from rigidsim.model.system import System
from rigidsim.model.tangents import moving_names, own_names
from rigidsim.solve.compiled import TaylorEngine, interruptible
from rigidsim.solve.switching.turned import Turned

_INTERVAL = 16.0  # internal units between orthogonalisations: some dozens of steps, little growth
_CHUNK, _MOST_CHUNKS = 4096, 256  # steps between two looks at Ctrl-C, and such chunks in an interval
_MOST_ROWS = 1000  # rows of the convergence that are kept


@dataclass(frozen=True)
class LyapunovSpectrum:
    """Lyapunov exponents as they converge."""

    times: np.ndarray  # times since the run's start, s, shape (rows,)
    exponents: np.ndarray  # 1/s, largest first, shape (rows, states of the motion)
    states: tuple[str, ...] = ()

    @property
    def largest(self) -> float:
        """The final estimate of the largest exponent, 1/s."""
        return float(self.exponents[-1, 0])

    @property
    def spread(self) -> float:
        """Change of the largest exponent over the second half of the run, 1/s: how far it converged."""
        later = self.exponents[len(self.times) // 2 :, 0]
        return float(later.max() - later.min())

    def chaotic(self, rate: float) -> bool:
        """Whether offsets grew far more than linearly, which is all that a stable motion allows."""
        duration = float(self.times[-1])
        regular = math.log1p(rate * duration)
        return self.largest * duration > 2 * regular + 3


@dataclass
class Convergence:
    """Progress of a spectrum, float64, to be resumed with the same bits; empty at the start."""

    number: int = 0
    state: np.ndarray = field(default_factory=lambda: np.zeros(0))
    sums: np.ndarray = field(default_factory=lambda: np.zeros(0))
    times: list[float] = field(default_factory=list)
    exponents: list[np.ndarray] = field(default_factory=list)
    parameters: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def arrays(self) -> dict[str, np.ndarray]:
        """The arrays to be saved."""
        return {one.name: np.atleast_1d(np.asarray(getattr(self, one.name))) for one in fields(self)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray]) -> Convergence:
        """The progress saved as arrays; empty arrays may be missing."""
        return cls(
            int(arrays["number"][0]),
            arrays["state"],
            arrays["sums"],
            [float(t) for t in arrays.get("times", ())],
            list(arrays.get("exponents", ())),
            arrays.get("parameters", np.zeros(0)),
        )


def lyapunov_spectrum(
    system: System,
    start: float,
    end: float,
    go_on: Callable[[Convergence], bool],
    done: Convergence | None = None,
) -> LyapunovSpectrum | None:
    """Integrate the variational equations, while ``go_on`` says so; None if ended early or lost."""
    moving = motion_states(system)
    states, count = len(system.states), len(moving)
    initial = [float(x) for x in system.initial] + list(np.eye(count).ravel())
    equations = tangent_equations(system, moving)
    integrator = interruptible(lambda: hy.taylor_adaptive(equations, initial, time=start, compact_mode=True))
    intervals = max(1, math.ceil((end - start) / _INTERVAL))
    stride = max(1, math.ceil(intervals / _MOST_ROWS))
    if done is None or (done.state.size, done.parameters.size) != (len(initial), len(integrator.pars)):
        done = Convergence(sums=np.zeros(count))
    if done.number:
        integrator.time = start + (end - start) * done.number / intervals
        integrator.state[:] = done.state
        integrator.pars[:] = done.parameters
    follow = _following(system, integrator, done)
    for number in range(done.number + 1, intervals + 1):
        time = start + (end - start) * number / intervals
        for _ in range(_MOST_CHUNKS):
            outcome = integrator.propagate_until(time, max_steps=_CHUNK, callback=follow)[0]
            if outcome != hy.taylor_outcome.step_limit or not go_on(done):
                break
        tangents = np.array(integrator.state[states:]).reshape(count, count)
        if outcome != hy.taylor_outcome.time_limit or not np.isfinite(tangents).all():
            return None
        basis, triangle = np.linalg.qr(tangents)
        lengths = np.abs(np.diag(triangle))
        done.sums = done.sums + np.log(np.maximum(lengths, np.finfo(float).tiny))
        integrator.state[states:] = basis.ravel()
        if number % stride == 0 or number == intervals:
            done.times.append(math.ldexp(time - start, system.scaling.time))
            done.exponents.append(np.sort(done.sums)[::-1] / done.times[-1])
        done.number, done.state = number, np.array(integrator.state)
        done.parameters = np.array(integrator.pars)
        if not go_on(done):
            return None
    names = tuple(system.states[i] for i in moving)
    return LyapunovSpectrum(np.array(done.times), np.array(done.exponents), names)


def _following(
    system: System, integrator: TaylorEngine, done: Convergence
) -> Callable[[TaylorEngine], bool] | None:
    """What keeps turns of angles, and the quaternion's sign, continuous after each step; None if the
    equations read neither.
    """
    states, angles, used = len(system.states), len(system.turning), len(integrator.pars)
    read = [*system.turning, *system.signed]
    if not read or not used:
        return None
    function = hy.cfunc(read, system.variables, compact_mode=True)

    def plain() -> tuple[list[float], list[float]]:
        found = function(np.array(integrator.state[:states])).tolist()
        return found[:angles], found[angles:]

    here = plain()
    turned = Turned.by(*here, done.parameters.tolist()) if done.number else Turned.begun(system, *here)

    def follow(_: TaylorEngine) -> bool:
        nonlocal turned
        here = plain()
        found = turned.parameters(*here)
        turned = Turned.by(*here, found)
        integrator.pars[: len(found)] = found[:used]
        return True

    follow(integrator)
    return follow


def motion_states(system: System) -> list[int]:
    """Indices of the states whose offsets are offsets of the motion (``rigidsim.model.tangents``)."""
    reads = {
        name: set(hy.get_variables(right))
        for name, (_, right) in zip(system.states, system.equations, strict=True)
    }
    moving = moving_names(own_names(system.mechanics), reads)
    return [i for i, name in enumerate(system.states) if name in moving]


def tangent_equations(system: System, moving: Sequence[int]) -> list[tuple[Symbolic, Symbolic]]:
    """The system's equations, then those of the derivatives of moving states by their initial values, row by
    row.

    All other states are integrated without tangent vectors, so that step control sees the same states.
    """
    chosen = [system.variables[i] for i in moving]
    varied = hy.var_ode_sys(system.equations, chosen).sys
    states, count = len(system.states), len(moving)
    rows = [varied[states + i * count : states + (i + 1) * count] for i in range(states)]
    # what drives the motion doesn't depend on it; what feeds on it is read by nothing
    none = {variable: hy.expression(0.0) for i in range(states) if i not in moving for variable, _ in rows[i]}
    tangents = [(variable, hy.subs(right, none)) for i in moving for variable, right in rows[i]]
    return [*varied[:states], *tangents]
