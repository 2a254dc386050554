"""How the methods of ``[integrator] method`` solve a scene: a registry, open to user-defined methods."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, TypeVar

from rigidsim.errors import ConfigError, Problem
from rigidsim.model.system import System
from rigidsim.scene.choices import METHODS, Method
from rigidsim.scene.registry import register_class
from rigidsim.scene.scene import Scene
from rigidsim.solve.closed_form import ClosedForm
from rigidsim.solve.effects.effect import registered_effects
from rigidsim.solve.events import EventLog
from rigidsim.solve.precision import Precision, Scalar, precision_of
from rigidsim.solve.stepper import Stepper


class Unsuitable(ValueError):
    """Raised if a method can't solve a scene; the message goes on from ``given "name", ``."""


class Algorithm:
    """How a method solves one scene; ``solves`` registers it.

    A user-defined one needs a ``stepper``; all else has a default.

    Attributes:
        method: what can be said of it for any scene.
        finds_events: whether its stepper looks for ``[[events]]``, which needs steps.
        sets_parameters: whether its stepper sets parameters of equations that change at surfaces or times.
        takes_series: whether its steps are Taylor series, which a root of zero at the start has none of.
        own_errors: whether it reports its errors itself (``Stepper.errors``), or has none; if not, they
            are estimated from motions that start near it, in heyoka's rounding.
        form: the closed form that gives the states; None if none does.
    """

    method: ClassVar[Method]
    finds_events: ClassVar[bool] = False
    sets_parameters: ClassVar[bool] = False
    takes_series: ClassVar[bool] = False
    own_errors: ClassVar[bool] = True
    form: ClosedForm | None = None

    @property
    def title(self) -> str:
        """What gives the states, in words: the attribute ``integrator`` of datasets."""
        return self.method.title

    @classmethod
    def of(cls, scene: Scene, system: System, *, driven: bool) -> Algorithm:
        """The algorithm for a scene.

        Args:
            driven: whether loads given from Python act.

        Raises:
            Unsuitable: it can't solve the scene.
        """
        return cls()

    def stepper(
        self, system: System, precision: Precision, tolerance: Scalar | None, start: Scalar, log: EventLog
    ) -> Stepper:
        """What takes its steps, at the start of the motion.

        Args:
            tolerance: None for the precision's epsilon.
            start: start time, internal units.
            log: where events go.
        """
        raise NotImplementedError


ALGORITHMS: dict[str, type[Algorithm]] = {}
"""By the names of their methods."""

A = TypeVar("A", bound=type[Algorithm])


def solves(method: Method) -> Callable[[A], A]:
    """Register an algorithm, so that ``[integrator] method`` finds it (a class decorator); raises a
    ValueError if the method's name is taken.
    """

    def register(algorithm: A) -> A:
        register_class(ALGORITHMS, method.name, algorithm, "a method named")
        METHODS[method.name] = method
        algorithm.method = method
        return algorithm

    return register


def algorithm_of(scene: Scene, system: System, *, driven: bool) -> Algorithm:
    """The algorithm that ``[integrator] method`` asks for; a ConfigError if it can't solve the scene."""
    name = scene.config.integrator.method
    kind = ALGORITHMS[name]
    try:
        found = kind.of(scene, system, driven=driven)
        if system.crossings and not scene.events and not kind.finds_events:
            what = "which takes no steps that could end at an impossible body"
            raise Unsuitable(f'{what} ({system.crossings[0].impossible}); choose method = "taylor"')
        if scene.events and not kind.finds_events:
            takes = "steps in which no" if kind.method.has_steps else "no steps in which"
            instead = 'remove [[events]], or choose method = "taylor"'
            raise Unsuitable(f"which takes {takes} events could be found; {instead}")
        if (system.parameters or system.stepwise) and kind.method.has_steps and not kind.sets_parameters:
            how = "takes no steps that end where the equations change, at a kink, a jump or a table's row"
            raise Unsuitable(f'which {how}; choose method = "taylor"')
        effects = registered_effects(system, precision_of("double"))
        if effects and not kind.method.has_steps:
            how = f'takes no steps between which the effect "{effects[0].registered}" could act'
            raise Unsuitable(f'which {how}; choose method = "taylor"')
    except Unsuitable as why:
        raise ConfigError(Problem("[integrator] method", f'given "{name}", {why}')) from None
    return found
