"""Tracing a system with its swept numbers as parameters, once for all members that share its equations; and
their numbers, evaluated for many members at once, in the scene's own arithmetic.

heyoka's arrays of multiprecision numbers (MPFR) round sums, products, quotients and roots as mpmath does, so
that each member's numbers equal its own build's in every bit. Other functions are mpmath's own, once for
each of the values that they are taken of.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np
from mpmath.libmp import from_man_exp

from rigidsim.model.model_plan import plan_model
from rigidsim.model.names import TANGENT
from rigidsim.model.scaling import EstimatedEffect
from rigidsim.model.system import System
from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.initial_values import check_start
from rigidsim.scene.paths import Path
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.scene.tracing import BINARY, Graph, Traced, TracingContext, Untraceable, swept_number
from rigidsim.solve.precision import precision_of
from rigidsim.solve.problem import InitialValueProblem, prepare

TRACED_TABLES = ("body", "initial", "loads", "rotors", "parameters")
"""Config tables whose numbers may become parameters."""
_PARAMETER = "swept_"
_CONTEXT = context_for("double")
_BITS = _CONTEXT.prec
_FAILURES = (ZeroDivisionError, ValueError, OverflowError, TypeError)
"""Errors of mpmath for numbers outside the range of an operation (of complex numbers none is the larger); the
member's own build reports them.
"""


@dataclass
class Parameters:
    """Coefficients that depend on swept numbers (graph ``nodes``), each a variable where it occurs."""

    nodes: list[int] = field(default_factory=list)
    _names: dict[int, Any] = field(default_factory=dict)

    def number(self, value: Any) -> Any:
        """A coefficient as a double, rounded once, or as a parameter."""
        if not isinstance(value, Traced):
            return _DOUBLE.number(value)
        if value.node not in self._names:
            self._names[value.node] = hy.make_vars(f"{_PARAMETER}{len(self.nodes)}")
            self.nodes.append(value.node)
        return self._names[value.node]

    @property
    def variables(self) -> list[Any]:
        """One variable for each node."""
        return list(self._names.values())


@dataclass(frozen=True)
class TracedSystem:
    """The system that all members of a family share."""

    prepared: InitialValueProblem  # the representative member's own, in plain numbers
    system: System  # the same, whose coefficients are expressions of ``parameters``
    parameters: Parameters
    graph: Graph  # how numbers follow from the swept ones; its guards decide which members belong here

    @cached_property
    def moving(self) -> int:
        """Number of states of the motion; a tangent vector's states follow."""
        return sum(not name.startswith(TANGENT) for name in self.system.states)

    @cached_property
    def in_equations(self) -> list[int]:
        """Indices of the parameters that the motion's equations and events read."""
        expressions = [right for _, right in self.system.equations[: self.moving]]
        expressions += [crossing.expression for crossing in self.system.crossings]
        read = {name for x in expressions for name in hy.get_variables(hy.expression(x))}
        return [k for k, v in enumerate(self.parameters.variables) if str(v) in read]

    def as_parameters(self, expressions: Sequence[Any]) -> list[Any]:
        """Expressions with the parameters as ``hy.par``, numbered as in ``in_equations``."""
        variables = self.parameters.variables
        table = {variables[k]: hy.par[n] for n, k in enumerate(self.in_equations)}
        found = [hy.expression(x) for x in expressions]
        return hy.subs(found, table) if table else found


_DOUBLE = precision_of("double")


def trace(
    representative: Experiment,
    keys: Sequence[str],
    numbers: Sequence[ExactNumber],
    drive: Callable[[], EstimatedEffect | None] = lambda: None,
) -> TracedSystem:
    """Build the system of a member with its swept numbers, by their keys, as parameters. ``drive`` is the
    estimated effect of loads of unknown size, if there are any: a power of two in the units, which has to be
    the same whoever is the representative.

    Raises:
        ConfigError: the member is refused, as a single run of it would be.
        Untraceable: something in it can't be traced.
    """
    prepared = prepare(representative)
    plan = prepared.system.plan
    if plan.scaling.drive is not None:
        plan = replace(plan, scaling=replace(plan.scaling, drive=drive()))
    graph = Graph(context_for(representative.config.integrator.precision))
    config, context = representative.config, TracingContext(graph)
    for column, (key, number) in enumerate(zip(keys, numbers, strict=True)):
        path = Path.of(key)
        if not isinstance(path.get(config), ExactNumber):
            raise Untraceable(f"what is swept, {key}, is no number")
        config = path.with_number(config, swept_number(graph, column, number), context)
    scene: Scene = build_scene(replace(representative, config=config), context)
    check_start(scene)
    parameters = Parameters()
    system = System(plan_model(scene, like=plan), parameters.number)
    for part in ("equations", "outputs", "invariants", "crossings", "rate_bound", "initial"):
        getattr(system, part)
    return TracedSystem(prepared, system, parameters, graph)


# --- numbers of members -------------------------------------------------------------------------------------

Reals = Any  # an array of hy.real, or one hy.real


def real_of(number: ExactNumber) -> hy.real:
    """An exact number, rounded as ``ExactNumber.at`` does."""
    if number.pi_power:
        return _real(number.at(_CONTEXT))
    return hy.real(number.rational.numerator, _BITS) / hy.real(number.rational.denominator, _BITS)


