"""Building blocks of the parts of ``summary.json``: fields, and which of them are claims."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, StrictStr

FiniteNumber = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Text = Annotated[StrictStr, Field(max_length=20_000)]
Three = tuple[FiniteNumber, FiniteNumber, FiniteNumber]


@dataclass(frozen=True)
class Claim:
    """Marks a field that follows from the config alone, so that running it again must confirm it.

    Attributes:
        since: schema version of the dataset from which the field has its present meaning.
        of_end: whether it tells how the run ended, which an interruption changes.
        beside: field whose absence, in older summaries, gives this one another meaning; empty for none.
    """

    since: int = 1
    of_end: bool = False
    beside: str = ""


class SummaryPart(BaseModel):
    """Immutable part of a summary; unknown fields, written by a newer version, are kept."""

    model_config = ConfigDict(extra="allow", frozen=True, ser_json_inf_nan="constants", defer_build=True)

    def having(self, **known: Any) -> Self:
        """A copy with the given fields set, validated as on reading."""
        given = {name: value for name, value in self if name in self.model_fields_set}
        return type(self).model_validate({**given, **known})

    def as_dict(self) -> dict[str, Any]:
        """Fields for JSON, without those that weren't given."""
        return self.model_dump(mode="json", exclude_unset=True)
