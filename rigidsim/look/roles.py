"""What part a variable plays in a dataset: told by its attributes, never by its name."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray


def is_residual(variable: xarray.DataArray) -> bool:
    """Whether it only holds the digits of another variable that float64 has no room for."""
    return "residual_of" in variable.attrs


def drift_of(variable: xarray.DataArray) -> str | None:
    """The invariant whose relative drift it is; None where it is none."""
    return _named(variable, "drift_of")


def put_back_of(variable: xarray.DataArray) -> str | None:
    """The projected invariant of which it tells what was put back; None where it is none."""
    return _named(variable, "put_back_of")


def drifts(dataset: xarray.Dataset) -> dict[str, xarray.DataArray]:
    """The drifts of a dataset by the name of their invariant."""
    return _by_invariant(dataset, "drift_of")


def put_backs(dataset: xarray.Dataset) -> dict[str, xarray.DataArray]:
    """What was put back of the projected invariants, by their name."""
    return _by_invariant(dataset, "put_back_of")


def _named(variable: xarray.DataArray, attribute: str) -> str | None:
    return str(variable.attrs[attribute]) if attribute in variable.attrs else None


def _by_invariant(dataset: xarray.Dataset, attribute: str) -> dict[str, xarray.DataArray]:
    return {str(v.attrs[attribute]): v for v in dataset.data_vars.values() if attribute in v.attrs}
