"""What is recorded of user-defined states: the states themselves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

import heyoka as hy

from rigidsim.model.kinematics import Kinematics
from rigidsim.model.observables.observable import Observable


def own_observables(m: Kinematics) -> Iterator[Observable]:
    """The recorded variable of each user-defined state, which default records have."""
    for state in m.scene.states:
        unit = m.scaling.own.get(state.name, 0)
        yield Observable(
            state.name, (), state.unit or "1", f"{state.name}, a state of [[states]]",
            partial(_variable, state.name), partial(_exponent, unit), attributes=_marked,
        )  # fmt: skip


def _variable(name: str, _: Kinematics) -> list[Any]:
    return [hy.make_vars(name)]


def _exponent(unit: int, _: Kinematics) -> list[int]:
    return [unit]


def _marked(_: Kinematics) -> Mapping[str, str]:
    return {"given_by": "[[states]]"}
