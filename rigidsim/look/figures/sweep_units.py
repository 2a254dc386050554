"""Units of a sweep's figure: times in the scene's unit, angles and their rates as they read well; and which
of its variables tell nothing.
"""

from __future__ import annotations

import numpy as np
import xarray

from rigidsim.look.record import read_config
from rigidsim.look.units import pretty_unit
from rigidsim.scene.readable import DAY, angle_unit, largest, unit_of

_STILL = 1e-9  # variation between members, relative to the largest, that is rounding
_NOISE = 1e-12  # of a signal's own size, below which a line or a secular rate is rounding
_MOST = 4_000_000  # numbers that are looked at


def in_units(dataset: xarray.Dataset, name: str) -> xarray.Dataset:
    """A sweep's dataset with axes and one of its variables in units that suit the scene."""
    wanted = [str(key) for key, values in dataset.coords.items() if values.dtype.kind == "f"]
    changed = {key: _in_unit(dataset, dataset[key]) for key in wanted}
    # as plain variables: an axis would be aligned with its own former values
    found = dataset.assign_coords({k: v.variable for k, v in changed.items() if v is not None})
    variable = _in_unit(dataset, dataset[name])
    return found if variable is None else found.assign({name: variable.variable})


def _in_unit(dataset: xarray.Dataset, variable: xarray.DataArray) -> xarray.DataArray | None:
    unit, size = pretty_unit(str(variable.attrs.get("units", ""))), largest(variable.values)
    if unit not in ("s", "rad", "rad/s") or not size > 0 or variable.dtype.kind != "f":
        return None
    asked = str(read_config(dataset).get("time", {}).get("unit") or dataset.attrs.get("time_unit") or "")
    time = unit_of({"time_unit": asked}, size if unit == "s" else DAY)
    if unit == "s":
        factor, name = 1 / time.seconds, time.symbol
    elif unit == "rad":
        angle = angle_unit(size)
        factor, name = angle.per_radian, angle.name
    elif asked and time.seconds >= DAY:
        angle = angle_unit(size * time.seconds)
        factor, name = angle.per_radian * time.seconds, f"{angle.name}/{time.symbol}"
    else:
        return None
    return (variable * factor).assign_attrs({**variable.attrs, "units": name})


def tells_nothing(dataset: xarray.Dataset, name: str) -> bool:
    """Whether a variable is the same in all members but for rounding, or rounding itself: a line or a secular
    rate that is too small beside the signal that it was found in.
    """
    variable = dataset[name]
    if variable.dtype.kind not in "fi" or variable.size > _MOST:
        return False
    values = np.asarray(variable.values, dtype=np.float64)
    members = int(np.prod([dataset.sizes[dim] for dim in variable.dims if dim in _axes(dataset, variable)]))
    table = values.reshape(members, -1) if members else values.reshape(1, -1)
    if len(table) < 2 or not np.isfinite(table).any():
        return False
    spread = np.fmax.reduce(table) - np.fmin.reduce(table)
    size = np.fmax.reduce(np.abs(table), axis=None)
    if np.fmax.reduce(spread) <= _STILL * size:
        return True
    signal, _, what = name.rpartition("_")
    if what not in ("amplitude", "rate"):
        return False
    over = largest(dataset["time_reached"].values) if what == "rate" and "time_reached" in dataset else 1.0
    scale = [largest(dataset[other].values) for other in (f"{signal}_amplitude",) if other in dataset]
    radians = [1.0] if str(variable.attrs.get("units", "")).startswith("rad") else []
    return bool(size * over <= _NOISE * max([*scale, *radians], default=0.0))


def _axes(dataset: xarray.Dataset, variable: xarray.DataArray) -> set[str]:
    """Dimensions of members: those of the members' status."""
    return set(map(str, dataset["status"].dims)) if "status" in dataset else set(map(str, variable.dims))
