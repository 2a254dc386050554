"""Local defects of a trajectory: where the experiment's equations lead from a row, and where it goes.

Kinematics separates a wrong model from a loose integrator. Whatever torques act and whatever the moments
of inertia are, the attitude is the integral of the angular velocity. So a motion of other equations, exactly
integrated, leaves the reference that starts from one of its rows in rates first, and in attitude just by
the integral of that: to first order d(theta)/dt = R (w - w_reference), with theta the rotation vector (space
axes) from the reference to the trajectory, and R of the reference. An integrator's errors, which are made in
rates and attitude alike, don't obey this: in a window of length T, in which the motion turns by little,
errors of the attitude itself exceed what errors of rates make of it by about 2 / (rate T).

The integral is taken over the rows of a window by the polynomial through them, whose first value is zero.

Attitudes without rates are the integral of some rates, whatever made them, so that kinematics shows nothing.
There the form of the defects separates a wrong model from a loose integrator. In each window of rows the
rates are those with which the experiment's equations come nearest to its attitudes; the defect is what they
miss. Then the equations are changed alike for all windows: other moments of inertia, another strength of the
loads, and an angular acceleration that is constant or linear in the rates (motors, drag, rotors). That
explains the defects of such a model to the digits of the file. Errors of an integrator's steps are no such
function of the state; errors of short equal steps are nearly one, if accelerations of more forms are added.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidsim.scene.rotations import conjugated, multiplied, normalised, turned, vector_of
from rigidsim.solve.from_states import FromStates, RowStates
from rigidsim.workflows.fit.estimation import Linear, iterate

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


# --- of attitudes without rates -----------------------------------------------------------------------------

_STEP = 0.15  # rad of turning in a step of the classical Runge-Kutta method, which gives derivatives alone
_SMALL = 1e-5  # relative step of derivatives
_ITERATIONS = 4
_EVALUATIONS = 8
_SYMMETRIC = np.array(
    [[[float({i, j} == {a, b}) for j in range(3)] for i in range(3)] for a in range(3) for b in range(a, 3)]
)
_MOMENTS = 7  # six elements of the tensor, and the strength of the loads
MOMENTS, STEADY, WIDER = 0, 4, 19
"""Forms of accelerations, for each component: none; constant and linear in the rates; also their products and
the directions of the space axes.
"""
_NOTHING = 1e-8  # of the effect of the largest change, by differences in double precision
_SPARE = 1.5  # times as many numbers as are fitted have to be there
_WITHIN = 0.1  # of the defects' size: a step as short as this is the last
_ROUNDING = 1e-5  # relative, of derivatives by differences


class WindowsOfAttitudes:
    """Windows of rows of attitudes alone, with the rates that lead through them.

    Attributes:
        rows: (windows, parts + 1), the rows of each. length: of a window, s (median).
        rates: (windows, 3), rad/s, at the first row.
        defects: (windows, numbers), rad: what the equations miss, apart from what other rates make.
        size: of these, rms, rad.
        unexplained: rms of defects with the added acceleration, for each free number; nan before ``explain``.
        acceleration: added, rms over the windows' first rows, rad/s^2.
    """

    def __init__(self, states: RowStates, times: np.ndarray, rows: np.ndarray, rate: float) -> None:
        """Find the rates; ``rate``: of the motion, rad/s."""
        self.rows, self.rate, self.equations = rows, rate, states.equations
        self.unexplained = self.acceleration = float("nan")
        self._at, self._seen, self._own = times[rows], states.quaternions[rows], states[rows[:, 0]]
        self.length = float(np.median(self._at[:, -1] - self._at[:, 0]))
        step = (self._at[:, 1] - self._at[:, 0])[:, None]
        self.rates = vector_of(multiplied(conjugated(self._seen[:, 0]), self._seen[:, 1])) / step
        nothing = np.zeros(0)
        for _ in range(_ITERATIONS):  # to the second row alone, so that the rest is near
            reached = self._paths(self.rates[None], nothing[None], parts=2)[0][:, 0]
            self.rates = self.rates + vector_of(multiplied(conjugated(reached), self._seen[:, 1])) / step
        for _ in range(_ITERATIONS - 1):
            by_rates, _ = self._derivatives(nothing)
            self.rates = self.rates + _solved(by_rates, self._missed(nothing))
        by_rates, _ = self._derivatives(nothing)
        self.defects = _apart_from(by_rates, self._missed(nothing)[..., None])[..., 0]
        self.size = float(np.sqrt(np.mean(self.defects**2)))

    def explain(self, forms: int) -> None:
        """Find the change of the equations that explains the defects best, if the rows suffice for it.

        Args:
            forms: ``MOMENTS`` and loads alone, also ``STEADY`` accelerations, or ``WIDER`` ones.
        """
        available = min(self.defects.size, 3 * len(np.unique(self.rows)))
        change = np.zeros(_MOMENTS + 3 * forms)
        self.unexplained = float("nan")
        if _SPARE * len(change) > available:
            return
        start = self.rates
        ended = iterate(change, self._linear, most=_EVALUATIONS, within=_WITHIN)
        if ended is None:
            return
        rank = len(change) - len(ended.solution.null)
        free = ended.linear.residuals.size * max(1 - rank / available, 1 / available)
        left = max(ended.linear.cost - ended.solution.step_sigmas**2, 0.0)  # after a last step
        self.unexplained, change = float(self.size * np.sqrt(left / free)), ended.values
        states = self.equations.states(self._own, self._seen[:, 0], self.rates)
        more = self._added(states, self._at[:, 0], change[None])
        self.acceleration = float(np.sqrt(np.mean(np.sum(more**2, axis=1))))
        self.rates = start

    def _linear(self, change: np.ndarray) -> Linear | None:
        """The defects with a change (numbers,) of the equations, over their size without it, linearised; with
        rates that come nearest to the rows.
        """
        before = self.rates
        with np.errstate(all="ignore"):  # of steps that lead too far
            by_rates, by_change = self._derivatives(change)
            if not np.isfinite(by_rates).all() or not np.isfinite(by_change).all():
                return None
            if change.any():
                self.rates = self.rates + _solved(by_rates, self._missed(change))
            both = np.concatenate([by_change, self._missed(change)[..., None]], axis=2)
        table = _apart_from(by_rates, both).reshape(-1, len(change) + 1) / self.size
        sizes = np.linalg.norm(table[:, :-1], axis=0)
        noise = np.where(sizes <= _NOTHING * sizes.max(), np.inf, _ROUNDING * sizes)
        none = np.zeros(len(change))
        linear = Linear(table[:, -1], table[:, :-1], np.zeros((len(table), 0)), noise, none, none, [])
        if np.isfinite(linear.cost):
            return linear
        self.rates = before
        return None

    def _added(self, states: np.ndarray, times: np.ndarray, changes: np.ndarray) -> np.ndarray:
        """Accelerations (rows, 3), rad/s^2, body axes, that changes (lanes, numbers) of the equations add."""
        lanes, inertia = len(changes), self.equations.inertia
        quaternions, rates = self.equations.attitude(states)
        own = self.equations.accelerations(states, times).reshape(lanes, -1, 3)
        w = rates.reshape(lanes, -1, 3)
        torque = own @ inertia + np.cross(w, w @ inertia)
        other = inertia + np.einsum("lk,kij->lij", changes[:, :6], _SYMMETRIC) * np.trace(inertia) / 3
        torque = torque * (1 + changes[:, 6, None, None])
        there = (torque - np.cross(w, w @ other)) @ np.linalg.pinv(other)
        forms = (changes.shape[1] - _MOMENTS) // 3
        shapes = [np.zeros((len(rates), 0))]
        if forms >= STEADY:
            shapes += [np.ones((len(rates), 1)), rates / self.rate]
        if forms >= WIDER:
            unit = conjugated(normalised(quaternions))
            shapes.append(turned(unit[:, None], np.eye(3)).reshape(len(rates), 9))
            shapes += [rates[:, i : i + 1] * rates[:, i:] / self.rate**2 for i in range(3)]
        steady = np.concatenate(shapes, axis=1).reshape(lanes, w.shape[1], -1)
        factors = changes[:, _MOMENTS:].reshape(lanes, forms, 3) * self.rate**2
        return np.asarray((there - own + steady @ factors).reshape(-1, 3))

    def _paths(self, rates: np.ndarray, changes: np.ndarray, parts: int = 0) -> np.ndarray:
        """Attitudes (lanes, windows, parts, 4) from rates (lanes, windows, 3) with the equations changed
        (lanes, numbers), by steps.
        """
        lanes, count = rates.shape[:2]
        states = np.concatenate([self.equations.states(self._own, self._seen[:, 0], w) for w in rates])

        def slopes(at: np.ndarray, now: np.ndarray) -> np.ndarray:
            more = self._added(now, at, changes) if changes.any() else None
            return self.equations.slopes(now, at, more)

        found = []
        for part in range(1, parts or self._at.shape[1]):
            begin, end = (np.tile(self._at[:, k], lanes) for k in (part - 1, part))
            steps = max(1, int(np.ceil((end - begin).max() * self.rate / _STEP)))
            h = (end - begin) / steps
            for n in range(steps):
                t, half = begin + n * h, h[:, None] / 2
                a = slopes(t, states)
                b = slopes(t + h / 2, states + half * a)
                c = slopes(t + h / 2, states + half * b)
                d = slopes(t + h, states + h[:, None] * c)
                states = states + h[:, None] / 6 * (a + 2 * b + 2 * c + d)
            found.append(normalised(self.equations.attitude(states)[0]).reshape(lanes, count, 4))
        return np.stack(found, axis=2)

    def _missed(self, change: np.ndarray) -> np.ndarray:
        """What is missed (windows, numbers), rad, with a change (numbers,) of the equations."""
        begun = self.equations.states(self._own, self._seen[:, 0], self.rates)
        reached = np.stack([
            normalised(self.equations.attitude(self.equations.after(state, at[0], at[1:]))[0])
            for state, at in zip(begun, self._at, strict=True)
        ])  # fmt: skip
        if change.any():
            both = self._paths(np.stack([self.rates, self.rates]), np.stack([0 * change, change]))
            reached = multiplied(reached, multiplied(conjugated(both[0]), both[1]))
        missed = vector_of(multiplied(conjugated(reached), self._seen[:, 1:]))
        return np.asarray(missed.reshape(len(missed), -1))

    def _derivatives(self, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of turns by the rates (windows, numbers, 3) and by changes of the equations (windows,
        numbers, changes).
        """
        lanes = 1 + 3 + change.size
        rates = np.repeat(self.rates[None], lanes, axis=0)
        changes = np.tile(change, (lanes, 1))
        for n in range(3):
            rates[1 + n, :, n] += _SMALL * self.rate
        changes[range(4, lanes), range(lanes - 4)] += _SMALL
        paths = self._paths(rates, changes)
        turns = vector_of(multiplied(conjugated(paths[:1]), paths[1:]))
        found = np.moveaxis(turns, 0, -1).reshape(len(self.rates), -1, lanes - 1) / _SMALL
        return found[..., :3] / self.rate, found[..., 3:]


def _solved(table: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Least squares for each window: (windows, numbers, 3) and (windows, numbers)."""
    return np.einsum("nij,nj->ni", np.linalg.pinv(table), goal)


def _apart_from(table: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (windows, numbers, columns) in an orthonormal basis of what the table's columns don't span."""
    basis = np.linalg.qr(table, mode="complete")[0][..., table.shape[2] :]
    return np.asarray(np.einsum("nij,nik->njk", basis, values))
