"""The building blocks of the config's schema: tables, exact quantities with units, vectors, and names."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from datetime import date, time
from decimal import Decimal
from fractions import Fraction
from itertools import product
from typing import Annotated, Any, ClassVar, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    PlainValidator,
    StrictStr,
    ValidationError,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import PydanticCustomError, core_schema

from rigidsim.errors import ensure
from rigidsim.scene.epochs import Epoch, parse_epoch
from rigidsim.scene.exact import (
    ExactNumber,
    UnitError,
    for_doubles,
    parse_number,
    powers,
    time_unit,
    unit_text,
)
from rigidsim.scene.two_line_elements import TwoLineElements, parse_elements
from rigidsim.scene.validation_messages import meant, shown

_NUMBER_TEXT = r"^\s*[-+]?(\d|\.\d|pi)"
"""Beginning of any text of a number; the unit after it is left to ``parse_number``."""
T = TypeVar("T")


Rule = Callable[[Any], str]
"""What is wrong with the keys of a table together; empty if nothing is."""


def _given(table: Any, keys: Iterable[str]) -> list[str]:
    return [key for key in keys if key in table.model_fields_set and getattr(table, key) is not None]


def one_of(*keys: str, least: int = 1, why: str = "") -> Rule:
    """Exactly one of some keys, or with ``least`` 0 at most one."""

    def rule(table: Any) -> str:
        found = _given(table, keys)
        need = f"exactly one of {', '.join(keys)} is needed" if least else "give one of them"
        said = f"given {' and '.join(found) or 'none'}; {need}{why and f' ({why})'}"
        return "" if least <= len(found) <= 1 else said

    return rule


def together(*keys: str) -> Rule:
    """All of some keys, or none."""

    def rule(table: Any) -> str:
        missing = [key for key in keys if key not in _given(table, keys)]
        said = f"missing {' and '.join(missing)}; {' and '.join(keys)} are given together, or none of them"
        return said if 0 < len(missing) < len(keys) else ""

    return rule


def excludes(key: str, *others: str) -> Rule:
    """None of some keys with another, which says the same."""

    def rule(table: Any) -> str:
        found = _given(table, others) if _given(table, [key]) else []
        said = f"given {' and '.join(found)} with {key}, which determines it; remove one of them"
        return said if found else ""

    return rule


def only_with(key: str, *others: str) -> Rule:
    """Some keys with another one alone."""

    def rule(table: Any) -> str:
        found = [] if _given(table, [key]) else _given(table, others)
        return f"given {' and '.join(found)} without {key}; add it, or leave these out" if found else ""

    return rule


@dataclass(frozen=True)
class Never:
    """A rule of its own: what a table is refused with, at one of its keys, where a condition holds."""

    holds: Callable[[Any], Any]
    text: str
    key: str = ""

    def __call__(self, table: Any) -> str:
        """As for other rules."""
        return self.text if self.holds(table) else ""


class ConfigTable(BaseModel):
    """A TOML table: unknown keys are errors, values never change after reading, and the text below a key
    describes it. Its ``rules`` are about several keys together.
    """

    rules: ClassVar[tuple[Rule, ...]] = ()

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        arbitrary_types_allowed=True,
        defer_build=True,
    )

    @model_validator(mode="after")
    def _as_a_whole(self) -> Self:
        for rule in self.rules:
            if what := rule(self):
                raise refuse(what, getattr(rule, "key", ""))
        return self


NAME_OR_VECTOR = ("as a name", "as a vector")
"""Tags of the alternatives of a key that takes either."""


def name_or_vector(allowed: str) -> Discriminator:
    """Distinguishes such alternatives; anything else isn't ``allowed``."""

    def kind(value: Any) -> str | None:
        if isinstance(value, str):
            return NAME_OR_VECTOR[0]
        return NAME_OR_VECTOR[1] if isinstance(value, list) else None

    return Discriminator(
        kind, custom_error_type="kind_of_value", custom_error_message=f"{allowed} is allowed"
    )


def refuse(text: str, key: str = "") -> PydanticCustomError:
    """The error with which a validator refuses a value, or a table at a key; the text is shown as it is."""
    return PydanticCustomError("rigidsim", "{text}", {"text": text, "key": key})


def reading(parse: Callable[[Any], Any]) -> PlainValidator:
    """A validator that reads values with a function, which refuses by ``ValueError``."""

    def read(value: Any) -> Any:
        try:
            return parse(value)
        except ValueError as error:
            raise refuse(str(error)) from None

    return PlainValidator(read)


def number_schema(unit: str) -> dict[str, Any]:
    """JSON schema of a number in the SI unit ``unit``, "" for any unit."""
    text = {"type": "string", "pattern": _NUMBER_TEXT}
    return {"anyOf": [{"type": "number"}, text], "x-unit": unit}


@dataclass(frozen=True)
class InUnit:
    """Annotation of an ``ExactNumber`` in an SI unit (see ``parse_number``), or with "" in any unit."""

    unit: str

    def _parse(self, value: Any) -> ExactNumber:
        return parse_number(value, self.unit)

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        return reading(self._parse).__get_pydantic_core_schema__(source, handler)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return number_schema(self.unit)


