"""The config's schema: what may stand in the TOML file, table by table (the interface's section 1).

Only shapes and single values are checked here; what needs mechanics (triangle inequality, a spin about an
axis without inertia, ...) is checked where the scene is built.
"""

from __future__ import annotations

import ast
import inspect
import math
import re
import sys
from collections import ChainMap
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache, partial
from itertools import islice, pairwise
from typing import Annotated, Any, Literal, Self, Union, get_args

from pydantic import (
    BaseModel,
    Field,
    StrictBool,
    StrictInt,
    StrictStr,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    create_model,
    field_validator,
    model_validator,
)
from pydantic.json_schema import GenerateJsonSchema

from rigidsim.errors import ConfigError, Problem, RigidsimError
from rigidsim.scene.bodies.body import Body, Matter
from rigidsim.scene.bodies.presets import PRESETS
from rigidsim.scene.choices import AUTO, DEFAULT_METHOD, FORMULATIONS, METHODS, ORBIT_AVERAGED, REDUCED
from rigidsim.scene.exact import ZERO, ExactNumber, UnitError, powers, to_si, unit_text
from rigidsim.scene.expressions.names import BODY_NAMES
from rigidsim.scene.expressions.tree import RESERVED
from rigidsim.scene.fields import (
    Angle,
    AnyQuantity,
    BodyName,
    ConfigTable,
    Dimensionless,
    Direction,
    EachOnce,
    ElementLines,
    EulerSequence,
    FileName,
    Formula,
    Four,
    Irradiance,
    Metre,
    Moment,
    Momentum,
    Never,
    NotNegative,
    NotZero,
    OneOf,
    OrWord,
    Pair,
    Positive,
    Range,
    Rate,
    Second,
    Speed,
    Triple,
    VariableName,
    checked,
    excludes,
    named,
    number_schema,
    one_of,
    only_with,
    refuse,
    together,
)
from rigidsim.scene.frame import Frame
from rigidsim.scene.kepler import Ellipse
from rigidsim.scene.kernels.reading import EphemerisTable
from rigidsim.scene.paths import ARRAYS_OF_TABLES, Path
from rigidsim.scene.point_masses import PointMassBody
from rigidsim.scene.registry import LOADS, MESSAGES, OBSERVABLES, BroughtState, LoadFields
from rigidsim.scene.sample_times import Time
from rigidsim.scene.validation_messages import meant, shown

_FOLDER_NAME = "^[A-Za-z0-9._-]{1,100}$"
_ABOUT_NAME = (
    "1 to 100 letters, digits, dots, underscores and hyphens, not dots alone, since it names the run folder"
)
_ABOUT_LOADS = "loads that act on the body, each of a kind; without any the body rotates freely"
LOCAL_FRAMES = ("lvlh", "vvlh", "rsw", "rtn", "ric", "ned")
EQUILIBRIUM_NAMES = ("relative", "cassini_1", "cassini_2", "cassini_3", "cassini_4")


_NOT_ZERO = Range(lambda x: x != 0, "any other time, a negative one for retrograde,")


class Motion(ConfigTable):
    """How a body moves at ``time.start``."""

    angular_velocity: Triple[Rate] | None = Field(
        None, examples=[[0.1, 1.0, 0.05], ["0 deg/s", "0 deg/s", "20 deg/h"]]
    )
    """angular velocity relative to space or to relative_to, in body axes; this or angular_momentum"""
    quaternion: Annotated[Four[Dimensionless], NotZero] | None = Field(None, examples=[[1, 0, 0, 0]])
    """attitude w, x, y, z: takes body axes to space axes (or the axes of relative_to); any norm but zero; by
    default the body axes start along these
    """
    euler_angles: Triple[Angle] | None = Field(None, examples=[["10 deg", "23.44 deg", "0 deg"]])
    """phi, theta, psi of [integrator] euler_sequence, intrinsic; instead of quaternion"""
    position: Triple[Metre] | None = Field(None, examples=[["7000 km", 0, 0]])
    """position of the centre of mass, in space axes; with it or velocity the body flies freely"""
    velocity: Triple[Speed] | None = Field(None, examples=[[0, "7.5 km/s", 0]])
    """velocity of the centre of mass, in space axes"""


class Initial(Motion):
    """``[initial]``: the state at ``time.start``."""

    rules = (excludes("tle", "position", "velocity", "frame"),)
    angular_momentum: Triple[Momentum] | None = Field(None, examples=[[0, 0, 12.5]])
    """angular momentum in space axes, instead of angular_velocity"""
    pole: Pair[Angle] | None = Field(None, examples=[["317.68 deg", "52.89 deg"]])
    """right ascension and declination (J2000) of the figure axis; instead of quaternion; needs [frame] axes
    """
    prime_meridian: Angle | None = Field(None, examples=["176.6 deg"])
    """the IAU's W, with pole: from the ascending node of its equator on the equator of J2000, along the
    body's equator, to the figure's prime meridian (body x where the figure axis is z); by default 0
    """
    obliquity: Angle | None = Field(None, examples=["23.44 deg"])
    """angle of the figure axis from the normal of [frame] reference; with node_longitude,
    instead of quaternion
    """
    node_longitude: Angle | None = Field(None, examples=["35.4 deg"])
    """longitude of the node where the body's equator rises through the plane of [frame] reference; without
    prime_meridian the figure's prime meridian starts there
    """
    spin_period: Annotated[Second, _NOT_ZERO] | None = Field(None, examples=["25 h"])
    """time of a turn about the figure axis, instead of angular_velocity; negative: opposite sense"""
    equilibrium: Annotated[str, OneOf(EQUILIBRIUM_NAMES)] | None = None
    """start in an equilibrium, which is found: relative (at rest in the frame of a circular orbit; the stable
    one, or the one nearest to an attitude that is given), or a Cassini state of an orbit whose node moves
    """
    apm: FileName | None = Field(None, examples=["satellite.apm"])
    """name of a file next to the config, a CCSDS attitude parameter message: its attitude, and its rates if
    it has any; without [time] epoch its date is the start
    """
    relative_to: Annotated[str, OneOf(LOCAL_FRAMES)] | None = None
    """local frame of the orbit from which attitude and rates count, and whose rate is added: lvlh or vvlh (x
    forward, y against the orbit's normal, z to the source), rsw, rtn or ric (outward, forward, normal), ned
    (north, east, to the source)
    """
    tle: ElementLines | None = Field(
        None,
        examples=[
            [
                "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753",
                "2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667",
            ]
        ],
    )
    """two-line elements of a satellite of the Earth, instead of position and velocity: SGP4 gives the
    start in GCRF; without [time] epoch their date is time 0
    """
    frame: Literal["GCRF", "ICRF", "EME2000", "J2000", "TEME", "ITRF"] | None = None
    """frame of position and velocity, at the date of [time] epoch, instead of the space axes; about the
    Earth; velocities in ITRF are relative to the rotating Earth
    """

    @property
    def flies(self) -> bool:
        """Whether the body has a position."""
        return not (self.position is None and self.velocity is None and self.tle is None)


