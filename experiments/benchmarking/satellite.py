"""The rows without closed form: a satellite under gravity gradient at equal error, against DOP853.

Both sides take CPU seconds from the start to the quaternion at the last sample, on an integrator that was
compiled before: for DOP853 its one compiled function, for rigidsim the cheaper of its loop alone (with the
samples at start and end and what is recorded of them) and of a run until its samples are on their way to the
file (with statistics and packing, which no peer does); the ratio with the latter stands beside.
"""

from dataclasses import dataclass, field

from experiments.peers.campaign import OURS, measure
from experiments.peers.curves import cost_at
from experiments.peers.own_runs import PROPAGATED
from experiments.peers.scenes import SCENES

COMPILED = ("numba",)
"""Peers with a compiled DOP853."""
ERRORS = (1e-6, 1e-9)
_SCENE = "satellite"
_FILL = 0.25
"""CPU seconds of calls, the fastest of which counts: on a shared core some moments are much slower."""


@dataclass
class Costs:
    """CPU seconds of an integration by attitude error, rad; those that can't be told are missing.

    Attributes:
        ours, best: of the cheapest of rigidsim's ways, and of the best peer.
        recorded: of rigidsim's runs from the first step to the last sample on its way to the file.
        notes: why some are missing.
    """

    ours: dict[float, float] = field(default_factory=dict)
    best: dict[float, float] = field(default_factory=dict)
    recorded: dict[float, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def radians(*, quick: bool) -> float:
    """How far the satellite turns."""
    scene = SCENES[_SCENE]
    return scene.rate * scene.ends[0 if quick else 1]


def costs(*, repeats: int, quick: bool) -> Costs:
    """Measure them in fresh processes, in turn.

    Args:
        quick: the short horizon.
    """
    case = _SCENE, SCENES[_SCENE].ends[0 if quick else 1]
    fill = 0.05 if quick else _FILL
    measured = measure([OURS, *COMPILED], [case], repeats=repeats, fill=fill)
    found = Costs(notes=[note for note in measured.notes if "left out" in note or "broke" in note])
    for error in ERRORS:
        points = measured.of(*case, OURS)
        ours = cost_at(points, error)
        recorded = cost_at([p for p in points if p.title != PROPAGATED], error)
        others = [cost_at(measured.of(*case, peer), error) for peer in COMPILED]
        best = min((cost for cost in others if cost is not None), default=None)
        if ours is not None:
            found.ours[error] = ours
        if recorded is not None:
            found.recorded[error] = recorded
        if best is not None:
            found.best[error] = best
    return found
