"""Runs in processes of their own, and the moments at which something happens to them."""

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import rigidsim
from experiments.durability.judging import names
from experiments.durability.scenes import tuning_of
from rigidsim.errors import RigidsimError


def child(work: Callable[[], object], log: Path) -> int:
    """Do something in a process of its own; returns its id. Its exit code is 0 when nothing was raised, that
    of the command line for what it says to users, and 9 for anything else.
    """
    pid = os.fork()
    if pid:
        return pid
    code = 9
    try:
        os.nice(5)
        with log.open("a") as file:
            os.dup2(file.fileno(), 2)
        sys.stderr = os.fdopen(2, "w", closefd=False)  # a test's capture has put something else there
        work()
        code = 0
    except RigidsimError as error:
        print(error, file=sys.stderr)
        code = error.exit_code
    except BaseException as error:
        print(repr(error), file=sys.stderr)
    finally:
        sys.stderr.flush()
        os._exit(code)


def exit_code(pid: int) -> int:
    """Wait for a child to end."""
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def work_on(folder: Path, text: str) -> Callable[[], object]:
    """Begin the run of a folder, or go on with it."""
    begun = (folder / "segments").exists() or (folder / "dataset.h5").exists()
    tuning = tuning_of(folder.name)
    if begun:
        return lambda: rigidsim.resume(folder, tuning=tuning)
    return lambda: rigidsim.run(rigidsim.parse(text), out=folder.parent, force=True, tuning=tuning)


def await_moment(pid: int, folder: Path, kind: str, delay: float, nth: int) -> bool:
    """Wait for a moment; False when the child ended before.

    Args:
        kind: "any": ``delay`` seconds from now; "writing": while the ``nth`` temporary file from now is
            written; "named": just after the ``nth`` file from now got its name.
    """
    deadline = time.monotonic() + (delay if kind == "any" else 20.0)
    seen, count = names(folder), 0
    while time.monotonic() < deadline:
        if os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT):
            return False
        if kind == "any":
            time.sleep(0.0005)
            continue
        time.sleep(0.0002)
        now = names(folder)
        new = now - seen
        seen = now
        writing = any(name.endswith(".partial") for name in new)
        named = any(not name.startswith(".") for name in new)
        if (kind == "writing" and writing) or (kind == "named" and named):
            count += 1
            if count >= nth:
                time.sleep(delay % 0.002)
                return True
    return True
