"""How a command ends: its exit code, errors for the user, interruptions, and builds that are under way."""

import os
import signal
import sys
from collections.abc import Callable

from rigidsim.errors import RigidsimError, Wording


def refuse_options(what: str, **given: object) -> None:
    """Refuse options that were given where they don't apply, rather than ignore them.

    Args:
        what: what they are for, and what was given instead.
        given: values by the options' names; None, False and nothing at all count as not given.
    """
    named = [f"--{name.replace('_', '-')}" for name, value in given.items() if value not in (None, False, [])]
    if named:
        raise RigidsimError(f"{', '.join(named)}: {what}; leave {'it' if len(named) == 1 else 'them'} out")


def exit_code(command: Callable[[], int]) -> int:
    """Run a command that returns its exit code; an error meant for the user is printed and has one, too."""
    # SIGTERM ends like Ctrl-C, and so does SIGINT where a script's background job starts with it ignored:
    # later on the run itself heeds both, and one that comes before that mustn't be lost
    ending = (signal.SIGINT, signal.SIGTERM)
    before = {number: signal.signal(number, signal.default_int_handler) for number in ending}
    try:
        with Wording.of_commands():
            code = command()
    except RigidsimError as error:
        print(f"rigidsim: {error}", file=sys.stderr)
        return error.exit_code
    except BrokenPipeError:
        sys.stderr.close()
        return 0
    except (KeyboardInterrupt, ImportError) as error:
        if not _is_interruption(error):
            raise
        print("rigidsim: interrupted", file=sys.stderr)
        _leave_builds(130)
        return 130
    else:
        _leave_builds(code)  # of a run that was interrupted, and saved meanwhile
        return code
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _is_interruption(error: BaseException | None) -> bool:
    """Whether it comes from Ctrl-C, which libraries make an ImportError of while they are loaded."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _leave_builds(code: int) -> None:
    """End the process at once if something is still being compiled: it can't be waited for (it may take
    seconds, and Ctrl-C promises half a second), and the usual way of ending would unload the compiler's own
    library beneath it.
    """
    threads = sys.modules.get("rigidsim.solve.compiled")  # not loaded, nothing was compiled
    if threads is not None and threads.building():
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