class Model(ConfigTable):
    """``[model]``: every rotation, or the motion averaged over it, or over the sources' orbits as well."""

    rules = (
        Never(
            lambda table: (
                table.level == "full" and table.model_fields_set & {"order", "start", "geodetic_precession"}
            ),
            'start, geodetic_precession or order is given with level = "full", but is for averaged levels: '
            "leave it out",
        ),
    )

    level: Literal["full", "spin_averaged", "orbit_averaged", "auto"] = "full"
    """full resolves every rotation; spin_averaged follows the direction of the angular momentum, and its size
    and energy under torques that do work, averaged over the body's free rotation; orbit_averaged averages
    over the sources' orbits as well; auto is the cheapest level that keeps [integrator] accuracy_axis
    """
    short_period: StrictBool = False
    """add back, to first order, what averaging removed: the nutation with the orbital periods, and the offset
    of figure and spin axes from the angular momentum
    """
    order: Literal[1, 2] = 2
    """order of the averaged equations: 1 leaves out the terms of second order, as the literature's equations
    of precession do
    """
    start: Literal["osculating", "mean"] = "osculating"
    """whether [initial] is the motion at that moment, or the averaged one already, as published poles are"""
    geodetic_precession: StrictBool = False
    """add the geodetic precession of the body on its orbits (1.92 arcsec a century for the Earth)"""

    @property
    def reduced(self) -> bool:
        """Whether the model averages anything."""
        return self.level in REDUCED


class TidesTable(ConfigTable):
    """``[tides]``: slow changes of the rotation, and of the distance of the body that raises tides."""

    model: Literal["linear", "constant_lag"] = "linear"
    """linear has the present rates of the Earth and Moon for all times; constant_lag follows the distance"""
    raised_by: EachOnce[StrictStr] = Field(min_length=1, examples=[["moon"]])
    """names of loads whose sources raise tides"""
    dissipation: NotNegative[Dimensionless] = ExactNumber(Fraction(1))
    """tidal dissipation relative to the present one, Td of the literature"""
    obliquity: StrictBool = False
    """whether tides change the obliquity as well"""
    radius: Positive[Metre] | None = Field(None, examples=["6378136.3 m"])
    """of the body, for constant_lag; by default the Earth's"""
    love_lag: NotNegative[Second] | None = Field(None, examples=["194.895 s"])
    """Love number k2 times the lag, for constant_lag; by default the Earth's of La2004, 0.305 times 639 s"""


class Insolation(ConfigTable):
    """``[output] insolation``: where on a planet, and when in its year, insolation is recorded."""

    latitude: Annotated[Angle, Range(lambda x: abs(x) <= math.pi / 2, "-90 to 90 deg")] = Field(
        examples=["65 deg"]
    )
    """geographic latitude"""
    solar_longitude: Angle = Field(examples=["90 deg"])
    """ecliptic longitude of the Sun from the moving equinox; 90 deg is the June solstice"""
    constant: Irradiance = Field(ExactNumber(Fraction(13607, 10)), examples=["1360.7 W/m^2"])
    """irradiance at a distance of the semi-major axis"""


def _states_of(tables: Mapping[str, Any]) -> Iterator[Any]:
    """Names of the states of a config as it is written, also of states that loads bring."""
    for key in ("states", "loads", "rotors"):
        listed = tables.get(key)
        for table in listed if isinstance(listed, list) else ():
            if isinstance(table, dict):
                load = LOADS["kind"].get(str(table.get("kind"))) if key == "loads" else None
                if key == "states" or (load is not None and load.Fields.brings_state):
                    yield table.get("name")
                if key == "rotors" and "gimbal" in table:
                    yield f"gimbal_{table.get('name')}"


class Output(ConfigTable):
    """``[output]``: what is kept and how it is shown."""

    rules = (
        Never(
            lambda table: table.tip is not None and table.record is not None and "tip" not in table.record,
            'a tip is given, but record has no "tip"; name it there, or leave tip out',
        ),
    )

    record: EachOnce[Annotated[str, OneOf(OBSERVABLES, of_scene=_states_of)]] | None = Field(
        None, min_length=1, examples=[["quaternion", "obliquity"]]
    )
    """names of the variables to record; by default variables that suit the scene (drifts of invariants are
    always recorded)
    """
    timeline: StrictBool = True
    """write timeline.rrd, for rigidsim view"""
    timeline_rows: StrictInt = Field(100_000, ge=2)
    """largest number of rows in the timeline; longer runs are thinned there, never in the dataset"""
    estimate: StrictBool = True
    """estimate the errors of attitude and position; costs a few percent of the run, in batches of a sweep
    one to two times as much as the members
    """
    lyapunov: StrictBool = False
    """Lyapunov exponents from variational equations; costs tens of times the plain run"""
    sensitivity: EachOnce[StrictStr] | None = Field(
        None, min_length=1, examples=[["initial.angular_velocity[0]"]]
    )
    """keys of numbers in the config by which attitude, rates and position are differentiated along the way,
    vectors component by component; initial.attitude stands for a turn of the start, body axes
    """
    orientation: StrictStr | None = Field(None, examples=["./pck00011.tpc"])
    """a published orientation to compare with the attitude: the path of a PCK of SPICE, text or
    binary, from the config's folder; its SHA-256 is kept in the dataset
    """
    orientation_of: BodyName | None = Field(None, examples=["mars", 31006])
    """the body in that kernel, by its name or number, or the number of axes in a binary kernel; by default
    [body] host, or the only axes of a binary kernel
    """
    insolation: Insolation | None = Field(
        None, examples=[{"latitude": "65 deg", "solar_longitude": "90 deg"}]
    )
    """latitude and longitude of the Sun of the recorded insolation"""
    tip: Triple[Metre] | None = Field(None, examples=[[0, 0, 0.1]])
    """the point whose path is recorded as tip, in body axes from the reference point; by default the centre
    of mass of a body that turns about another point
    """


