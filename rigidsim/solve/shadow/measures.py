"""What differences between nearby states amount to, and what is noted of them along motions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from rigidsim.model.heyoka_expressions import TANGENT
from rigidsim.model.state_blocks import AttitudeStates
from rigidsim.model.system import System
from rigidsim.solve.compiled import compiled_function, evaluate_rows

_GROUPS = {
    "rates": ("wx", "wy", "wz"),
    "position": ("x", "y", "z"),
    "velocity": ("vx", "vy", "vz"),
}
_APART = ("pace", "work", "stride")
"""States that nothing depends on."""


@dataclass(frozen=True)
class Starts:
    """Motions to be followed; internal units.

    Attributes:
        begin, end: times, (motions,).
    """

    states: np.ndarray  # initial states (states, motions)
    begin: np.ndarray
    end: np.ndarray
    steps: np.ndarray  # steps that each is expected to take, (motions,)
    rate_units: np.ndarray  # factors that bring the body rates to a common unit, (3, motions)
    parameters: np.ndarray  # of the equations, (parameters, motions)

    def of(self, which: np.ndarray) -> Starts:
        """The starts of some motions."""
        return Starts(*(getattr(self, field.name)[..., which] for field in fields(self)))


class Measures:
    """Groups of a system's states, and angles between attitudes.

    Attributes:
        places: indices of the states of each quantity ("rates", "attitude", "position", "velocity").
        felt: mask of the states that anything depends on, (states,).
        groups: (groups, states), 1 for states that are measured together.
        carried: whether there is an attitude.
        angles, turn: indices of the states that are angles growing without bound, and their full turn.
    """

    def __init__(self, system: System, states: int | None = None, parameters: Sequence[Any] = ()) -> None:
        names, attitude = list(system.states[:states]), system.mechanics.attitude
        self.places = {group: [names.index(n) for n in of if n in names] for group, of in _GROUPS.items()}
        self.places["attitude"] = [] if attitude is None else [names.index(n) for n in attitude.names]
        self.felt = np.array([n not in _APART and not n.startswith(TANGENT) for n in names])
        grouped = {place for places in self.places.values() for place in places}
        alone = [[n] for n in range(len(names)) if n not in grouped and self.felt[n]]
        together = [*filter(None, self.places.values()), *alone]
        self.groups = np.zeros((len(together), len(names)))
        for row, places in enumerate(together):
            self.groups[row, places] = 1.0
        self.carried = attitude is not None
        self.angles, self.turn = list(system.angle_states), math.ldexp(2 * math.pi, -system.angle_unit)
        self._attitude = attitude
        self._variables = [*system.variables[: len(names)], *parameters]
        self._chord = None if attitude is None else attitude.chord

    def differences(
        self,
        states: np.ndarray,
        apart: np.ndarray,
        starts: Starts,
        which: np.ndarray,
        unit: np.ndarray | float = 1.0,
    ) -> dict[str, np.ndarray]:
        """Root mean square differences (motions,) of each quantity, as ``Spread`` names them, in units
        (motions,): of states (states, motions) and others that are ``apart`` (states, motions, others), where
        ``which`` are their numbers among the starts.
        """
        places, found = self.places, {}
        wrong = np.sqrt(np.add.reduce(apart * apart, axis=2) / apart.shape[2]) / unit
        if rates := places["rates"]:
            units = starts.rate_units[:, which]
            size, off = (np.sqrt(((units * x[rates]) ** 2).sum(axis=0)) for x in (states, wrong))
            found["rates"] = np.where(size > 0, off / np.maximum(size, 1e-300), 0.0)
        if self.carried:
            angles = self._angles_between(states, apart, starts.parameters[:, which])
            found["attitude"] = np.sqrt((angles**2).mean(axis=1)) / unit
        for name, size_name in (("position", "distance"), ("velocity", "speed")):
            if place := places[name]:
                found[name], found[size_name] = (
                    np.sqrt((x[place] ** 2).sum(axis=0)) for x in (wrong, states)
                )
        return found

    def _angles_between(self, states: np.ndarray, apart: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Angles (motions, others), rad, between the attitudes."""
        if self._chord is not None:
            return np.asarray(self._chord * np.sqrt((apart[self.places["attitude"]] ** 2).sum(axis=0)))
        _, motions, others = apart.shape
        every = np.concatenate([states[:, :, None], states[:, :, None] + apart], axis=2)
        read = np.repeat(parameters, others + 1, axis=1)
        found = self._quaternions(every.reshape(len(states), -1), read).reshape(4, motions, -1)
        return np.asarray(2.0 * np.sqrt(((found[:, :, 1:] - found[:, :, :1]) ** 2).sum(axis=0)))

    def _quaternions(self, states: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """Attitudes (4, n): Euler angles without compiling anything (40 ms)."""
        attitude = self._attitude
        assert attitude is not None
        if attitude.sequence and attitude.orbital is None:
            return _quaternion(attitude, states[self.places["attitude"]])
        # all at one time: a frame that turns with time doesn't change their distances
        function = padded_function(attitude.quaternion, self._variables, opt_level=0)
        return function(states, parameters, np.zeros(states.shape[1]))


def padded_function(
    expressions: Sequence[Any], variables: Sequence[Any], **options: Any
) -> Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]:
    """Compiled function of states, parameters and times, whose columns don't feel each other."""
    compiled = compiled_function(expressions, variables, compact_mode=True, fp_type=float, **options)
    return lambda states, parameters, times: evaluate_rows(
        compiled, np.concatenate([states, parameters]).T, times=times
    )


