"""What a trajectory shows beside the experiment: errors, drifts of invariants, and local defects."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import xarray

from rigidsim.accuracy.comparison import parts_of, rotation_vectors
from rigidsim.scene.row_rotations import angles_between, normalised
from rigidsim.solve.from_states import FromStates, RowStates
from rigidsim.workflows.compare import defects
from rigidsim.workflows.compare.attitudes_alone import MOMENTS, STEADY, WindowsOfAttitudes
from rigidsim.workflows.compare.columns import QUATERNION, Attitudes, size_of
from rigidsim.workflows.compare.conventions import Convention

ABOVE = 5.0
"""Times what the digits of the file allow, from which on defects show something."""
_MOST_STARTS = 1500  # rows from which local defects are integrated
_MOST_WINDOWS = 250
_MOST_ALONE = 80  # windows of attitudes without rates
_WINDOW = 1.5  # rad of the motion in the shortest of these, in so many parts where rows are near enough
_PARTS = 4
_SLOWEST = 1e-12  # rad over the whole file: a motion that is none
_LONG = 12.0  # rad of the motion: in shorter files, errors of equal steps look like steady accelerations
_LONGER = 4.0  # times, by which windows grow until their defects exceed the digits
_RANDOM = 0.5  # correlation of neighbours, up to which errors are those of rounding
_CLOSE = 0.2  # of the last digit of times, to which the rounding of evenly spaced ones is known
_EXACT = 1e-13  # relative, of times in double precision
_LEAST_ROWS = 20
_UNEQUAL, _MUCH = 1.3, 3.0
"""Ratio of long intervals to short ones from which a tolerance, and an order, shows."""
_CLEAR = 0.85  # share of the variance (of logarithms) that the power explains
_STEEPEST, _FLATTEST = 20.0, 1.7  # slopes of methods of order 1 to 19
_SIMILAR = 300.0  # ratio of large defects to small ones, up to which they are held
_NORM = "quaternion_norm"


class Evidence:
    """A trajectory in a convention beside the experiment's motion; what costs time is worked out when needed.

    Attributes:
        times: (rows,), s; over the ``span``, s. quaternions: (rows, 4), w x y z, body to space axes.
        rates, own_rates: of the file and of the experiment, (rows, 3), rad/s, body axes; None if unknown.
        errors: angles (rows,), rad, between the attitudes. rate_errors, position_errors: (rows,), SI; None
            where one of both has none.
        rate: of the motion, rad/s: the experiment's, or that at which the file's attitudes turn, if larger.
        turn: from row to row, rad (median), by the faster of both motions.
        resolution, rate_noise: of attitudes (rad) and rates (rad/s) by the digits that they are written in.
        attitude_noise: the same of attitudes, with the rounding of times.
        states: the rows as states of the experiment's equations; None where these can't begin from attitude
            and rates, for the reason ``why_not``.
        explained: windows of attitudes alone, once it was tried what explains their defects.
    """

    def __init__(
        self, given: Attitudes, convention: Convention, own: xarray.Dataset, uncertainty: float,
        within: float, told: list[str],
    ) -> None:  # fmt: skip
        """Read the rows.

        Args:
            own: the experiment at the trajectory's times. uncertainty: announced error of its attitude, rad.
            within: rad, what attitudes may differ by and agree. told: gets what a user should know.
        """
        self.given, self.convention, self.told = given, convention, told
        self._uncertainty, self._within = uncertainty, within
        self.states: RowStates | None = None
        self.why_not = ""
        self.explained: WindowsOfAttitudes | None = None
        self.times, self.quaternions = given.times, convention.quaternions(given)
        self.span = float(self.times[-1] - self.times[0])
        self.own_rates = own["angular_velocity"].values
        self.rates = None if given.rates is None else convention.rates(given.rates, self.quaternions)
        first, *more = parts_of(own, "quaternion", np.arange(len(self.times)))
        self._vectors = rotation_vectors([normalised(first), *more], [self.quaternions])
        self.errors = np.linalg.norm(self._vectors, axis=1)
        self.rate_errors = None if self.rates is None else np.linalg.norm(self.rates - self.own_rates, axis=1)
        theirs, known = given.positions, "position" in own
        self.position_errors = (
            np.linalg.norm(theirs - own["position"].values, axis=1) if known and theirs is not None else None
        )
        steps = np.diff(self.times)
        turns = angles_between(self.quaternions[:-1], self.quaternions[1:])
        seen = float(np.sqrt(np.sum(turns**2 / steps) / self.span))
        self.rate = max(defects.motion_rate(self.times, self.own_rates), seen, _SLOWEST / self.span)
        both = [self.own_rates] if self.rates is None else [self.own_rates, self.rates]
        fastest = np.max([np.linalg.norm(x, axis=1) for x in both], axis=0)
        self.turn = float(np.median(fastest[:-1] * steps))

        unit, turning = convention.unit, convention.rate_unit
        self.resolution = given.resolution[0] * (size_of(unit, "rad") if unit else 2.0)
        self.rate_noise = given.resolution[1] * size_of(turning, "rad/s") if turning else 0.0
        self._even = even = np.linspace(self.times[0], self.times[-1], len(self.times))
        exact, apart = _EXACT * abs(float(self.times[-1])), float(np.abs(self.times - even).max())
        self._exact, most = apart <= exact, given.resolution[2]
        rounded = not self._exact and apart <= 2 * most  # times that would be even but for their digits
        self.attitude_noise = self.resolution + (self.rate * most / np.sqrt(3) if rounded else 0.0)

    @cached_property
    def floor(self) -> tuple[float, str]:
        """What attitudes may differ by and agree, rad, and why."""
        floor = max(self._within, 4 * self.resolution, 3 * self._uncertainty)
        if self.errors.max() > floor and (rounded := self._rounded_times(floor)) is not None:
            why = (
                f"the attitude error comes from its times, which are rounded ({self.given.resolution[2]:.2g}"
            )
            return rounded, f"{why} s or less)"
        return floor, f"the attitude error is within {floor:.2g} rad everywhere"

    def _rounded_times(self, floor: float) -> float | None:
        """Largest angle (rad) by which rounded times explain the error everywhere; None where they don't.

        Attitudes at a time that is off by d are turned by the rate times d. Rounded times are off by half
        their last digit at most: by what evenly spaced ones show, or by another amount in each row. Even
        times show no rounding.
        """
        most, rates = self.given.resolution[2], self.own_rates
        size = np.maximum(np.linalg.norm(rates, axis=1), 1e-150)
        shifts = np.sum(self._vectors * rates, axis=1) / size**2
        rest = np.linalg.norm(self._vectors - rates * shifts[:, None], axis=1)
        bent = floor + size**2 * most**2  # which the change of the rate leaves
        if self._exact or (rest > bent).any() or (np.abs(shifts) > 1.1 * most + floor / size).any():
            return None
        around, known, even = (
            shifts - shifts.mean(),
            shifts + self.times - self._even,
            self._even - self._even[0],
        )
        alike, spread = float(np.sum(around[1:] * around[:-1])), float(np.sum(around**2))
        line = np.polyval(np.polyfit(even, known, 1), even)  # which rounded ends of even times leave
        by_digits = (np.abs(known - line) < _CLOSE * most + floor / size).all()
        random = spread > 0 and alike <= _RANDOM * spread
        return float(1.1 * most * size.max() + floor) if random or by_digits else None

    # --- by the experiment's equations ----------------------------------------------------------------------

    def begin_from(self, equations: FromStates) -> None:
        """Let each row be a start of the experiment's equations.

        Raises:
            NotFromStates: the experiment's motion ends before.
        """
        given, rates = self.given, self.own_rates if self.rates is None else self.rates
        flight = None
        if given.positions is not None and given.velocities is not None:
            flight = np.concatenate([given.positions, given.velocities], axis=1)
        base = equations.motion(self.times)
        self.states = RowStates(equations, base, self.quaternions, rates, flight)
        if equations.others:
            names = ", ".join(equations.others)
            self.told.append(f"the file has no {names}: each interval begins with the experiment's own")

    def drifts(self) -> dict[str, np.ndarray]:
        """Of the invariants by the file alone, relative, (rows,) each."""
        if self.states is None:
            return {}
        found = {} if self.rates is None else self.states.equations.drifts(self.states, self.times)
        found.pop(_NORM, None)  # of quaternions that were normalised
        if self.given.kind == QUATERNION:
            norms = np.linalg.norm(self.given.attitude, axis=1)
            found[_NORM] = norms / norms[0] - 1
        return found

    @cached_property
    def local(self) -> tuple[np.ndarray, np.ndarray, np.ndarray | None] | None:
        """Rows that local defects begin at, the attitude's (rad) to the next rows, and the rates' (rad/s);
        without rates those of the shortest windows. None where rows are too far apart.
        """
        if self.states is None:
            return None
        if self.rates is None:
            if (alone := self.first_alone) is None:
                return None
            self.told.append(
                "the file has no angular velocities: defects are taken with the nearest rates, over "
                f"{len(alone.rows)} windows of {alone.rows.shape[1]} rows"
            )
            return alone.rows[:, 0], np.linalg.norm(alone.defects, axis=1), None
        count = len(self.times) - 1
        starts = np.unique(np.linspace(0, count - 1, min(count, _MOST_STARTS)).astype(int))
        near = starts[np.diff(self.times)[starts] * self.rate < defects.RESOLVED]
        starts = near if len(near) else starts
        if len(starts) < count:
            self.told.append(f"local defects were measured from {len(starts):,} of {count:,} rows")
        found = defects.row_defects(self.states.equations, self.times, self.states, starts)
        return starts, np.linalg.norm(found.attitude, axis=1), np.linalg.norm(found.rates, axis=1)

    @cached_property
    def windows(self) -> defects.WindowDefects | None:
        """Of attitudes with rates; None where rows are too few or too far apart."""
        if self.rates is None or self.states is None:
            return None
        equations = self.states.equations
        return defects.window_defects(equations, self.times, self.states, self.rate, _MOST_WINDOWS)

    @cached_property
    def first_alone(self) -> WindowsOfAttitudes | None:
        """The shortest windows of attitudes alone; None where rows are too far apart."""
        return self._alone(_WINDOW)

    @cached_property
    def alone(self) -> WindowsOfAttitudes | None:
        """The same over windows in which defects exceed the digits, with what explains them."""
        span, length, found = self.span * self.rate, _WINDOW, self.first_alone
        while found is not None and found.size <= ABOVE * self.attitude_noise and length < span:
            length = min(_LONGER * length, span)
            found = self._alone(length) or found
        if found is not None and found.size > ABOVE * self.attitude_noise:
            found.explain(self.attitude_noise, STEADY if span >= _LONG else MOMENTS)
            self.explained = found
        return found

    def _alone(self, length: float) -> WindowsOfAttitudes | None:
        """Windows of attitudes alone of a length in rad of the motion."""
        if self.states is None:
            return None
        most_parts = min(max(_PARTS, int(np.ceil(length))), len(self.times) - 1)
        for parts in range(most_parts, 1, -1):
            most = max(1, _MOST_ALONE * _PARTS // parts)
            rows = defects.windows_of_rows(self.times, self.rate, length, parts, most)
            if len(rows):
                found = WindowsOfAttitudes(self.states, self.times, rows, self.rate)
                return found if np.isfinite(found.defects).all() else None
        return None

    @cached_property
    def own_steps(self) -> tuple[float | None, float | None]:
        """Order of the tool's method, and the angle (rad) that errors of its steps are held to, if rows are
        its steps; None where they don't show.

        A method of order p errs by a multiple of h^(p+1) in a step h. Where steps are chosen by the error,
        defects are about as large whatever the interval. Equal intervals show neither.
        """
        assert self.local is not None
        starts, sizes, _ = self.local
        intervals = np.diff(self.times)[starts]
        seen = np.isfinite(sizes) & (sizes > ABOVE * self.attitude_noise)
        if seen.sum() < max(_LEAST_ROWS, len(seen) / 2):
            return None, None
        x, y = np.log(intervals[seen]), np.log(sizes[seen])
        unequal = np.exp(np.subtract(*np.quantile(x, [0.95, 0.05])))
        if unequal < _UNEQUAL:
            return None, None
        slope, clear = float(np.polyfit(x, y, 1)[0]), np.corrcoef(x, y)[0, 1] ** 2
        if clear >= _CLEAR:
            return (slope - 1 if unequal >= _MUCH and _FLATTEST <= slope <= _STEEPEST else None), None
        alike = np.exp(np.subtract(*np.quantile(y, [0.9, 0.1]))) <= _SIMILAR
        return None, (float(np.quantile(sizes[seen], 0.95)) if alike else None)
