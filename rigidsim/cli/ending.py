"""How a command ends: its exit code, whatever it meets, and no traceback for what users are told."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable

from rigidsim.errors import RigidsimError


def exit_code(command: Callable[[], int]) -> int:
    """Of a command that returns its own; an error meant for the user is printed and has a code, too.

    Args:
        command: is called once, in this thread.
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
    """End the process at once where something is still being compiled: that can neither be waited for, which
    may take seconds, nor be going on while libraries are unloaded.
    """
    threads = sys.modules.get("rigidsim.solve.building")  # not loaded, nothing was compiled
    if threads is not None and threads.building():
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