def quantity(unit: str) -> Any:
    """Type of a key in an SI unit, for user-defined loads: ``Joule = quantity("J")``."""
    return Annotated[ExactNumber, InUnit(unit)]


_KINDS = {"m": "length", "s": "time", "1/s": "rate", "rad/s": "rate"}


@dataclass(frozen=True)
class Range:
    """Annotation of a number: whether its value in SI (mpf) is allowed, and how messages and JSON schemas say
    it. It is asked of a config's numbers, and of those that take their place, as in members of a sweep.
    """

    holds: Callable[[Any], bool]
    allowed: str
    limits: Mapping[str, float] = field(default_factory=dict, hash=False)

    def checked(self, number: ExactNumber, context: Any = None) -> ExactNumber:
        """The number, which may stand for all members' numbers in their context; ValueError if it is out."""
        if not self.holds(number.at(context or for_doubles())):
            unit = number.assumed or (number.unit and unit_text(powers(number.unit)))
            allowed = self.allowed.format(_KINDS.get(unit, "number"))
            raise ValueError(f"given {float(number):g}; {allowed} is allowed")
        return number

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        def validate(number: ExactNumber) -> ExactNumber:
            try:
                return self.checked(number)
            except ValueError as error:
                raise refuse(str(error)) from None

        return core_schema.no_info_after_validator_function(validate, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        found: dict[str, Any] = handler(schema)
        for kind in found.get("anyOf", ()):  # numbers written as strings are checked by rigidsim
            kind |= self.limits if kind.get("type") == "number" else {}
        return found


Positive = Annotated[T, Range(lambda x: x > 0, "a positive {}", {"exclusiveMinimum": 0})]
NotNegative = Annotated[T, Range(lambda x: x >= 0, "zero or more", {"minimum": 0})]


def within(least: str, most: str) -> Range:
    """Annotation of a number from one to another."""
    limits = {"minimum": float(least), "maximum": float(most)}
    return Range(lambda x: Fraction(least) <= x <= Fraction(most), f"{least} to {most}", limits)


def checked(holds: Callable[[Any], Any], text: str) -> AfterValidator:
    """A validator that refuses a value for which something doesn't hold; "{}" in the text is the value."""

    def validate(value: Any) -> Any:
        ensure(holds(value), refuse(text.format(shown(value))))
        return value

    return AfterValidator(validate)


NotZero = checked(
    lambda value: any(x.sign for x in value), "given zero; a direction is needed, of any length but zero"
)
"""Annotation of a vector with any norm but zero."""


Dimensionless = Annotated[ExactNumber, InUnit("1")]
Eccentricity = Annotated[Dimensionless, Range(lambda x: 0 <= x < 1, "0 (a circle) to below 1")]
Metre = Annotated[ExactNumber, InUnit("m")]
Kilogram = Annotated[ExactNumber, InUnit("kg")]
Second = Annotated[ExactNumber, InUnit("s")]
Moment = Annotated[ExactNumber, InUnit("kg m^2")]
Rate = Annotated[ExactNumber, InUnit("rad/s")]
PerSecond = Annotated[ExactNumber, InUnit("s^-1")]
Angle = Annotated[ExactNumber, InUnit("rad")]
Momentum = Annotated[ExactNumber, InUnit("kg m^2/s")]
Speed = Annotated[ExactNumber, InUnit("m/s")]
Acceleration = Annotated[ExactNumber, InUnit("m/s^2")]
GravitationalParameter = Annotated[ExactNumber, InUnit("m^3/s^2")]
Damping = Annotated[ExactNumber, InUnit("kg m^2/s")]
Irradiance = Annotated[ExactNumber, InUnit("W/m^2")]
AnyQuantity = Annotated[ExactNumber, InUnit("")]


def _formula(value: Any) -> str:
    """The text of an expression; a bare number is one too."""
    if isinstance(value, bool) or not isinstance(value, str | int | Decimal | float):
        raise refuse(f'given {shown(value)}; an expression in quotes is allowed, such as "k*sin(t)^2"')
    return value if isinstance(value, str) else str(value)


Formula = Annotated[
    str, PlainValidator(_formula), WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "number"}]})
]
"""An expression as it is written, or a number."""


@dataclass(frozen=True)
class NumberOrFormula(InUnit):
    """Annotation of a number in an SI unit, or of the text of an expression."""

    def _parse(self, value: Any) -> Any:
        try:
            return super()._parse(value)
        except ValueError:
            if isinstance(value, str):
                return value
            raise

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return {"anyOf": [{"type": "string"}, {"type": "number"}], "x-unit": self.unit}


MomentOrFormula = Annotated[ExactNumber | str, NumberOrFormula("kg m^2")]


@dataclass(frozen=True)
class Exactly:
    """Annotation of an array of so many entries."""

    count: int

    def _counted(self, value: Any) -> Any:
        if not isinstance(value, list):
            raise refuse(f"given {shown(value)}; an array of {self.count} is allowed")
        if len(value) != self.count:
            entries = "entry" if len(value) == 1 else "entries"
            raise refuse(f"given {len(value)} {entries}; exactly {self.count} are needed")
        return value

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        return BeforeValidator(self._counted).__get_pydantic_core_schema__(source, handler)