class EventTable(ConfigTable):
    """``[[events]]``: a moment, or where an expression of time and the state crosses zero."""

    rules = (
        one_of("time", "expression"),
        one_of("angular_velocity", "angular_impulse", least=0),
        excludes("time", "direction"),
    )

    name: VariableName = Field(examples=["flip"])
    """prefix of the dataset's variables: NAME_time, NAME_quaternion, ..."""
    time: Second | None = Field(None, examples=["10 day"])
    """time of the event, instead of expression"""
    expression: StrictStr | None = Field(None, examples=["wy", "theta - pi/2"])
    """expression of t, the states (wx wy wz, qw qx qy qz, phi theta psi, x y z, vx vy vz) and [parameters],
    in SI; the event is its crossing of zero
    """
    direction: Literal["any", "up", "down"] = "any"
    """direction of the crossing"""
    action: Literal["record", "stop", "impulse"] = "record"
    """record the event, stop the run at it, or change velocities at it at once"""
    body: StrictStr | None = Field(None, examples=["dimorphos"])
    """body that the impulse acts on: a name of [[rigid_bodies]]; by default [body]"""
    velocity: Triple[Speed] | None = Field(None, examples=[[0, "-2.6 mm/s", 0]])
    """impulse: change of the body's velocity, in axes"""
    axes: Literal["space", "body", "rtn"] = "space"
    """axes of this velocity; rtn: outwards (from the origin, or from [body]), along the orbit, its normal"""
    angular_velocity: Triple[Rate] | None = Field(None, examples=[[0, 0, "0.1 deg/s"]])
    """impulse: change of the body's angular velocity, body axes"""
    angular_impulse: Triple[Momentum] | None = Field(None, examples=[[0, 0, "0.02 kg m^2/s"]])
    """impulse: angular impulse on the body (N m s), body axes, instead of angular_velocity"""

    @model_validator(mode="after")
    def _changes_something(self) -> EventTable:
        keys = "velocity", "angular_velocity", "angular_impulse"
        given = [key for key in (*keys, "body", "axes") if key in self.model_fields_set]
        if self.action != "impulse" and given:
            raise refuse(f'given {" and ".join(given)} with action = "{self.action}"; set action = "impulse"')
        if self.action == "impulse" and not set(given) & set(keys):
            raise refuse(
                f'given action = "impulse" without what changes; add {", ".join(keys[:2])} or {keys[2]}'
            )
        return self


class Limits(ConfigTable):
    """``[limits]``: guards that stop the run, resumable, with the reason named."""

    wall_time: Positive[Second] | None = Field(None, examples=["2 h"])
    """time for integrating and recording in one session"""
    max_steps: StrictInt | None = Field(None, ge=1, examples=[1_000_000_000])
    """number of steps in one session, never exceeded"""
    max_drift: Positive[Dimensionless] | None = Field(None, examples=[1e-9])
    """largest relative drift of any invariant; the run ends with the first sample past it"""


class TableText(ConfigTable):
    """``[tables.NAME]``: a table that belongs to the config; files that it names are taken in like this."""

    rules = (one_of("text", "sha256"),)

    text: StrictStr | None = None
    """text of the CSV file, or of the gravity field"""
    sha256: Annotated[StrictStr, named("[0-9a-f]{64}", "64 hexadecimal digits")] | None = None
    """of a file of more than 3 MB next to the config, which is read from there: its SHA-256"""


# A number is carried and stored as a sum of float64 parts, which end at 2^-1074: 250 digits (833 bits) leave
# room for numbers down to 1e-70.
LARGEST_DIGITS = 250
_ANGLE_ERROR = {"exclusiveMinimum": 0, "exclusiveMaximum": 3}
_BELOW_HALF_A_TURN = Range(lambda x: 0 < x < 3, "an angle above 0 and below pi, in rad,", _ANGLE_ERROR)
PRECISION_NAMES = ("single", "double", "extended", "quadruple")
_DIGITS = OrWord(
    PRECISION_NAMES,
    Annotated[StrictInt, Field(ge=1, le=LARGEST_DIGITS)],
    f"a number of decimal digits from 1 to {LARGEST_DIGITS}",
)
_UP_TO_1 = Range(lambda x: 0 < x <= 1, "above 0, at most 1", {"exclusiveMinimum": 0, "maximum": 1})
_TOLERANCE = OrWord(
    ("auto",),
    Annotated[Dimensionless, _UP_TO_1],
    "a number above 0 and at most 1",
)


class Integrator(ConfigTable):
    """``[integrator]``: how accurately, and in which variables."""

    precision: Annotated[str | int, _DIGITS] = Field("double", examples=["extended", 50])
    """precision of the arithmetic: single, double, extended or quadruple (24, 53, 64 or 113 bits), or a
    number of decimal digits
    """
    tolerance: Annotated[str | ExactNumber, _TOLERANCE] = Field("auto", examples=["auto", 1e-12])
    """error tolerance of each step, relative to the largest component of the state; auto is epsilon in double
    precision, and an eighth of it in most others, where epsilon would truncate the series slightly too early
    """
    formulation: Annotated[str, OneOf(FORMULATIONS, (AUTO,))] = Field(
        AUTO,
        description="the variables that are integrated; "
        + "; ".join(f"{name}: {known.described}" for name, known in FORMULATIONS.items() if known.described),
    )
    euler_sequence: EulerSequence = "zxz"
    """axes of the intrinsic rotations, for [initial] and for recorded angles"""
    method: Annotated[str, OneOf(METHODS)] = Field(
        DEFAULT_METHOD, description="; ".join(f"{x.name}: {x.described}" for x in METHODS.values())
    )
    hold_invariants: Annotated[bool | str, OrWord(("auto",), StrictBool, "true or false")] = "auto"
    """project the state onto its invariants, so that errors of long runs grow far more slowly; auto: from
    step 8192 on, leaving shorter runs unchanged; in sweeps auto means false
    """
    accuracy: Annotated[Angle, _BELOW_HALF_A_TURN] | None = Field(None, examples=[1e-9])
    """attitude error allowed at the end, instead of precision and tolerance; certified"""
    # version 1.0 promises that the schema shows no unit here
    accuracy_axis: Annotated[Angle, _BELOW_HALF_A_TURN, WithJsonSchema(number_schema("1"))] | None = Field(
        None, examples=[1e-6]
    )
    """error (rad) allowed until the end in the directions of the angular momentum and the figure axis; with
    [model] level = "auto" the cheapest model within it is chosen
    """
    accuracy_position: Positive[Metre] | None = Field(None, examples=["1 um"])
    """position error allowed at the end if the body flies, or of a second body; certified"""

    @property
    def has_steps(self) -> bool:
        """Whether the method integrates in steps; a closed form takes none."""
        return METHODS[self.method].has_steps


