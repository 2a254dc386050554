"""What a trajectory shows against the experiment, and what it means.

Errors, drifts of invariants and local defects are measured. Then a verdict is given, in this order: its
attitudes are the experiment's or not. They turn at its rates or not. Where the attitudes are others, its
integration errs, its model is another one, or the two can't be separated.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray

from rigidsim.accuracy.comparison import parts_of, rotation_vectors
from rigidsim.scene.rotations import angles_between, conjugated, multiplied, normalised, vector_of
from rigidsim.scene.scene import Scene
from rigidsim.solve.from_states import FromStates, NotFromStates, RowStates
from rigidsim.workflows.compare import defects
from rigidsim.workflows.compare.conventions import QUATERNION, Attitudes, Convention, size_of
from rigidsim.workflows.compare.defects import MOMENTS, STEADY, WIDER, WindowsOfAttitudes

AGREES, INTEGRATION_ERROR, WRONG_MODEL, UNDECIDED = "agrees", "integration_error", "wrong_model", "undecided"
INCONSISTENT_RATES = "inconsistent_rates"
Verdict = tuple[str, str]
"""A verdict, and why."""
_ABOVE = 5.0  # times what the digits of the file allow, from which on defects show something
_MOST_STARTS = 1500  # rows from which local defects are integrated
_MOST_WINDOWS = 250
_MOST_ALONE = 80  # windows of attitudes without rates
_WINDOW = 1.5  # rad of the motion in the shortest of these, in so many parts where rows are near enough
_PARTS = 4
_SLOWEST = 1e-12  # rad over the whole file: a motion that is none
_LONG = 12.0  # rad of the motion: in shorter files, errors of equal steps look like steady accelerations
_LONGER = 4.0  # times, by which windows grow until their defects exceed the digits
_RANDOM = 0.5  # correlation of neighbours, up to which errors come from rounding
_CLOSE = 0.2  # of the last digit of times, to which the rounding of evenly spaced ones is known
_EXACT = 1e-13  # relative, of times in double precision
_NORM = "quaternion_norm"
_ROUNDING = 1e-13  # rad: what references in double precision, and quaternions of doubles, leave
_MODEL, _INTEGRATOR = 0.2, 0.5
"""Unexplained over explained attitude defects. Another model's are explained up to the integral's own error,
some 1e-3 and less, and more in long windows of few rows; an integrator's unexplained ones exceed the
explained by 2 / (rate T), 4 for the usual window, and 0.5 for the longest. In experiments/compare_conventions
they are 0.86 and more in 264 loose integrations, and up to 0.12 in 200 other models (0.14 with another seed).
"""
_ALONE = 5e-4
"""Defects that no change of the equations explains, over all, where attitudes are alone. Another model's are
explained up to the error of the derivatives, some 5e-5 and less.
"""
_IN_NOISE = 0.02  # the same, of defects that are explained to the digits of the file
_SURE = 1e3  # times what attitudes alone miss, by which they have to start elsewhere
_START = 3.0  # times what defects add up to, from which on another start is what the error comes from
_NO_RATES = 0.15
"""Of the turn in a window: unexplained defects beyond that are no integrator's, whose steps would be a
radian long, but those of rates that are something else.
"""
_FAR = np.pi / 3
"""Turn (rad) from row to row, beyond which the rates' integral misses as much as loose integrations."""
_SAME = 3.0  # factor within which the rates' first difference is what the attitudes' turning misses
_AGREE = 10.0  # times the attitude's floor per radian of the motion, that rates may differ by and agree


@dataclass(frozen=True)
class Partner:
    """The second of two bodies in a trajectory: what is known of its attitudes (rows, 4), rates, and of its
    positions and velocities from the first, (rows, 3) each, SI, space axes, rates in body axes.
    """

    quaternions: np.ndarray
    rates: np.ndarray | None
    positions: np.ndarray | None
    velocities: np.ndarray | None

    @property
    def states(self) -> np.ndarray | None:
        """All of these (rows, 13); None where one is unknown."""
        parts = [self.positions, self.velocities, self.quaternions, self.rates]
        known = [part for part in parts if part is not None]
        return np.concatenate(known, axis=1) if len(known) == len(parts) else None


