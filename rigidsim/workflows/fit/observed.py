"""What a fit observes: variables that can be recorded, and expressions, which become such for its time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

from rigidsim.errors import ConfigError, Problem
from rigidsim.formats.trajectories import config_unit
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

    @property
    def config_unit(self) -> str | None:
        """``unit`` as configs write it."""
        return None if self.unit is None else config_unit(self.unit)


@contextmanager
def observing(experiment: Experiment) -> Iterator[tuple[list[Observed], Experiment]]:
    """What each ``[[fit.data]]`` observes, with the experiment that records it; expressions can be recorded
    inside the block only.

    Raises:
        ConfigError: something can't be recorded in this scene.
    """
    table = experiment.config.fit
    assert table is not None
    texts = [data.observable for data in table.data]
    own = [state.name for state in experiment.config.states]
    names, also, entered = [], list[str](), list[str]()
    try:
        for number, text in enumerate(texts, start=1):
            name = QUATERNION if text in _ROTATIONS else text
            if text not in OBSERVABLES and text not in own:
                name = f"{_PREFIX}{texts.index(text)}"
                OBSERVABLES[name], states = _expression(name, text, experiment.config, number)
                entered.append(name)
                also += [state for state in states if state in own]
            names.append(name)
        quiet = experiment.quiet([*dict.fromkeys([*names, *also])], events=[], fit=None)
        recorded = {one.name: one for one in prepare(quiet).system.recorded}
        found = []
        for text, name in zip(texts, names, strict=True):
            one, expression = recorded[name], name in entered
            labels = [LABELS.get(dim, [str(i) for i in range(one.count)]) for dim in one.dims]
            form, unit = "plain" if expression else "angle" if one.units == "rad" else "plain", one.units
            if text in _ROTATIONS:
                form = text
            if text == EULER_ANGLES:
                labels, unit = [LABELS["euler_angle"]], "rad"
            shown = "value" if expression else text
            components = tuple("_".join([shown, *parts]) for parts in product(*labels))
            found.append(
                Observed(text, text if form == text else name, form, components, None if expression else unit)
            )
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
