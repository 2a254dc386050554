"""A trajectory by the experiment's equations: drifts of invariants by its numbers, and local defects."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import xarray

from rigidsim.scene.row_rotations import angles_between
from rigidsim.solve.from_states import FromStates, RowStates
from rigidsim.store.many_rows import largest, picked
from rigidsim.workflows.compare import defects
from rigidsim.workflows.compare.attitudes_alone import MOMENTS, STEADY, WindowsOfAttitudes
from rigidsim.workflows.compare.motion import OwnMotion
from rigidsim.workflows.compare.result import LocalDefects, TrajectoryDrift
from rigidsim.workflows.compare.verdict import unexplained_share

_MOST_STARTS = 1500  # rows from which local defects are integrated
_MOST_WINDOWS = 250
_MOST_ALONE = 80  # windows of attitudes without rates
_WINDOW = 1.5  # rad of the motion in the shortest of these, in so many parts where rows are near enough
_PARTS = 4
_SLOWEST = 1e-12  # rad over the whole file: a motion that is none
_LONG = 12.0  # rad of the motion: in shorter files, errors of equal steps look like steady accelerations
_LONGER = 4.0  # times, by which windows grow until their defects exceed the digits
_ABOVE = 5.0  # times what the digits of the file allow, from which on defects tell something
_NORM = "quaternion_norm"


@dataclass
class ByEquations:
    """What the equations say of a trajectory; variables are put into the dataset as they are found.

    Attributes:
        times: (rows,), s. quaternions: (rows, 4), w x y z, of norm one. rates: (rows, 3), rad/s, if there.
        flight: positions and velocities (rows, 6), SI, if there.
        norm_drift: relative, of the quaternions as they are written; None for other attitudes.
        noise: of the attitude by the digits of the file, rad.
        windows: with rates; None where models can't be told from integrators.
        by_attitudes: the shortest windows of attitudes alone, where these were measured.
    """

    equations: FromStates
    times: np.ndarray
    quaternions: np.ndarray
    rates: np.ndarray | None
    flight: np.ndarray | None
    norm_drift: np.ndarray | None
    noise: float
    own: OwnMotion
    dataset: xarray.Dataset
    drifts: list[TrajectoryDrift] = field(default_factory=list)
    local: LocalDefects | None = None
    windows: defects.WindowDefects | None = None
    by_attitudes: WindowsOfAttitudes | None = None
    told: list[str] = field(default_factory=list)
    intervals: np.ndarray = field(default_factory=lambda: np.empty(0))  # of local defects, s

    def measure(self) -> None:
        """Measure all of it."""
        base = self.equations.motion(self.times) if self.own.states is None else self.own.states
        self._base = base
        if self.equations.others:
            names = ", ".join(self.equations.others)
            self.told.append(f"the file has no {names}: each interval begins with the experiment's own")
        rates = self.own.rates if self.rates is None else self.rates
        states = RowStates(self.equations, base, self.quaternions, rates, self.flight)
        self._drifts(states)
        count = len(self.times) - 1
        starts = np.unique(np.linspace(0, count - 1, min(count, _MOST_STARTS)).astype(int))
        if len(starts) < count:
            spread = f"{len(starts):,} of {count:,} rows, evenly spread"
            self.told.append(f"local defects were measured from {spread}")
        self.motion_rate = max(defects.motion_rate(self.times, self.own.rates), self._turning_rate(starts))
        if self.rates is None:
            self.alone_in(states, _WINDOW)
            return
        steps = picked(self.times, starts + 1) - picked(self.times, starts)
        near = starts[steps * self.motion_rate < defects.RESOLVED]
        if 0 < len(near) < len(starts):
            far = f"{len(starts) - len(near):,} intervals that the motion turns by more than "
            self.told.append(f"local defects leave out {far}{defects.RESOLVED:g} rad in")
            starts = near
        rows = defects.row_defects(self.equations, self.times, states, starts)
        self.windows = defects.window_defects(
            self.equations, self.times, states, self.motion_rate, _MOST_WINDOWS
        )
        self._keep(starts, np.linalg.norm(rows.attitude, axis=1), np.linalg.norm(rows.rates, axis=1))

    def _turning_rate(self, starts: np.ndarray) -> float:
        """Rate (rad/s, rms) at which the file's attitudes turn from rows to the next ones, at least."""
        here, there = picked(self.quaternions, starts), picked(self.quaternions, starts + 1)
        steps = picked(self.times, starts + 1) - picked(self.times, starts)
        turns = angles_between(here, there)
        return max(float(np.sqrt(np.sum(turns**2 / steps) / steps.sum())), _SLOWEST / float(steps.sum()))

    def alone(self) -> WindowsOfAttitudes | None:
        """Defects of the attitudes alone, over windows in which these exceed the digits, and what explains
        them; None where rows are too far apart.
        """
        span = float(self.times[-1] - self.times[0]) * self.motion_rate
        length = _WINDOW
        rates = self.own.rates if self.rates is None else self.rates
        states = RowStates(self.equations, self._base, self.quaternions, rates, self.flight)
        found = self.by_attitudes or self.alone_in(states, length)
        while found is not None and found.size <= _ABOVE * self.noise and length < span:
            length = min(_LONGER * length, span)
            found = self.alone_in(states, length) or found
        if found is not None and found.size > _ABOVE * self.noise:
            found.explain(self.noise, STEADY if span >= _LONG else MOMENTS)
            if self.local is not None and np.isfinite(found.unexplained):
                self.local = self.local.having(
                    missing_acceleration=found.acceleration, unexplained=found.unexplained / found.size
                )
        return found

    def alone_in(self, states: RowStates, length: float) -> WindowsOfAttitudes | None:
        """Defects of attitudes alone, over windows of such a length (rad of the motion)."""
        most_parts = min(max(_PARTS, int(np.ceil(length))), len(self.times) - 1)
        for parts in range(most_parts, 1, -1):
            most = max(1, _MOST_ALONE * _PARTS // parts)
            rows = defects.windows_of_rows(self.times, self.motion_rate, length, parts, most)
            if len(rows):
                break
        else:
            return None
        found = WindowsOfAttitudes(self.equations, self.times, states, rows, self.motion_rate)
        if not np.isfinite(found.defects).all():
            return None
        if self.by_attitudes is None:
            self.by_attitudes = found
            if self.rates is None:
                self.told.append(
                    "the file has no angular velocities: defects are taken with the nearest rates, over "
                    f"{len(rows)} windows of {parts + 1} rows"
                )
                self._keep(rows[:, 0], np.sqrt(np.sum(found.defects**2, axis=1)), None)
        return found

    def _drifts(self, states: RowStates) -> None:
        found = {} if self.rates is None else self.equations.drifts(states, self.times)
        found.pop(_NORM, None)  # of quaternions that were normalised
        if self.norm_drift is not None:
            found[_NORM] = self.norm_drift
        for name, values in found.items():
            self.drifts.append(TrajectoryDrift(name=name, largest=largest(values), final=float(values[-1])))
            attributes = {"units": "1", "long_name": f"drift of {name.replace('_', ' ')}"}
            self.dataset[f"{name}_drift"] = ("time", values, attributes)

    def _keep(self, starts: np.ndarray, sizes: np.ndarray, rates: np.ndarray | None) -> None:
        """Local defects as values, and along time in the dataset."""
        put, windows = self.dataset, self.windows
        times = picked(self.times, starts)
        self.intervals = picked(self.times, starts + 1) - times
        put["defect"] = ("start", sizes, {"units": "rad", "long_name": "local defect of the attitude"})
        put["defect_time"] = ("start", times, {"units": "s", "long_name": "time of the row"})
        if rates is not None:
            words = {"units": "rad s-1", "long_name": "local defect of the angular velocity"}
            put["rate_defect"] = ("start", rates, words)
        at = int(np.nanargmax(sizes)) if np.isfinite(sizes).any() else 0
        mean = None if windows is None else np.sqrt(np.mean(np.sum(windows.acceleration**2, axis=1)))
        self.local = LocalDefects(
            largest=float(sizes[at]),
            rms=float(np.sqrt(np.nanmean(sizes**2))),
            time=float(times[at]),
            rate_largest=None if rates is None else float(np.nanmax(rates)),
            rows=len(starts),
            window_s=None if windows is None else windows.length,
            unexplained=None if windows is None else unexplained_share(windows),
            missing_acceleration=None if mean is None else float(mean),
        )