KEPT = (
    "final", "extremes", "means", "events", "section", "megno", "fli", "lyapunov", "frequencies", "series",
)  # fmt: skip
"""Items that can be kept of a member; drifts, steps and warnings always are."""
INDICATORS = ("megno", "fli", "lyapunov")
"""Items that need a tangent vector's growth, which is recorded for them."""
RANDOM = ("normal", "uniform", "sphere")
WAYS = ("linspace", "logspace", "step", "values", *RANDOM)
"""Ways to give an axis's values."""
LARGEST_AXIS = 10_000_000
LARGEST_TILE = 100_000_000
MOST_EVENTS = 100_000


class AxisTable(ConfigTable):
    """One axis: the values that a key takes, given in one of seven ways."""

    rules = (
        one_of(*WAYS),
        Never(
            lambda axis: axis.way == "sphere" and (axis.count is None) == (axis.grid is None),
            "a sphere takes either count (random directions) or grid (polar angles and azimuths), such as "
            "grid = [16, 32]",
        ),
        Never(
            lambda axis: axis.way in RANDOM[:2] and axis.count is None,
            "missing; random values need it",
            "count",
        ),
        Never(
            lambda axis: axis.way not in RANDOM and axis.count is not None,
            f"given, but is for random values ({', '.join(RANDOM)}); other ways say it themselves: remove it",
            "count",
        ),
        Never(
            lambda axis: axis.way != "sphere" and axis.grid is not None,
            "given without sphere; remove it",
            "grid",
        ),
    )

    linspace: Triple[Any] | None = None
    """[from, to, count], both ends included"""
    logspace: Triple[Any] | None = None
    """[from, to, count], with equal ratios, both ends included"""
    step: Triple[Any] | None = None
    """[from, step, count], equally spaced"""
    values: list[Any] | None = Field(None, min_length=1)
    """list of values, each as the key itself accepts it"""
    normal: Pair[Any] | None = None
    """[mean, standard deviation]; with count"""
    uniform: Pair[Any] | None = None
    """[from, to]; with count"""
    sphere: Any = None
    """radius: random directions of a vector with count, or a grid of directions with grid"""
    count: StrictInt | None = Field(None, ge=1)
    """number of random values"""
    grid: Pair[Annotated[StrictInt, Field(ge=1)]] | None = None
    """for sphere: numbers of polar angles (equally spaced in their cosine) and azimuths"""
    name: StrictStr | None = None
    """name of the dimension; by default the last part of the key, or the whole key if the last part names
    a recorded variable
    """

    @property
    def way(self) -> str:
        """Which of the ways the axis uses."""
        return next(way for way in WAYS if getattr(self, way) is not None)


class SweepTable(ConfigTable):
    """``[sweep]``: many members of one experiment."""

    mode: Literal["product", "zip"] = "product"
    """product: every combination of the axes' values; zip: the first of each, the second, ..."""
    seed: StrictInt = 0
    """seed of random values; each draw depends on seed, key and index"""
    keep: EachOnce[Annotated[str, OneOf(KEPT)]] = Field(["final"])
    """results kept of each member, besides drifts, steps and warnings"""
    most_events: StrictInt = Field(16, ge=1, le=MOST_EVENTS)
    """largest number of times (events) or points (section) kept of an event"""
    tile: StrictInt | None = Field(None, ge=1, le=LARGEST_TILE)
    """number of members computed and saved together; by default some seconds of work"""
    batch: StrictBool = True
    """integrate members that share their equations in batches; false: each alone, which takes many times
    as long
    """
    impossible: Literal["refuse", "mark"] = "refuse"
    """members that can't be run: refuse the sweep before any of them runs, or mark those as "refused", with
    the reason, and run the others
    """
    axes: dict[StrictStr, AxisTable] = Field(min_length=1)
    """the axes, by the dotted keys whose values are swept, with indices from 0"""


MOST_STARTS = 10_000
_ONE_OR_MORE = Range(lambda x: x >= 1, "1 or more")


Sigma = Annotated[
    Any,
    checked(
        lambda value: not (isinstance(value, bool | dict) or value is None),
        "given {}; a standard deviation is allowed, of a vector one for each component, of data the name of "
        "a column",
    ),
]


class KnownWithin(ConfigTable):
    """KnownWithin knowledge of a value."""

    sigma: Sigma = Field(examples=[0.1, "1e10 m^3/s^2", [0.1, 0.1, 0.2]])
    """standard deviation about the config's value, in the unit of the key; of a vector one for all its
    components, or one for each
    """


