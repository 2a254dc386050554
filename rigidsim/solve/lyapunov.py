"""Lyapunov exponents of a motion, from its variational equations (Benettin et al. 1980, Meccanica 15, 9).

The tangent vectors of all states are integrated along with the motion and orthogonalised at equal intervals;
the logarithms of their lengths add up to the exponents. In double precision, whatever the run's: exponents
are known to their statistical error at best.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import heyoka as hy
import numpy as np

from rigidsim.model.system import System

_INTERVAL = 16.0  # internal units between orthogonalisations: some dozens of steps, little growth
_MOST_ROWS = 1000  # of the convergence that is kept


@dataclass(frozen=True)
class LyapunovSpectrum:
    """Estimates as they converge.

    Attributes:
        times: since the run's start, seconds, shape (rows,).
        exponents: 1/s, largest first, shape (rows, states).
    """

    times: np.ndarray
    exponents: np.ndarray

    @property
    def largest(self) -> float:
        """The final estimate of the largest exponent, 1/s."""
        return float(self.exponents[-1, 0])

    @property
    def spread(self) -> float:
        """How far the largest one moved over the second half of the run: a sign of its convergence, 1/s."""
        later = self.exponents[len(self.times) // 2 :, 0]
        return float(later.max() - later.min())

    def chaotic(self, rate: float) -> bool:
        """Whether offsets grew far more than a stable motion's linear growth lets them.

        Args:
            rate: of the motion, rad/s.
        """
        duration = float(self.times[-1])
        regular = math.log1p(rate * duration)
        return self.largest * duration > 2 * regular + 3


@dataclass
class Convergence:
    """How far a spectrum is: plain float64 arrays, all that is needed to go on with the same bits.

    Attributes:
        number: intervals done.
        state: of the motion and its tangent vectors, orthogonalised; empty at the start.
        sums: logarithms of lengths so far, in the order of the vectors.
        times, exponents: estimates kept so far.
    """

    number: int = 0
    state: np.ndarray = field(default_factory=lambda: np.zeros(0))
    sums: np.ndarray = field(default_factory=lambda: np.zeros(0))
    times: list[float] = field(default_factory=list)
    exponents: list[np.ndarray] = field(default_factory=list)

    def arrays(self) -> dict[str, np.ndarray]:
        """For a file."""
        return {
            "number": np.array([self.number], dtype=np.int64),
            "state": self.state,
            "sums": self.sums,
            "times": np.array(self.times),
            "exponents": np.array(self.exponents),
        }

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray]) -> Convergence:
        """What was put into a file; an empty array isn't there."""
        return cls(
            int(arrays["number"][0]),
            arrays["state"],
            arrays["sums"],
            [float(t) for t in arrays.get("times", ())],
            list(arrays.get("exponents", ())),
        )


def lyapunov_spectrum(
    system: System,
    start: float,
    end: float,
    go_on: Callable[[Convergence], bool],
    done: Convergence | None = None,
) -> LyapunovSpectrum | None:
    """Integrate the variational equations over a run.

    Args:
        system: built for double precision.
        start, end: internal units.
        go_on: is told how far it is at each orthogonalisation; False ends it.
        done: to go on from; the same bits as in one go.

    Returns:
        The spectrum; None where it was ended early or the tangent vectors stopped being finite.
    """
    count = len(system.states)
    equations = hy.var_ode_sys(system.equations, hy.var_args.vars)
    initial = [float(x) for x in system.initial]
    integrator = hy.taylor_adaptive(equations, initial, time=start, compact_mode=True)
    intervals = max(1, math.ceil((end - start) / _INTERVAL))
    stride = max(1, math.ceil(intervals / _MOST_ROWS))
    done = done or Convergence(sums=np.zeros(count))
    if done.number:
        integrator.time = start + (end - start) * done.number / intervals
        integrator.state[:] = done.state
    for number in range(done.number + 1, intervals + 1):
        time = start + (end - start) * number / intervals
        outcome = integrator.propagate_until(time)[0]
        tangents = np.array(integrator.state[count:]).reshape(count, count)
        if outcome != hy.taylor_outcome.time_limit or not np.isfinite(tangents).all():
            return None
        basis, triangle = np.linalg.qr(tangents)
        lengths = np.abs(np.diag(triangle))
        done.sums = done.sums + np.log(np.maximum(lengths, np.finfo(float).tiny))
        integrator.state[count:] = basis.ravel()
        if number % stride == 0 or number == intervals:
            done.times.append(math.ldexp(time - start, system.scaling.time))
            done.exponents.append(np.sort(done.sums)[::-1] / done.times[-1])
        done.number, done.state = number, np.array(integrator.state)
        if not go_on(done):
            return None
    return LyapunovSpectrum(np.array(done.times), np.array(done.exponents))
