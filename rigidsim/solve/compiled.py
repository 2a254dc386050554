"""What heyoka compiles, once in a process: what a trial or an earlier run compiled serves the next one.

Even with compiled code in heyoka's own cache an engine or a function takes some 10 ms to put together, which
is more than many runs take.
"""

from __future__ import annotations

import copy
import pickle
from collections import OrderedDict
from collections.abc import Callable, Sequence
from threading import Lock
from typing import Any, Generic, TypeVar

import heyoka as hy

from rigidsim.solve.engine import CompiledFunction, Integrator

T = TypeVar("T")


class Kept(Generic[T]):
    """The latest things that were made of the same description.

    Args:
        most: how many are kept.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._made: OrderedDict[bytes, T] = OrderedDict()
        self._lock = Lock()

    def get(self, description: object, make: Callable[[], T]) -> T:
        """What was made of this description, or what is made now.

        Args:
            description: all that it depends on. It is compared by its serialised bytes, since expressions
                that count as equal can differ in the sign of a zero.
        """
        key = pickle.dumps(description)
        with self._lock:
            if key in self._made:
                self._made.move_to_end(key)
                return self._made[key]
        made = make()  # seconds, during which others aren't kept waiting
        with self._lock:
            self._made[key] = made
            if len(self._made) > self._most:
                self._made.popitem(last=False)
        return made


_functions: Kept[CompiledFunction] = Kept(32)
_engines: Kept[Integrator] = Kept(8)


def compiled_function(
    expressions: Sequence[Any], variables: Sequence[Any], **options: Any
) -> CompiledFunction:
    """As ``heyoka.cfunc``; such functions have no state, and several threads may call the same."""
    expressions, variables = list(expressions), list(variables)
    return _functions.get(
        (expressions, variables, sorted(options.items())),
        lambda: hy.cfunc(expressions, variables, **options),
    )


def compiled_engine(equations: Sequence[Any], initial: Any, **options: Any) -> Integrator:
    """As ``heyoka.taylor_adaptive``, without events: an engine of one's own, as if it were newly compiled."""
    made = _engines.get(
        (list(equations), initial, sorted(options.items())),
        lambda: hy.taylor_adaptive(list(equations), initial, **options),
    )
    return copy.deepcopy(made)
