"""What a fit observes: variables that can be recorded, and expressions, which become such for its time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.names import written
from rigidsim.model.observables.observable import Observable
from rigidsim.scene.config import Experiment
from rigidsim.scene.expressions.names import names_of
from rigidsim.scene.expressions.parser import parse_expression
from rigidsim.scene.expressions.tree import ExpressionError, names_used, states_read
from rigidsim.scene.registry import OBSERVABLES
from rigidsim.scene.schema import Config
from rigidsim.scene.validation_messages import nearest
from rigidsim.solve.problem import prepare
from rigidsim.store.variables import LABELS

_PREFIX = "fit_expression_"
QUATERNION, EULER_ANGLES = "quaternion", "euler_angles"
"""Variables that are attitudes; what is computed of any is the former."""
_ROTATIONS = (QUATERNION, EULER_ANGLES)
_STATES = ("attitude", "flight")


@dataclass(frozen=True)
class Observed:
    """One observable.

    Attributes:
        text: as the config says it. name: of the variable that is recorded for it.
        form: "quaternion" or "euler_angles" for attitudes, "angle" for others that turn, otherwise "plain".
        components: default names of its columns. unit: SI; None for an expression, of any.
    """

    text: str
    name: str
    form: str
    components: tuple[str, ...]
    unit: str | None

    @property
    def rotation(self) -> bool:
        """Whether it is an attitude, whose residuals are rotation vectors."""
        return self.form in _ROTATIONS

    @property
    def variable(self) -> str:
        """Name of what is recorded for it; any attitude as a quaternion."""
        return "quaternion" if self.rotation else self.name


@contextmanager
def observing(experiment: Experiment) -> Iterator[tuple[list[Observed], Experiment]]:
    """What each ``[[fit.data]]`` observes, with the experiment that records it; expressions can be recorded
    inside the block only.

    Raises:
        ConfigError: something can't be recorded in this scene.
    """
    table = experiment.config.fit
    assert table is not None
    entered: list[str] = []
    try:
        texts = [data.observable for data in table.data]
        own = [state.name for state in experiment.config.states]
        names, also = [], list[str]()
        for number, text in enumerate(texts, start=1):
            if text in OBSERVABLES or text in own:
                names.append("quaternion" if text in _ROTATIONS else text)
                continue
            name = f"{_PREFIX}{texts.index(text)}"
            if name not in entered:
                observable, states = _expression(name, text, experiment.config, number)
                OBSERVABLES[name] = observable
                entered.append(name)
                also += [state for state in states if state in own]
            names.append(name)
        record = [*dict.fromkeys([*names, *also])]
        quiet = experiment.quiet(record, events=[], fit=None)
        recorded = {one.name: one for one in prepare(quiet).system.recorded}
        found = []
        for text, name in zip(texts, names, strict=True):
            one = recorded[name]
            labels = [LABELS.get(dim, [str(i) for i in range(one.count)]) for dim in one.dims]
            suffixes = ["_" + "_".join(parts) if parts else "" for parts in product(*labels)]
            if text == EULER_ANGLES:
                components = tuple(f"{text}_{angle}" for angle in LABELS["euler_angle"])
                found.append(Observed(text, text, text, components, "rad"))
                continue
            form = QUATERNION if text == QUATERNION else "angle" if one.units == "rad" else "plain"
            expression = name.startswith(_PREFIX)
            shown = name if not expression else "value"
            components = tuple(f"{shown}{suffix}" for suffix in suffixes)
            if expression:
                form = "plain"
            found.append(Observed(text, name, form, components, None if expression else one.units))
        yield found, quiet
    finally:
        for name in entered:
            OBSERVABLES.pop(name, None)


def _expression(name: str, text: str, config: Config, number: int) -> tuple[Observable, frozenset[str]]:
    """An expression as an observable, with the states that it reads."""
    try:
        parsed = parse_expression(text, names_of(config), parameters=config.parameters)
    except ExpressionError as error:
        near = nearest(text, list(OBSERVABLES))
        what = f'"{text}" is no variable that can be recorded{near}, nor an expression: {error}'
        raise ConfigError(Problem(f"[[fit.data]] number {number} observable", what)) from None
    if not names_used(parsed):
        what = f'given "{text}", which never changes'
        raise ConfigError(Problem(f"[[fit.data]] number {number} observable", what))
    states = states_read(parsed)
    observable = Observable(
        name, (), "1", text, partial(_written, text), needs=tuple(s for s in _STATES if s in states)
    )
    return observable, states


def _written(text: str, m: Kinematics) -> list[Any]:
    """The expression of a scene, with its own values of ``[parameters]``."""
    config = m.scene.config
    return written(m, [parse_expression(text, names_of(config), parameters=config.parameters)])
