"""What a run's ``summary.json`` claims, held against the same experiment run again.

Only what follows from the config is compared: times, machine facts, how often a run was interrupted, and
certificates (which stand for another run) are left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rigidsim.store import provenance
from rigidsim.store.folder import RunFolder

_CLAIMS = (
    "name", "description", "samples", "samples_planned", "time_reached", "formulation", "states", "precision",
    "tolerance", "method", "hold_invariants", "cost.steps", "invariants", "events", "chart_changes", "body",
    "lyapunov.chaotic", "lyapunov.largest_exponent", "lyapunov.moved_over_second_half", "lyapunov.exponents",
)  # fmt: skip
_END = ("status", "message", "exit_code")
_DRAWING = "interrupted after the integration"  # while the timeline was drawn: the dataset is complete
_SIGNED = 3  # schema version from which what was put back of a scalar has its sign


def summary_problems(
    saved: Mapping[str, Any], again: Mapping[str, Any], folder: RunFolder, version: int
) -> list[str]:
    """The first claim of a summary that running again doesn't confirm, in words; none where all hold.

    Args:
        saved, again: summaries; the saved one may be of an older version, which claimed less.
        version: schema version of the dataset beside it.
    """
    if "cost" not in saved:
        return []  # of a run that was killed: it claims nothing
    ended = _DRAWING not in str(saved.get("message", ""))
    found = list(_differences(saved, again, [*(_END if ended else ()), *_CLAIMS]))
    if version < _SIGNED:
        found = [text for text in found if ".put_back " not in text]
    if not found:
        return []
    more = f" (and {len(found) - 1} more of its claims don't hold)" if len(found) > 1 else ""
    return [f"{folder.summary}: says that {found[0]}{more}"]


def _differences(saved: Mapping[str, Any], again: Mapping[str, Any], names: list[str]) -> Iterator[str]:
    for name in names:
        yield from _compared(name, _at(saved, name), _at(again, name))


_ABSENT = object()


def _at(summary: Any, name: str) -> Any:
    """The value of a dotted name."""
    for key in name.split("."):
        if not isinstance(summary, Mapping) or key not in summary:
            return _ABSENT
        summary = summary[key]
    return summary


def _compared(name: str, saved: Any, again: Any) -> Iterator[str]:
    """Claims that differ; one that is absent from an older summary is none."""
    if isinstance(saved, Mapping) and isinstance(again, Mapping):
        for key in [*again, *(k for k in saved if k not in again)]:
            there = saved.get(key, _ABSENT)
            if there is _ABSENT and isinstance(again[key], Mapping):
                yield f"there is no {name}.{key}, which there is when run again"
            else:
                yield from _compared(f"{name}.{key}", there, again.get(key, _ABSENT))
    elif saved is _ABSENT or (saved is None and again is _ABSENT):
        return
    elif again is _ABSENT:
        yield f"{name} is {_short(saved)}, which there isn't when run again"
    elif type(saved) is not type(again) or saved != again:
        yield f"{name} is {_short(saved)}, {_short(again)} when run again"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 120 else text[:117] + "..."


def timeline_problems(saved: Mapping[str, Any], folder: RunFolder) -> list[str]:
    """Whether the timeline that a summary names is there and as it was drawn; older ones name none."""
    claimed = saved.get("timeline_sha256")
    if claimed is None:
        return []
    if not folder.timeline.is_file() or folder.timeline.is_symlink():
        return [f"{folder.timeline}: is missing; rigidsim view draws it again"]
    if provenance.file_sha256(folder.timeline) != claimed:
        return [f"{folder.timeline}: was damaged or changed since it was drawn; rigidsim view draws it again "
                "once it is removed"]  # fmt: skip
    return []
