"""What does it cost that nothing is lost, and does memory stay flat however long a run is?

Question: a free asymmetric body in double precision.
  cost: CPU of a run that writes segments, checkpoints and a sealed dataset, over the CPU of the same steps
  and evaluations with everything that is written left out (allowed for a long sparse run: 1.05; the dense
  figure is for information: there writing is what the run is for). Sparse: 1001 samples over 1e6 s and
  more, segments at their usual pace. Dense: a sample every 0.05 s.
  memory: the largest resident set of a process that runs 1e6 to 1e8 samples (with timeline), and 1e6 to 1e9
  steps (allowed: 10 % more than the shortest of each). Samples are in memory until a segment of 16 MB, and
  of the dataset the timeline reads every n-th row, so that longer runs keep nothing more.

Method: cost: within one process, with and without in turn, medians of CPU seconds (the same compiled code
and memory; ratios of processes differ by more than what is measured). Memory: fresh processes,
``ru_maxrss``; each case is told when it is done, and one that fails leaves the others. 1e8 samples take 20
GB of disk and a quarter of an hour, 1e9 steps as long.

Run: python -m experiments.durability_cost [--pairs 5] [--what cost|memory] [--full] [--scratch DIR]
"""

from __future__ import annotations

import argparse
import contextlib
import json
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from typing import Any
from unittest import mock

CONFIG = """
name = "durability"
[body]
principal_moments = [1, 2, 2.5]
[initial]
angular_velocity = [0.1, 1.0, 0.05]
[time]
end = {end}
samples = {samples}
[output]
timeline = {timeline}
timeline_rows = 20000
"""
COSTS = {"sparse": (2e6, 1001), "dense": (2e4, 400_001)}
# kind: (name, end, samples), the shortest first; a second takes 2 steps
MEMORY = {
    "steps": [
        ("1e6 steps", 5e5, 101),
        ("1e7 steps", 5e6, 101),
        ("1e8 steps", 5e7, 101),
        ("1e9 steps", 5e8, 101),
    ],
    "samples": [
        ("1e6 samples", 5e4, 10**6 + 1),
        ("3e6 samples", 1.5e5, 3 * 10**6 + 1),
        ("1e7 samples", 5e5, 10**7 + 1),
        ("1e8 samples", 5e6, 10**8 + 1),
    ],
}
_SHORT = 2  # of each kind, without --full
_BYTES_PER_SAMPLE = 220  # of disk at its fullest: all segments, and the dataset beside them
_GROWTH = 1.1


@contextlib.contextmanager
def nothing_written() -> Iterator[None]:
    """Samples are evaluated and watched, and then forgotten."""
    from rigidsim.store.segments import SegmentWriter

    def forget(*_: Any, **__: Any) -> int:
        return 0

    with mock.patch.multiple(SegmentWriter, add=forget, flush=forget, complete=forget, due=False):
        yield


def cpu(case: str, *, writing: bool) -> float:
    """CPU seconds of one run."""
    import rigidsim

    end, samples = COSTS[case]
    experiment = rigidsim.parse(CONFIG.format(end=end, samples=samples, timeline="false"))
    with tempfile.TemporaryDirectory() as folder:
        started = time.process_time()
        with contextlib.nullcontext() if writing else nothing_written():
            rigidsim.run(experiment, out=folder)
        return time.process_time() - started


def cost(pairs: int) -> dict[str, Any]:
    """Ratios of CPU seconds, pair by pair."""
    found: dict[str, Any] = {}
    for case in COSTS:
        cpu(case, writing=True)  # compiles
        ratios, seconds = [], []
        for pair in range(pairs):
            first = bool(pair % 2)
            times = {writing: cpu(case, writing=writing) for writing in (first, not first)}
            ratios.append(times[True] / times[False])
            seconds.append(times[False])
        found[case] = {
            "ratio": statistics.median(ratios),
            "all": [round(r, 3) for r in sorted(ratios)],
            "seconds": statistics.median(seconds),
        }
        print(f"{case}: {found[case]}", flush=True)
    return found


def memory(full: bool, scratch: str | None) -> bool:
    """Megabytes of a fresh process for each run; whether all ran, and none took more than it may."""
    good = True
    for cases in MEMORY.values():
        least: float | None = None
        for name, end, samples in cases if full else cases[:_SHORT]:
            started = time.monotonic()
            found = measured(end, samples, scratch)
            took = f"{time.monotonic() - started:.0f} s"
            if isinstance(found, str):
                good = False
                print(f"{name}: FAILED after {took}: {found}", flush=True)
                continue
            least = least or found
            within = found <= _GROWTH * least
            good = good and within
            growth = f"{100 * (found / least - 1):+.1f} %{'' if within else ', MORE THAN PROMISED'}"
            print(f"{name}: {found:.0f} MB ({growth}), {took}", flush=True)
    return good


def measured(end: float, samples: int, scratch: str | None) -> float | str:
    """Megabytes of a fresh process that makes one run, or what went wrong."""
    room, needed = shutil.disk_usage(scratch or tempfile.gettempdir()).free, _BYTES_PER_SAMPLE * samples
    if room < needed:
        return f"needs {needed / 1e9:.0f} GB of disk, of which {room / 1e9:.0f} are free; give --scratch DIR"
    command = [
        sys.executable,
        "-m",
        "experiments.durability_cost",
        "--one",
        json.dumps([end, samples, scratch]),
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        return f"exit code {done.returncode}: {done.stderr.strip()[-300:]}"
    return float(done.stdout)


def one(end: float, samples: int, scratch: str | None) -> None:
    """A run; prints its process's largest resident set, MB."""
    import rigidsim

    with tempfile.TemporaryDirectory(dir=scratch) as folder:
        run = rigidsim.run(
            rigidsim.parse(CONFIG.format(end=end, samples=samples, timeline="true")), out=folder
        )
        assert run.status == "finished"
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


def main() -> int:
    """Exit code 1 if a long sparse run costs more than 5 %, or memory grows by more than 10 %."""
    parser = argparse.ArgumentParser(prog="python -m experiments.durability_cost")
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--what", choices=["cost", "memory"])
    parser.add_argument("--full", action="store_true", help="to 1e8 samples and 1e9 steps; else 3e6 and 1e7")
    parser.add_argument("--scratch", metavar="DIR", help="where the runs for memory are written")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        one(*json.loads(arguments.one))
        return 0
    good = True
    if arguments.what != "memory":
        good &= cost(arguments.pairs)["sparse"]["ratio"] <= 1.05
    if arguments.what != "cost":
        good &= memory(arguments.full, arguments.scratch)
    print("as promised" if good else "MORE THAN PROMISED")
    return int(not good)


if __name__ == "__main__":
    raise SystemExit(main())
