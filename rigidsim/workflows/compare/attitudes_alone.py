"""Local defects of attitudes without rates, and whether other moments or steady torques explain them.

Attitudes alone are the integral of some rates, whatever made them, so that kinematics shows nothing here.
What separates a wrong model from a loose integrator is the form of the defects. In each window of rows the
rates are those with which the experiment's equations come nearest to its attitudes; the defect is what they
miss. Then the equations are changed alike for all windows: other moments of inertia, another strength of the
loads, and an angular
acceleration that is constant or linear in the rates (motors, drag, rotors). That explains the defects
of such a model to the digits of the file. Errors of an integrator's steps are no such function of the state;
errors of short equal steps are nearly one, if accelerations of more forms are added.
"""

from __future__ import annotations

import numpy as np

from rigidsim.scene.row_rotations import conjugated, multiplied, normalised, turned, vector_of
from rigidsim.solve.from_states import RowStates
from rigidsim.workflows.fit.estimation import Linear, iterate

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
