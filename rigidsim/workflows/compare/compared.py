"""``rigidsim compare``: another tool's trajectory beside an experiment, at its own times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from rigidsim.errors import RigidsimError
from rigidsim.scene.config import Experiment
from rigidsim.scene.row_rotations import angles_between, normalised
from rigidsim.solve.from_states import FromStates, NotFromStates
from rigidsim.store.many_rows import blocks_of, flagged, gathered, largest, mean_square, picked
from rigidsim.workflows.compare import defects, saving
from rigidsim.workflows.compare.as_run import dataset_of_rows, files_of, trajectory_given
from rigidsim.workflows.compare.by_equations import ByEquations
from rigidsim.workflows.compare.columns import Attitudes, attitudes_of, seconds_in
from rigidsim.workflows.compare.conventions import (
    FoundReading,
    RateReading,
    find_convention,
    find_rates,
    rows_compared,
)
from rigidsim.workflows.compare.kinematics import Turning, turning_readings
from rigidsim.workflows.compare.motion import OwnMotion, motion_at_all, own_motion, plain, sampled_run
from rigidsim.workflows.compare.own_steps import own_steps
from rigidsim.workflows.compare.result import (
    INTEGRATION_ERROR,
    UNDECIDED,
    AttitudeError,
    Comparison,
    Disagreement,
    FoundConvention,
)
from rigidsim.workflows.compare.saving import DRAWN, MOST_SHOWN, save_dataset, save_figure, save_timeline
from rigidsim.workflows.compare.verdict import (
    Evidence,
    agreement,
    by_attitudes,
    by_rates,
    contradiction,
    elsewhere,
    elsewhere_alone,
)
from rigidsim.workflows.physics.models import rotation_vectors
from rigidsim.workflows.read import Given, as_experiment

WITHIN = 1e-9
"""Largest angle (rad) between attitudes that agree, if nothing else is asked for."""
_ROUNDED = "the attitude error comes from its times, which are rounded"
_CLOSE = 0.2  # of the last digit of times, to which the rounding of evenly spaced ones is known
_RANDOM = 0.5  # correlation of neighbours, up to which errors are those of rounding
_EXACT = 1e-13  # relative, of times in double precision
_FAR_AWAY = 10.0  # spans of the file or of the experiment, beyond which times are counted from another zero
_UNITS = ("s", "ms", "min", "h", "day", "yr")
_FAR = np.log(0.02)  # the same, above which only conventions are tried in which it turns at its rates
_NEARER = 1.0  # of these, by which attitudes that are nearer outweigh rates
_BAD = np.log(0.15)  # mean logarithm of mismatches (rad), above which times in another unit are tried


def compare(
    experiment: Given,
    table: Any,
    *,
    within: float = WITHIN,
    out: str | Path | None = None,
    figure: str | Path | None = None,
    timeline: str | Path | None = None,
    kernels: Sequence[str | Path] = (),
    force: bool = False,
) -> Comparison:
    """Judge a trajectory by how far it is from an experiment, at its own times.

    Args:
        experiment: as for ``rigidsim.run``.
        table: a file (CSV, Parquet, netCDF, AEM), a run or its folder, a mapping of names to arrays,
            a pandas DataFrame, or an xarray Dataset. Columns are known by their names (docs/compare.md).
        within: rad, what attitudes may differ by and agree.
        out: file for the dataset. figure: file for the figure, a .png or .svg.
        timeline: file for a timeline (.rrd) of both bodies with the angle between them.
        kernels: SPICE's, that a CK is read with: its clock, and leap seconds.
        force: replace existing files; what is read is never written over.

    Raises:
        ConfigError: the config can't be run.
        RigidsimError: the trajectory can't be used, or a file would be replaced, and what to do.
    """
    asked = as_experiment(experiment)
    place, picture, drawn = (None if path is None else Path(path) for path in (out, figure, timeline))
    saving.refuse_targets(place, picture, drawn, [*asked.files, *files_of(table, kernels)], force=force)
    quiet, scene = plain(asked)
    given = attitudes_of(trajectory_given(table, scene, kernels), scene.epoch)
    if not 0 < within < np.pi:
        raise RigidsimError(f"within: given {within:g}; an angle above 0 and below pi, in rad, is allowed")
    try:
        equations: FromStates | None = FromStates(scene)
        why_not = ""
    except NotFromStates as error:
        equations, why_not = None, str(error)
    judging = _Judging(quiet, given, equations, why_not, float(scene.start), float(scene.samples.last))
    result = judging.compared(asked.config.name, within)
    if place is not None:
        result = _with(result, dataset_file=str(save_dataset(result.dataset, place)))
    if picture is not None:
        result = _with(result, figure_file=str(save_figure(result.dataset, picture)))
    if drawn is not None:
        result = _with(result, timeline_file=str(judging.drawn(drawn)))
    return result


def _with(result: Comparison, **values: str) -> Comparison:
    made, dataset = result.having(**values), result.dataset
    made._dataset = dataset
    return made


@dataclass
class _Judging:
    """A trajectory and the experiment beside it; ``begin`` and ``end``: of the experiment, s."""

    experiment: Experiment
    given: Attitudes
    equations: FromStates | None
    why_not: str
    begin: float
    end: float

    def compared(self, name: str, within: float) -> Comparison:
        """Everything, in order: unit of time, convention, errors, drifts, defects, verdict."""
        self.told = list(self.given.told)
        self.turning: list[Turning] = []
        unit, found, sampled = self._convention()
        self.unit = unit
        second = seconds_in(unit)
        times = gathered(self.given.times[rows] * second for rows in blocks_of(len(self.given.times)))
        own = motion_at_all(self.experiment, self.equations, times, sampled, self.told)
        count = len(own.rates)
        times, theirs = times[:count], found.quaternions(self.given)[:count]
        errors = gathered(_errors(own, theirs, rows) for rows in blocks_of(count))
        compared = rows_compared(count)
        rates: np.ndarray | None = None
        reading: RateReading | None = None
        more: list[str] = []
        if self.given.rates is not None:
            allowed = {one.rates for one in self.turning if one.reading == found.reading}
            there = picked(theirs, compared), picked(own.rates, compared)
            reading, more = find_rates(self.given.at(compared), found, *there, allowed)
            rates = gathered(_rates(self.given, reading, found, theirs, rows) for rows in blocks_of(count))
        flight = self._flight(count)
        self.read = times, found, reading
        dataset = _dataset(times, errors, name, self.given.trajectory.source)
        rate_errors = None if rates is None else _distances(rates, own.rates)
        attitude_noise, rate_noise = self._noise(found, reading)
        steps = self._steps(times, own, rates)
        rate = defects.motion_rate(times, own.rates)
        largest_error, turn = largest(errors), float(np.median(steps))
        floor = max(within, 4 * attitude_noise, 3 * own.uncertainty)
        reason = f"the attitude error is within {floor:.2g} rad everywhere"
        rounded = None if largest_error <= floor else self._rounded_times(times, own, theirs, floor)
        seen = Evidence(
            largest_error,
            max(floor, rounded or 0.0),
            reason if rounded is None else f"{_ROUNDED} ({self.given.resolution[2]:.2g} s or less)",
            attitude_noise + rate * self._time_noise(times),
            rate_noise,
            (float(errors[0]), 0.0 if rate_errors is None else float(rate_errors[0])),
            rate,
            float(times[-1] - times[0]),
            None if rate_errors is None else largest(rate_errors),
            turn,
        )
        known = self._by_equations(times, theirs, rates, own, flight, seen.attitude_noise, dataset)
        verdict, why = agreement(seen) or self._judged(seen, known)
        local = None if known is None else known.local
        if known is not None and local is not None and verdict == INTEGRATION_ERROR and rates is not None:
            own_step = own_steps(known.intervals, dataset["defect"].values, attitude_noise)
            local = local.having(order=own_step.order, step_tolerance=own_step.tolerance)
        if rate_errors is not None:
            dataset["rate_error"] = (
                "time",
                rate_errors,
                {"units": "rad s-1", "long_name": "difference of angular velocities"},
            )
        position_error = None
        if flight is not None and own.positions is not None and self.given.positions is not None:
            apart = _distances(flight[:, :3], own.positions)
            position_error = largest(apart)
            dataset["position_error"] = ("time", apart, {"units": "m", "long_name": "distance of positions"})
        dataset.attrs["verdict"] = verdict
        worst = max((int(np.argmax(errors[rows])) + rows.start for rows in blocks_of(count)), key=errors.item)
        _, first = flagged(lambda rows: errors[rows] > seen.floor, count)
        trajectory = self.given.trajectory
        made = Comparison(
            name=name,
            source=trajectory.source,
            rows=count,
            span_s=float(times[-1] - times[0]),
            verdict=verdict,
            why=why,
            within=seen.floor,
            resolution=attitude_noise,
            attitude_error=AttitudeError(
                largest=seen.largest,
                rms=float(np.sqrt(mean_square(errors))),
                time=float(times[worst]),
                row=trajectory.row(worst),
            ),
            rate_error=seen.rate_error,
            position_error=position_error,
            convention=_described(found, self.given.named, unit, reading, more),
            drifts=[] if known is None else known.drifts,
            local_defects=local,
            first_disagreement=None
            if first < 0
            else Disagreement(time=float(times[first]), row=trajectory.row(first)),
            told=self.told,
        )
        made._dataset = dataset
        return made

    def _judged(self, seen: Evidence, known: ByEquations | None) -> tuple[str, str]:
        """The verdict of attitudes that aren't the experiment's."""
        if known is None:
            return UNDECIDED, f"model and integration can't be distinguished: {self.why_not}"
        found, windows = None, known.windows
        if windows is not None:
            rate_defects = float(np.sqrt(np.mean(windows.rates**2)))
            attitude = float(np.sqrt(np.mean(windows.attitude**2)))
            found = (
                contradiction(seen, windows)
                or elsewhere(seen, attitude, rate_defects, windows.length)
                or by_rates(seen, windows)
            )
        if found is None:
            alone = known.alone()
            if alone is not None and windows is None:
                slip = float(np.linalg.norm(alone.rates[0] - known.own.rates[alone.rows[0, 0]]))
                found = elsewhere_alone(seen, alone, slip)
            found = found or by_attitudes(seen, alone)
        return found

    def _steps(self, times: np.ndarray, own: OwnMotion, rates: np.ndarray | None) -> np.ndarray:
        """Turns (rad) from some rows to the next ones, by the faster of both motions."""
        rows = rows_compared(len(times) - 1)
        both = [own.rates] if rates is None else [own.rates, rates]
        fastest = np.max([np.linalg.norm(picked(x, rows), axis=1) for x in both], axis=0)
        return np.asarray(fastest * (picked(times, rows + 1) - picked(times, rows)))

    def _rounded_times(
        self, times: np.ndarray, own: OwnMotion, theirs: np.ndarray, floor: float
    ) -> float | None:
        """Largest angle (rad) by which rounded times explain the error everywhere; None where they don't.

        Attitudes at a time that is off by d are turned by the rate times d. Rounded times are off by half
        their last digit at most: by what evenly spaced ones show, or by another amount in each row.
        """
        most = self.given.resolution[2] * seconds_in(self.unit)
        rows = rows_compared(len(times))
        parts = [picked(part, rows) for part in own.quaternions]
        error = rotation_vectors([normalised(parts[0]), *parts[1:]], [picked(theirs, rows)])
        rates = picked(own.rates, rows)
        square = np.maximum(np.sum(rates**2, axis=1), 1e-300)
        shifts = np.sum(error * rates, axis=1) / square
        rest = np.linalg.norm(error - rates * shifts[:, None], axis=1)
        size = np.linalg.norm(rates, axis=1)
        bent = floor + size**2 * most**2  # which the change of the rate leaves
        if (rest > bent).any() or (np.abs(shifts) > 1.1 * most + floor / np.sqrt(square)).any():
            return None
        even = picked(self._even(times), rows)
        known = shifts + picked(times, rows) - even  # of which rounded ends leave a line
        line = np.polyval(np.polyfit(even - even[0], known, 1), even - even[0])
        spread = float(np.sum((shifts - shifts.mean()) ** 2))
        alike = float(np.sum((shifts[1:] - shifts.mean()) * (shifts[:-1] - shifts.mean())))
        uneven = (np.abs(known - shifts) > _EXACT * abs(float(times[-1]))).any()  # even ones show no rounding
        by_digits = uneven and (np.abs(known - line) < _CLOSE * most + floor / np.sqrt(square)).all()
        if spread == 0 or (abs(alike) > _RANDOM * spread and not by_digits):
            return None
        return float(1.1 * most * size.max() + floor)

    def _even(self, times: np.ndarray) -> np.ndarray:
        """As many times (s) evenly spaced."""
        step = (times[-1] - times[0]) / (len(times) - 1)
        return gathered(times[0] + step * np.arange(rows.start, rows.stop) for rows in blocks_of(len(times)))

    def _time_noise(self, times: np.ndarray) -> float:
        """Rounding of the times, s, rms, where these would be evenly spaced but for their digits."""
        most, even = self.given.resolution[2] * seconds_in(self.unit), self._even(times)
        apart = max(float(np.abs(times[rows] - even[rows]).max()) for rows in blocks_of(len(times)))
        return most / np.sqrt(3) if _EXACT * abs(float(times[-1])) < apart <= 2 * most else 0.0

    def drawn(self, path: Path) -> Path:
        """Write the timeline of both, after ``compared``."""
        times, found, reading = self.read
        rows = np.unique(np.linspace(0, len(times) - 1, min(len(times), MOST_SHOWN)).astype(int))
        own = sampled_run(self.experiment, picked(times, rows)).dataset
        name = Path(self.given.trajectory.source).stem
        looks = {key: own.attrs[key] for key in DRAWN if key in own.attrs} | {"title": name}
        theirs = dataset_of_rows(self.given.at(rows), picked(times, rows), found, reading, looks)
        return save_timeline(own, theirs, name, path)

    def _convention(self) -> tuple[str, FoundReading, tuple[np.ndarray, OwnMotion]]:
        """Unit of the times and convention of the attitude, with the motion at the rows compared."""
        units = [self.given.time_unit] if self.given.time_unit else list(_UNITS)
        self._refuse_far(units)
        rows = rows_compared(len(self.given.times))
        some = self.given.at(rows)
        best: tuple[str, FoundReading, tuple[np.ndarray, OwnMotion]] | None = None
        refused = ""
        for unit in units:
            times = some.times * seconds_in(unit)
            if times[0] < self.begin - 1e-9 * abs(self.begin):
                refused = (
                    f"{self.given.trajectory.source}: its first time ({times[0]:.6g} s) is before the "
                    f"experiment's start ({self.begin:.6g} s); leave these rows out, or move [time] start"
                )
                continue
            if best is not None and times[-1] > self.begin + 1.5 * (self.end - self.begin):
                continue
            own = own_motion(self.experiment, times)
            kept = rows[: len(own.rates)]
            found = find_convention(some, own.quaternions[0])
            # where nothing moves anything fits: what counts is the mismatch by the motion in these times
            moved = angles_between(own.quaternions[0], own.quaternions[0][:1]).max()
            score = found.score - float(np.log(min(1.0, moved + 1e-12)))
            if best is None or score < min(best[1].score - 1.0, _BAD):
                best = unit, found, (kept, own)
            if score < _BAD:
                break
        if best is None:
            raise RigidsimError(refused)
        if self.given.time_unit is None and best[0] != "s":
            self.told.append(
                f"times were taken for {best[0]}, by which the attitudes fit best; name a unit: t [{best[0]}]"
            )
        if best[1].score > _FAR:  # another model may be nearer in another convention: its rates tell
            unit, found, (kept, own) = best
            self.turning = turning_readings(self.given, seconds_in(unit))
            allowed = {one.reading for one in self.turning}
            turning = find_convention(some, own.quaternions[0], allowed)
            if turning.score < found.score + _NEARER:
                best = unit, turning, (kept, own)
            else:  # its attitudes are near the experiment's, and these rates contradict them
                self.turning = []
        if best[1].score > _BAD:
            why = "this is one in which it turns at its rates" if self.turning else "that found may be wrong"
            self.told.append(f"no convention tried brings it near the experiment: {why}")
        return best

    def _refuse_far(self, units: list[str]) -> None:
        """Refuse times that lie far from the experiment in all units, such as Unix seconds."""
        first, last = float(self.given.times[0]), float(self.given.times[-1])
        for unit in units:
            second = seconds_in(unit)
            away = max(first * second - self.end, self.begin - last * second)
            if away <= _FAR_AWAY * max((last - first) * second, self.end - self.begin):
                return
        start = self.begin / seconds_in(units[0])
        raise RigidsimError(
            f"{self.given.trajectory.source}: its times, {first:.15g} to {last:.15g} {units[0]}, lie far "
            f"from the experiment, {self.begin:.6g} to {self.end:.6g} s, as if counted from another zero "
            f"(Unix seconds?); subtract {first - start:.15g} from each time, if its first row is the "
            "experiment's start; or write dates, and give [time] epoch"
        )

    def _flight(self, count: int) -> np.ndarray | None:
        if self.given.positions is None or self.given.velocities is None:
            return None
        both = self.given.positions, self.given.velocities
        return gathered(np.concatenate([x[rows] for x in both], axis=1) for rows in blocks_of(count))

    def _noise(self, found: FoundReading, reading: RateReading | None) -> tuple[float, float]:
        """Resolution of attitude (rad) and rates (rad/s) by the digits of the file."""
        attitude, rates, _ = self.given.resolution
        attitude *= np.pi / 180 if found.reading.unit == "deg" else 2.0
        if reading is None:
            return float(attitude), 0.0
        return float(attitude), float(
            rates
            * np.linalg.norm(reading.rates(np.eye(3), found, np.tile([1.0, 0, 0, 0], (3, 1))), axis=1).max()
        )

    def _by_equations(
        self, times: np.ndarray, theirs: np.ndarray, rates: np.ndarray | None, own: OwnMotion,
        flight: np.ndarray | None, noise: float, dataset: xarray.Dataset,
    ) -> ByEquations | None:  # fmt: skip
        """Drifts and local defects, which are put into the dataset too; None where they can't be measured."""
        if self.equations is None:
            self.told.append(f"neither local defects nor drifts were measured: {self.why_not}")
            return None
        drift: np.ndarray | None = None
        if (given := self.given.quaternions) is not None:
            begun = np.linalg.norm(given[:1], axis=1)
            drift = gathered(
                np.linalg.norm(given[rows], axis=1) / begun - 1 for rows in blocks_of(len(times))
            )
        found = ByEquations(self.equations, times, theirs, rates, flight, drift, noise, own, dataset)
        try:
            found.measure()
        except NotFromStates as error:
            self.why_not = str(error)
            self.told.append(f"neither local defects nor drifts were measured: {error}")
            return None
        self.told += found.told
        return found


