"""The process ends at once, and nothing that was to be done is left out."""

from __future__ import annotations

import subprocess
import sys

import pytest


def ended(program: str) -> subprocess.CompletedProcess[str]:
    code = f"import atexit, sys, threading, time\nfrom rigidsim.cli.ending import left_at_once\n{program}"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(("code", "expected"), [("None", 0), ("3", 3), ("130", 130)])
def test_what_was_printed_and_registered_is_done(code: str, expected: int) -> None:
    done = ended(
        "atexit.register(print, 'registered')\n"
        "class Remains:\n    def __del__(self): print('taken apart')\n"
        "remains = Remains()\n"
        f"def program():\n    print('x' * 100_000)\n    sys.exit({code})\n"
        "left_at_once(program)"
    )
    assert (done.returncode, done.stderr) == (expected, "")
    assert done.stdout == "x" * 100_000 + "\nregistered\n"  # and nothing was taken apart


def test_other_threads_are_waited_for() -> None:
    done = ended(
        "def work():\n    time.sleep(0.3); print('worked')\n"
        "def program():\n    threading.Thread(target=work).start(); sys.exit(2)\n"
        "left_at_once(program)"
    )
    assert (done.returncode, done.stdout, done.stderr) == (2, "worked\n", "")


def test_messages_for_an_exit_and_errors_go_the_long_way() -> None:
    said = ended("def program(): sys.exit('no')\nleft_at_once(program)")
    assert (said.returncode, said.stderr) == (1, "no\n")
    broke = ended("def program(): raise KeyError('oops')\nleft_at_once(program)")
    assert broke.returncode == 1
    assert "KeyError: 'oops'" in broke.stderr