class FitDataTable(ConfigTable):
    """``[[fit.data]]``: one set of observations with times."""

    rules = (
        Never(
            lambda table: isinstance(table.sigma, list),
            "given an array; a standard deviation for all components, or the name of a column, is allowed",
            "sigma",
        ),
    )

    file: StrictStr = Field(examples=["observed.csv"])
    """CSV, Parquet, NumPy, netCDF, AEM, APM, OEM, CK, or the dataset of a run; its path from the config's
    folder
    """
    kernels: EachOnce[StrictStr] = Field(default_factory=list, examples=[["clock.tsc", "leapseconds.tls"]])
    """of a CK: the clock (SCLK) and other kernels that SPICE needs; paths from the config's folder"""
    segment: StrictStr | None = Field(None, examples=["2", "2024-03-01T00:10:00"])
    """of an AEM or OEM: number from 1 of the only segment that counts, or a date within it"""
    time: StrictStr = Field("time", examples=["time", "utc"])
    """column of the times: seconds of the run, dates, or Unix time"""
    observable: StrictStr = Field(examples=["quaternion", "angular_velocity", "wz^2"])
    """any variable that can be recorded, or an expression as in [[events]]"""
    columns: EachOnce[StrictStr] | None = Field(None, examples=[["alpha_deg", "beta_deg", "gamma_deg"]])
    """columns of its components; by default NAME_COMPONENT as in exported tables, or NAME for a single one,
    or what tools write
    """
    unit: StrictStr | None = Field(None, examples=["deg"])
    """unit of these columns; by default the file's, or SI"""
    sigma: Sigma = Field(examples=["5 deg", "sigma_deg", 1e-3])
    """standard deviation of each component: a number with its unit (bare ones are SI), or the name of a
    column, in ``unit``; of attitudes, of each component of a rotation vector
    """
    scale: Literal["TDB", "TT", "TAI", "GPS", "UTC"] = "UTC"
    """time scale of dates that don't name theirs"""
    offset: Second = Field(ZERO, examples=["37 s"])
    """added to the times; estimated if "fit.data[N].offset", N from 0, is among the parameters"""
    outliers: Annotated[Dimensionless, _ONE_OR_MORE] | None = Field(None, examples=[4])
    """leave out and report rows with a residual above so many standard deviations; by default none"""


class FitTable(ConfigTable):
    """``[fit]``: what ``rigidsim fit`` estimates."""

    rules = (
        Never(
            lambda table: set(table.parameters) & set(table.consider),
            "some key is both estimated (parameters) and considered; remove it from one of them",
            "consider",
        ),
        Never(
            lambda table: table.starts > 1 and not table.prior,
            "given more than one, but without a prior there is nothing to draw them from; add "
            'prior."KEY" = {sigma = ...}',
            "starts",
        ),
    )

    parameters: EachOnce[StrictStr] = Field(
        min_length=1, examples=[["initial.attitude", "initial.angular_velocity", "body.principal_moments[0]"]]
    )
    """dotted keys with indices from 0 whose values are estimated, in this order everywhere; initial.attitude
    is a rotation vector in body axes from the config's attitude; the fit starts at the config's values
    """
    prior: dict[StrictStr, KnownWithin] = Field(default_factory=dict)
    """by key: how well a parameter is known beforehand"""
    consider: dict[StrictStr, KnownWithin] = Field(default_factory=dict)
    """by key: uncertainty of values that aren't estimated; it adds to the sigmas of estimated values"""
    data: list[FitDataTable] = Field(min_length=1)
    """the observations"""
    starts: StrictInt = Field(1, ge=1, le=MOST_STARTS)
    """number of starts: the config's values, and others drawn from the priors; the best result is kept"""


class RotorTable(ConfigTable):
    """A wheel in the body, symmetric about its axis, whose momentum is in every total. The body's own tensor
    includes it as if it were locked.
    """

    rules = (together("gimbal", "gimbal_rate"), only_with("gimbal", "gimbal_angle"))
    name: VariableName = Field(examples=["wheel"])
    """letters, digits and underscores, beginning with a letter; rate_NAME in expressions is its rate"""
    axis: Direction = Field(examples=[[0, 0, 1]])
    """direction of its axis, body axes; any length"""
    moment: NotNegative[Moment] = Field(examples=["0.01 kg m^2"])
    """moment of inertia about its axis"""
    rate: Rate = Field(ZERO, examples=["300 rad/s", "3000 rpm"])
    """rate about its axis relative to the body, at the start"""
    torque: Formula | None = Field(None, examples=["-k*wz"])
    """torque of the motor on the rotor, N m: an expression of t, the state and [parameters]; its reaction
    acts on the body; without it the rotor turns freely
    """
    fixed: StrictBool = False
    """a motor keeps the rate, with any torque needed"""
    gimbal: Direction | None = Field(None, examples=[[1, 0, 0]])
    """axis of a gimbal that turns the rotor, body axes, at right angles to its axis: a control moment gyro;
    needs fixed = true and gimbal_rate
    """
    gimbal_rate: Formula | None = Field(None, examples=["0.1*sin(t)"])
    """rate of the gimbal's angle, rad/s: an expression like torque; gimbal_NAME is the angle"""
    gimbal_angle: Angle = ZERO
    """angle of the gimbal at the start; at 0 the rotor's axis is axis"""

    def brought_states(self) -> list[BroughtState]:
        """The gimbal's angle."""
        if self.gimbal is None or self.gimbal_rate is None:
            return []
        start = {"angle__": self.gimbal_angle}
        return [BroughtState(f"gimbal_{self.name}", "rad", "angle__", self.gimbal_rate, start)]


class RelativeOrbit(Ellipse):
    """Osculating elements of a body about ``[body]`` at the start, of both as points."""

    semi_major_axis: Positive[Metre] = Field(examples=["1190 m"])
    """semi-major axis of the ellipse"""


class RigidBodyTable(Matter, Motion):
    """``[[rigid_bodies]]``: a second body, with keys of ``[body]`` and ``[initial]``; its position and
    velocity count from the centre of mass of ``[body]``.
    """

    rules = (
        *Matter.rules,
        excludes("orbit", "position", "velocity"),
        excludes("equilibrium", "orbit", "velocity", "angular_velocity"),
    )

    name: VariableName = Field(examples=["dimorphos"])
    """letters, digits and underscores, beginning with a letter; its label in the dataset"""
    orbit: RelativeOrbit | None = Field(None, examples=[{"semi_major_axis": "1190 m", "eccentricity": 0.02}])
    """osculating elements about [body] at the start, instead of position and velocity"""
    equilibrium: Annotated[str, OneOf(("synchronous", "doubly_synchronous"))] | None = None
    """start on a circular orbit in the equator of [body], which always sees the same side of this one; at the
    distance of position velocity, attitude and rates are found; doubly_synchronous: both bodies show one side
    """


