"""What does a labelled, resumable map of many spins cost beside a bare script, and is each cell what it
says?

Question: ``configs/sweeps/hyperion_map.toml`` with many more cells (angle by rate, 100 orbits each, MEGNO
at a tolerance of 1e-9, final state kept), against ``experiments/bare/spin_orbit_map.py``: heyoka's batch
integrator, the same motion, tangent vector, samples and width, and no labels, files, checks or energy
balance.

Method: both as whole processes in turn, wall and CPU time of all their processes, and the largest memory
of any of them. Then cells drawn at random are run again, each by itself in a batch of the same width,
without its neighbours and in another place; everything that is kept of it has to have the same bits.

Held against: at most 1.3 times the bare script's wall time (for maps of 250,000 cells or more: some
seconds go into looking at the config before anything runs); all bits the same; the regular share of the
bare map (MEGNO below 3), to 2 % of the cells, since chaotic motions are those of their roundings; spins
above 2.7 n, which are regular (Wisdom, Peale & Mignard 1984, fig. 2).

Run: python -m experiments.spin_orbit_map [--cells 16384] [--workers 2] [--again 1000] [--rounds 1]
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

if not __package__:  # as a script
    sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from experiments.common import Check, table
from rigidsim.store.sweeps.run import open_sweep
from rigidsim.workflows.sweeps.verify import verify_sweep

CONFIG = Path(__file__).parents[1] / "configs" / "sweeps" / "hyperion_map.toml"
BARE = Path(__file__).parent / "bare" / "spin_orbit_map.py"
NAME = "hyperion_map"
KEEP = ("megno", "final")
REGULAR = 3.0
"""MEGNO below which a motion counts as regular after 100 orbits: 2, and what its oscillation adds."""
_MOST_RATIO = 1.3  # asked of this project
_MANY = 250_000
_DIFFERENT_SHARE = 0.02


def settings(side: int) -> list[str]:
    """What makes the ready map one of side by side cells."""
    axes = 'sweep.axes."initial.{}".linspace=[0, {}, {}]'
    return [
        axes.format("euler_angles[2]", "3.141592653589793", side),
        axes.format("angular_velocity[2]", "3", side),
        f"sweep.keep={json.dumps(KEEP)}",
    ]


def measured(command: Sequence[str]) -> tuple[dict[str, float], str]:
    """Wall seconds, CPU seconds of it and its children, largest resident memory of any; its output."""
    report = (
        "import json,resource,subprocess,sys,time\n"
        "began = time.perf_counter()\n"
        "done = subprocess.run(sys.argv[1:], stdout=subprocess.PIPE, text=True, check=True)\n"
        "wall = time.perf_counter() - began\n"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "told = dict(wall=wall, cpu=used.ru_utime + used.ru_stime, megabytes=used.ru_maxrss / 1024)\n"
        "print(json.dumps([told, done.stdout]))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", report, *command], stdout=subprocess.PIPE, text=True, check=True
    )
    told, output = json.loads(done.stdout.splitlines()[-1])
    return told, output


def once(side: int, workers: int, out: Path) -> tuple[dict[str, float], dict[str, float], dict[str, Any]]:
    """Both, in turn: what the sweep took, what the bare script took, and what that found."""
    command = [sys.executable, "-m", "rigidsim", "sweep", str(CONFIG), "--out", str(out), "--force"]
    command += ["--workers", str(workers)]
    for setting in settings(side):
        command += ["--set", setting]
    ours, _ = measured(command)
    orbits, samples = 100, 501
    numbers = [str(x) for x in (side, side, orbits, samples, workers)]
    bare, told = measured([sys.executable, str(BARE), *numbers])
    return ours, bare, json.loads(told)


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, check, print; exit code 1 if a check failed."""
    parser = argparse.ArgumentParser(prog="python -m experiments.spin_orbit_map")
    parser.add_argument("--cells", type=int, default=16384, help="a square number of them is taken")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--again", type=int, default=1000, help="cells that are run again")
    parser.add_argument("--rounds", type=int, default=1, help="of both in turn; medians are told")
    parser.add_argument("--out", type=Path, help="folder that keeps the map; none by default")
    arguments = parser.parse_args(argv)
    with tempfile.TemporaryDirectory(prefix="rigidsim-map-") as temporary:
        checks = compared(arguments, arguments.out or Path(temporary))
    print(table(checks, "spin_orbit_map"))
    return int(not all(check.passed for check in checks))


def compared(arguments: argparse.Namespace, out: Path) -> list[Check]:
    """Both sides, then cells again."""
    side = math.isqrt(arguments.cells)
    rounds = [once(side, arguments.workers, out) for _ in range(arguments.rounds)]
    for ours, bare, _ in rounds:
        print(f"rigidsim {json.dumps(ours)}  bare {json.dumps(bare)}", flush=True)
    ratios = {what: float(np.median([ours[what] / bare[what] for ours, bare, _ in rounds]))
              for what in ("wall", "cpu")}  # fmt: skip
    saved = open_sweep(out / NAME)
    began = time.process_time()
    verdict = verify_sweep(out / NAME, members=arguments.again, seed=1, together=1)
    seconds = time.process_time() - began
    print(f"{side}x{side} cells; wall ratio {ratios['wall']:.3f}, CPU {ratios['cpu']:.3f}")
    print(f"{verdict.samples} cells again in {seconds:.1f} s CPU; first difference: {verdict.difference}")
    different = len(verdict.differing)
    megno = saved.dataset.megno.values
    regular = float((megno < REGULAR).mean())
    rates = saved.dataset["rate"].values
    checks = [
        Check("variables of other bits, cells run again", different, 0, 0.5, "1", "none may", "absolute"),
        Check("regular share of the map", regular, rounds[-1][2]["regular"], _DIFFERENT_SHARE, "1",
              "bare script; chaotic cells near the shore of an island", "absolute"),
        Check("regular share at rates above 2.7", float((megno[:, rates > 2.7] < REGULAR).mean()), 1.0,
              _DIFFERENT_SHARE, "1", "Wisdom, Peale & Mignard 1984, fig. 2", "absolute"),
    ]  # fmt: skip
    if side * side >= _MANY:
        asked = "asked of a map of a million"
        checks.append(
            Check(
                "wall time over the bare script's", ratios["wall"], 1, _MOST_RATIO - 1, "1", asked, "absolute"
            )
        )
    return checks


if __name__ == "__main__":
    sys.exit(main())
