"""The state of a scene in SI, in which loads and observables of users are written.

Equations are in internal units (``rigidsim.model.scaling``): powers of two, so that both ways are exact.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import wraps
from typing import Any

import heyoka as hy

from rigidsim.errors import ConfigError, Problem
from rigidsim.model import kinematics
from rigidsim.model.kinematics import Kinematics
from rigidsim.model.rotations import Symbolic
from rigidsim.model.scaling import Scaling
from rigidsim.model.state_blocks import StateBlock
from rigidsim.scene.arithmetic import Vector
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.exact import ExactNumber

_SECONDS = "seconds of the scene"  # stands for its time, until the expression is in internal units
_SAME = frozenset({"scene", "number", "matrix", "vertical", "fixed", "seen", "carried", "orbit", "table"})
_UNITS: dict[str, Callable[[Scaling], int]] = {
    "rates": lambda units: -units.time,
    "position": lambda units: units.length,
    "velocity": lambda units: units.speed,
    **dict.fromkeys(("momentum_body", "momentum_space", "own_momentum"), lambda units: units.momentum),
    **dict.fromkeys(("rotational_energy", "energy"), lambda units: units.energy),
}
_TERMS: dict[str, Callable[[Scaling], int]] = {
    "torque": lambda units: units.energy,
    "force": lambda units: units.speed - units.time,
    "carried_momentum": lambda units: units.momentum,
    "exerted_torque": lambda units: units.energy,
}
_VALUES: dict[str, Callable[[Scaling], int]] = {
    "potential": lambda units: units.energy,
    "carried_energy": lambda units: units.energy,
    "supplied_power": lambda units: units.energy - units.time,
    "motion": lambda units: units.speed,
    **dict.fromkeys(
        ("narrow", "roots", "endings", "range_ends", "contacts", "source_direction", "flux_density",
         "keeps_axial", "lends"),
        lambda _: 0,
    ),
}  # fmt: skip
"""Binary exponents of the internal units in which a load's methods are asked for their values."""


class InSI:
    """Expressions of a scene's state in SI.

    Attributes are ``rates`` (rad/s, body axes), ``position`` and ``velocity`` (m and m/s, space axes),
    ``momentum_body``, ``momentum_space`` and ``own_momentum`` (kg m^2/s), ``rotational_energy`` and
    ``energy`` (J), ``time`` (s), and what has no unit: ``matrix`` (R, body to space axes), ``vertical``,
    ``seen`` (a vector of space axes in body axes), ``fixed``, ``orbit``, ``table``; ``scene`` has the
    constants, and ``number`` rounds one to the working precision.
    """

    def __init__(self, m: Kinematics) -> None:
        self.internal = m

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        if name in _SAME:
            return getattr(self.internal, name)
        if name in _UNITS:
            return _times(self.internal, getattr(self.internal, name), _UNITS[name](self.internal.scaling))
        raise ConfigError(
            Problem(
                "loads",
                f'asks for "{name}", which the state in SI doesn\'t have; it has '
                f"{', '.join([*_UNITS, *_SAME])}, time and units. Loads and observables of users speak SI: "
                "leave out factors such as 2**-m.scaling.energy (docs/howto/own_load.md)",
            )
        )

    @property
    def time(self) -> Symbolic:
        """The scene's time, s."""
        return hy.make_vars(_SECONDS)

    @property
    def units(self) -> Scaling:
        """Binary exponents of the internal units, for ``StateBlock.exponents``."""
        return self.internal.scaling

    def offset_from(self, point: Vector) -> list[Symbolic]:
        """Vector from a fixed point (mpf, m) to the body in flight, m, space axes."""
        found: list[Symbolic] = _times(self.internal, self.internal.offset_from(point), self.units.length)
        return found

    def seen_from(self, point: Vector) -> tuple[list[Symbolic], Symbolic]:
        """Direction (unit, space axes) from a fixed point (mpf, m) to the body in flight; 1/distance, 1/m."""
        direction, inverse = self.internal.seen_from(point)
        return direction, _times(self.internal, inverse, -self.units.length)


