"""What a dataset tells of itself: its config and title, and the roles of variables by their attributes."""

import re
import tomllib
from collections.abc import Mapping
from typing import Any

import xarray

_ORBIT_NORM = re.compile(r"orbit_norm_(\d+)")
_AVERAGED = ("spin_averaged", "orbit_averaged")
"""Model levels whose datasets have axes but no attitude."""


def read_config(dataset: xarray.Dataset) -> dict[str, Any]:
    """The embedded config as a dictionary; empty when there is none or it can't be read."""
    try:
        return tomllib.loads(str(dataset.attrs.get("config", "")))
    except tomllib.TOMLDecodeError:
        return {}


def title_of(dataset: xarray.Dataset) -> str:
    """Title of the run: attribute `title`, else the config's name."""
    return str(dataset.attrs.get("title") or read_config(dataset).get("name") or "rigid body")


def is_residual(variable: xarray.DataArray) -> bool:
    """Whether a variable only holds the digits of another that don't fit its float64."""
    return "residual_of" in variable.attrs


def drift_of(variable: xarray.DataArray) -> str | None:
    """The invariant whose relative drift a variable is; None for any other variable."""
    return variable.attrs.get("drift_of")


def put_back_of(variable: xarray.DataArray) -> str | None:
    """The projected invariant whose corrections put back a variable holds; None for any other variable."""
    return variable.attrs.get("put_back_of")


def drifts(dataset: xarray.Dataset) -> dict[str, xarray.DataArray]:
    """The drifts of a dataset by the name of their invariant."""
    return {name: v for v in dataset.data_vars.values() if (name := drift_of(v))}


def put_backs(dataset: xarray.Dataset) -> dict[str, xarray.DataArray]:
    """Corrections put back into projected invariants, by their name."""
    return {name: v for v in dataset.data_vars.values() if (name := put_back_of(v))}


def in_words(name: str) -> str:
    """A variable's name as people read it."""
    orbit = _ORBIT_NORM.fullmatch(name)
    return f"norm of orbit {orbit[1]}'s cosine and sine" if orbit else name.replace("_", " ")


def is_averaged(attributes: Mapping[str, Any]) -> bool:
    """Whether a dataset with these attributes is of an averaged model: it has axes, but no attitude."""
    return attributes.get("formulation") in _AVERAGED