_NUMBER = ("", "1")
"""Units of a pure number."""


class OwnStateTable(ConfigTable):
    """``[[states]]``: a user-defined state, integrated with the motion and readable in every expression."""

    name: Annotated[
        VariableName,
        checked(
            lambda name: name not in BODY_NAMES and name not in RESERVED,
            "given {}, which expressions use already; rename it",
        ),
    ] = Field(examples=["integral"])
    """name in expressions, and of the variable in the dataset"""
    initial: AnyQuantity = Field(ZERO, json_schema_extra={"x-unit-key": "unit"})
    """value at the start, SI or with its unit"""
    unit: StrictStr | None = Field(None, examples=["rad", "N m s"])
    """SI unit, "1" for a number; labels the dataset, and is checked in every expression
    """
    derivative: Formula = Field(examples=["wz", "(2*k*qz - torque)/(2 s)"])
    """rate of change in SI: an expression of t, the state, [[states]] and [parameters]"""

    @field_validator("unit")
    @classmethod
    def _in_si(cls, value: str | None) -> str | None:
        if value is None:
            return None
        if value in _NUMBER:
            return "1"
        try:
            factor, pi_power = to_si(value)
        except UnitError as error:
            raise refuse(f"given {shown(value)}: {error}") from None
        if factor != 1 or pi_power:
            found = powers(value)
            instead = unit_text(found) if found else "rad"
            raise refuse(f'given "{value}"; states are in SI: "{instead}" is allowed')
        return value


class Config(ConfigTable):
    """One experiment; ``config_model`` adds the kinds of loads."""

    rules = (
        Never(
            lambda config: (
                config.tides is not None
                and not (
                    config.model.level == ORBIT_AVERAGED
                    and config.model.order == 1
                    and not config.model.short_period
                )
            ),
            '[tides] is for [model] level = "orbit_averaged" with order = 1, no short_period; change these '
            "keys, or leave [tides] out",
        ),
    )

    name: Annotated[StrictStr, named(rf"(?!\.*$){_FOLDER_NAME}", _ABOUT_NAME)] = Field(
        examples=["intermediate_axis"], json_schema_extra={"pattern": _FOLDER_NAME}
    )
    """name of the run folder: letters, digits, dots, underscores and hyphens"""
    description: StrictStr = ""
    """free text, shown with the results"""
    parameters: dict[StrictStr, AnyQuantity] = Field(
        default_factory=dict, examples=[{"k": 0.25, "c": "2e-4 N m s"}]
    )
    """named constants for expressions"""
    body: Body
    """the rigid body"""
    initial: Initial
    """the state at the start"""
    loads: list[LoadFields] = Field(default_factory=list, description=_ABOUT_LOADS)
    ephemeris: EphemerisTable | None = None
    """the kernel that places real bodies: sources of loads given by name, and the body itself"""
    bodies: list[PointMassBody] = Field(default_factory=list, max_length=64)
    """point masses under mutual gravity, integrated with the body"""
    rigid_bodies: list[RigidBodyTable] = Field(default_factory=list, max_length=1)
    """a second rigid body, integrated with [body]; kind = "mutual_gravity" of [[loads]] binds them"""
    rotors: list[RotorTable] = Field(default_factory=list, max_length=64)
    """wheels in the body, free, driven or at fixed rates"""
    states: list[OwnStateTable] = Field(default_factory=list, max_length=64)
    """user-defined states (controllers, filters, slosh, fuel), by their derivatives"""
    events: list[EventTable] = Field(default_factory=list)
    """events: zero crossings of an expression of time and the state"""
    frame: Frame = Field(default_factory=Frame.model_construct)
    """name of the space axes, and the references of angles"""
    time: Time
    """time span and sample times"""
    tides: TidesTable | None = None
    """slow changes of rotation and of the Moon's distance, in orbit_averaged motions"""
    model: Model = Field(default_factory=Model.model_construct)
    """the full motion, or an average of it"""
    integrator: Integrator = Field(default_factory=Integrator.model_construct)
    """accuracy, and the variables that are integrated"""
    output: Output = Field(default_factory=Output.model_construct)
    """what is recorded and displayed"""
    limits: Limits = Field(default_factory=Limits.model_construct)
    """guards that stop the run; it can be resumed"""
    sweep: SweepTable | None = None
    """the sweep: many members of one experiment"""
    fit: FitTable | None = None
    """the fit: parameters that rigidsim fit estimates from data"""
    tables: dict[StrictStr, TableText] = Field(
        default_factory=dict, examples=[{"elements.csv": {"text": "time [yr], eccentricity\n0, 0.01\n"}}]
    )
    """texts of tables that loads refer to; the text of files next to the config is copied here"""

    @property
    def texts(self) -> dict[str, str]:
        """Texts of tables by name."""
        return {name: table.text for name, table in self.tables.items() if table.text is not None}

    @property
    def every_state(self) -> list[tuple[str, int, OwnStateTable | BroughtState]]:
        """``[[states]]`` and states that loads bring, each with its array of tables and the place there."""
        found: list[tuple[str, int, Any]] = [("states", i, table) for i, table in enumerate(self.states)]
        bringing: tuple[tuple[str, list[Any]], ...] = (("loads", self.loads), ("rotors", self.rotors))
        return found + [
            (key, i, x) for key, tables in bringing for i, table in enumerate(tables)
            for x in table.brought_states()
        ]  # fmt: skip

    @model_validator(mode="after")
    def _dated(self) -> Config:
        """Date and axes that two-line elements, or a frame, imply where the config says nothing of them."""
        start, changes = self.initial, dict[str, Any]()
        if start.tle is not None and self.time.epoch is None:
            changes["time"] = self.time.model_copy(update={"epoch": start.tle.epoch})
        if start.apm in self.texts:
            try:
                stated = MESSAGES["apm"](start.apm, self.texts[start.apm])
                if self.time.epoch is None:
                    begun = stated.epochs[0].after(-Decimal(repr(float(self.time.start))))
                    changes["time"] = self.time.model_copy(update={"epoch": begun})
            except (RigidsimError, ValueError) as error:
                raise refuse(f"[initial] apm: {error}") from None
            if stated.axes in LOCAL_FRAMES:
                local = {"relative_to": start.relative_to or stated.axes}
                changes["initial"] = start.model_copy(update=local)
            elif self.frame.axes is None and self.ephemeris is None:
                changes["frame"] = self.frame.model_copy(update={"axes": stated.axes})
        if (start.tle or start.frame) and self.frame.axes is None and self.ephemeris is None:
            changes["frame"] = self.frame.model_copy(update={"axes": "GCRF"})
        return self.model_copy(update=changes) if changes else self

    @property
    def impulses(self) -> list[EventTable]:
        """The events if any change the motion, at their places; others are recorded and stop nothing."""
        if not any(event.action == "impulse" for event in self.events):
            return []
        plain = {"action": "record"}
        return [x if x.action == "impulse" else x.model_copy(update=plain) for x in self.events]

    def as_motion(self, record: Sequence[str] = ("quaternion",), **integrator: Any) -> Self:
        """The config of the same motion alone, without what is only watched or judged: a quaternion in steps,
        without projections, unless the keys of ``[integrator]`` given here say otherwise.
        """
        watched = ("sensitivity", "orientation", "orientation_of", "tip")
        output = {"record": list(record), "timeline": False, "lyapunov": False, **dict.fromkeys(watched)}
        plain = {"formulation": "quaternion", "method": DEFAULT_METHOD, "hold_invariants": False}
        judged = dict.fromkeys(("accuracy", "accuracy_axis", "accuracy_position"))
        tables = {
            "integrator": self.integrator.model_copy(update=plain | judged | integrator),
            "output": self.output.model_copy(update=output),
            "events": self.impulses,
        }
        return self.model_copy(update=tables)

    @field_validator("loads", "events", "bodies", "rigid_bodies", "rotors", "states")
    @classmethod
    def _different(cls, value: list[Any], info: ValidationInfo) -> list[Any]:
        names = [table.name for table in value]
        for name in filter(None, names):
            if names.count(name) > 1:
                raise refuse(f'two {info.field_name} are named "{name}"; give each another name')
        for name in (
            x.name
            for table in value
            for x in ([table] if info.field_name == "states" else getattr(table, "brought_states", list)())
        ):
            if name in {*OBSERVABLES, *BODY_NAMES, *RESERVED}:
                raise refuse(f'a state is named "{name}", as a variable that can be recorded; rename it')
        return value

    @field_validator("parameters")
    @classmethod
    def _parameter_names(cls, value: dict[str, Any]) -> dict[str, Any]:
        for name in value:
            if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]{0,40}", name):
                raise refuse(f'given the name "{name[:40]}"; allowed: letters, digits and underscores')
            if name in BODY_NAMES or name in RESERVED:
                raise refuse(f'given the name "{name}", which expressions use already; rename it')
        return value