def _real(value: Any) -> hy.real:
    """The same number as an mpf; nan if it isn't a real number, or is far outside a double's range."""
    if not hasattr(value, "_mpf_"):  # complex
        return hy.real(math.nan, _BITS)
    sign, mantissa, exponent, _ = value._mpf_
    if not mantissa and exponent:  # mpmath's codes of infinities and nan
        return hy.real(math.nan, _BITS)
    whole = hy.real(int(-mantissa if sign else mantissa), _BITS)
    return whole * hy.real(math.ldexp(1.0, exponent), _BITS)


def _mpf(value: hy.real) -> Any:
    """The same number as an mpf; ValueError or OverflowError far outside a double's range."""
    places = _BITS - math.frexp(float(value))[1]
    whole = int(value * hy.real(math.ldexp(1.0, places), _BITS))
    return _CONTEXT.make_mpf(from_man_exp(whole, -places))


def _reals(values: np.ndarray) -> Reals:
    return values.astype(hy.real) * hy.real(1.0, _BITS)  # an array of doubles has their precision alone


class Replay:
    """A graph's numbers for so many members, from a column for each key; nan where an operation has no
    result.
    """

    def __init__(self, graph: Graph, columns: Sequence[Reals], count: int) -> None:
        self._graph, self._columns, self._count = graph, columns, count
        self._found: dict[int, Reals] = {}

    @np.errstate(all="ignore")
    def agreeing(self) -> np.ndarray:
        """Mask of the members that make all decisions as the representative does, (members,)."""
        found = np.ones(self._count, dtype=bool)
        for guard in self._graph.guards:
            left, right = self._number(guard.left), self._number(guard.right)
            decided = left < right if guard.kind == "<" else left == right
            found &= (decided == guard.outcome) & np.isfinite(left) & np.isfinite(right)
            if not found.any():
                break
        return found

    @np.errstate(all="ignore")
    def doubles(self, node: int) -> np.ndarray:
        """A number rounded once, (members,); nan if it is outside a double's range."""
        exact = np.broadcast_to(self._number(node), self._count)
        found = exact.astype(np.float64) + 0.0  # zero without a sign
        found[(np.abs(found) < np.finfo(float).tiny) & (exact != hy.real(0.0, _BITS))] = np.nan
        found[np.isinf(found)] = np.nan
        return found

    def _number(self, node: int) -> Reals:
        if node not in self._found:
            self._found[node] = self._worked_out(*self._graph.nodes[node])
        return self._found[node]

    def _worked_out(self, operation: str, arguments: tuple[Any, ...]) -> Reals:
        if operation == "constant":
            return _real(arguments[0])
        if operation == "column":
            return self._columns[arguments[0]]
        if operation == "power":
            base, power = self._number(arguments[0]), arguments[1]
            return base * base if power == 2 else _one_by_one(lambda x: x**power, base)
        if operation == "call":
            function, *nodes = arguments
            return _one_by_one(lambda *x: function(_CONTEXT, *x), *map(self._number, nodes))
        values = [self._number(argument) for argument in arguments]
        known = BINARY.get(operation) or _OF_ARRAYS.get(operation)
        if known is None:
            return _one_by_one(getattr(_CONTEXT, operation), *values)
        found = known(*values)
        if operation == "divide":
            found[np.broadcast_to(values[1] == hy.real(0.0, _BITS), found.shape)] = hy.real(math.nan, _BITS)
        return found


def _one_by_one(function: Callable[..., Any], *values: Reals) -> Reals:
    """A function that arrays lack, once for each of the values that there are."""
    codes: np.ndarray = np.zeros(1, dtype=np.int64)
    for numbers in values:
        distinct, code = np.unique(numbers, return_inverse=True)
        codes = codes * len(distinct) + code
    _, first, places = np.unique(codes, return_index=True, return_inverse=True)
    found = []
    for given in zip(*(np.broadcast_to(x, codes.shape)[first] for x in values), strict=True):
        try:
            found.append(_real(function(*map(_mpf, given))))
        except _FAILURES:
            found.append(hy.real(math.nan, _BITS))
    return np.array(found)[places]


def _exponent(value: Reals) -> Reals:
    """The smallest e with abs(value) < 2**e."""
    size = np.abs(value)
    doubles = size.astype(np.float64)
    exponents = np.frexp(doubles)[1]
    # a number just below a power of two is rounded to it
    exponents -= size < _reals(np.ldexp(1.0, exponents - 1))
    return _reals(np.where((doubles > 0) & np.isfinite(doubles), exponents, np.nan))


def _power_of_two(exponent: Reals) -> Reals:
    doubles = exponent.astype(np.float64)
    return _reals(np.where(np.isfinite(doubles), np.ldexp(1.0, doubles.astype(np.int64)), np.nan))


_OF_ARRAYS: dict[str, Callable[..., Reals]] = {
    "maximum": np.maximum,
    "minimum": np.minimum,
    "negative": lambda x: -x,
    "absolute": np.abs,
    "sqrt": np.sqrt,
    "exponent": _exponent,
    "power_of_two": _power_of_two,
}
