"""Compiling takes seconds in which no signal is heeded: another thread does it, and Ctrl-C ends the wait."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeVar

_NAME = "rigidsim build"

T = TypeVar("T")


def interruptible(work: Callable[[], T]) -> T:
    """Do something that leaves Python's lock free, such as compiling, and wait for it.

    In the main thread, the only one that signals reach, the work is done by another one. A signal handler
    that raises ends the wait; the work itself goes on and what it makes is lost.
    """
    if threading.current_thread() is not threading.main_thread():
        return work()
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
    done.wait()
    if failed:
        raise failed[0]
    return made[0]


def building() -> bool:
    """Whether such work is under way, be it work that nobody waits for any more."""
    return any(thread.name == _NAME for thread in threading.enumerate())
