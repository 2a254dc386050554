"""Error of a run whose motion has a closed form, by comparison, at any horizon."""

from __future__ import annotations

import math
from dataclasses import dataclass

import heyoka as hy
import numpy as np

from rigidsim.model.system import System
from rigidsim.solve.closed_form import ClosedForm
from rigidsim.solve.precision import Precision, precision_of
from rigidsim.solve.problem import InitialValueProblem, double_twin
from rigidsim.solve.trail import SampleTrail

_VECTORS = {"rates": ("wx", "wy", "wz"), "position": ("x", "y", "z"), "velocity": ("vx", "vy", "vz")}


@dataclass(frozen=True)
class ExactError:
    """Largest errors at some samples, the last among them: rad (None without an attitude), relative, m and
    m/s (None without a position).
    """

    attitude: float | None
    rates: float | None
    position: float | None
    velocity: float | None


def exact_error(prepared: InitialValueProblem, form: ClosedForm, trail: SampleTrail) -> ExactError:
    """Compare a run's samples with the closed form of its motion, evaluated in the run's precision or better,
    which rounds only a few times at any time.
    """
    precision = precision_of("double") if prepared.precision.narrow else prepared.precision
    there_system = double_twin(prepared)
    times = np.array([time for _, time, _, _ in trail.samples], dtype=precision.scalar)
    start = precision.scalar(prepared.clock.start)
    there = form.states(there_system, precision, times, start)
    here = [_Reader(s, precision) for s in (prepared.system, prepared.system.partner) if s is not None]
    reference = _Reader(there_system, precision)
    largest: dict[str, float] = {}
    for row, (_, _, state, chart) in enumerate(trail.samples):
        found = _apart(here[chart].read(state.astype(precision.scalar)), reference.read(there[row]))
        largest = {name: max(error, largest.get(name, 0.0)) for name, error in found.items()}
    return ExactError(*(largest.get(name) for name in ("attitude", *_VECTORS)))


class _Reader:
    """Quantities that the states of a system stand for, compiled once."""

    def __init__(self, system: System, precision: Precision) -> None:
        self._system, attitude = system, system.mechanics.attitude
        self._function = None
        self._places: list[int] = []
        if attitude is not None and all(x in system.variables for x in attitude.quaternion):
            self._places = [system.variables.index(x) for x in attitude.quaternion]
        elif attitude is not None:
            options = precision.options
            self._function = hy.cfunc(attitude.quaternion, system.variables, compact_mode=True, **options)

    def read(self, state: np.ndarray) -> dict[str, np.ndarray]:
        """The quaternion (4,), and vectors in SI as the nearest doubles and their residuals, (2, 3)."""
        found: dict[str, np.ndarray] = {}
        if self._function is not None:
            found["attitude"] = np.array(self._function(state))
        elif self._places:
            found["attitude"] = state[self._places]
        for name, of in _VECTORS.items():
            if all(state_name in self._system.states for state_name in of):
                found[name] = _vector(self._system, state, of)
        return found


def _apart(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> dict[str, float]:
    """Distances in SI; for rates, relative to their size."""
    found: dict[str, float] = {}
    for name in one.keys() & other.keys():
        a, b = one[name], other[name]
        if name == "attitude":
            found[name] = _angle(a, b)
        else:
            size = float(np.linalg.norm(b[0])) if name == "rates" else 1.0
            found[name] = float(np.linalg.norm(a[0] - b[0] + (a[1] - b[1]))) / (size or 1.0)
    return found


def _vector(system: System, values: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """Three states in SI as the nearest doubles and their residuals, (2, 3)."""
    places = [system.states.index(name) for name in names]
    exponents = np.array([system.state_exponents[i] for i in places], dtype=np.int32)
    high = np.array([float(values[i]) for i in places])
    low = np.array([float(values[i] - type(values[i])(h)) for i, h in zip(places, high, strict=True)])
    return np.ldexp(np.array([high, low]), exponents)


def _angle(one: np.ndarray, other: np.ndarray) -> float:
    """Angle between attitudes given as quaternions, up to their sign, rad."""
    opposite = sum(float(a) * float(b) for a, b in zip(one, other, strict=True)) < 0
    apart = [float(a + b) if opposite else float(a - b) for a, b in zip(one, other, strict=True)]
    return 4 * math.asin(min(math.hypot(*apart) / 2, 1.0))