def in_si(m: Kinematics | InSI) -> InSI:
    """The state in SI."""
    return m if isinstance(m, InSI) else InSI(m)


def seconds(m: Kinematics | InSI, since: Epoch | None = None) -> Symbolic:
    """The scene's time as an expression, s, or that since J2000, if ``since`` is the date of time 0."""
    if not isinstance(m, InSI):
        return kinematics.seconds(m, since)
    begin = since and ExactNumber(since.since_j2000()).at(m.scene.context)
    return m.time + m.number(begin) if begin else m.time


def speaks_si(cls: type) -> None:
    """Let the methods that a class of a user defines take the state in SI, and give SI."""
    for name in {*_TERMS, *_VALUES, "extra_states"} & set(vars(cls)):
        setattr(cls, name, _in_si(name, vars(cls)[name]))


def values_in_si(given: Callable[[Any], Any]) -> Callable[[Kinematics], Any]:
    """A function of the state in SI, as one of the state in internal units; its values are in SI."""
    return lambda m: _internal(m, given(in_si(m)), 0, {})


def _in_si(name: str, method: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(method)
    def converted(load: Any, m: Any, *more: Any) -> Any:
        if isinstance(m, InSI):  # called by another method of the load
            return method(load, m, *more)
        given, scaling = method(load, InSI(m), *more), m.scaling
        if name == "extra_states":
            return given and _block(m, given)
        states = getattr(type(load).extra_states, "__wrapped__", None)
        block = states(load, InSI(m)) if states else None
        own = _own_states(m, block) if block else {}
        if name in _TERMS:
            return _terms(m, given, _TERMS[name](scaling), own)
        return _internal(m, given, _VALUES[name](scaling), own)

    return converted


def _times(m: Kinematics, value: Any, exponent: int) -> Any:
    """A value, or each of a list, times a power of two."""
    if exponent == 0 or value is None:
        return value
    if isinstance(value, list):
        return [_times(m, x, exponent) for x in value]
    return m.scaled(1, exponent) * value


def _internal(m: Kinematics, value: Any, unit: int, own: Mapping[str, Symbolic]) -> Any:
    """What a method gives in SI, in internal units of this exponent; texts and truths stay."""
    if value is None or isinstance(value, str | bool):
        return value
    if isinstance(value, list | tuple):
        return type(value)(_internal(m, x, unit, own) for x in value)
    expression = hy.expression(value)
    if hy.subs(expression, {hy.time: hy.expression(0.0)}) != expression:
        raise ConfigError(
            Problem("loads", "reads heyoka's time, which is in internal units; write m.time, which is in s")
        )
    found = hy.subs(expression, {_SECONDS: hy.expression(kinematics.seconds(m)), **own})
    return _times(m, found, -unit)


def _terms(m: Kinematics, given: Any, unit: int, own: Mapping[str, Symbolic]) -> Any:
    """Terms in internal units; what isn't terms is refused by who asks for them."""
    context = m.scene.context
    try:
        return [
            ([context.ldexp(_exact(context, x), -unit) for x in vector], _internal(m, expression, 0, own))
            for vector, expression in given
        ]
    except TypeError:
        return given


def _exact(context: Any, x: Any) -> Any:
    return context.mpf(x) if isinstance(x, int | float | str) else x


def _own_states(m: Kinematics, block: StateBlock) -> dict[str, Symbolic]:
    """The states of a load in SI, by their names."""
    units = zip(block.names, block.variables, block.unit_exponents, strict=True)
    return {name: hy.expression(_times(m, state, unit)) for name, state, unit in units}


def _block(m: Kinematics, given: StateBlock) -> StateBlock:
    """States with derivatives and initial values in SI, in separate units."""
    context, own = m.scene.context, _own_states(m, given)
    units = given.unit_exponents
    return replace(
        given,
        derivatives=[
            _internal(m, x, unit - m.scaling.time, own)
            for x, unit in zip(given.derivatives, units, strict=True)
        ],
        initial=[
            context.ldexp(_exact(context, x), -unit) for x, unit in zip(given.initial, units, strict=True)
        ],
        norms=[_internal(m, x, 0, own) for x in given.norms],
    )
