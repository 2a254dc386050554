"""End of a command and of its process: the exit code in every case, and no traceback for errors users are
told.

Python takes its modules apart before its process ends, and the libraries theirs: a twelfth of a short run's
time, for memory that goes back with the process anyway. So the process is left at once, after what programs
rely on: everything printed is written out, and what registered with ``atexit`` is called.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
from collections.abc import Callable

from rigidsim.errors import RigidsimError


def exit_code(command: Callable[[], int]) -> int:
    """Run a command that returns its exit code; an error meant for the user is printed and has a code, too.

    Args:
        command: called once, in this thread.
    """
    # SIGTERM ends like Ctrl-C, and so does SIGINT where a script's background job starts with it ignored:
    # later on the run itself heeds both, and one that comes before that mustn't be lost
    ending = (signal.SIGINT, signal.SIGTERM)
    before = {number: signal.signal(number, signal.default_int_handler) for number in ending}
    try:
        code = command()
    except RigidsimError as error:
        print(f"rigidsim: {error.for_command_line()}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("rigidsim: interrupted", file=sys.stderr)
        _leave_builds(130)
        return 130
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    else:
        _leave_builds(code)  # of a run that was interrupted, and saved meanwhile
        return code
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _leave_builds(code: int) -> None:
    """End the process at once if something is still being compiled, which can neither be waited for (it may
    take seconds) nor go on while libraries are unloaded.
    """
    threads = sys.modules.get("rigidsim.solve.building")  # not loaded, nothing was compiled
    if threads is not None and threads.building():
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def left_at_once(program: Callable[[], None]) -> None:
    """Run a program and end the process with its exit code; in the usual way if other threads are running.

    Raises:
        SystemExit: the usual way.
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
    """Whether everything printed was written out; not to a pipe that nobody reads, which Python reports."""
    try:
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
    except (OSError, ValueError):
        return False
    return True