def _errors(own: OwnMotion, theirs: np.ndarray, rows: slice) -> np.ndarray:
    """Angles (rows,), rad, between attitudes."""
    one = [part[rows] for part in own.quaternions]
    return np.linalg.norm(rotation_vectors([normalised(one[0]), *one[1:]], [theirs[rows]]), axis=1)


def _rates(
    given: Attitudes, reading: RateReading, found: FoundReading, theirs: np.ndarray, rows: slice
) -> np.ndarray:
    assert given.rates is not None
    return reading.rates(given.rates[rows], found, theirs[rows])


def _distances(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return gathered(np.linalg.norm(one[rows] - other[rows], axis=1) for rows in blocks_of(len(one)))


def _dataset(times: np.ndarray, errors: np.ndarray, name: str, source: str) -> xarray.Dataset:
    attributes = {"units": "rad", "long_name": "angle between the attitudes"}
    return xarray.Dataset(
        {"attitude_error": ("time", errors, attributes)},
        {"time": ("time", times, {"units": "s", "long_name": "time"})},
        {"title": f"{source} beside {name}", "kind": "comparison"},
    )


def _described(
    found: FoundReading, named: str, unit: str, rates: RateReading | None, more: list[str]
) -> FoundConvention:
    reading, frames = found.reading, found.frames
    return FoundConvention(
        order=named or reading.order,
        direction=reading.direction,
        sequence=reading.sequence,
        about=("fixed" if reading.fixed else "body") if reading.sequence else "",
        unit=reading.unit,
        time_unit=unit,
        rate_unit="" if rates is None else rates.unit,
        rate_axes="" if rates is None else rates.axes,
        offset=frames.side,
        offset_angle=frames.angle,
        offset_quaternion=[float(x) for x in frames.turn],
        undecided=[*found.undecided, *more],
    )
