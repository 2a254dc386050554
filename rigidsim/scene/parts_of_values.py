"""Parts, float64 each, that hold one value of a dataset exactly; its rows in the order of time."""

from itertools import count, takewhile
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray


def part_name(name: str, part: int) -> str:
    """Name of a part of a value: ``name``, ``name_lo``, ``name_lo2``, ``name_lo3``, ..."""
    return name + ("", "_lo")[part] if part < 2 else f"{name}_lo{part}"


def parts_in(dataset: "xarray.Dataset", name: str) -> list[str]:
    """Names of a value's parts in a dataset, whose sum, smallest first, is the exact value."""
    residuals = takewhile(dataset.variables.__contains__, (part_name(name, part) for part in count(1)))
    return [name, *takewhile(lambda residual: "residual_of" in dataset[residual].attrs, residuals)]


BACKWARDS = "backwards"


def in_time_order(dataset: "xarray.Dataset") -> "xarray.Dataset":
    """The dataset with ascending times: the rows of a run that goes backwards are reversed, lazily, and its
    attribute ``BACKWARDS`` says so.
    """
    times = dataset.coords.get("time")
    if times is None or times.dims != ("time",) or len(times) < 2 or not times[0] > times[-1]:
        return dataset
    return dataset.isel(time=slice(None, None, -1)).assign_attrs({BACKWARDS: 1})
