"""Is anything lost when a run is killed, the disk fills up or becomes read-only, or its files are damaged?

Each scene is run once undisturbed; then it is begun in a child process, killed by SIGKILL (a third at any
moment, a third while a temporary file is written, a third just after a file got its name), and resumed, one
to six times. Segments are written some hundred times as often as usual. What was saved is noted from
outside before the kill: it has to be there afterwards, and the dataset has to be bit for bit the
undisturbed one. The same on a small tmpfs (without root under a limit of file sizes) that is enlarged
before each resume, on one that is remounted read-only (as root), with files damaged at random places, and
in runs under a kernel that kill themselves at the edge of a block.

Run: python -m experiments.kill_campaign [--kills 300] [--full-disks 40] [--read-only 20] [--damages 400]
[--edges 30] [--seconds 1200] [--seed 1]
"""

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
