"""``[sweep]``: the keys for swept values, and for what is kept of each member."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, StrictBool, StrictInt, StrictStr, field_validator, model_validator

from rigidsim.scene.fields import ConfigTable, refuse
from rigidsim.scene.validation_messages import nearest, shown

KEPT = (
    "final",
    "extremes",
    "means",
    "events",
    "section",
    "megno",
    "fli",
    "lyapunov",
    "frequencies",
    "series",
)
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
    """One axis: the values that a key takes, said in one of seven ways."""

    linspace: list[Any] | None = Field(
        default=None, description="[from, to, count], both ends included", min_length=3, max_length=3
    )
    logspace: list[Any] | None = Field(
        default=None, description="[from, to, count], with equal ratios, both ends included",
        min_length=3, max_length=3,
    )  # fmt: skip
    step: list[Any] | None = Field(
        default=None, description="[from, step, count], equally spaced", min_length=3, max_length=3
    )
    values: list[Any] | None = Field(
        default=None, description="list of values, each as the key itself accepts it", min_length=1
    )
    normal: list[Any] | None = Field(
        default=None, description="[mean, standard deviation]; with count", min_length=2, max_length=2
    )
    uniform: list[Any] | None = Field(
        default=None, description="[from, to]; with count", min_length=2, max_length=2
    )
    sphere: Any = Field(
        default=None,
        description="radius: random directions of a vector with count, or a grid of directions with grid",
    )
    count: StrictInt | None = Field(default=None, ge=1, description="number of random values")
    grid: list[StrictInt] | None = Field(
        default=None, min_length=2, max_length=2,
        description="for sphere: numbers of polar angles (equally spaced in their cosine) and azimuths",
    )  # fmt: skip
    name: StrictStr | None = Field(
        default=None,
        description="name of the dimension; by default the last part of the key, or the whole key where the "
        "last part is the name of something recorded",
    )

    @model_validator(mode="after")
    def _one_way(self) -> AxisTable:
        ways = [way for way in WAYS if getattr(self, way) is not None]
        if len(ways) != 1:
            given = "none of them" if not ways else " and ".join(ways)
            raise refuse(f"given {given}; exactly one of {', '.join(WAYS)} is needed")
        [way] = ways
        if way == "sphere" and (self.count is None) == (self.grid is None):
            raise refuse(
                "a sphere takes either count (random directions) or grid (polar angles and azimuths), "
                "such as grid = [16, 32]"
            )
        if way in ("normal", "uniform") and self.count is None:
            raise refuse(f"{way} needs a count beside it, such as count = 100")
        if way not in RANDOM and self.count is not None:
            raise refuse(f"count is for random values ({', '.join(RANDOM)}); {way} says it itself")
        if way != "sphere" and self.grid is not None:
            raise refuse("grid is for sphere alone")
        return self

    @field_validator("grid")
    @classmethod
    def _possible_grid(cls, value: list[int] | None) -> list[int] | None:
        if value is not None and min(value) < 1:
            raise refuse(f"given {shown(value)}; two whole numbers of at least 1 are allowed")
        return value

    @property
    def way(self) -> str:
        """Which of the ways the axis uses."""
        return next(way for way in WAYS if getattr(self, way) is not None)


class SweepTable(ConfigTable):
    """``[sweep]``: many members of one experiment."""

    mode: Literal["product", "zip"] = Field(
        default="product",
        description="product: every combination of the axes' values; zip: the first of each, the second, ...",
    )
    seed: StrictInt = Field(
        default=0, description="seed of random values; each draw depends on seed, key and index"
    )
    keep: list[StrictStr] = Field(
        default_factory=lambda: ["final"],
        description="results kept of each member, besides drifts, steps and warnings",
        json_schema_extra={"items": {"type": "string", "enum": list(KEPT)}, "default": ["final"]},
    )
    most_events: StrictInt = Field(
        default=16,
        ge=1,
        le=MOST_EVENTS,
        description="largest number of times (events) or points (section) kept of an event",
    )
    tile: StrictInt | None = Field(
        default=None,
        ge=1,
        le=LARGEST_TILE,
        description="number of members computed and saved together; by default some seconds of work",
    )
    batch: StrictBool = Field(
        default=True,
        description="integrate members that share their equations side by side; false: each by itself, "
        "which takes many times as long",
    )
    impossible: Literal["refuse", "mark"] = Field(
        default="refuse",
        description="members that can't be run: refuse the sweep before any of them runs, or mark those "
        'as "refused", with the reason, and run the others',
    )
    axes: dict[StrictStr, AxisTable] = Field(
        min_length=1, description="the axes, by the dotted keys whose values are swept, with indices from 0"
    )

    @field_validator("keep")
    @classmethod
    def _can_be_kept(cls, value: list[str]) -> list[str]:
        for name in value:
            if name not in KEPT:
                raise refuse(f"given {shown(name)}{nearest(name, KEPT)}; allowed: {', '.join(KEPT)}")
        if len(set(value)) < len(value):
            raise refuse("something is named twice; name each once")
        return value
