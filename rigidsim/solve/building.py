"""Compiling without blocking Ctrl-C: another thread compiles, and a signal ends the wait."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeVar

_NAME = "rigidsim build"
_LOOK = 0.05  # seconds between checks
_given_up = threading.Event()

T = TypeVar("T")


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

    threading.Thread(target=build, name=_NAME, daemon=True).start()
    while not done.wait(_LOOK):  # a signal that comes just before the wait isn't heeded within it
        pass
    if failed:
        raise failed[0]
    return made[0]


def building() -> bool:
    """Whether such work is under way, even if nobody waits for it any more."""
    return any(thread.name == _NAME for thread in threading.enumerate())


def give_up() -> None:
    """Begin no more such work for the main thread until ``take_up``, since nobody would wait for it."""
    _given_up.set()


def take_up() -> None:
    """Allow such work again."""
    _given_up.clear()
