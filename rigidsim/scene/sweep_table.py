"""``[sweep]``: the keys for swept values, and for what is kept of each member."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, StrictBool, StrictInt, StrictStr, field_validator, model_validator

from rigidsim.scene.fields import ConfigTable, EachOnce, OneOf, Pair, Triple, refuse
from rigidsim.scene.validation_messages import shown

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
    """One axis: the values that a key takes, said in one of seven ways."""

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
    grid: Pair[StrictInt] | None = None
    """for sphere: numbers of polar angles (equally spaced in their cosine) and azimuths"""
    name: StrictStr | None = None
    """name of the dimension; by default the last part of the key, or the whole key where the last part is the
    name of something recorded
    """

    @model_validator(mode="after")
    def _one_way(self) -> AxisTable:
        way = self.way
        if way == "sphere" and (self.count is None) == (self.grid is None):
            raise refuse(
                "a sphere takes either count (random directions) or grid (polar angles and azimuths), "
                "such as grid = [16, 32]"
            )
        if way in ("normal", "uniform") and self.count is None:
            raise refuse(f"{way} needs a count, such as count = 100")
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
    """integrate members that share their equations side by side; false: each by itself, which takes many
    times as long
    """
    impossible: Literal["refuse", "mark"] = "refuse"
    """members that can't be run: refuse the sweep before any of them runs, or mark those as "refused", with
    the reason, and run the others
    """
    axes: dict[StrictStr, AxisTable] = Field(min_length=1)
    """the axes, by the dotted keys whose values are swept, with indices from 0"""
