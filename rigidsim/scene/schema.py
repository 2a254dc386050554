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

from rigidsim.scene.body_table import Body
from rigidsim.scene.exact import ZERO, parse_number
from rigidsim.scene.expressions import ATTITUDE_NAMES, FLIGHT_NAMES, RATE_NAMES, RESERVED
from rigidsim.scene.fields import (
    Angle,
    AnyQuantity,
    ConfigTable,
    Dimensionless,
    EulerSequence,
    Four,
    Instant,
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
from rigidsim.scene.registry import LOAD_KINDS, OBSERVABLES, LoadFields
from rigidsim.scene.sweep_table import SweepTable
from rigidsim.scene.validation_messages import nearest, shown

# A number is carried and stored as a sum of float64 parts, which end at 2^-1074: 250 digits (833 bits) leave
# room for numbers down to 1e-70.
LARGEST_DIGITS = 250
PRECISION_NAMES = ("single", "double", "extended", "quadruple")
FORMULATIONS = ("auto", "rates", "quaternion", "euler_angles", "rotation_matrix", "canonical", "planar")
STATE_NAMES = ("t", *RATE_NAMES, *ATTITUDE_NAMES, *FLIGHT_NAMES)


class Initial(ConfigTable):
    """``[initial]``: the state at ``time.start``."""

    angular_velocity: Triple[Rate] | None = None
    angular_momentum: Triple[Momentum] | None = None
    quaternion: Four[Dimensionless] | None = None
    euler_angles: Triple[Angle] | None = None
    position: Triple[Metre] | None = None
    velocity: Triple[Speed] | None = None


class Time(ConfigTable):
    """``[time]``: where the samples lie; one of ``samples``, ``every`` and ``times``; what time 0 is, and
    the unit that times are shown in.
    """

    start: Second = ZERO
    end: Second | None = None
    samples: StrictInt | None = None
    every: Second | None = None
    times: list[Second] | None = None
    epoch: Instant | None = Field(default=None, description="what time 0 is; scales TDB, TT and UTC")
    unit: TimeUnitName | None = Field(
        default=None,
        description="what times are shown in, such as day, yr or kyr; bare numbers stay seconds",
    )


class Integrator(ConfigTable):
    """``[integrator]``: how accurately, and in which variables."""

    precision: Literal["single", "double", "extended", "quadruple"] | StrictInt = "double"
    tolerance: Literal["auto"] | Dimensionless = Field(
        default="auto",
        description="of each step, relative to the largest component of the state; auto is the precision's "
        "epsilon in double precision and an eighth of it in others, whose series would otherwise be just too "
        "short to keep what is cut off well below rounding",
    )
    formulation: Literal[
        "auto", "rates", "quaternion", "euler_angles", "rotation_matrix", "canonical", "planar"
    ] = "auto"
    euler_sequence: EulerSequence = "zxz"
    method: Literal["taylor", "closed_form"] = "taylor"
    hold_invariants: StrictBool = False
    accuracy: Dimensionless | None = None
    accuracy_position: Metre | None = None

    @field_validator("precision", mode="before")
    @classmethod
    def _known_precision(cls, value: Any) -> Any:
        if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= LARGEST_DIGITS:
            return value
        if isinstance(value, str) and value in PRECISION_NAMES:
            return value
        raise refuse(
            f"given {shown(value)}; allowed: {', '.join(PRECISION_NAMES)}, "
            f"or a number of decimal digits from 1 to {LARGEST_DIGITS}"
        )

    @field_validator("accuracy", mode="before")
    @classmethod
    def _possible_accuracy(cls, value: Any) -> Any:
        if value is None:
            return value
        try:
            number = parse_number(value, "rad")
        except ValueError as error:
            raise refuse(str(error)) from None
        if not 0 < float(number) < 3:
            raise refuse(f"given {shown(value)}; an angle above 0 and below pi is allowed, in rad")
        return value

    @field_validator("accuracy_position")
    @classmethod
    def _possible_accuracy_of_position(cls, value: Any) -> Any:
        if value is not None and value.sign <= 0:
            raise refuse(f"given {shown(value)}; a length above 0 is allowed, in m")
        return value

    @field_validator("tolerance", mode="before")
    @classmethod
    def _positive_tolerance(cls, value: Any) -> Any:
        if value == "auto":
            return value
        try:
            number = parse_number(value, "1")
        except ValueError as error:
            raise refuse(f'{error}; or "auto"') from None
        if not (number.sign > 0 and float(number) <= 1):
            raise refuse(f'given {shown(value)}; allowed: above 0 and at most 1, or "auto"')
        return number


class Output(ConfigTable):
    """``[output]``: what is kept and how it is shown."""

    record: list[StrictStr] | None = None
    timeline: StrictBool = True
    timeline_rows: StrictInt = Field(default=100_000, ge=2)
    estimate: StrictBool = True
    lyapunov: StrictBool = False
    tip: Triple[Metre] | None = Field(
        default=None,
        description="the point whose path is recorded as tip, in body axes from the reference point; by "
        "default the centre of mass of a body that turns about another point",
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

    name: StrictStr
    expression: StrictStr
    direction: Literal["any", "up", "down"] = "any"
    action: Literal["record", "stop"] = "record"

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

    wall_time: Second | None = None
    max_steps: StrictInt | None = Field(default=None, ge=1)
    max_drift: Dimensionless | None = None


class Config(ConfigTable):
    """One experiment; ``config_model`` knows the kinds of loads beside."""

    name: StrictStr
    description: StrictStr = ""
    parameters: dict[StrictStr, AnyQuantity] = Field(default_factory=dict)
    body: Body
    initial: Initial
    loads: list[LoadFields] = Field(default_factory=list)
    events: list[EventTable] = Field(default_factory=list)
    frame: Frame = Field(default_factory=Frame)
    time: Time
    integrator: Integrator = Field(default_factory=Integrator)
    output: Output = Field(default_factory=Output)
    limits: Limits = Field(default_factory=Limits)
    sweep: SweepTable | None = None

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
        if not re.fullmatch(r"[A-Za-z0-9._-]{1,100}", value) or not value.strip("."):
            raise refuse(
                f"given {shown(value)}; allowed: 1 to 100 letters, digits, dots, underscores and "
                "hyphens, not dots alone, since it names the run folder"
            )
        return value


def config_model() -> type[Config]:
    """The schema with every kind of load that is registered: what texts are validated with, and shown by.

    Raises:
        RuntimeError: none is; ``rigidsim.model.loads`` enters rigidsim's own.
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
        loads=(list[union], Field(default_factory=list)),
    )
