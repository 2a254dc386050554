"""Is anything lost when runs and sweeps are killed, disks fill up or become read-only, or files are damaged?

Each scene is run once undisturbed; then it is begun in a child process, killed by SIGKILL (a third at any
moment, a third while a temporary file is written, a third just after a file got its name), and resumed, one
to six times. Segments are written some hundred times as often as usual. What was saved is noted from
outside before the kill: it has to be there afterwards, and the dataset has to be bit for bit the
undisturbed one. The same on a small tmpfs (without root under a limit of file sizes) that is enlarged
before each resume, on one that is remounted read-only (as root), with files damaged at random places, in
runs under a kernel that kill themselves at the edge of a block, and in sweeps (``durability.sweeps``).

Run: python -m experiments.kill_campaign [--kills 300] [--full-disks 40] [--read-only 20] [--damages 400]
[--edges 30] [--sweeps 100] [--seconds 1200] [--seed 1]
``--seconds`` is about the most that each part takes. Exit code 1 if anything failed, 130 if interrupted.
"""

import random
import signal
import tempfile
import time
from pathlib import Path

from experiments.common import Command
from experiments.durability.damages import damage_files
from experiments.durability.disks import fill_disks, lock_disks
from experiments.durability.edges import kill_at_edges
from experiments.durability.judging import Tally
from experiments.durability.kills import kill_runs
from experiments.durability.sweeps import disturb_sweeps


@Command
def campaign(
    kills: int = 300,
    full_disks: int = 40,
    read_only: int = 20,
    damages: int = 400,
    edges: int = 30,
    sweeps: int = 100,
    seconds: float = 1200.0,
    seed: int = 1,
) -> int:
    """All parts in turn; kinds of trials, and how many."""
    parts = {
        "SIGKILLs": (kill_runs, kills),
        "trials, each of several full disks": (fill_disks, full_disks),
        "trials, each of several read-only disks": (lock_disks, read_only),
        "damaged files": (damage_files, damages),
        "SIGKILLs at edges of a kernel's blocks": (kill_at_edges, edges),
        "disturbances of sweeps": (disturb_sweeps, sweeps),
    }
    tally = Tally()
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends like Ctrl-C
    try:
        for number, (what, (part, trials)) in enumerate(parts.items()):
            if trials:
                print(f"== {trials} {what}, {seconds:.0f} s at most", flush=True)
                with tempfile.TemporaryDirectory(prefix="rigidsim-campaign-") as folder:
                    end = time.monotonic() + seconds
                    part(tally, trials, random.Random(seed + number), Path(folder), end)
    except KeyboardInterrupt:
        print("interrupted", flush=True)
        return 130
    finally:
        tally.print_totals()
    return int(bool(tally.failures))
