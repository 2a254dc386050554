"""Lyapunov exponents of a motion, from its variational equations (Benettin et al. 1980, Meccanica 15, 9).

The tangent vectors of all states are integrated along with the motion and orthogonalised at equal intervals;
the logarithms of their lengths add up to the exponents. In double precision, whatever the run's: exponents
are known to their statistical error at best.

The spectrum describes the body's motion. Other states that a scene carries have no tangent vectors:
neither those that only feed on the motion (the work of the loads, the pace of narrow functions), nor those
that drive it without feeling it (the position on an orbit), which stand for an explicit dependence on time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import heyoka as hy
import numpy as np

from rigidsim.model.system import System
from rigidsim.model.tangents import moving_names, own_names
from rigidsim.solve.compiled import interruptible
from rigidsim.solve.precision import precision_of
from rigidsim.solve.tangents import Derivatives, LostTangents, Place, Tangents

_INTERVAL = 16.0  # internal units between orthogonalisations: some dozens of steps, little growth
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


Convergence = dict[str, np.ndarray]
"""Progress of a spectrum, to be resumed with the same bits: ``number`` of intervals, ``place`` (state and
tangents), ``turns``, ``sums`` of logarithms, and ``times`` and ``exponents`` so far.
"""


def lyapunov_spectrum(
    system: System,
    start: float,
    end: float,
    go_on: Callable[[Convergence], bool],
    done: Convergence | None = None,
) -> LyapunovSpectrum | None:
    """Integrate the variational equations, while ``go_on`` says so; None if ended early or lost."""
    moving = motion_states(system)
    count = len(moving)
    tangents = interruptible(
        lambda: Tangents(Derivatives.of(system), moving, count, precision_of("double"), compact_mode=True)
    )
    intervals = max(1, math.ceil((end - start) / _INTERVAL))
    stride = max(1, math.ceil(intervals / _MOST_ROWS))
    begun = {
        "number": np.zeros(1, dtype=np.int64),
        "place": np.array([*map(float, system.initial), *np.eye(count).ravel()]),
        "turns": np.zeros(0),
        "sums": np.zeros(count),
        "times": np.zeros(0),
        "exponents": np.zeros((0, count)),
    }
    # of arrays that are empty none may have been saved
    fits = done is not None and "place" in done and done["place"].shape == begun["place"].shape
    done = begun | (done if done is not None and fits else {})
    first = int(done["number"][0])
    time = start + (end - start) * first / intervals
    none = np.zeros(count, dtype=np.int64)
    tangents.begin(Place((time, 0.0), done["place"], none, turns=tuple(done["turns"].tolist())))
    for number in range(first + 1, intervals + 1):
        time = start + (end - start) * number / intervals
        try:
            state, grown = tangents.to(time, lambda: go_on(done))
        except (LostTangents, KeyboardInterrupt):
            return None
        basis, triangle = np.linalg.qr(grown.T)
        lengths = np.abs(np.diag(triangle))
        done["sums"] = done["sums"] + np.log(np.maximum(lengths, np.finfo(float).tiny))
        tangents.restart(state, basis.T)
        if number % stride == 0 or number == intervals:
            done["times"] = np.append(done["times"], math.ldexp(time - start, system.scaling.time))
            latest = np.sort(done["sums"])[::-1] / done["times"][-1]
            done["exponents"] = np.vstack([done["exponents"], latest])
        done["number"], done["place"] = np.array([number]), tangents.here.state
        done["turns"] = np.array(tangents.here.turns, dtype=float)
        if not go_on(done):
            return None
    names = tuple(system.states[i] for i in moving)
    return LyapunovSpectrum(done["times"], done["exponents"], names)


def motion_states(system: System) -> list[int]:
    """Indices of the states whose offsets are offsets of the motion (``rigidsim.model.tangents``)."""
    reads = {
        name: set(hy.get_variables(right))
        for name, (_, right) in zip(system.states, system.equations, strict=True)
    }
    moving = moving_names(own_names(system.mechanics), reads)
    return [i for i, name in enumerate(system.states) if name in moving]