Pair = Annotated[list[T], Field(min_length=2, max_length=2), Exactly(2)]
Triple = Annotated[list[T], Field(min_length=3, max_length=3), Exactly(3)]
"""A vector of three components."""
Direction = Annotated[Triple[Dimensionless], NotZero]
"""A vector that isn't zero, of any length."""
Four = Annotated[list[T], Field(min_length=4, max_length=4), Exactly(4)]
"""A quaternion's four components."""


@dataclass(frozen=True, eq=False)
class OneOf:
    """Annotation of a text that is one of some names, which may be registered later; ``more`` come first, and
    last names that follow from the tables of the config, by ``of_scene``.
    """

    names: Iterable[str]
    more: tuple[str, ...] = ()
    of_scene: Callable[[Mapping[str, Any]], Iterable[Any]] | None = None

    @property
    def words(self) -> list[str]:
        """Names that don't follow from the config."""
        return [*self.more, *self.names]

    def _known(self, value: Any, info: Any) -> str:
        own = self.of_scene(info.context or {}) if self.of_scene else ()
        allowed = [*self.words, *(name for name in own if isinstance(name, str))]
        if isinstance(value, str) and value in allowed:
            return value
        word = value if isinstance(value, str) else shown(value)
        near = meant(word, allowed)
        raise refuse(f"given {shown(value)}{near}; allowed: {', '.join(allowed)}")

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        return core_schema.with_info_plain_validator_function(self._known)

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        if self.of_scene:
            return {"anyOf": [{"enum": self.words}, {"type": "string"}]}
        return {"type": "string", "enum": self.words}


@dataclass(frozen=True)
class Beside:
    """Annotation of the name of a file next to the config, whose text is copied into it; ``kind`` says what
    is kept of it: all ("text"), a column of "times", moments of a mesh ("solid"), or some degrees ("field").
    """

    kind: str = "text"


FileName = Annotated[StrictStr, Beside()]


@dataclass(frozen=True, eq=False)
class OrWord:
    """Annotation of a value of a type that may be one of some words instead; ``allowed`` says what it may."""

    words: tuple[str, ...]
    kind: Any
    allowed: str

    def _read(self, value: Any, inner: Callable[[Any], Any]) -> Any:
        if isinstance(value, str) and value in self.words:
            return value
        try:
            return inner(value)
        except ValidationError as error:
            said = error.errors()[0]
            given = said["msg"] if said["type"] == "rigidsim" else f"given {shown(value)}"
            raise refuse(f"{given}; allowed: {', '.join(self.words)}, or {self.allowed}") from None

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        return core_schema.no_info_wrap_validator_function(self._read, handler.generate_schema(self.kind))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return {"anyOf": [{"type": "string", "enum": list(self.words)}, handler(schema)]}


def named(pattern: str, allowed: str) -> AfterValidator:
    """A validator of names of a pattern; its error says what is ``allowed``."""
    return checked(re.compile(pattern).fullmatch, f"given {{}}; allowed: {allowed}")


VariableName = Annotated[
    StrictStr,
    named(r"[A-Za-z][A-Za-z0-9_]{0,40}", "letters, digits and underscores, beginning with a letter"),
]


BodyName = Annotated[
    StrictStr,
    BeforeValidator(lambda value: str(value) if type(value) is int else value),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "integer"}]}),
]
"""A body of a kernel, by its name or NAIF's number, with or without quotes."""


EachOnce = Annotated[
    list[T],
    checked(lambda value: len(set(value)) == len(value), "something is named twice; name each once"),
]
"""An array of different names."""


def _instant(value: Any) -> Epoch:
    if isinstance(value, date | time):  # TOML's own; a datetime is a date
        value = value.isoformat()
    if not isinstance(value, str):
        raise ValueError(f'given {shown(value)}; a string such as "2029-04-13T21:46:00 TDB" is allowed')
    return parse_epoch(value)


Instant = Annotated[Epoch, reading(_instant), WithJsonSchema({"type": "string"})]
"""A date and time with its scale."""
ElementLines = Annotated[
    TwoLineElements,
    reading(parse_elements),
    WithJsonSchema({"type": "array", "items": {"type": "string"}, "minItems": 2, "maxItems": 2}),
]
"""Two-line elements: a list of both lines."""


def _time_unit(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError(f'given {shown(value)}; the name of a unit of time such as "day" is allowed')
    try:
        time_unit(value)
    except UnitError as error:
        raise ValueError(f'given {shown(value)}: {error}; a unit of time is allowed, such as "day"') from None
    return value


TimeUnitName = Annotated[str, reading(_time_unit), WithJsonSchema({"type": "string"})]
"""The name of a unit of time."""
EULER_SEQUENCES = tuple("".join(axes) for axes in product("xyz", repeat=3) if axes[0] != axes[1] != axes[2])
"""Axes of intrinsic rotations, one after the other."""
EulerSequence = Annotated[str, OneOf(EULER_SEQUENCES)]