class Evidence:
    """A trajectory in a convention with the experiment's motion; what costs time is worked out when needed.

    Attributes:
        times: (rows,), s; over the ``span``, s. quaternions: (rows, 4), w x y z, body to space axes.
        rates, own_rates: of the file and of the experiment, (rows, 3), rad/s, body axes; None if unknown.
        begin: the row nearest to the experiment's start.
        errors: angles (rows,), rad, between the attitudes. rate_errors, position_errors: (rows,), SI; None
            where one of both has none. Of two bodies the larger ones, and the positions of the second.
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
        within: float, notes: list[str], scene: Scene, partner: Partner | None = None,
    ) -> None:  # fmt: skip
        """Read the rows.

        Args:
            own: the experiment at the trajectory's times. uncertainty: announced error of its attitude, rad.
            within: rad, what attitudes may differ by and agree. notes: gets what a user should know.
            scene: of the experiment, whose equations each row may start.
            partner: the second of two bodies, if the file has it.
        """
        self._partner = partner
        self.given, self.convention, self.notes = given, convention, notes
        self._uncertainty, self._within = uncertainty, within
        self.explained: WindowsOfAttitudes | None = None
        self.times, self.quaternions = given.times, convention.quaternions(given)
        self.span = float(self.times[-1] - self.times[0])
        self.begin = int(np.argmin(np.abs(self.times - float(scene.start))))
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
        if partner is not None:
            self._see(partner, own)
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
        exact, apart = _EXACT * float(np.abs(self.times).max()), float(np.abs(self.times - even).max())
        self._exact, most = apart <= exact, given.resolution[2]
        rounded = not self._exact and apart <= 2 * most  # times that would be even but for their digits
        self.attitude_noise = self.resolution + (self.rate * most / np.sqrt(3) if rounded else 0.0)
        self.states: RowStates | None = None
        try:
            self.states = self._states_of(FromStates(scene))
        except NotFromStates as error:
            self.why_not = str(error)
            notes.append(f"neither local defects nor drifts were measured: {error}")

    def _see(self, partner: Partner, own: xarray.Dataset) -> None:
        """Errors of two bodies, of which the larger count."""
        known = {
            x: own[f"rigid_body_{x}"].values[:, 0] for x in ("quaternion", "angular_velocity", "position")
        }
        turned = angles_between(partner.quaternions, normalised(known["quaternion"]))
        self.errors = np.maximum(self.errors, turned)
        if partner.rates is not None and self.rate_errors is not None:
            slips = np.linalg.norm(partner.rates - known["angular_velocity"], axis=1)
            self.rate_errors = np.maximum(self.rate_errors, slips)
        if partner.positions is not None:
            self.position_errors = np.linalg.norm(partner.positions - known["position"], axis=1)

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

    def _states_of(self, equations: FromStates) -> RowStates:
        """Each row as a start of the experiment's equations."""
        given, rates = self.given, self.own_rates if self.rates is None else self.rates
        flight = None if self._partner is None else self._partner.states
        if given.positions is not None and given.velocities is not None:
            flight = np.concatenate([given.positions, given.velocities], axis=1)
        missing = [*equations.others, *(equations.second if flight is None else ())]
        if missing:
            names = ", ".join(missing)
            self.notes.append(f"the file has no {names}: each interval begins with the experiment's own")
        return RowStates(equations, equations.motion(self.times), self.quaternions, rates, flight)

    def drifts(self) -> dict[str, np.ndarray]:
        """Drifts of the invariants by the file alone, relative, (rows,) each."""
        if self.states is None:
            return {}
        found = {} if self.rates is None else self.states.equations.drifts(self.states, self.times)
        for name in (_NORM, f"rigid_body_{_NORM}"):  # of quaternions that were normalised
            found.pop(name, None)
        if self.given.kind == QUATERNION:
            norms = np.linalg.norm(self.given.attitude, axis=1)
            found[_NORM] = norms / norms[0] - 1
        return found

    @cached_property
    def local(self) -> tuple[np.ndarray, np.ndarray, np.ndarray | None] | None:
        """Rows that local defects begin at, the attitude's (rad) to the next rows, and the rates' (rad/s);
        without rates from the shortest windows. None where rows are too far apart.
        """
        if self.states is None:
            return None
        if self.rates is None:
            if (alone := self.first_alone) is None:
                return None
            self.notes.append(
                "the file has no angular velocities: defects are taken with the nearest rates, over "
                f"{len(alone.rows)} windows of {alone.rows.shape[1]} rows"
            )
            return alone.rows[:, 0], np.linalg.norm(alone.defects, axis=1), None
        count = len(self.times) - 1
        starts = np.unique(np.linspace(0, count - 1, min(count, _MOST_STARTS)).astype(int))
        near = starts[np.diff(self.times)[starts] * self.rate < defects.RESOLVED]
        starts = near if len(near) else starts
        if len(starts) < count:
            self.notes.append(f"local defects were measured from {len(starts):,} of {count:,} rows")
        turns, slips = defects.row_defects(self.states.equations, self.times, self.states, starts)
        return starts, np.linalg.norm(turns, axis=1), np.linalg.norm(slips, axis=1)

    @property
    def rate_gap(self) -> float:
        """Difference of the rates where they begin, rad/s."""
        return 0.0 if self.rate_errors is None else float(self.rate_errors[self.begin])

    @cached_property
    def windows(self) -> defects.WindowDefects | None:
        """Defects of attitudes with rates; None where rows are too few or too far apart."""
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
        while found is not None and found.size <= _ABOVE * self.attitude_noise and length < span:
            length = min(_LONGER * length, span)
            found = self._alone(length) or found
        if found is not None and found.size > _ABOVE * self.attitude_noise:
            found.explain(STEADY if span >= _LONG else MOMENTS)
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


