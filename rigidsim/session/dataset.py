"""What a run's dataset holds: variables along time, those along events, and root attributes.

A published orientation is recorded with the attitude, sample by sample, and the rotation between the two.
Each row depends on its own time and attitude alone, so that no resumption can be seen in it.

Dates of samples and events are there if time 0 of the scene is known: year, Julian date, calendar date. A
Julian date is worked out from the exact rational time of a sample and kept in two doubles: right to 2^-104 of
its size, some 1e-20 s. Blocks are cut at multiples of a fixed count of samples, so that bits depend on the
sample alone.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from rigidsim.errors import ConfigError, Problem, RunFolderError
from rigidsim.model.orbits import sights_of
from rigidsim.model.system import Invariant
from rigidsim.scene.epochs import J2000, Epoch, leap_seconds, parse_epoch
from rigidsim.scene.frame import Figure
from rigidsim.scene.kernels.reading import KernelError, date_of
from rigidsim.scene.kernels.spice import Orientation
from rigidsim.scene.rotations import product, quaternion_of, rotation_matrix
from rigidsim.scene.sample_times import SampleTimes
from rigidsim.scene.scene import Scene
from rigidsim.solve.assembly import Assembly
from rigidsim.solve.evaluate import Evaluator, RecordedParts
from rigidsim.solve.events import EventLog, samples_at
from rigidsim.solve.problem import InitialValueProblem
from rigidsim.solve.projection import LATE
from rigidsim.solve.status import Status
from rigidsim.store import provenance
from rigidsim.store.summary import EventTimes, Summary
from rigidsim.store.variables import LABELS, OF_THE_RUN, SCHEMA_VERSION, Extra, Variable, time_variable

DAY = 86400
_YEAR = 365.25
_J2000 = float(J2000.julian_date())
_BLOCK = 1 << 16
_SPARE = 17  # bits taken by products with an index within a block
# What xarray turns into datetime64[ns] without the package cftime.
_FIRST_DATE, _LAST_DATE = parse_epoch("1678-01-01 TT").day, parse_epoch("2262-01-01 TT").day

Columns = dict[str, list[np.ndarray]]
"""Parts of each variable by name, (rows,) float64."""
Parts = tuple[float, float, float]


@dataclass(frozen=True)
class Dates:
    """Coordinates besides ``time`` for a scene whose time 0 is known."""

    epoch: Epoch
    samples: SampleTimes

    @property
    def scale(self) -> str:
        """Time scale of years and Julian dates: TDB for an epoch in TDB, otherwise TT."""
        return self.epoch.uniform().scale

    @cached_property
    def has_dates(self) -> bool:
        """Whether all samples lie where readers have dates (1678 to 2261) and, in UTC, from 1972 to the last
        day for which it is known.
        """
        ends = [self.samples.begin, self.samples.exact_last]
        days: list[Fraction] = [Fraction(self.epoch.day), *(self.epoch.uniform().day + t / DAY for t in ends)]
        if not _FIRST_DATE <= min(days) <= max(days) < _LAST_DATE:
            return False
        if self.epoch.scale != "UTC":
            return True
        if self.epoch.day < leap_seconds()[0][0]:
            return False
        last = date.fromordinal(leap_seconds()[2] - 1)
        known = [parse_epoch(f"{day} UTC").julian_date() for day in ("1972-01-01", last)]
        zero = self.epoch.julian_date()
        return known[0] <= zero + min(ends) / DAY and zero + max(ends) / DAY < known[1]

    @property
    def variables(self) -> list[Variable]:
        """The variables ``year`` and ``julian_date``, and ``date`` if every sample has one."""
        scale = {"time_scale": self.scale}
        found = [
            Variable(
                "year",
                (),
                {"units": "julian_year", "long_name": f"Julian year, {self.scale}", **scale}
                | {"definition": "2000 + (julian_date - 2451545) / 365.25"},
            ),
            Variable(
                "julian_date",
                (),
                {"units": "d", "long_name": f"Julian date, {self.scale}", **scale, "significant_bits": 106},
                2,
            ),
        ]
        if self.has_dates:
            attributes = {
                "units": f"seconds since {self._reference[0]}",
                "calendar": "proleptic_gregorian",
                "standard_name": "time",
                "long_name": f"date, {self.epoch.scale}",
                "time_scale": self.epoch.scale,
            }
            if self.epoch.scale == "UTC":
                attributes["comment"] = "leap seconds aren't counted; samples within one have no date"
            found.append(Variable("date", (), attributes))
        return found

    def of_samples(self, first: int, count: int) -> Columns:
        """Dates of samples first ... first+count-1."""
        times = self.samples.times
        if times is not None:
            return self.of_times(times[first : first + count])
        blocks = range(first // _BLOCK, (first + max(count, 1) - 1) // _BLOCK + 1)
        pieces = [self._grid(block, first, first + count) for block in blocks]
        return self._columns(*(np.concatenate([piece[i] for piece in pieces]) for i in range(3)))

    def of_times(self, times: Sequence[Fraction]) -> Columns:
        """Dates of any times of the scene, s."""
        zero = self.epoch.julian_date()
        dates = [zero + time / DAY for time in times]
        high = np.array([float(date) for date in dates])
        low = np.array(
            [float(date - Fraction(near)) for date, near in zip(dates, high.tolist(), strict=True)]
        )
        return self._columns(high, low, np.array([float(time) for time in times]))

    def _grid(self, block: int, first: int, stop: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Julian dates in two doubles and times (s) of the requested samples of one block."""
        origin = block * _BLOCK
        index = np.arange(max(first - origin, 0), min(stop - origin, _BLOCK), dtype=np.float64)
        begin = self.samples.begin + origin * self.samples.step
        days, seconds = _parts(self.epoch.julian_date() + begin / DAY), _parts(begin)
        high, low = _line(days, self._steps[0], index)
        return high, low, np.add(*_line(seconds, self._steps[1], index))

    @cached_property
    def _steps(self) -> tuple[Parts, Parts]:
        """Sampling interval in days and in seconds; products of two parts with an index are exact."""
        step = self.samples.step
        return _parts(step / DAY, _SPARE), _parts(step, _SPARE)

    def _columns(self, high: np.ndarray, low: np.ndarray, seconds: np.ndarray) -> Columns:
        year = 2000 + ((high - _J2000) + low) / _YEAR
        found = {"year": [year], "julian_date": [high, low]}
        if self.has_dates:
            found["date"] = [self._date(seconds)]
        return found

    @cached_property
    def _reference(self) -> tuple[str, float]:
        """A date and time without fractions to count from, and the seconds from it to time 0."""
        second = 10**14
        whole = min(self.epoch.ticks // second, DAY - 1)
        start = Epoch(self.epoch.scale, self.epoch.day, whole * second)
        return start.calendar().replace("T", " "), float(Fraction(self.epoch.ticks, second) - whole)

    def _date(self, seconds: np.ndarray) -> np.ndarray:
        """Dates from seconds since the reference, none of them a leap second; NaT within one."""
        dates = seconds + self._reference[1]
        if self.epoch.scale != "UTC":
            return dates
        for at, more in self._leaps:
            dates[seconds >= at] -= more
            dates[(seconds >= at - more) & (seconds < at)] = np.nan
        return dates

    @cached_property
    def _leaps(self) -> list[tuple[float, int]]:
        """Times (s) after time 0 from which UTC has counted another second, or one less, with the count."""
        days, offsets, _ = leap_seconds()
        later = [k for k in range(1, len(days)) if days[k] > self.epoch.day]
        zero = self.epoch.julian_date()
        begins = [float((Epoch("UTC", days[k], 0).julian_date() - zero) * DAY) for k in later]
        return [(at, offsets[k] - offsets[k - 1]) for at, k in zip(begins, later, strict=True)]


def _line(base: Parts, step: Parts, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """base + index * step in two doubles, to 2^-104 of the larger part; the index has at most 16 bits."""
    (a0, a1, a2), (b0, b1, b2) = base, step
    high, rest = _sum(a0, index * b0)
    middle, rest_of_middle = _sum(a1, index * b1)
    low, rest_of_low = _sum(rest, middle)
    high, low = _sum(high, low)  # before: the second is up to 2^-36 of the first, whose bits it shares
    return _sum(high, low + ((rest_of_middle + rest_of_low) + (a2 + index * b2)))


def _parts(value: Fraction, spare: int = 0) -> Parts:
    """Three doubles whose sum is close to a value, the first two with ``spare`` low bits zero."""
    parts = []
    for bits in (spare, spare, 0):
        part = float(value)
        if bits and part:
            unit = Fraction(2) ** (int(np.frexp(part)[1]) - 53 + bits)
            part = float(round(value / unit) * unit)
        parts.append(part)
        value -= Fraction(part)
    return parts[0], parts[1], parts[2]


def _sum(a: float | np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rounded sum and its rounding error (Knuth 1969, section 4.2.2, theorem B)."""
    total = a + b
    of_b = total - a
    return total, (a - (total - of_b)) + (b - of_b)


# --- variables ----------------------------------------------------------------------------------------------


LYAPUNOV_NAMES = ("lyapunov_time", "lyapunov_index", "lyapunov_exponents")
"""Names of variables and dimensions."""


def drift_name(invariant: str) -> str:
    """Name of the variable with an invariant's drift; its attribute ``drift_of`` names the invariant."""
    return f"{invariant}_drift"


def put_back_name(invariant: str) -> str:
    """Name of the variable with what was put back of an invariant, which its ``put_back_of`` names."""
    return f"{invariant}_put_back"


def dataset_variables(prepared: InitialValueProblem) -> list[Variable]:
    """Time first, then dates if known, recorded variables, each invariant's drift, and the corrections put
    back into projected ones.
    """
    system, projected = prepared.system, prepared.projected_scalars
    time, *recorded = recorded_variables(prepared)
    found = [
        *recorded,
        *(_drift(invariant) for invariant in system.invariants),
        *(_put_back(invariant, projected) for invariant in system.invariants if invariant.name in projected),
    ]
    beside_published = published_of(prepared)
    if beside_published is not None:
        found += beside_published.variables
    if prepared.sensitivity_keys:
        from rigidsim.session.sensitivity import sensitivity_variables  # which few runs need

        found += sensitivity_variables(prepared)
    dates = dates_of(prepared)
    if dates is None:
        return [time, *found]
    beside = " ".join(name for variable in dates.variables for name in variable.part_names())
    dated = [replace(v, attributes={**v.attributes, "coordinates": beside}) for v in found]
    return [time, *dates.variables, *dated]


def unused_variables(prepared: InitialValueProblem, steps: int) -> set[str]:
    """Variables of corrections put back, if the run ended before the step at which projection begins."""
    if not prepared.holds_late or steps > LATE:
        return set()
    return {put_back_name(name) for name in prepared.projected_scalars}


def dates_of(prepared: InitialValueProblem) -> Dates | None:
    """Dates of samples; None if the date of time 0 is unknown."""
    scene = prepared.scene
    return None if scene.epoch is None else Dates(scene.epoch, scene.samples)


def published_of(prepared: InitialValueProblem) -> "PublishedAttitude | None":
    """What is recorded of a published orientation; None without one."""
    orientation, scene = prepared.scene.orientation, prepared.scene
    if orientation is None:
        return None
    if not any(recorded.name == QUATERNION for recorded in prepared.system.recorded):
        named = scene.config.output.record
        lacking = f"isn't recorded; name {QUATERNION} in record" if named else "this model doesn't have"
        what = f"needs the attitude, which {lacking}, or leave orientation out"
        raise ConfigError(Problem("[output] orientation", what), prepared.experiment.source)
    return PublishedAttitude(orientation, scene.figure)


def labels_of_the_run(scene: Scene) -> dict[str, Sequence[str]]:
    """Labels of the dimensions ``OF_THE_RUN``."""
    bodies = () if scene.bodies is None else scene.bodies.names
    sights, tables = sights_of(scene), (scene.config.rotors, scene.config.rigid_bodies)
    rotors, others = ([one.name for one in table] for table in tables)
    sources = [sight.source for sight in sights]
    return {"point_mass": bodies, "rotor": rotors, "rigid_body": others, "source": sources}


def recorded_variables(prepared: InitialValueProblem) -> list[Variable]:
    """Time and the recorded variables; each with residuals beyond double precision.

    In single precision time has one too, since its labels are exact to a double.
    """
    parts, labels = prepared.precision.part_count, labels_of_the_run(prepared.scene)
    result = [time_variable(prepared.clock.part_count)]
    for recorded in prepared.system.recorded:
        attributes: dict[str, Any] = {"units": recorded.units, "long_name": recorded.long_name}
        if recorded.frame:
            attributes["frame"] = recorded.frame
        if recorded.name == "euler_angles":
            attributes["euler_sequence"] = prepared.system.sequence
            attributes["convention"] = "intrinsic"
        if recorded.continuity == "unwrap":
            attributes["angle"] = "continuous"
        attributes |= recorded.attributes
        if recorded.invariant:
            attributes["invariant"] = 1
        own = {name: labels[name] for name in recorded.dims if name in labels}
        result.append(Variable(recorded.name, recorded.dims, attributes, parts, own))
    return result


def _drift(invariant: Invariant) -> Variable:
    several = len(invariant.expressions) > 1
    definition = "norm of (value - initial) / scale" if several else "(value - initial) / scale"
    return _of_invariant(drift_name(invariant.name), invariant, "drift of", definition, "drift_of")


def _put_back(invariant: Invariant, projected: Sequence[str]) -> Variable:
    """The corrections put back into an invariant; ``projected``: the correction of each projected scalar."""
    what = "norm of the sum of the changes" if projected.count(invariant.name) > 1 else "sum of the changes"
    definition = (
        f"{what} of (value - initial) / scale from one correction to the next, up to the last one before "
        "each sample: to first order what the drift would have been without them"
    )
    name = put_back_name(invariant.name)
    return _of_invariant(name, invariant, "correction of", definition, "put_back_of")


def _of_invariant(name: str, invariant: Invariant, what: str, definition: str, of: str) -> Variable:
    attributes = {
        "units": "1",
        "long_name": f"{what} the {invariant.long_name}",
        "scale": float(invariant.scale),
        "scale_units": invariant.units,
        "scale_name": invariant.scale_name,
        "definition": definition,
        of: invariant.name,
    }
    return Variable(name, (), attributes)


def event_variables(
    prepared: InitialValueProblem, log: EventLog, evaluator: Evaluator, last: float
) -> list[Extra]:
    """``NAME_time``, dates and ``NAME_<variable>`` along a dimension ``NAME``, with residuals beyond double,
    up to the run's last sample (internal units); steps and crossings may lie past it.
    """
    extras: list[Extra] = []
    variables, dates = recorded_variables(prepared), dates_of(prepared)
    if dates is not None:
        variables[1:1] = dates.variables
    for index, crossing in enumerate(prepared.system.events):
        found = log.occurrences(index, last)
        values: RecordedParts = {}
        times = prepared.clock.internal(0, 0)
        if found:
            block = samples_at(found, prepared.precision)
            values, times = evaluator.evaluate_apart(block), block.times
        values["time"] = prepared.clock.parts_of(times)
        while len(values["time"]) < prepared.clock.part_count:  # found by the engine: no label to be off
            values["time"].append(np.zeros(len(times)))
        if dates is not None:
            rows = zip(*values["time"], strict=True)
            values |= dates.of_times([sum((Fraction(float(x)) for x in row), Fraction(0)) for row in rows])
        for variable in variables:
            wrapped = "angle" in variable.attributes
            more = dict.fromkeys(("turns", "angle"), "within one turn") if wrapped else {}
            more["event"] = crossing.name
            for part, name in enumerate(variable.part_names()):
                column = values[variable.name][part] if variable.name in values else np.zeros(0)
                extras.append(
                    Extra(
                        f"{crossing.name}_{name}",
                        (crossing.name, *variable.dims),
                        column.reshape(len(found), *variable.shape),
                        {**variable.part_attributes(part), **more},
                    )
                )
    return extras


def refuse_taken_names(prepared: InitialValueProblem) -> None:
    """Refuse a run whose dataset would use one name twice."""
    names = [name for variable in dataset_variables(prepared) for name in variable.part_names()]
    reserved = {*LABELS, *OF_THE_RUN, *LYAPUNOV_NAMES, "checkpoint", "events"}
    for number, table in enumerate(prepared.scene.config.states, start=1):
        if names.count(table.name) > 1 or table.name in reserved:
            what = f'given "{table.name}", a name that the dataset uses already; rename it'
            raise ConfigError(Problem(f"[[states]] number {number} name", what), prepared.experiment.source)
    taken = {*names, *reserved}
    dates, variables = dates_of(prepared), recorded_variables(prepared)
    if dates is not None:
        variables += dates.variables
    for crossing in prepared.system.events:
        names = [f"{crossing.name}_{name}" for variable in variables for name in variable.part_names()]
        double = next((name for name in (crossing.name, *names) if name in taken), None)
        if double is not None:
            events = [table.name for table in prepared.scene.config.events]
            problem = Problem(
                f"[[events]] number {events.index(crossing.name) + 1} name",
                f'given "{crossing.name}", by which the dataset would need the name "{double}" twice; choose '
                "another",
            )
            raise ConfigError(problem, prepared.experiment.source)
        taken.update((crossing.name, *names))


def event_times(prepared: InitialValueProblem, log: EventLog, last: float) -> dict[str, EventTimes]:
    """First and last times of each event that was found."""
    clock, times = prepared.clock, {}
    for index, crossing in enumerate(prepared.system.events):
        found = [clock.seconds(event.time) for event in log.occurrences(index, last)]
        if found:
            early = tuple(found[: EventTimes.EARLY])
            times[crossing.name] = EventTimes(first=early[0], last=found[-1], early=early)
    return times


def root_attributes(
    prepared: InitialValueProblem, parts: Assembly, run_id: str, mixed: str = ""
) -> dict[str, Any]:
    """Attributes of segments, and of a dataset before the end of its run is known.

    ``config`` is the text of what was run, one visible value per key; ``config_given`` as it was given;
    ``config_set`` the settings, one per line; ``recorded`` the names of the variables along time: if the
    config names none, a later version may record more by default. Tables are JSON texts.
    """
    scene, system = prepared.scene, prepared.system
    platform: dict[str, Any] = {f"version_{k}": v for k, v in provenance.versions().items()}
    platform |= {f"code_{k}": v for k, v in provenance.code_target(parts.evaluator.code).items()}
    exponents: dict[str, Any] = {"time": system.scaling.time, "inertia": system.scaling.inertia}
    found: dict[str, Any] = dict(
        title=scene.name,
        comment=scene.description,
        source="rigidsim",
        run_id=run_id,
        schema_version=SCHEMA_VERSION,
        status=Status.RUNNING.value,
        config=prepared.experiment.text,
        config_sha256=prepared.experiment.sha256,
        config_given=prepared.experiment.given,
        config_set="\n".join(prepared.experiment.settings),
        formulation=system.formulation.name,
        euler_sequence=system.sequence,
        euler_partner_sequence="" if system.partner is None else system.partner.sequence,
        states=" ".join(system.states),
        precision=prepared.precision.name,
        precision_bits=prepared.precision.bits,
        tolerance=prepared.effective_tolerance,
        integrator=prepared.algorithm.title,
        method=scene.config.integrator.method,
        hold_invariants=int(prepared.holds_invariants),
        hold_from_step=LATE if prepared.holds_late else None,
        taylor_order=parts.order,
        compact_mode=int(prepared.precision.compact or system.wide),
        high_accuracy=0,
        batch_size=1,
        unit_exponents=json.dumps({**exponents, "states": system.state_exponents}),
        principal_moments=json.dumps([float(m) for m in scene.body.principal_moments]),
        principal_axes=json.dumps([[float(x) for x in a] for a in scene.body.principal_axes]),
        inertia_tensor=json.dumps([[float(x) for x in row] for row in scene.body.inertia]),
        body_source=scene.body.source,
        center_of_mass=json.dumps([float(x) for x in scene.body.center_of_mass]),
        mass=None if scene.body.mass is None else float(scene.body.mass),
        scene=json.dumps(_recorded(prepared)),
        axes=scene.axes,
        epoch=None if scene.epoch is None else str(scene.epoch),
        **kernel_attributes(scene),
        time_unit=scene.config.time.unit,
        recorded=" ".join(variable.name for variable in system.recorded),
        python_loads=" ".join(type(load).__name__ for load in prepared.python_loads),
        cpu_model=provenance.cpu_model(),
        started_at=provenance.now(),
        **platform,
        mixed_provenance=mixed or None,
    )
    return _known(found)


def _known(attributes: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in attributes.items() if value is not None}


def kernel_attributes(scene: Scene) -> dict[str, Any]:
    """Identifies the kernels of a scene: names, span of what was read, and SHA-256; empty without one."""
    found: dict[str, Any] = {}
    if scene.ephemeris is not None and scene.ephemeris.used:
        first, last = zip(*(sight.span for sight in scene.ephemeris.used), strict=True)
        span, kernel = f"{date_of(max(first))} to {date_of(min(last))} TDB", scene.ephemeris.kernel
        found = {"ephemeris_kernel": kernel.name, "ephemeris_span": span, "ephemeris_sha256": kernel.digest}
    if (turning := scene.orientation) is not None:
        found |= {"orientation_kernel": turning.name, "orientation_of": turning.described}
        found["orientation_sha256"] = turning.digest
    return found


def _recorded(prepared: InitialValueProblem) -> dict[str, Any]:
    """The scene as pictures read it (``rigidsim.look.record``)."""
    scene = prepared.scene
    body, asked = scene.body, "reference" in scene.config.frame.model_fields_set
    locked = [x for found in scene.tabled.values() for x in found if not x.acts()]  # and drawn all the same
    shown = [load.pictured() for load in (*scene.loads, *locked, *prepared.python_loads)]

    def plain(vector: Any) -> list[float] | None:
        return [float(x) for x in vector] if vector else None

    return {
        "version": 1,
        "moments": plain(body.principal_moments),
        "axes": [plain(axis) for axis in body.principal_axes],
        "inertia": [plain(row) for row in body.inertia],
        "center_of_mass": plain(body.center_of_mass),
        "mass": None if body.mass is None else float(body.mass),
        "drawing": body.drawing,
        "host": scene.config.body.host,
        "figure_axis": plain(scene.figure.pole),
        "reference": (plain(scene.reference) or "moving") if asked else None,
        "space_axes": scene.axes,
        "gravity": plain(scene.gravity),
        "objects": [one for one in shown if one is not None],
    }


def of_complete(attributes: dict[str, Any], summary: Summary, angles_wrapped_from: float) -> dict[str, Any]:
    """Attributes of the dataset of a run that ended; from ``angles_wrapped_from`` on, s, Euler angles are
    within one turn, since nobody knows their turns.
    """
    put_back = {name: row.put_back for name, row in summary.invariants.items()}
    tables = {name: found.as_dict() for name, found in summary.tables.items()}
    ended: dict[str, Any] = {
        "status": summary.status,
        "status_message": summary.message,
        "warnings": "\n".join(summary.warnings),
        "steps": summary.cost.steps,
        "wall_seconds": summary.cost.wall_seconds,
        "cpu_seconds": summary.cost.cpu_seconds,
        "finished_at": provenance.now(),
        "put_back": json.dumps(put_back) if summary.held else None,
        "attitude_error": summary.accuracy.estimated_attitude_error,
        "modelling_error": None if summary.modelling is None else summary.modelling.worst,
        "table_errors": json.dumps(tables) if tables else None,
        "angles_wrapped_from": None if math.isnan(angles_wrapped_from) else angles_wrapped_from,
    }
    return _known(attributes | ended)


# --- the published orientation ------------------------------------------------------------------------------


QUATERNION = "quaternion"
_TURN = 2 * np.pi
_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])
_SMALL = 1e-300


@dataclass(frozen=True)
class PublishedAttitude:
    """A published orientation; its axes x, y, z are the figure's first axis, its second, and its pole."""

    orientation: Orientation
    figure: Figure

    @property
    def variables(self) -> list[Variable]:
        """What is recorded of it."""
        kernel = {"kernel": self.orientation.name, "published": self.orientation.described}
        figure = f"its x and z as the first axis and the pole of the figure ({self.figure.described})"

        def named(name: str, dims: tuple[str, ...], units: str, long_name: str, **more: Any) -> Variable:
            return Variable(name, dims, {"units": units, "long_name": long_name, **more, **kernel})

        turns = "in the turn nearest to the run's own where that is recorded, otherwise within one turn"
        return [
            named("published_quaternion", ("quaternion_component",), "1", "published attitude",
                  frame="body to space axes", convention=figure),
            named("published_right_ascension", (), "rad", "right ascension of the published pole",
                  convention=f"of the equator of J2000; {turns}"),
            named("published_declination", (), "rad", "declination of the published pole",
                  convention="of the equator of J2000"),
            named("published_prime_meridian", (), "rad", "published prime meridian, the IAU's W",
                  convention=f"from the equator's node on the equator of J2000; {turns}"),
            named("published_rotation", ("body_axis",), "rad", "rotation from the published attitude",
                  frame="body axes", convention="rotation vector from the published axes to the body's"),
            named("published_angle", (), "rad", "angle of the rotation from the published attitude"),
            named("published_pole_angle", (), "rad", "angle between the figure axis and the published pole"),
        ]  # fmt: skip

    def of_samples(self, rows: Mapping[str, Sequence[np.ndarray]]) -> Columns:
        """Its columns next to the recorded ones: parts of time, quaternion, and angles of the pole."""
        orientation, attitude = self.orientation, rows[QUATERNION][0].astype(np.float64)
        dates = orientation.dates([np.ravel(part) for part in rows["time"]])
        try:
            equatorial = orientation.matrices(dates)
        except KernelError as error:
            raise RunFolderError(f"{orientation.place}: {error}; restore it, then resume the run") from None
        named = self.figure.first, self.figure.second, self.figure.pole
        axes = np.array([[float(x) for x in axis] for axis in named])  # a row each, in body axes
        matrices = orientation.equator @ equatorial
        published = quaternion_of(matrices @ axes)
        published *= np.where((published * attitude).sum(axis=1) < 0, -1.0, 1.0)[:, None]
        (px, py, pz), (fx, fy, fz) = equatorial[:, :, 2].T, equatorial[:, :, 0].T
        ascension, meridian = np.arctan2(py, px), np.arctan2(fz, px * fy - py * fx)
        turned = np.stack(product([*(published * _CONJUGATE).T], [*attitude.T]), axis=1)
        turned *= np.where(turned[:, 0] < 0, -1.0, 1.0)[:, None]
        size = np.linalg.norm(turned[:, 1:], axis=1)
        angle = 2 * np.arctan2(size, turned[:, 0])
        pole = np.einsum("ijn,j->ni", np.array(rotation_matrix([*attitude.T])), axes[2])
        along, across = (pole * matrices[:, :, 2]).sum(axis=1), np.cross(pole, matrices[:, :, 2])
        return {
            "published_quaternion": [published],
            "published_right_ascension": [_near(ascension, rows.get("right_ascension"))],
            "published_declination": [np.arctan2(pz, np.hypot(px, py))],
            "published_prime_meridian": [_near(meridian, rows.get("prime_meridian"))],
            "published_rotation": [turned[:, 1:] * (angle / np.maximum(size, _SMALL))[:, None]],
            "published_angle": [angle],
            "published_pole_angle": [np.arctan2(np.linalg.norm(across, axis=1), along)],
        }


def _near(angles: np.ndarray, own: Sequence[np.ndarray] | None) -> np.ndarray:
    """Angles in the turn that is nearest to the run's own; between 0 and a turn where that isn't known."""
    if own is None:
        return np.mod(angles, _TURN)
    first = own[0].astype(np.float64).reshape(len(angles), -1)[:, 0]
    turns = np.round((first - angles) / _TURN)
    return np.where(np.isfinite(turns), angles + _TURN * turns, np.mod(angles, _TURN))
