"""Local defects of a trajectory: where the experiment's equations lead from a row, beside where it goes.

Kinematics separates a wrong model from a loose integrator. Whatever torques act and whatever the moments
of inertia are, the attitude is the integral of the angular velocity. So a motion of other equations, exactly
integrated, leaves the reference that starts from one of its rows in rates first, and in attitude just by
the integral of that: to first order d(theta)/dt = R (w - w_reference), with theta the rotation vector (space
axes) from the reference to the trajectory, and R of the reference. An integrator's errors, which are made in
rates and attitude alike, don't obey this: in a window of length T, in which the motion turns by little,
errors of the attitude itself exceed what errors of rates make of it by about 2 / (rate T).

The integral is taken over the rows of a window by the polynomial through them, whose first value is zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidsim.scene.row_rotations import conjugated, multiplied, normalised, turned, vector_of
from rigidsim.solve.from_states import FromStates, RowStates

_WINDOW = 0.5  # times the rate of the motion: length of a window, where the rows allow it
_PARTS = 4  # of a window
RESOLVED = 2.0
"""rad that the motion may turn from row to row, beyond which the rows don't show how."""
_ENOUGH = 0.5  # share of the windows with fewer parts that suffice
_STEEP = 4.0  # sum of the absolute weights, beyond which rows lie too unevenly for a polynomial


@dataclass(frozen=True)
class WindowDefects:
    """Defects over windows of several rows, rms over these.

    Attributes:
        length: of a window, s (median).
        attitude: angles at the windows' ends, rad.
        explained: those that are the integral of the differences of rates. unexplained: the rest.
        rates: differences of rates at the ends, rad/s.
        acceleration: missing mean acceleration, rad/s^2.
    """

    length: float
    attitude: float
    explained: float
    unexplained: float
    rates: float
    acceleration: float

    @property
    def share(self) -> float:
        """Unexplained over explained attitude defects."""
        return self.unexplained / self.explained if self.explained else float("inf")


def rms(values: np.ndarray) -> float:
    """Root of the mean square of numbers (n,), or of the sizes of vectors (n, 3)."""
    return float(np.sqrt(np.sum(values**2) / len(values)))


def motion_rate(times: np.ndarray, rates: np.ndarray) -> float:
    """The rate of a motion, rad/s: of its turning, or of the change of its rates, if faster."""
    size = float(np.sqrt(np.mean(np.sum(rates**2, axis=1))))
    steps = np.diff(times)
    change = np.diff(rates, axis=0) / steps[:, None]
    bend = float(np.sqrt(np.sum(change**2, axis=1) @ steps / steps.sum()))
    return max(size, bend / size if size else 0.0)


def windows_of_rows(times: np.ndarray, rate: float, length: float, parts: int, most: int) -> np.ndarray:
    """Rows (windows, parts + 1) of at most so many windows whose rows are about equally far apart in time.

    Args:
        rate: of the motion, rad/s. length: of a window in rad of the motion, where the rows are close enough;
            windows with a gap of more than ``RESOLVED`` are left out.
    """
    count = len(times)
    starts = np.unique(np.linspace(0, max(count - 1 - parts, 0), most).astype(int))
    steps = np.arange(parts + 1)
    goals = times[starts][:, None] + length / rate * steps / parts
    rows = np.maximum.accumulate(np.searchsorted(times, goals) - steps, axis=1) + steps
    rows = rows[rows[:, -1] < count]
    gaps = np.diff(times[rows], axis=1).max(axis=1, initial=0.0)
    return np.asarray(rows[gaps * rate < RESOLVED])


def row_defects(
    equations: FromStates, times: np.ndarray, states: RowStates, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Defects from some rows to the next ones; ``states`` are the trajectory's.

    Returns:
        Rotation vectors (rows, 3), rad, space axes, from where the equations lead to the next row, and
        differences of rates (rows, 3), rad/s, body axes.
    """
    begun = zip(states[rows], times[rows], times[rows + 1, None], strict=True)
    ends = np.stack([equations.after(*one)[0] for one in begun])
    return _apart(equations, states[rows + 1], ends)


def window_defects(
    equations: FromStates, times: np.ndarray, states: RowStates, rate: float, most: int
) -> WindowDefects | None:
    """Defects over at most so many windows; None where rows are too few or too far apart.

    Args:
        rate: of the motion, rad/s.
    """
    for parts in range(_PARTS, 1, -1):
        windows = windows_of_rows(times, rate, _WINDOW, parts, most)
        if parts > 2:
            ends = times[windows[:, -1]] - times[windows[:, 0]]
            windows = windows[ends * rate < RESOLVED]
        if len(windows) >= _ENOUGH * min(most, len(times) - parts):
            break
    found = [_one(equations, times, states, rows) for rows in windows]
    kept = [x for x in found if x is not None]
    if not kept:
        return None
    theta, integral, rates, length = (np.array(x) for x in zip(*kept, strict=True))
    vectors = (theta, integral, theta - integral, rates, rates / length[:, None])
    return WindowDefects(float(np.median(length)), *map(rms, vectors))


def _one(
    equations: FromStates, times: np.ndarray, states: RowStates, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float] | None:
    """A window: rotation vector at its end, the integral of the rates' differences, these."""
    reference = equations.after(states[rows[0]], times[rows[0]], times[rows[1:]])
    if not np.isfinite(reference).all():
        return None
    theta, apart = _apart(equations, states[rows[1:]], reference)
    quaternions, _ = equations.attitude(reference)
    along = turned(normalised(quaternions), apart)  # space axes
    length = times[rows[-1]] - times[rows[0]]
    places = (times[rows[1:]] - times[rows[0]]) / length
    powers = np.arange(1, len(places) + 1)
    weights = np.linalg.solve(places[None, :] ** powers[:, None], 1.0 / (powers + 1))
    if np.abs(weights).sum() > _STEEP:
        return None
    return theta[-1], length * weights @ along, apart[-1], float(length)


def _apart(equations: FromStates, theirs: np.ndarray, reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rotation vectors (space axes) from the reference to the trajectory, and differences of rates."""
    one, other = equations.attitude(reference), equations.attitude(theirs)
    turn = multiplied(normalised(other[0]), conjugated(normalised(one[0])))
    return vector_of(turn), other[1] - one[1]
