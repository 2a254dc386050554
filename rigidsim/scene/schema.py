"""The config's schema: what may stand in the TOML file, table by table (the interface's section 1).

Only shapes and single values are checked here; what needs mechanics (triangle inequality, a spin about an
axis without inertia, ...) is checked where the scene is built.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Annotated, Any, Literal, Union

from pydantic import (
    Field,
    StrictBool,
    StrictInt,
    StrictStr,
    create_model,
    field_validator,
    model_validator,
)

from rigidsim.scene.bodies.table import Body
from rigidsim.scene.exact import ZERO
from rigidsim.scene.expressions.tree import ATTITUDE_NAMES, FLIGHT_NAMES, RATE_NAMES, RESERVED
from rigidsim.scene.fields import (
    Angle,
    AnyQuantity,
    ConfigTable,
    Dimensionless,
    Four,
    Instant,
    Later,
    Metre,
    Momentum,
    Rate,
    Second,
    Speed,
    TimeUnitName,
    Triple,
    refuse,
)
from rigidsim.scene.frame_table import Frame
from rigidsim.scene.integrator_table import Integrator
from rigidsim.scene.model_table import Model
from rigidsim.scene.point_mass_table import PointMassBody
from rigidsim.scene.registry import LOAD_KINDS, OBSERVABLES, LoadFields
from rigidsim.scene.sweep_table import SweepTable
from rigidsim.scene.validation_messages import nearest, shown

_FOLDER_NAME = "^[A-Za-z0-9._-]{1,100}$"
_ABOUT_LOADS = "loads that act on the body, each of a kind; without any the body rotates freely"
STATE_NAMES = ("t", *RATE_NAMES, *ATTITUDE_NAMES, *FLIGHT_NAMES)


class Initial(ConfigTable):
    """``[initial]``: the state at ``time.start``."""

    angular_velocity: Triple[Rate] | None = Field(
        default=None,
        description="angular velocity relative to space, in body axes; this or angular_momentum",
        examples=[[0.1, 1.0, 0.05], ["0 deg/s", "0 deg/s", "20 deg/h"]],
    )
    angular_momentum: Triple[Momentum] | None = Field(
        default=None,
        description="angular momentum in space axes, instead of angular_velocity",
        examples=[[0, 0, 12.5]],
    )
    quaternion: Four[Dimensionless] | None = Field(
        default=None,
        description="attitude w, x, y, z: takes body axes to space axes; any norm but zero; by default "
        "the body axes start along the space axes",
        examples=[[1, 0, 0, 0]],
    )
    euler_angles: Triple[Angle] | None = Field(
        default=None,
        description="phi, theta, psi of [integrator] euler_sequence, intrinsic; instead of quaternion",
        examples=[["10 deg", "23.44 deg", "0 deg"]],
    )
    position: Triple[Metre] | None = Field(
        default=None,
        description="position of the centre of mass, in space axes; with it or velocity the body flies "
        "freely",
        examples=[["7000 km", 0, 0]],
    )
    velocity: Triple[Speed] | None = Field(
        default=None,
        description="velocity of the centre of mass, in space axes",
        examples=[[0, "7.5 km/s", 0]],
    )


class Time(ConfigTable):
    """``[time]``: where the samples lie; one of ``samples``, ``every`` and ``times``; what time 0 is, and
    the unit that times are shown in.
    """

    start: Second = Field(default=ZERO, description="start of the run, to which [initial] refers")
    end: Second | None = Field(
        default=None, description="end of the run; with samples or every", examples=[1000.0, "10 yr"]
    )
    samples: StrictInt | None = Field(
        default=None,
        description="number of samples, equally spaced from start to end, both included",
        examples=[10001],
    )
    every: Second | None = Field(
        default=None, description="interval between samples, instead of samples", examples=[0.1, "1 day"]
    )
    times: list[Second] | None = Field(
        default=None, description="sample times, ascending, instead of end", examples=[[0, 1, 10, 100]]
    )
    epoch: Instant | None = Field(
        default=None,
        description="date of time 0; scales TDB, TT and UTC",
        examples=["J2000", "2029-04-13T21:46:00 TDB"],
    )
    unit: TimeUnitName | None = Field(
        default=None,
        description="unit in which times are displayed, such as day, yr or kyr; bare numbers in the "
        "config remain seconds",
        examples=["day"],
    )


class Output(ConfigTable):
    """``[output]``: what is kept and how it is shown."""

    record: list[StrictStr] | None = Field(
        default=None,
        description="names of the variables to record; by default those that suit the scene (drifts of "
        "invariants are always recorded)",
        examples=[["quaternion", "obliquity"]],
        json_schema_extra={"x-items": "observables"},
    )
    timeline: StrictBool = Field(default=True, description="write timeline.rrd, for rigidsim view")
    timeline_rows: StrictInt = Field(
        default=100_000,
        ge=2,
        description="largest number of rows in the timeline; longer runs are thinned there, never in the "
        "dataset",
    )
    estimate: StrictBool = Field(
        default=True,
        description="estimate the errors of attitude and position; costs a few percent of the run, in "
        "batches of a sweep one to two times the members themselves",
    )
    lyapunov: StrictBool = Field(
        default=False,
        description="Lyapunov exponents from variational equations; costs tens of times the plain run",
    )
    tip: Triple[Metre] | None = Field(
        default=None,
        description="the point whose path is recorded as tip, in body axes from the reference point; by "
        "default the centre of mass of a body that turns about another point",
        examples=[[0, 0, 0.1]],
    )

    @field_validator("record")
    @classmethod
    def _recordable(cls, value: list[str] | None) -> list[str] | None:
        for name in value or []:
            if name not in OBSERVABLES:
                near = nearest(name, OBSERVABLES)
                raise refuse(f"given {shown(name)}{near}; allowed: {', '.join(OBSERVABLES)}")
        if value is not None and not value:
            raise refuse("given an empty array; name at least one variable, or leave the key out")
        if value is not None and len(set(value)) < len(value):
            raise refuse("a variable is named twice; name each once")
        return value

    @model_validator(mode="after")
    def _tip_is_recorded(self) -> Output:
        if self.tip is not None and self.record is not None and "tip" not in self.record:
            raise refuse('a tip is given, but record has no "tip"; name it there, or leave tip out')
        return self


class EventTable(ConfigTable):
    """``[[events]]``: where an expression of time and the state crosses zero."""

    name: StrictStr = Field(
        description="prefix of the dataset's variables: NAME_time, NAME_quaternion, ...", examples=["flip"]
    )
    expression: StrictStr = Field(
        description="expression of t, the states (wx wy wz, qw qx qy qz, phi theta psi, x y z, vx vy vz) "
        "and [parameters], in SI; the event is its crossing of zero",
        examples=["wy", "theta - pi/2"],
    )
    direction: Literal["any", "up", "down"] = Field(default="any", description="direction of the crossing")
    action: Literal["record", "stop"] = Field(
        default="record", description="record the event, or stop the run at it"
    )

    @field_validator("name")
    @classmethod
    def _variable_name(cls, value: str) -> str:
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,40}", value):
            raise refuse(
                f"given {shown(value)}; allowed: letters, digits and underscores, beginning with a letter"
            )
        return value


class Limits(ConfigTable):
    """``[limits]``: guards that stop the run, resumable, with the reason named."""

    wall_time: Second | None = Field(
        default=None, description="time for integrating and recording in one session", examples=["2 h"]
    )
    max_steps: StrictInt | None = Field(
        default=None,
        ge=1,
        description="number of steps in one session, never exceeded",
        examples=[1_000_000_000],
    )
    max_drift: Dimensionless | None = Field(
        default=None,
        description="largest relative drift of any invariant; the run ends with the first sample past it",
        examples=[1e-9],
    )


class TableText(ConfigTable):
    """``[tables.NAME]``: a table that belongs to the config; files that it names are taken in like this."""

    text: StrictStr = Field(description="text of the CSV file")


class Config(ConfigTable):
    """One experiment; ``config_model`` knows the kinds of loads beside."""

    name: StrictStr = Field(
        description="name of the run folder: letters, digits, dots, underscores and hyphens",
        examples=["intermediate_axis"],
        json_schema_extra={"pattern": _FOLDER_NAME},
    )
    description: StrictStr = Field(default="", description="free text, shown with the results")
    parameters: dict[StrictStr, AnyQuantity] = Field(
        default_factory=dict,
        description="named constants for expressions",
        examples=[{"k": 0.25, "c": "2e-4 N m s"}],
    )
    body: Later[Body] = Field(description="the rigid body")
    initial: Later[Initial] = Field(description="the state at the start")
    loads: list[LoadFields] = Field(default_factory=list, description=_ABOUT_LOADS)
    bodies: list[Later[PointMassBody]] = Field(
        default_factory=list, description="point masses under mutual gravity, integrated with the body"
    )
    events: list[Later[EventTable]] = Field(
        default_factory=list, description="events: zero crossings of an expression of time and the state"
    )
    frame: Later[Frame] = Field(
        default_factory=Frame.model_construct,
        description="name of the space axes, and the references of angles",
    )
    time: Later[Time] = Field(description="time span and sample times")
    model: Later[Model] = Field(
        default_factory=Model.model_construct, description="the full motion, or an average of it"
    )
    integrator: Later[Integrator] = Field(
        default_factory=Integrator.model_construct,
        description="accuracy, and the variables that are integrated",
    )
    output: Later[Output] = Field(
        default_factory=Output.model_construct, description="what is recorded and displayed"
    )
    limits: Later[Limits] = Field(
        default_factory=Limits.model_construct, description="guards that stop the run; it can be resumed"
    )
    sweep: Later[SweepTable] | None = Field(
        default=None, description="the sweep: many members of one experiment"
    )
    tables: dict[StrictStr, Later[TableText]] = Field(
        default_factory=dict,
        description="texts of tables that loads refer to; the text of files beside the config is copied here",
        examples=[{"elements.csv": {"text": "time [yr], eccentricity\n0, 0.01\n"}}],
    )

    @field_validator("events")
    @classmethod
    def _event_names(cls, value: list[EventTable]) -> list[EventTable]:
        names = [event.name for event in value]
        for name in names:
            if names.count(name) > 1:
                raise refuse(f'two events are named "{name}"; give each a name of its own')
        return value

    @field_validator("parameters")
    @classmethod
    def _parameter_names(cls, value: dict[str, Any]) -> dict[str, Any]:
        for name in value:
            if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]{0,40}", name):
                raise refuse(f'given the name "{name[:40]}"; allowed: letters, digits and underscores')
            if name in STATE_NAMES or name in RESERVED:
                raise refuse(f'given the name "{name}", which expressions use already; rename it')
        return value

    @field_validator("name")
    @classmethod
    def _folder_name(cls, value: str) -> str:
        if not re.fullmatch(_FOLDER_NAME, value) or not value.strip("."):
            raise refuse(
                f"given {shown(value)}; allowed: 1 to 100 letters, digits, dots, underscores and "
                "hyphens, not dots alone, since it names the run folder"
            )
        return value


def config_model() -> type[Config]:
    """The schema with every registered kind of load, with which texts are validated and described.

    Raises:
        RuntimeError: none is registered; importing ``rigidsim.model.loads`` registers rigidsim's own.
    """
    if not LOAD_KINDS:
        raise RuntimeError("no kinds of loads are registered; import rigidsim.model.loads first")
    kinds = [LOAD_KINDS[name].Fields for name in sorted(LOAD_KINDS)]
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
