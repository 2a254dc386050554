"""How the process ends: at once, when nothing is left to be done.

Python takes its modules apart before it ends, and the libraries theirs: a twelfth of a short run's time, for
memory that goes back with the process anyway. What is done first is what programs rely on: everything printed
is written out, and what registered with ``atexit`` is called.
"""

from __future__ import annotations

import atexit
import os
import sys
import threading
from collections.abc import Callable


def left_at_once(program: Callable[[], None]) -> None:
    """Run a program and end the process with its exit code, the long way where other threads go on.

    Raises:
        SystemExit: the long way.
    """
    try:
        program()
    except SystemExit as ended:
        code = 0 if ended.code is None else ended.code
        if not isinstance(code, int) or threading.active_count() > 1:
            raise
        if not _written_out():
            raise
        atexit._run_exitfuncs()
        _written_out()
        os._exit(code)


def _written_out() -> bool:
    """Whether what was printed went out; not to a pipe that nobody reads, which Python has words for."""
    try:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
    except (OSError, ValueError):
        return False
    return True
