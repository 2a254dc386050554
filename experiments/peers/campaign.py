"""Peers in turn, each in fresh processes: their points, and what is missing and why."""

import functools
import itertools
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mpmath

from experiments.peers.curves import Point, angle
from experiments.peers.scenes import SCENES

BARE, OURS = "heyoka", "rigidsim"
_SLOW = 0.3  # CPU seconds; measured in the first repeat alone


@dataclass
class Measured:
    """All points, and what there is to say about peers.

    Attributes:
        imports: CPU seconds, by peer.
        notes: why peers and settings are missing.
    """

    points: dict[tuple[Any, ...], Point] = field(default_factory=dict)
    imports: dict[str, list[float]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def of(self, scene: str, end: float, peer: str) -> list[Point]:
        """The points of a peer on one horizon of a scene."""
        return [p for p in self.points.values() if (p.scene, p.end, p.peer) == (scene, end, peer)]


def measure(
    peers: Sequence[str],
    cases: Sequence[tuple[str, float]],
    *,
    repeats: int,
    stride: int = 1,
    fill: float = 0.05,
    fewest: int = 2,
    cap: float = 10.0,
) -> Measured:
    """Run the peers in turn, each in fresh processes.

    Args:
        peers: names from ``ADAPTERS``.
        cases: pairs of scene and end.
        repeats: processes per peer.
        stride: take every n-th knob.
        fill: CPU seconds of calls per setting, the fastest of which counts.
        fewest: calls at least, but of slow ones.
        cap: CPU seconds of one call from which tighter settings of a peer are left out.

    Returns:
        What there is, after Ctrl-C as well.
    """
    truths = {case: reference(*case) for case in cases}
    measured = Measured()
    slow: set[tuple[Any, ...]] = set()
    for number, peer in itertools.product(range(repeats), peers):
        if number and peer not in measured.imports:
            continue
        skip = [key[1:] for key in slow if key[0] == peer]
        request = {"cases": list(cases), "skip": skip, "stride": stride, "cap": cap}
        request |= {"fill": fill, "fewest": fewest}
        print(f"repeat {number + 1} of {repeats}: {peer}", file=sys.stderr, flush=True)
        try:
            records = _child(peer, request)
        except KeyboardInterrupt:
            measured.notes.append(f"interrupted in repeat {number + 1} of {repeats}, at {peer}")
            break
        for record in records:
            _note(measured, peer, record, truths, slow)
    return measured


def _child(peer: str, request: dict[str, Any]) -> list[dict[str, Any]]:
    root = Path(__file__).parents[2]
    command = [sys.executable, "-m", "experiments.peers.child", peer, json.dumps(request)]
    single = os.environ | {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}  # seconds are all of the work
    done = subprocess.run(command, capture_output=True, text=True, cwd=root, env=single)
    records = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode:
        reason = done.stderr.strip().splitlines()[-1:] or [f"exit code {done.returncode}"]
        records.append({"broke": reason[0]})
    return records


def _note(
    measured: Measured, peer: str, record: dict[str, Any], truths: dict[Any, Any], slow: set[tuple[Any, ...]]
) -> None:
    note = ""
    if "absent" in record:
        note = f"{peer} left out: {record['absent']}; install it with pip install 'rigidsim[peers]'"
    elif "broke" in record:
        note = f"{peer} broke down: {record['broke']}"
    elif "import_seconds" in record:
        measured.imports.setdefault(peer, []).append(record["import_seconds"])
    elif "refused" in record:
        what = " ".join(record["refused"].split())
        note = f"{peer}, {record['variant']} on {record['scene']}: {what}"
    else:
        case = record["scene"], record["end"]
        key = (peer, *case, record["variant"], record["knob"])
        if key not in measured.points:
            error = angle(record["quaternion"], truths[case])
            measured.points[key] = Point(peer, record["title"], *case, record["knob"], error)
        measured.points[key].seconds.append(record["seconds"])
        if record["whole"] > _SLOW and peer not in (BARE, OURS):
            slow.add(key)
    if note and note not in measured.notes:
        measured.notes.append(note)


@functools.cache
def reference(name: str, end: float) -> list[Any]:
    """The final quaternion by heyoka in 128-bit arithmetic, tolerance 1e-32."""
    from experiments.peers.bare_heyoka import reference as integrated

    with mpmath.workdps(50):
        return [mpmath.fsum(parts) for parts in integrated(SCENES[name], end)]
