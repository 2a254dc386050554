"""The building blocks of the config's schema: exact quantities with units, vectors, and tables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    StrictStr,
    WithJsonSchema,
)
from pydantic_core import PydanticCustomError, core_schema

from rigidsim.scene.epochs import Epoch, parse_epoch
from rigidsim.scene.exact import ExactNumber, parse_number, parse_quantity
from rigidsim.scene.units import UnitError, time_unit
from rigidsim.scene.validation_messages import shown

_NUMBER_TEXT = r"^\s*[-+]?(\d|\.\d|pi)"
"""Beginning of any text of a number; the unit after it is left to ``parse_number``."""


def refuse(text: str) -> PydanticCustomError:
    """The error with which a validator refuses a value; the text is shown as it is."""
    return PydanticCustomError("rigidsim", "{text}", {"text": text})


def quantity(unit: str) -> Any:
    """Annotated type of a number in the SI unit ``unit`` (see ``parse_number``)."""

    def validate(value: Any) -> ExactNumber:
        try:
            return parse_number(value, unit)
        except ValueError as error:
            raise refuse(str(error)) from None

    return Annotated[ExactNumber, PlainValidator(validate), WithJsonSchema(number_schema(unit))]


def number_schema(unit: str) -> dict[str, Any]:
    """JSON schema of a number in the SI unit ``unit``, "" for any unit."""
    text = {"type": "string", "pattern": _NUMBER_TEXT}
    return {"anyOf": [{"type": "number"}, text], "x-unit": unit}


def _exactly(count: int) -> BeforeValidator:
    def validate(value: Any) -> Any:
        if isinstance(value, list) and len(value) != count:
            raise refuse(f"given {len(value)} {'entry' if len(value) == 1 else 'entries'}; "
                          f"exactly {count} are needed")  # fmt: skip
        return value

    return BeforeValidator(validate)


T = TypeVar("T")
Triple = Annotated[list[T], Field(min_length=3, max_length=3), _exactly(3)]
"""A vector of three components."""
Four = Annotated[list[T], Field(min_length=4, max_length=4), _exactly(4)]
"""A quaternion's four components."""


if TYPE_CHECKING:
    Dimensionless: TypeAlias = ExactNumber
    Metre: TypeAlias = ExactNumber
    Kilogram: TypeAlias = ExactNumber
    Second: TypeAlias = ExactNumber
    Moment: TypeAlias = ExactNumber
    Rate: TypeAlias = ExactNumber
    Angle: TypeAlias = ExactNumber
    Momentum: TypeAlias = ExactNumber
    Speed: TypeAlias = ExactNumber
    Acceleration: TypeAlias = ExactNumber
    GravitationalParameter: TypeAlias = ExactNumber
    Damping: TypeAlias = ExactNumber
else:
    Dimensionless = quantity("1")
    Metre = quantity("m")
    Kilogram = quantity("kg")
    Second = quantity("s")
    Moment = quantity("kg m^2")
    Rate = quantity("rad/s")
    Angle = quantity("rad")
    Momentum = quantity("kg m^2/s")
    Speed = quantity("m/s")
    Acceleration = quantity("m/s^2")
    GravitationalParameter = quantity("m^3/s^2")
    Damping = quantity("kg m^2/s")


def _any_quantity(value: Any) -> ExactNumber:
    try:
        return parse_quantity(value)
    except ValueError as error:
        raise refuse(str(error)) from None


AnyQuantity = Annotated[
    ExactNumber,
    PlainValidator(_any_quantity),
    WithJsonSchema(number_schema("")),
]
"""A number with any unit written after it."""


def _instant(value: Any) -> Epoch:
    if not isinstance(value, str):
        raise refuse(f'given {shown(value)}; a string such as "2029-04-13T21:46:00 TDB" is allowed')
    try:
        return parse_epoch(value)
    except ValueError as error:
        raise refuse(str(error)) from None


Instant = Annotated[Epoch, PlainValidator(_instant), WithJsonSchema({"type": "string"})]
"""A date and time with its scale."""


def _time_unit(value: Any) -> str:
    if not isinstance(value, str):
        raise refuse(f'given {shown(value)}; the name of a unit of time such as "day" is allowed')
    try:
        time_unit(value)
    except UnitError as error:
        raise refuse(f'given {shown(value)}: {error}; a unit of time is allowed, such as "day"') from None
    return value


TimeUnitName = Annotated[str, PlainValidator(_time_unit), WithJsonSchema({"type": "string"})]
"""The name of a unit of time."""


class ConfigTable(BaseModel):
    """A TOML table: unknown keys are errors, values never change after reading."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True, defer_build=True)


if TYPE_CHECKING:
    Later: TypeAlias = Annotated[T, ...]
else:

    class Later:
        """Defers building the validator of a nested table until the first such table is read, since most
        configs use few of the possible tables.
        """

        def __class_getitem__(cls, table: type[ConfigTable]) -> Any:
            return Annotated[table, _BuiltLater(table)]


BUILT_LATER = "rigidsim_table"
"""Key in a core schema that tells which table it stands for."""


@dataclass(frozen=True)
class _BuiltLater:
    table: type[ConfigTable]

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Schema that builds the table's own validator when needed."""
        read = self.table.model_validate
        return core_schema.no_info_plain_validator_function(read, metadata={BUILT_LATER: self.table})


EULER_SEQUENCES = tuple(
    first + second + third
    for first in "xyz"
    for second in "xyz"
    for third in "xyz"
    if first != second != third
)
"""Axes of intrinsic rotations, one after the other."""


def _sequence(value: str | None) -> str | None:
    if value is not None and value not in EULER_SEQUENCES:
        raise refuse(f"given {shown(value)}; allowed: {', '.join(EULER_SEQUENCES)} (intrinsic)")
    return value


EulerSequence = Annotated[
    StrictStr,
    AfterValidator(_sequence),
    WithJsonSchema({"type": "string", "enum": list(EULER_SEQUENCES)}),
]
