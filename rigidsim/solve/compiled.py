"""What heyoka compiles, once in a process: what a trial or an earlier run compiled serves the next one.

What other processes compiled is found on disk (``HEYOKA_CACHE_DIR``), in a cache that is kept small here.
Even with compiled code in heyoka's own cache an engine or a function takes some 10 ms to put together, which
is more than many runs take.
"""

from __future__ import annotations

import copy
import pickle
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from threading import Lock
from typing import Any, Generic, TypeVar

import heyoka as hy

from rigidsim.solve.engine import CompiledFunction, TaylorEngine

T = TypeVar("T")

_HEYOKAS_LIMIT = 20 << 30
DISK_LIMIT = 256 << 20
"""Bytes of compiled code on disk, of some five hundred scenes. heyoka's own limit is 20 GiB; compiling takes
ten times as long when the cache has grown to a few of them."""


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
        limit_disk_cache()
        made = make()  # seconds, during which others aren't kept waiting
        with self._lock:
            self._made[key] = made
            if len(self._made) > self._most:
                self._made.popitem(last=False)
        return made


@cache
def limit_disk_cache() -> None:
    """Before anything is compiled: what wasn't used for longest leaves the cache on disk when it is full.

    A limit that somebody has set, with ``heyoka.llvm_state.set_diskcache_limit``, is left as it is.
    """
    if hy.llvm_state.get_diskcache_limit() == _HEYOKAS_LIMIT:
        hy.llvm_state.set_diskcache_limit(DISK_LIMIT)


class CodeStore:
    """Functions and engines that were compiled."""

    def __init__(self) -> None:
        self.functions: Kept[CompiledFunction] = Kept(32)
        self.engines: Kept[TaylorEngine] = Kept(8)


_stores = [CodeStore()]


@contextmanager
def kept_in(store: CodeStore) -> Iterator[None]:
    """Take compiled code from this store alone meanwhile, in all threads: for code that is compiled otherwise
    than its description tells.
    """
    _stores.append(store)
    try:
        yield
    finally:
        _stores.remove(store)


def compiled_function(
    expressions: Sequence[Any], variables: Sequence[Any], **options: Any
) -> CompiledFunction:
    """As ``heyoka.cfunc``; such functions have no state, and several threads may call the same."""
    expressions, variables = list(expressions), list(variables)
    return _stores[-1].functions.get(
        (expressions, variables, sorted(options.items())),
        lambda: hy.cfunc(expressions, variables, **options),
    )


def compiled_engine(equations: Sequence[Any], initial: Any, **options: Any) -> TaylorEngine:
    """As ``heyoka.taylor_adaptive``, without events: an engine of one's own, as if it were newly compiled."""
    made = _stores[-1].engines.get(
        (list(equations), initial, sorted(options.items())),
        lambda: hy.taylor_adaptive(list(equations), initial, **options),
    )
    return copy.deepcopy(made)