def config_model() -> type[Config]:
    """The schema with every kind of load; ``RuntimeError`` if ``rigidsim.model.loads`` registered none."""
    if not LOADS["kind"]:
        raise RuntimeError("no kinds of loads are registered; import rigidsim.model.loads first")
    kinds = [LOADS["kind"][name].Fields for name in sorted(LOADS["kind"])]
    return _with_loads(tuple(fields for fields in kinds if fields is not None))


@lru_cache
def _with_loads(fields: tuple[type[LoadFields], ...]) -> type[Config]:
    union = Annotated[Union[fields], Field(discriminator="kind")]  # type: ignore[valid-type]  # noqa: UP007
    return create_model(
        "Config",
        __base__=Config,
        __doc__="One experiment.",
        loads=(list[union], Field(default_factory=list, description=_ABOUT_LOADS)),
    )


# --- errors of its validator, which name the key and the remedy ---------------------------------------------

_WORDS = {
    "too_short": "given an empty array; at least one entry is needed",
    "too_long": "given {actual_length}; at most {max_length} are allowed",
    "kind_of_value": "given {given}; {msg}",
    "list_type": "given {given}; an array is allowed",
    "dict_type": "given {given}; a table of keys and their values is allowed",
    "model_type": "given {given}; a table is allowed",
    "model_attributes_type": "given {given}; a table is allowed",
    "int_type": "given {given}; a whole number, without point or exponent, is allowed",
    "int_from_float": "given {given}; a whole number, without point or exponent, is allowed",
    "string_type": "given {given}; a string is allowed",
    "bool_type": "given {given}; true or false is allowed",
    "greater_than_equal": "given {given}; at least {ge} is allowed",
    "less_than_equal": "given {given}; at most {le:g} is allowed",
}
"""Kinds of errors of pydantic, in the words of ``Problem``."""
_MOST_PROBLEMS = 200  # worth reporting; a file of a million wrong keys has said enough by then


def _what(allowed: Callable[[], list[str]], error: Mapping[str, Any]) -> str:
    kind, context = error["type"], error.get("ctx", {})
    location, given = tuple(error["loc"]), error["input"]
    effect = len(location) < 2 or location[0] in ("loads", "initial")
    if kind == "extra_forbidden":
        key, fields = str(location[-1]), allowed()
        return f"unknown key{meant(key, fields, effect=effect)}; allowed: {', '.join(fields)}"
    if kind in ("missing", "union_tag_not_found"):
        return "missing; it must be given"
    if kind in ("literal_error", "union_tag_invalid"):
        expected = context.get("expected", context.get("expected_tags", ""))
        names = [part.strip() for part in expected.replace("'", "").replace(" or ", ", ").split(",")]
        word = given if isinstance(given, str) else shown(given)
        near = meant(word, names, effect=effect)
        return f"given {shown(given)}{near}; allowed: {', '.join(names)}"
    name = ".".join(map(str, location))
    if kind == "list_type" and isinstance(given, Mapping) and name in ARRAYS_OF_TABLES:
        return f"given a table; an array of them is allowed: write [[{name}]] in double brackets"
    if kind in _WORDS:
        return _WORDS[kind].format(given=shown(given), msg=error["msg"], **context)
    return str(error["msg"])


def _of_the_user(location: tuple[str | int, ...], alternatives: Collection[str]) -> tuple[str | int, ...]:
    """A location without the names of alternatives, each of which follows a key; what stands in one is a key,
    even one of such a name.
    """
    found: list[str | int] = []
    within = False
    for part in location:
        within = bool(found) and part in alternatives and not within
        if not within:
            found.append(part)
    return tuple(found)