def _quaternion(attitude: AttitudeStates, angles: np.ndarray) -> np.ndarray:
    """Product of three rotations (4, n) about the axes of the sequence in turn."""
    cosines, sines = np.cos(angles / 2), np.sin(angles / 2)
    found = np.zeros((4, angles.shape[1]))
    found[0] = 1.0
    for axis, c, s in zip(attitude.sequence, cosines, sines, strict=True):
        n = "xyz".index(axis) + 1
        following, before = n % 3 + 1, (n + 1) % 3 + 1
        turned = c * found
        turned[0] -= s * found[n]
        turned[n] += s * found[0]
        turned[following] += s * found[before]
        turned[before] -= s * found[following]
        found = turned
    return found


class Spread:
    """Effect of errors of one epsilon per step along some motions, as noted at times.

    Its quantities, each by name:

    - ``time``, ``steps``: internal units; steps that the motion took until then, as it was followed;
    - ``rates``, ``attitude``, ``position``, ``velocity``: root mean square over the perturbed motions, in
      epsilons of internal units; attitude as an angle, rates relative to their size; zeros if there is none;
    - ``cut``: sum of the steps' truncation errors, in epsilons of the size of the states they befall; zero if
      the tolerance allows none beyond rounding;
    - ``distance``, ``speed``: of the motion from the origin.

    Attributes:
        whole: (motions,), False for motions that couldn't be followed to the requested end.
    """

    QUANTITIES = ("time", "steps", "rates", "attitude", "position", "velocity", "cut", "distance", "speed")

    def __init__(self, motions: int) -> None:
        self.whole = np.ones(motions, dtype=bool)
        self._largest = np.zeros((len(self.QUANTITIES), motions))
        self._notes: list[tuple[np.ndarray, np.ndarray]] = []

    def note(self, which: np.ndarray, **quantities: np.ndarray) -> None:
        """Note quantities of some motions."""
        rows = np.zeros((len(self.QUANTITIES), len(which)))
        for name, values in quantities.items():
            rows[self.QUANTITIES.index(name)] = values
        self._notes.append((which, rows))
        self._largest[:, which] = np.maximum(self._largest[:, which], rows)

    def along(self, name: str) -> np.ndarray:
        """Values of a quantity along a single motion, (notes,)."""
        place = self.QUANTITIES.index(name)
        return np.array([rows[place, 0] for _, rows in self._notes])

    def largest(self, name: str, until: np.ndarray | None = None) -> np.ndarray:
        """Largest values so far, (motions,), zero at the start; at the first note, and until some times."""
        place = self.QUANTITIES.index(name)
        if until is None:
            return self._largest[place]
        found = np.zeros(len(self.whole))
        for which, rows in self._notes:
            soon = (found[which] == 0) | (rows[0] <= until[which])
            found[which] = np.where(soon, np.maximum(found[which], rows[place]), found[which])
        return found

    def put(self, places: np.ndarray, others: Spread) -> None:
        """Replace the largest values of some motions."""
        self.whole[places], self._largest[:, places] = others.whole, others._largest