# --- the verdict -------------------------------------------------------------------------------------------


def judged(seen: Evidence) -> Verdict:
    """The verdict on a trajectory."""
    if (found := _agreement(seen)) is not None:
        return found
    if seen.states is None:
        return UNDECIDED, f"model and integration can't be distinguished: {seen.why_not}"
    windows = seen.windows
    if windows is None:
        alone = seen.alone
        return (_elsewhere_alone(seen, alone) if alone else None) or _by_attitudes(seen, alone)
    return (
        _contradiction(seen, windows)
        or _elsewhere(seen, seen.rate_gap, windows.attitude, windows.rates, windows.length)
        or _by_rates(seen, windows)
        or _by_attitudes(seen, seen.alone)
    )


def _agreement(seen: Evidence) -> Verdict | None:
    """The verdict on attitudes that are the experiment's; None for others."""
    floor, reason = seen.floor
    if seen.errors.max() > floor:
        return None
    rate_gap = 0.0 if seen.rate_errors is None else float(seen.rate_errors.max())
    agree = seen.rates is None or rate_gap <= 4 * seen.rate_noise + _AGREE * floor * seen.rate
    if agree and (seen.rates is not None or seen.turn < np.pi):
        return AGREES, reason
    if seen.turn >= np.pi:
        return UNDECIDED, (
            f"its attitudes are the experiment's, but the motion turns by {np.degrees(seen.turn):.3g} deg "
            "from row to row, so that other motions have the same rows; write more rows, or angular "
            "velocities (wx wy wz) that agree"
        )
    return INCONSISTENT_RATES, (
        f"its attitudes are the experiment's, but they don't turn at its rates, which differ by "
        f"up to {rate_gap:.3g} rad/s, at a motion of {seen.rate:.3g} rad/s"
    )


def _contradiction(seen: Evidence, windows: defects.WindowDefects) -> Verdict | None:
    """The verdict on rates at which the attitudes don't turn; None for others."""
    missed = windows.unexplained / windows.length
    rate_gap = seen.rate_gap
    moved = rate_gap > max(_ABOVE * seen.rate_noise, seen.floor[0] * seen.rate)
    if missed <= _NO_RATES * seen.rate and not (moved and rate_gap / _SAME < missed < rate_gap * _SAME):
        return None
    return INCONSISTENT_RATES, (
        f"its attitudes don't turn at its rates: these miss {missed:.3g} rad/s, at a motion of "
        f"{seen.rate:.3g} rad/s; remove the rates to have its attitudes judged alone"
    )


def _start_of(seen: Evidence) -> str:
    """The trajectory's own start as keys of a config; rates by extrapolated turns where it has none."""
    at, near = seen.begin, slice(seen.begin, seen.begin + 3)
    if seen.rates is not None:
        rates = seen.rates[at]
    else:
        rows = seen.quaternions[near]
        turns = vector_of(multiplied(conjugated(rows[:-1]), rows[1:])) / np.diff(seen.times[near])[:, None]
        rates = turns[0] + (turns[0] - turns[-1]) / 2 if len(turns) else np.zeros(3)
    start = [", ".join(f"{x:.9g}" for x in values) for values in (seen.quaternions[at], rates)]
    words = f"near the experiment's start it has quaternion = [{start[0]}], angular_velocity = [{start[1]}]"
    return words if seen.rates is not None else f"{words}, roughly"


