"""Cache of what heyoka compiles: code compiled for a trial or an earlier run in this process is reused.

Code compiled by other processes is found on disk (``HEYOKA_CACHE_DIR``), in a cache that is kept small here.
Even with compiled code in heyoka's own cache, an engine or a function takes some 10 ms to assemble, which
is more than many runs take.
"""

from __future__ import annotations

import copy
import pickle
import warnings
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
"""Largest size of compiled code on disk (bytes), enough for some five hundred scenes. heyoka's own limit is
20 GiB; compiling takes ten times as long when the cache has grown to a few of them.
"""


class Kept(Generic[T]):
    """Cache of the latest objects made, by the description they were made from.

    Args:
        most: how many are kept.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._made: OrderedDict[bytes, T] = OrderedDict()
        self._lock = Lock()

    def get(self, description: object, make: Callable[[], T]) -> T:
        """The object made earlier from this description, or a new one.

        Args:
            description: everything that the object depends on. It is compared by its serialised bytes, since
                expressions that count as equal can differ in the sign of a zero.
        """
        key = pickle.dumps(description)
        with self._lock:
            if key in self._made:
                self._made.move_to_end(key)
                return self._made[key]
        limit_disk_cache()
        made = make()  # seconds, during which others needn't wait
        with self._lock:
            self._made[key] = made
            if len(self._made) > self._most:
                self._made.popitem(last=False)
        return made


@cache
def limit_disk_cache() -> None:
    """Limit heyoka's cache on disk before anything is compiled; the least recently used code is dropped when
    it is full.

    A limit that somebody has set, with ``heyoka.llvm_state.set_diskcache_limit``, is left as it is. Where the
    cache can't be used, on a full disk for instance, compiled code isn't kept.
    """
    try:
        if hy.llvm_state.get_diskcache_limit() == _HEYOKAS_LIMIT:
            hy.llvm_state.set_diskcache_limit(DISK_LIMIT)
    except RuntimeError as error:
        hy.llvm_state.set_diskcache_enabled(False)
        warnings.warn(f"compiled code isn't kept for the next process: {error}", RuntimeWarning, stacklevel=3)


class CodeStore:
    """Functions and engines compiled so far."""

    def __init__(self) -> None:
        self.functions: Kept[CompiledFunction] = Kept(32)
        self.engines: Kept[TaylorEngine] = Kept(8)


_stores = [CodeStore()]


@contextmanager
def kept_in(store: CodeStore) -> Iterator[None]:
    """Use only this store of compiled code inside the block, in all threads: for code compiled otherwise than
    its description tells.
    """
    _stores.append(store)
    try:
        yield
    finally:
        _stores.remove(store)


def compiled_function(
    expressions: Sequence[Any], variables: Sequence[Any], **options: Any
) -> CompiledFunction:
    """Like ``heyoka.cfunc``, but cached; the functions have no state and may be called by several threads."""
    expressions, variables = list(expressions), list(variables)
    return _stores[-1].functions.get(
        (expressions, variables, sorted(options.items())),
        lambda: hy.cfunc(expressions, variables, **options),
    )


def compiled_engine(equations: Sequence[Any], initial: Any, **options: Any) -> TaylorEngine:
    """Like ``heyoka.taylor_adaptive`` without events, but cached: the caller gets an engine of its own, as if
    newly compiled.
    """
    made = _stores[-1].engines.get(
        (list(equations), initial, sorted(options.items())),
        lambda: hy.taylor_adaptive(list(equations), initial, **options),
    )
    return copy.deepcopy(made)
