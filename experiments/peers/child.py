"""One peer in a process of its own: every scene, variant and knob, timed; a JSON line at a time on stdout.

Run by ``experiments.peer_comparison`` and ``experiments.benchmark``, with a JSON request:

    python -m experiments.peers.child PEER REQUEST
"""

import functools
import importlib
import json
import math
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

_MOST_CALLS = 200
_HANDFUL = 3  # settings
_PATIENCE = 1.0  # CPU seconds of one call from which it isn't repeated


def main() -> None:
    """Import (timed), then measure what the request names."""
    peer, request = sys.argv[1], json.loads(sys.argv[2])
    started = time.process_time()
    from experiments import peers
    from experiments.peers.scenes import SCENES

    try:
        adapter = importlib.import_module(f"experiments.peers.{peers.ADAPTERS[peer]}")
    except ImportError as error:
        emit(absent=str(error))
        return
    emit(import_seconds=time.process_time() - started)
    skipped = {tuple(point) for point in request["skip"]}
    for scene_name, end in request["cases"]:
        scene = SCENES[scene_name]
        for variant in adapter.TITLES:
            for knob in thinned(adapter.knobs(variant, scene), request["stride"]):
                if (scene_name, end, variant, knob) in skipped:
                    continue
                record = {"scene": scene_name, "end": end, "variant": variant, "knob": knob}
                try:
                    prepare = functools.partial(adapter.prepare, scene, end, variant, knob)
                    record |= measure(prepare, request["fill"], request["fewest"])
                except (ImportError, RuntimeError, ValueError) as error:
                    emit(**record, refused=f"{type(error).__name__}: {error}")
                    continue
                emit(**record, title=adapter.TITLES[variant])
                if record["seconds"] > request["cap"]:
                    break  # tighter ones cost more


def thinned(knobs: Sequence[float], stride: int) -> Sequence[float]:
    """Every n-th from the tightest on; a handful stays as it is."""
    return knobs if len(knobs) <= _HANDFUL else knobs[::-1][::stride][::-1]


def measure(prepare: Callable[[], Callable[[], Any]], fill: float, fewest: int = 2) -> dict[str, Any]:
    """CPU seconds of the fastest integration, and of the fastest whole call.

    Args:
        prepare: returns the function to be timed.
        fill: CPU seconds of calls to choose the fastest from.
        fewest: calls at least, but of slow ones.
    """
    solve = prepare()
    fastest, whole, spent, quaternion = math.inf, math.inf, 0.0, []
    for number in range(_MOST_CALLS):
        started = time.process_time()
        answer = solve()
        elapsed = time.process_time() - started
        quaternion = list(getattr(answer, "quaternion", answer))
        fastest = min(fastest, getattr(answer, "seconds", elapsed))
        whole = min(whole, elapsed)
        spent += elapsed
        if elapsed > _PATIENCE or (spent > fill and number + 1 >= fewest):
            break
    return {"seconds": fastest, "whole": whole, "quaternion": quaternion}


def emit(**record: Any) -> None:
    """One line; floats keep every bit."""
    print(json.dumps(record), flush=True)


if __name__ == "__main__":
    main()
