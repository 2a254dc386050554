"""Fresh processes, timed: what a command costs as a whole, or what it says of its own work."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[2]
SCRIPT = str(ROOT / "experiments" / "bare" / "free_body.py")
Figures = dict[str, float]
"""``cpu`` and ``wall`` seconds; ``peak``, MB of memory."""


def told(arguments: Sequence[str]) -> Figures:
    """What a Python process says of itself in its last line, JSON.

    Args:
        arguments: of the interpreter.

    Raises:
        RuntimeError: it failed.
    """
    done = subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, cwd=ROOT, env=environment(), check=False
    )
    if done.returncode:
        raise RuntimeError(f"{' '.join(arguments)}: {done.stderr.strip()[-500:]}")
    found: Figures = json.loads(done.stdout.splitlines()[-1])
    return found


def whole(arguments: Sequence[str]) -> Figures:
    """What a Python process takes from its start to its end.

    Args:
        arguments: of the interpreter.

    Raises:
        RuntimeError: it failed.
    """
    began = time.perf_counter()
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(
            [sys.executable, *arguments], stdout=said, stderr=said, cwd=ROOT, env=environment()
        )
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            said.seek(0)
            raise RuntimeError(f"{' '.join(arguments)}: {said.read().decode()[-500:]}")
    wall = time.perf_counter() - began
    return {"cpu": used.ru_utime + used.ru_stime, "wall": wall, "peak": used.ru_maxrss / 1024}


def environment() -> dict[str, str]:
    """This process's own, with this code found first, and modules compiled once as in an installation."""
    given = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    path = os.pathsep.join([str(ROOT), *filter(None, [given.get("PYTHONPATH")])])
    return given | {"PYTHONPATH": path}
