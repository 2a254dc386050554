"""``[fit]``: the keys for what is estimated from data, what is known beforehand, and where the data are."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, StrictInt, StrictStr, field_validator, model_validator

from rigidsim.scene.fields import ConfigTable, Dimensionless, EachOnce, Range, refuse
from rigidsim.scene.validation_messages import shown

MOST_STARTS = 10_000
_ONE_OR_MORE = Range(lambda x: x >= 1, "1 or more")


class KnownWithin(ConfigTable):
    """How well a value is known besides the data."""

    sigma: Any = Field(examples=[0.1, "1e10 m^3/s^2", [0.1, 0.1, 0.2]])
    """standard deviation about the config's value, in the unit of the key; of a vector one for all its
    components, or one for each
    """

    @field_validator("sigma")
    @classmethod
    def _number(cls, value: Any) -> Any:
        if isinstance(value, bool | dict) or value is None:
            raise refuse(f"given {shown(value)}; a standard deviation, or one for each component, is allowed")
        return value


class FitDataTable(ConfigTable):
    """``[[fit.data]]``: one set of observations, at its own times."""

    file: StrictStr = Field(examples=["observed.csv"])
    """CSV, Parquet, netCDF, AEM, OEM, CK, or the dataset of a run; its path from the config's folder"""
    kernels: EachOnce[StrictStr] = Field(default_factory=list, examples=[["clock.tsc", "leapseconds.tls"]])
    """of a CK: the clock (SCLK) and what else SPICE reads it with; paths from the config's folder"""
    time: StrictStr = Field("time", examples=["time", "utc"])
    """column of the times: seconds of the run, or dates"""
    observable: StrictStr = Field(examples=["quaternion", "angular_velocity", "wz^2"])
    """any variable that can be recorded, or an expression as in [[events]]"""
    columns: EachOnce[StrictStr] | None = Field(None, examples=[["alpha_deg", "beta_deg", "gamma_deg"]])
    """columns of its components; by default NAME_COMPONENT as in exported tables, or NAME for a single one"""
    unit: StrictStr | None = Field(None, examples=["deg"])
    """unit of these columns; by default the file's, or SI"""
    sigma: Any = Field(examples=["5 deg", "sigma_deg", 1e-3])
    """standard deviation of each component: a number with its unit (bare ones are SI), or the name of a
    column, in ``unit``; of attitudes, of each component of a rotation vector
    """
    scale: Literal["TDB", "TT", "TAI", "GPS", "UTC"] = "UTC"
    """time scale of dates that don't name theirs"""
    outliers: Annotated[Dimensionless, _ONE_OR_MORE] | None = Field(None, examples=[4])
    """leave out and report rows with a residual above so many standard deviations; by default none"""

    @field_validator("sigma")
    @classmethod
    def _sigma(cls, value: Any) -> Any:
        if isinstance(value, bool | dict | list) or value is None:
            raise refuse(f"given {shown(value)}; a standard deviation, or the name of a column, is allowed")
        return value


class FitTable(ConfigTable):
    """``[fit]``: what ``rigidsim fit`` estimates."""

    parameters: EachOnce[StrictStr] = Field(
        min_length=1, examples=[["initial.attitude", "initial.angular_velocity", "body.principal_moments[0]"]]
    )
    """dotted keys with indices from 0 whose values are estimated, in this order everywhere; initial.attitude
    is a rotation vector in body axes from the config's attitude; the config's values are where it starts
    """
    prior: dict[StrictStr, KnownWithin] = Field(default_factory=dict)
    """by key: how well a parameter is known beforehand"""
    consider: dict[StrictStr, KnownWithin] = Field(default_factory=dict)
    """by key: how uncertain values are that are not estimated; it counts in the sigmas of those that are"""
    data: list[FitDataTable] = Field(min_length=1)
    """the observations"""
    starts: StrictInt = Field(1, ge=1, le=MOST_STARTS)
    """number of starts: the config's values, and others drawn from the priors; the best end is taken"""

    @model_validator(mode="after")
    def _either(self) -> FitTable:
        both = sorted(set(self.parameters) & set(self.consider))
        if both:
            raise refuse(f'"{both[0]}" is both estimated and considered; remove it from one of them')
        if self.starts > 1 and not self.prior:
            raise refuse(
                f"starts = {self.starts}, but without a prior there is nothing to draw them from; add "
                'prior."KEY" = {sigma = ...}'
            )
        return self
