"""Is anything lost when a run is killed, the disk fills up or becomes read-only, or its files are damaged?

Question: after SIGKILL at any moment, is the folder readable, is every sample still there whose segment had
its name before the kill, and is the dataset bit for bit that of a run that nobody disturbed? The same for a
disk that fills up and for one that becomes read-only; and is every file that was truncated, flipped in a
bit, exchanged or lost recognised?

Method: each scene is run once undisturbed. Then it is begun in a child process, killed, resumed in another
child, killed again, ..., and left to finish after one to six kills. A third of the moments are uniform over
the scene's duration, a third while a temporary file is being written, a third just after a file got its
name. What was saved is noted from outside before the kill. Segments are written some hundred times as often
as usual (``FREQUENT``), to have many moments at which something can go wrong. Then: the same on a small
tmpfs (as root; else under a limit of the files' size), enlarged before each resume; on a tmpfs that is
remounted read-only (as root only) and writable again before each resume; and files of finished and
unfinished runs damaged at random places. Last, runs under a kernel that kill themselves where the integrator
stands at the edge of a block, in three precisions; a look after every step tells, and counts.

Seeded: the same kills are planned, though the machine's timing moves what they hit. Each run is told as it is
done, and the totals are printed even when time is up or the campaign is interrupted.

Run: python -m experiments.kill_campaign [--kills 300] [--full-disks 40] [--read-only 20] [--damages 400]
[--edges 30] [--seconds 1200] [--seed 1]
"""

from __future__ import annotations

import argparse
import random
import signal
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from experiments.durability.damages import damage_files
from experiments.durability.disks import fill_disks, lock_disks
from experiments.durability.edges import kill_at_edges
from experiments.durability.judging import Tally
from experiments.durability.kills import kill_runs

PARTS = {
    "kills": (kill_runs, 300, "SIGKILLs"),
    "full_disks": (fill_disks, 40, "trials, each of several full disks"),
    "read_only": (lock_disks, 20, "trials, each of several read-only disks"),
    "damages": (damage_files, 400, "files"),
    "edges": (kill_at_edges, 30, "SIGKILLs at edges of a kernel's blocks"),
}


def main(argv: Sequence[str] | None = None) -> int:
    """The campaigns; exit code 1 if anything failed, 130 if they were interrupted."""
    parser = argparse.ArgumentParser(prog="python -m experiments.kill_campaign")
    for name, (_, trials, what) in PARTS.items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=int, default=trials, help=what)
    parser.add_argument("--seconds", type=float, default=1200, help="at most, for each part, roughly")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args(argv)
    tally = Tally()
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends like Ctrl-C
    try:
        for number, (name, (part, _, what)) in enumerate(PARTS.items()):
            trials = getattr(arguments, name)
            if not trials:
                continue
            print(f"== {name}: {trials} {what}, {arguments.seconds:.0f} s at most", flush=True)
            draw = random.Random(arguments.seed + number)
            with tempfile.TemporaryDirectory(prefix="rigidsim-campaign-") as folder:
                part(tally, trials, draw, Path(folder), time.monotonic() + arguments.seconds)
    except KeyboardInterrupt:
        print("interrupted", flush=True)
        tally.print_totals()
        return 130
    tally.print_totals()
    return int(bool(tally.failures))


if __name__ == "__main__":
    raise SystemExit(main())