def config_error(
    model: type[BaseModel], tables: Mapping[str, Any], error: ValidationError, alternatives: Collection[str]
) -> ConfigError:
    """All problems found in a config's tables, one per key; names of unions' ``alternatives`` aren't part of
    the user's key.
    """
    problems: dict[str, Problem] = {}
    for item in islice(error.errors(include_url=False), _MOST_PROBLEMS):
        # the alternatives of a union each report; their names are no part of the user's key
        path, given = Path(_of_the_user(item["loc"], alternatives)), item["input"]
        if key := item.get("ctx", {}).get("key"):
            path = path / key
        if item["type"].startswith("union_tag"):  # kind chooses among tables: kind is the key at fault
            path, given = path / "kind", given.get("kind") if isinstance(given, Mapping) else None
        allowed = partial(path.parent.keys, model, tables)
        what = _what(allowed, {**item, "loc": path.steps, "input": given})
        problems.setdefault(path.where, Problem(path.where, what))
    return ConfigError(list(problems.values()))


# --- as a JSON schema for editors ---------------------------------------------------------------------------

DRAFT = "http://json-schema.org/draft-07/schema#"


def editor_schema(model: type[Config] | None = None) -> dict[str, Any]:
    """The JSON schema of a config, for editors and other tools.

    Args:
        model: by default ``config_model()``, with every registered kind of load.

    Returns:
        A schema of draft 7. Each key has a ``description`` that ends with its unit in square brackets, which
        stands alone as ``x-unit`` too ("" for a number in any unit), and where there are such, ``default``
        and ``examples`` as a user would write them.
    """
    made = (model or config_model()).model_json_schema(schema_generator=_ForEditors)
    # a config's own states can be recorded, too, and a schema can't know their names
    names = made["$defs"]["Output"]["properties"]["record"]["items"]["anyOf"][0]
    strictly = {"properties": {"record": {"items": names}}}
    without = {"if": {"not": {"required": ["states"]}}, "then": {"properties": {"output": strictly}}}
    for name in {name for preset in PRESETS.values() for name in preset.tables}:
        table, _ = get_args(Body.model_fields[name].annotation)
        made["$defs"][table.__name__].pop("required", None)  # a preset may have the rest of their keys
    return {"$schema": DRAFT, **made, **without, "title": "rigidsim config"}


class _ForEditors(GenerateJsonSchema):
    """A schema in TOML's terms. Pydantic's own describes a Python object: keys that are left out are null
    there, defaults are exact numbers, and every key has a title. A TOML file has no null, and an editor shows
    descriptions; all stays within draft 7, which every editor's checker knows.
    """

    def field_title_should_be_set(self, schema: Any) -> bool:
        """False: the key is its own title."""
        return False

    def nullable_schema(self, schema: Any) -> dict[str, Any]:
        """A key that may be left out needn't be null."""
        return self.generate_inner(schema["schema"])

    def default_schema(self, schema: Any) -> dict[str, Any]:
        """Without the default of such a key."""
        found = super().default_schema(schema)
        return {key: value for key, value in found.items() if key != "default" or value is not None}

    def encode_default(self, dft: Any) -> Any:
        """A default as a user would write it."""
        if isinstance(dft, list):
            return [self.encode_default(item) for item in dft]
        if isinstance(dft, ExactNumber):
            return int(dft.rational) if dft.rational.denominator == 1 and not dft.pi_power else float(dft)
        return super().encode_default(dft)

    def model_schema(self, schema: Any) -> dict[str, Any]:
        """A table: its keys with their units."""
        table = super().model_schema(schema)
        words = " ".join(table["description"].replace("``", "").split())
        mro = schema["cls"].__mro__
        said = ChainMap(*(_texts_below(one.__module__).get(one.__qualname__, {}) for one in mro))
        for name in table["properties"].keys() & said.keys():
            table["properties"][name].setdefault("description", said[name])
        table = {
            **table,
            "description": words,
            "properties": dict(map(_described, table["properties"].items())),
        }
        if "const" in (kind := table["properties"].get("kind", {})):
            kind["description"] = words
        return {key: value for key, value in table.items() if key != "title"}


def _described(item: tuple[str, dict[str, Any]]) -> tuple[str, dict[str, Any]]:
    """A key, its unit in its description."""
    name, key = item
    if "description" in key:
        key["description"] = " ".join(key["description"].split())
    units = _units(key)
    if len(units) == 1:
        (key["x-unit"],) = units
        shown = f"[{key['x-unit'] or 'SI, or any unit'}]"
        key["description"] = f"{key.get('description', '')} {shown if units != {'1'} else ''}".strip()
    if "$ref" in key and len(key) > 1:  # draft 7 ignores anything next to a reference
        key["allOf"] = [{"$ref": key.pop("$ref")}]
    return name, key


def _units(node: Any) -> set[str]:
    """Units of all numbers of a key, except numbers in separate tables."""
    if isinstance(node, Mapping):
        own = {node["x-unit"]} if "x-unit" in node else set()
        inner = (value for name, value in node.items() if name not in ("default", "examples"))
        return own.union(*map(_units, inner))
    return set().union(*map(_units, node)) if isinstance(node, list) else set()


@lru_cache(None)
def _texts_below(module: str) -> dict[str, dict[str, str]]:
    """Of the classes of a module, by qualified names, the texts below their attributes. They are read when a
    schema is asked for: pydantic would read them at every start, in a third of its time.
    """
    found: dict[str, dict[str, str]] = {}

    def read(body: list[ast.stmt], around: str) -> None:
        for one, below in pairwise([*body, ast.Pass()]):
            match one, below:
                case ast.ClassDef(), _:
                    read(one.body, f"{around}{one.name}.")
                case ast.AnnAssign(target=ast.Name(key)), ast.Expr(ast.Constant(str(text))):
                    found.setdefault(around[:-1], {})[key] = inspect.cleandoc(text)

    with suppress(KeyError, OSError, TypeError):  # classes without a file
        read(ast.parse(inspect.getsource(sys.modules[module])).body, "")
    return found
