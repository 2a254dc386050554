"""Tracing a system with its swept numbers as parameters, once for all members that share its equations."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import heyoka as hy

from rigidsim.model.heyoka_expressions import TANGENT
from rigidsim.model.model_plan import plan_model
from rigidsim.model.scaling import Drive
from rigidsim.model.system import System
from rigidsim.scene.arithmetic import context_for
from rigidsim.scene.config import Experiment
from rigidsim.scene.exact import ExactNumber
from rigidsim.scene.initial_values import check_start
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.scene.toml_text import key_steps
from rigidsim.scene.tracing.arithmetic import TracingContext, swept_number
from rigidsim.scene.tracing.numbers import Graph, Traced, Untraceable
from rigidsim.scene.varied_keys import replaced, value_at
from rigidsim.solve.precision import precision_of
from rigidsim.solve.problem import InitialValueProblem, prepare

TRACED_TABLES = ("body", "initial", "loads", "rotors", "parameters")
"""Config tables whose numbers may become parameters."""
_PARAMETER = "swept_"


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
        """Number of states of the motion; those of a tangent vector follow."""
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
    drive: Callable[[], Drive | None] = lambda: None,
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
    config = representative.config
    for column, (key, number) in enumerate(zip(keys, numbers, strict=True)):
        steps = key_steps(key, "axes")
        if not isinstance(value_at(config, steps), ExactNumber):
            raise Untraceable(f"what is swept, {key}, is no number")
        config = replaced(config, steps, swept_number(graph, column, number))
    context = TracingContext(graph)
    scene: Scene = build_scene(replace(representative, config=config), context)
    check_start(scene)
    parameters = Parameters()
    system = System(plan_model(scene, like=plan), parameters.number)
    for part in ("equations", "outputs", "invariants", "crossings", "rate_bound", "initial"):
        getattr(system, part)
    return TracedSystem(prepared, system, parameters, graph)