def _elsewhere(seen: Evidence, gap: float, attitude: float, rates: float, length: float) -> Verdict | None:
    """The verdict on another start, which outweighs defects (rad, rad/s) over windows of a length (s)."""
    angle, floor = float(seen.errors[seen.begin]), seen.floor[0]
    collected = seen.span / length * (attitude + rates * seen.span)
    noise = seen.rate_noise + seen.attitude_noise / length
    if angle <= floor and gap <= max(_ABOVE * noise, floor * seen.rate):
        return None
    if angle + gap * seen.span <= _START * collected:
        return None
    apart = f"{angle:.3g} rad and {gap:.3g} rad/s apart"
    seen.notes.append(_start_of(seen))
    return UNDECIDED, f"it starts elsewhere, {apart}, which outweighs what its equations miss on the way"


def _elsewhere_alone(seen: Evidence, windows: WindowsOfAttitudes) -> Verdict | None:
    """The verdict on attitudes alone whose first rates differ, where their defects are nothing."""
    first = int(np.argmin(np.abs(windows.rows[:, 0] - seen.begin)))
    rate_gap = float(np.linalg.norm(windows.rates[first] - seen.own_rates[windows.rows[first, 0]]))
    size, length = windows.size, windows.length
    if rate_gap * length <= _SURE * size and seen.errors[seen.begin] <= seen.floor[0]:
        return None
    return _elsewhere(seen, rate_gap, size, size / length, length)


def _by_rates(seen: Evidence, windows: defects.WindowDefects) -> Verdict | None:
    """By kinematics; None where defects are within the digits."""
    noise = seen.attitude_noise + seen.rate_noise * windows.length + _ROUNDING
    if max(windows.attitude, windows.explained) <= _ABOVE * noise:
        return None
    left, share = windows.unexplained, windows.share
    measured = (
        f"of the attitude's defects ({windows.attitude:.2g} rad over spans of {windows.length:.3g} s) "
        f"differences of the rates explain {windows.explained:.2g} rad and leave {left:.2g} rad"
    )
    if share <= _MODEL or left <= 2 * noise:
        return WRONG_MODEL, f"its equations are others, by {windows.acceleration:.3g} rad/s^2: {measured}"
    if seen.turn > _FAR:
        return UNDECIDED, f"{_rows_apart(seen)}: {measured}"
    if share >= _INTEGRATOR:
        return INTEGRATION_ERROR, f"its equations are these, loosely integrated: {measured}"
    return UNDECIDED, f"both its model and its integration may differ: {measured}"


def _by_attitudes(seen: Evidence, windows: WindowsOfAttitudes | None) -> Verdict:
    """By attitudes alone."""
    if windows is None:
        return UNDECIDED, _rows_apart(seen)
    noise = seen.attitude_noise + _ROUNDING
    if windows.size <= _ABOVE * noise:
        return UNDECIDED, (
            f"local defects ({windows.size:.2g} rad) are within the digits of the file ({noise:.2g} rad); "
            "write more digits to separate a model from an integration"
        )
    share, left = windows.unexplained / windows.size, windows.unexplained
    left_by_fits = f"of the attitudes' defects ({windows.size:.2g} rad) other moments or steady torques leave"
    if share <= _ALONE or (left <= 2 * noise and share <= _IN_NOISE):
        more = f"by {windows.acceleration:.3g} rad/s^2"
        return WRONG_MODEL, f"its equations are others, {more}: {left_by_fits} {left:.2g} rad"
    windows.explain(WIDER)
    if windows.unexplained / windows.size > _ALONE:
        loose = "its equations are these, loosely integrated"
        return INTEGRATION_ERROR, f"{loose}: {left_by_fits} {windows.unexplained:.2g} rad"
    return UNDECIDED, (
        f"its model and its integration can't be distinguished: {left_by_fits} {left:.2g} rad; write angular "
        "velocities too (wx wy wz), or more rows"
    )


def _rows_apart(seen: Evidence) -> str:
    turn, most = np.degrees([seen.turn, _FAR])
    return (
        f"rows are too far apart to separate a model from an integration: the motion turns by {turn:.3g} deg "
        f"from row to row; write rows at most {most:.0f} deg apart"
    )
