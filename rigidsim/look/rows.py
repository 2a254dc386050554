"""What a picture is drawn from, for annotations: a dataset, lazy or in memory, and its variables."""

from __future__ import annotations

from typing import TypeAlias

import xarray

Table: TypeAlias = xarray.Dataset
Variable: TypeAlias = xarray.DataArray
