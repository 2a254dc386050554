"""``[integrator]``: accuracy of the integration, and the variables it uses."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, StrictBool, StrictInt, WithJsonSchema, field_validator

from rigidsim.scene.choices import AUTO, DEFAULT_METHOD, FORMULATIONS, METHODS
from rigidsim.scene.exact import parse_number
from rigidsim.scene.fields import (
    Angle,
    ConfigTable,
    Dimensionless,
    EulerSequence,
    Metre,
    OneOf,
    Positive,
    Range,
    number_schema,
    refuse,
)
from rigidsim.scene.validation_messages import shown

# A number is carried and stored as a sum of float64 parts, which end at 2^-1074: 250 digits (833 bits) leave
# room for numbers down to 1e-70.
LARGEST_DIGITS = 250
_BELOW_HALF_A_TURN = Range(lambda x: 0 < x < 3, "an angle above 0 and below pi, in rad,")
PRECISION_NAMES = ("single", "double", "extended", "quadruple")


class Integrator(ConfigTable):
    """``[integrator]``: how accurately, and in which variables."""

    precision: (
        Literal["single", "double", "extended", "quadruple"]
        | Annotated[StrictInt, WithJsonSchema({"type": "integer", "minimum": 1, "maximum": LARGEST_DIGITS})]
    ) = Field("double", examples=["extended", 50])
    """precision of the arithmetic: single, double, extended or quadruple (24, 53, 64 or 113 bits), or a
    number of decimal digits
    """
    tolerance: Literal["auto"] | Dimensionless = Field(
        "auto", examples=["auto", 1e-12], json_schema_extra={"x-above": 0, "x-at-most": 1}
    )
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
    hold_invariants: StrictBool | Literal["auto"] = "auto"
    """project the state onto its invariants, so that errors of long runs grow far more slowly; auto: from
    step 8192 on, leaving shorter runs unchanged; in sweeps auto means false
    """
    accuracy: Annotated[Angle, _BELOW_HALF_A_TURN] | None = Field(
        None, examples=[1e-9], json_schema_extra={"x-above": 0, "x-below": 3}
    )
    """attitude error allowed at the end, instead of precision and tolerance; certified"""
    # version 1.0 promises that the schema shows no unit here
    accuracy_axis: Annotated[Angle, _BELOW_HALF_A_TURN, WithJsonSchema(number_schema("1"))] | None = Field(
        None, examples=[1e-6]
    )
    """error (rad) allowed until the end in the directions of the angular momentum and the figure axis; with
    [model] level = "auto" the cheapest model within it is chosen
    """
    accuracy_position: Positive[Metre] | None = Field(
        None, examples=["1 um"], json_schema_extra={"x-above": 0}
    )
    """position error allowed at the end if the body flies; certified"""

    @property
    def has_steps(self) -> bool:
        """Whether the method integrates in steps; a closed form takes none."""
        return METHODS[self.method].has_steps

    @field_validator("hold_invariants", mode="before")
    @classmethod
    def _whether_to_hold(cls, value: Any) -> Any:
        if isinstance(value, bool) or value == "auto":
            return value
        raise refuse(f'given {shown(value)}; true, false or "auto" is allowed')

    @field_validator("precision", mode="before")
    @classmethod
    def _known_precision(cls, value: Any) -> Any:
        whole = isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= LARGEST_DIGITS
        if whole or (isinstance(value, str) and value in PRECISION_NAMES):
            return value
        raise refuse(
            f"given {shown(value)}; allowed: {', '.join(PRECISION_NAMES)}, "
            f"or a number of decimal digits from 1 to {LARGEST_DIGITS}"
        )

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
