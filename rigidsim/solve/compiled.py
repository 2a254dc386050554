"""What heyoka compiles: kept for its next use, made without blocking Ctrl-C, and evaluated row by row.

Code compiled for a trial or an earlier run in this process is reused; code of other processes is found on
disk (``HEYOKA_CACHE_DIR``), in a cache that is kept small here. Even from heyoka's own cache, an engine or a
function takes some 10 ms to assemble, which is more than many runs take.
"""

import copy
import pickle
import threading
import warnings
from collections import OrderedDict
from collections.abc import Callable, Sequence
from functools import cache
from threading import Lock
from typing import Any, Generic, TypeVar

import heyoka as hy
import numpy as np

T = TypeVar("T")

_BUILD = "rigidsim build"  # name of threads
_LOOK = 0.05  # seconds between checks
_GROUP = 64  # rows; a multiple of every SIMD width
_given_up = threading.Event()

_HEYOKAS_LIMIT = 20 << 30
DISK_LIMIT = 256 << 20
"""Largest size of compiled code on disk (bytes), enough for some five hundred scenes. heyoka's own limit is
20 GiB; compiling takes ten times as long when the cache has grown to a few of them.
"""


CompiledFunction = Any
"""What ``heyoka.cfunc`` returns: from inputs (k,) or (k, n) to outputs, in its own precision."""
TaylorEngine = Any
"""What ``heyoka.taylor_adaptive`` returns; times and states in internal units."""


class Kept(Generic[T]):
    """Cache of the latest objects made, by the description they were made from."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._made: OrderedDict[bytes, T] = OrderedDict()
        self._lock = Lock()

    def get(self, description: object, make: Callable[[], T]) -> T:
        """The object made earlier from this description of everything it depends on, or a new one. It is
        compared by its serialised bytes, since expressions that count as equal can differ in the sign of a
        zero.
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
def quieten_engine() -> None:
    """In processes that are rigidsim's own, commands and workers: the engine warns on stdout of roots that it
    loses, which switching steppers look for themselves.
    """
    hy.set_logger_level_error()


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


FUNCTIONS: Kept[CompiledFunction] = Kept(64)
ENGINES: Kept[TaylorEngine] = Kept(8)
"""Those compiled so far."""


def compiled_function(
    expressions: Sequence[Any], variables: Sequence[Any], **options: Any
) -> CompiledFunction:
    """Like ``heyoka.cfunc``, but cached; the functions have no state and may be called by several threads."""
    expressions, variables = list(expressions), list(variables)
    return FUNCTIONS.get(
        (expressions, variables, sorted(options.items())),
        lambda: hy.cfunc(expressions, variables, **options),
    )


def compiled_engine(equations: Sequence[Any], initial: Any, **options: Any) -> TaylorEngine:
    """Like ``heyoka.taylor_adaptive``, but cached where there are no events; each caller gets a copy."""
    options = {name: x for name, x in options.items() if not (name.endswith("events") and not x)}
    if "t_events" in options or "nt_events" in options:
        return hy.taylor_adaptive(list(equations), initial, **options)
    made = ENGINES.get(
        (list(equations), initial, sorted(options.items())),
        lambda: hy.taylor_adaptive(list(equations), initial, **options),
    )
    return copy.deepcopy(made)


def interruptible(work: Callable[[], T]) -> T:
    """Run work that releases Python's lock, such as compiling, and wait for it interruptibly.

    In the main thread, the only one that signals reach, another thread does the work. A signal handler that
    raises ends the wait; the work itself goes on and its result is lost.

    Raises:
        KeyboardInterrupt: after ``give_up``, before any work begins.
    """
    if threading.current_thread() is not threading.main_thread():
        return work()
    if _given_up.is_set():
        raise KeyboardInterrupt
    made: list[T] = []
    failed: list[BaseException] = []
    done = threading.Event()

    def build() -> None:
        try:
            made.append(work())
        except BaseException as error:
            failed.append(error)
        finally:
            done.set()

    threading.Thread(target=build, name=_BUILD, daemon=True).start()
    while not done.wait(_LOOK):  # a signal that comes just before the wait isn't heeded within it
        pass
    if failed:
        raise failed[0]
    return made[0]


def building() -> bool:
    """Whether such work is under way, even if nobody waits for it any more."""
    return any(thread.name == _BUILD for thread in threading.enumerate())


def give_up() -> None:
    """Begin no more such work for the main thread until ``take_up``, since nobody would wait for it."""
    _given_up.set()


def take_up() -> None:
    """Allow such work again."""
    _given_up.clear()


def evaluate_rows(
    function: CompiledFunction,
    states: np.ndarray,
    constants: np.ndarray | None = None,
    times: np.ndarray | None = None,
) -> np.ndarray:
    """Values (outputs, n) of a compiled function at each row of states (n, states).

    In single and double precision heyoka takes rows several at a time and the rest one by one, which differs
    in the last bit. Rows are padded to whole groups there, so that a row's bits don't depend on the block
    that it came in.

    Args:
        constants: the function's parameters, (k,) for all rows or (k, n).
        times: (n,), internal units, where the function may depend on them.
    """
    count = len(states)
    group = _GROUP if states.dtype in (np.float32, np.float64) else 1
    padded = -(-count // group) * group
    # compiled expressions without parameters don't accept an array of them
    arguments = {}
    if times is not None and function.is_time_dependent:
        arguments["time"] = _padded(np.asarray(times, dtype=states.dtype), padded)
    if constants is not None:
        table = np.repeat(constants[:, None], padded, axis=1) if constants.ndim == 1 else constants
        arguments["pars"] = _padded(table, padded)
    return np.asarray(function(_padded(states.T, padded), **arguments))[:, :count]


def _padded(values: np.ndarray, count: int) -> np.ndarray:
    """An array, contiguous, whose last axis is filled up to a length with its last value."""
    given = values.shape[-1]
    if given == count:
        return np.ascontiguousarray(values)
    filled = np.empty((*values.shape[:-1], count), dtype=values.dtype)
    filled[..., :given] = values
    filled[..., given:] = values[..., -1:]
    return filled
