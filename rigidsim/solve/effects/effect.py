"""An effect: something that happens at boundaries of natural steps, with a memory."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, TypeVar

import numpy as np

from rigidsim.model.system import System
from rigidsim.scene.registry import register_class
from rigidsim.solve.precision import Precision, Scalar
from rigidsim.solve.stepper import Stepper


class Effect:
    """Something done at boundaries of natural steps: by default at each stride's end, and without a memory.

    Strides are fixed counts of natural steps, as long as the smallest limit of all effects allows. A step
    that would go beyond a time given by an effect is cut short to end there.

    Attributes:
        registered: name under which ``register_effect`` registered it; empty for rigidsim's own.
        version: of its memory; a checkpoint with another is refused.
        anywhere: whether the effect may also be due within a stride.
        rewrites: whether the effect expresses the same motion in other states, and doesn't change the motion.
    """

    registered: ClassVar[str] = ""
    version = 1
    anywhere = False
    rewrites: ClassVar[bool] = False

    @classmethod
    def of(cls, system: System, precision: Precision) -> Effect | None:
        """The effect of a registered class for a system; None if the effect does nothing."""
        return cls()

    @property
    def name(self) -> str:
        """Name of its part of a checkpoint."""
        return f"registered_{self.registered}" if self.registered else type(self).__name__

    @property
    def limit(self) -> int:
        """Largest length of a stride that the effect allows at present; it never grows during a run."""
        return sys.maxsize

    @property
    def until(self) -> Scalar | None:
        """Time (internal units) at which a step has to end next, None for none; only with ``anywhere``.
        When it has come the effect must be due, and its application move it on.
        """
        return None

    def due(self, stepper: Stepper, stride: int) -> bool:
        """Whether to apply it here, at a stride's end or ``anywhere``: by steps, state and memory alone, so
        that bits depend on no clock or sampling.
        """
        return True

    def apply(self, stepper: Stepper, stride: int) -> bool:
        """Do it; False if it can't be done, which ends the run here."""
        raise NotImplementedError

    @property
    def memory(self) -> Any:
        """All that later applications depend on, as an immutable value."""
        return None

    def back_to(self, memory: Any, stepper: Stepper) -> None:
        """Return to an earlier memory; the stepper's state is restored after all effects."""

    def pack(self, memory: Any) -> dict[str, np.ndarray]:
        """A memory as arrays of a checkpoint, float64 or int64, with names that no other effect uses."""
        return {}

    def unpack(self, arrays: Mapping[str, np.ndarray]) -> Any:
        """A memory restored from a checkpoint's arrays.

        Raises:
            ValueError: they belong to another system.
        """
        return None

    def of_samples(self, times: np.ndarray) -> dict[str, Any]:
        """What samples within the latest steps have to know of it, as arguments of ``SampleBlock.of``.

        Args:
            times: (n,), internal units.
        """
        return {}


EFFECTS: dict[str, type[Effect]] = {}
"""Effects from outside by name: where their ``of`` gives one it acts after rigidsim's own."""

E = TypeVar("E", bound=type[Effect])


def register_effect(name: str) -> Callable[[E], E]:
    """Register a class of effects (a class decorator).

    Raises:
        ValueError: the name is taken.
    """

    def register(kind: E) -> E:
        register_class(EFFECTS, name, kind, "an effect named")
        kind.registered = name
        return kind

    return register


def registered_effects(system: System, precision: Precision) -> list[Effect]:
    """The registered effects of a system, in the order in which they were registered."""
    made = [kind.of(system, precision) for kind in EFFECTS.values()]
    return [effect for effect in made if effect is not None]
