"""A trajectory by the experiment's equations: drifts of invariants by its numbers, and local defects."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import xarray

from rigidsim.scene.row_rotations import normalised
from rigidsim.solve.from_states import FromStates, RowStates
from rigidsim.store.many_rows import largest, picked, usual_step
from rigidsim.workflows.compare import defects
from rigidsim.workflows.compare.motion import OwnMotion
from rigidsim.workflows.compare.result import LocalDefects, TrajectoryDrift
from rigidsim.workflows.compare.verdict import unexplained_share
from rigidsim.workflows.physics.models import rotation_vectors

_MOST_STARTS = 1500  # rows from which local defects are integrated
_MOST_WINDOWS = 250
_ABOVE = 5.0  # times what the digits of the file allow, from which on defects without rates tell something
_STEADY = 1e-9  # of the rate squared: an angular acceleration that is none
_NORM = "quaternion_norm"


@dataclass
class ByEquations:
    """What the equations say of a trajectory; variables are put into the dataset as they are found.

    Attributes:
        times: (rows,), s. quaternions: (rows, 4), w x y z, of norm one. rates: (rows, 3), rad/s, if there.
        flight: positions and velocities (rows, 6), SI, if there.
        norm_drift: relative, of the quaternions as they are written; None for other attitudes.
        noise: of the attitude by the digits of the file, rad.
        windows: None where models can't be told from integrators; ``missing`` says why.
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
    missing: str = ""
    told: list[str] = field(default_factory=list)
    intervals: np.ndarray = field(default_factory=lambda: np.empty(0))  # of local defects, s

    def measure(self) -> None:
        """Measure all of it."""
        base = self.equations.motion(self.times) if self.own.states is None else self.own.states
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
        if self.rates is None:
            self._by_shooting(states, starts[starts < count - 1])
            return
        rows = defects.row_defects(self.equations, self.times, states, starts)
        rate = defects.motion_rate(self.times, self.rates)
        self.windows = defects.window_defects(self.equations, self.times, states, rate, _MOST_WINDOWS)
        spacing = usual_step(self.times)
        self.missing = f"rows are too far apart ({spacing:.3g} s, at {rate:.3g} rad/s)"
        self._keep(starts, np.linalg.norm(rows.attitude, axis=1), np.linalg.norm(rows.rates, axis=1))

    def _drifts(self, states: RowStates) -> None:
        found = {} if self.rates is None else self.equations.drifts(states, self.times)
        found.pop(_NORM, None)  # of quaternions that were normalised
        if self.norm_drift is not None:
            found[_NORM] = self.norm_drift
        for name, values in found.items():
            self.drifts.append(TrajectoryDrift(name=name, largest=largest(values), final=float(values[-1])))
            attributes = {"units": "1", "long_name": f"drift of {name.replace('_', ' ')}"}
            self.dataset[f"{name}_drift"] = ("time", values, attributes)

    def _by_shooting(self, states: RowStates, starts: np.ndarray) -> None:
        """Without rates in the file: those that lead to the next row also lead to the one beyond it."""
        shot = defects.shot_rates(self.equations, self.times, states, starts)
        begun = self.equations.states(states[starts], picked(self.quaternions, starts), shot)
        times, until = picked(self.times, starts), picked(self.times, starts + 2)
        reached, _ = self.equations.attitude(defects.ends_of(self.equations, begun, times, until))
        there = picked(self.quaternions, starts + 2)
        apart = np.linalg.norm(rotation_vectors([normalised(reached)], [there]), axis=1)
        self.told.append(
            "the file has no angular velocities: defects are at each second row, from two attitudes"
        )
        self._keep(starts, apart, None)
        self._missing_without_rates(starts, apart, until - times)

    def _missing_without_rates(self, starts: np.ndarray, apart: np.ndarray, length: np.ndarray) -> None:
        """What acceleration would have to be missing if the defects (rows,), rad, were another model's.

        Where the two intervals are a and b, and the rate is what leads over the first, an acceleration makes
        its (a + b) b / 2 of angle at the end of the second.
        """
        missing = _rms(2 * apart / (length * (length - self.intervals)))
        rates = picked(self.own.rates, starts)
        change = (picked(self.own.rates, starts + 1) - rates) / self.intervals[:, None]
        own, rate = (_rms(np.linalg.norm(x, axis=1)) for x in (change, rates))
        share = f"{missing / own:.2g} of its own" if own > _STEADY * rate**2 else "where its own is zero"
        told = (
            f"a loose integration, or an angular acceleration of {missing:.3g} rad/s^2 that its model adds "
            f"to the body ({share}), would lead to the same rows"
        )
        if _rms(apart) <= _ABOVE * self.noise:
            told = f"local defects ({_rms(apart):.2g} rad) are within the digits of the file, too"
        elif self.local is not None:
            self.local = self.local.having(missing_acceleration=missing)
        self.missing = (
            f"the file has attitudes alone; {told}. Write angular velocities too, as columns wx wy wz: an "
            "attitude that isn't their integral tells an integration"
        )

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


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))
