"""What part a variable plays in a dataset: told by its attributes, never by its name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rigidsim.look.rows import Table, Variable


_AVERAGED = ("spin_averaged", "orbit_averaged")
"""Levels of the model whose datasets have axes, but no attitude."""


def is_residual(variable: Variable) -> bool:
    """Whether it only holds the digits of another variable that float64 has no room for."""
    return "residual_of" in variable.attrs


def drift_of(variable: Variable) -> str | None:
    """The invariant whose relative drift it is; None where it is none."""
    return _named(variable, "drift_of")


def put_back_of(variable: Variable) -> str | None:
    """The projected invariant of which it tells what was put back; None where it is none."""
    return _named(variable, "put_back_of")


def drifts(dataset: Table) -> dict[str, Variable]:
    """The drifts of a dataset by the name of their invariant."""
    return _by_invariant(dataset, "drift_of")


def put_backs(dataset: Table) -> dict[str, Variable]:
    """What was put back of the projected invariants, by their name."""
    return _by_invariant(dataset, "put_back_of")


def is_averaged(attributes: Mapping[str, Any]) -> bool:
    """Whether a dataset with these attributes is of an averaged model: it has axes, but no attitude."""
    return attributes.get("formulation") in _AVERAGED


def _named(variable: Variable, attribute: str) -> str | None:
    return str(variable.attrs[attribute]) if attribute in variable.attrs else None


def _by_invariant(dataset: Table, attribute: str) -> dict[str, Variable]:
    return {str(v.attrs[attribute]): v for v in dataset.data_vars.values() if attribute in v.attrs}
