"""Calls of a batch integrator from the better of two places on the stack.

The compiled code of a step keeps hundreds of vectors on the stack, and takes it as it finds it: aligned to 16
bytes, not to a vector's 32. Where a process's stack begins is drawn by the system. In half of all processes
every second vector lies across two cache lines, and a step of eight lanes takes 1.25 times as long (2.1 us
instead of 1.7, a free body at epsilon on Zen 4), with the same bits. One call more in between moves the stack
on. Which way is faster is found from calls that have to be made anyway.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

_TRIED = 4
"""Calls each way before one is chosen."""
_LASTS = 1000
"""Calls after which the choice is made anew: from elsewhere in a program the stack may be another."""
_STEPS = 16
"""A call of fewer steps tells nothing."""


def _straight(call: Callable[[], Any]) -> Any:
    return call()


def _shifted(call: Callable[[], Any]) -> Any:
    return max(map(lambda _: call(), (None,)))  # noqa: C417 (called from C: that is the point)


class StackPlaces:
    """Calls a batch integrator whichever way is faster.

    Args:
        integrator: heyoka's.
    """

    def __init__(self, integrator: Any) -> None:
        self._integrator = integrator
        self._calls = 0
        self._least = {_straight: float("inf"), _shifted: float("inf")}
        self._better: Callable[[Callable[[], Any]], Any] = _straight

    def __call__(self, method: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        """Result of one of the integrator's methods that take steps."""
        place = self._calls % _LASTS
        self._calls += 1
        steps = partial(method, *arguments, **options)
        if place >= 2 * _TRIED:
            return self._better(steps)
        if place == 0:
            self._least = dict.fromkeys(self._least, float("inf"))
        way = _shifted if place % 2 else _straight
        began = time.perf_counter()
        found = way(steps)
        seconds = time.perf_counter() - began
        taken = max(lane[3] for lane in self._integrator.propagate_res)
        if taken < _STEPS:
            self._calls -= 1
        else:
            self._least[way] = min(self._least[way], seconds / taken)
            self._better = min(self._least, key=self._least.__getitem__)
        return found
