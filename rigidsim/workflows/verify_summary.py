"""Verifying the claims of a run's ``summary.json`` against the same experiment run again.

Only what follows from the config is compared, as the fields of ``Summary`` are marked: times, machine facts,
how often a run was interrupted, and certificates (which stand for another run) are left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

from rigidsim.solve.status import Status
from rigidsim.store import provenance
from rigidsim.store.folder import RunFolder
from rigidsim.store.summary import Brief, Summary
from rigidsim.store.summary_fields import Claim


def summary_problems(saved: Brief, again: Brief, folder: RunFolder, version: int) -> list[str]:
    """The first claim of a summary that running again doesn't confirm, in words; empty if all hold.

    Args:
        saved, again: summaries; the saved one may be of an older version, which claimed less.
    """
    if not isinstance(saved, Summary):
        return []  # a run that was killed claims nothing
    # once there is a dataset, an interruption can only have hit its timeline or its segments' removal
    ended = saved.status != Status.INTERRUPTED.value
    claims = (_claims(summary, version, ended=ended) for summary in (saved, again))
    found = list(_differences("", *claims))
    if not found:
        return []
    more = f" (and {len(found) - 1} more of its claims don't hold)" if len(found) > 1 else ""
    return [f"{folder.summary}: says that {found[0]}{more}"]


def _claims(part: BaseModel, version: int, *, ended: bool) -> dict[str, Any]:
    """The fields marked as claims, in this part and in parts within, as plain values."""
    found: dict[str, Any] = {}
    given = part.model_dump(mode="json", exclude_unset=True)
    for name, field in type(part).model_fields.items():
        claim = next((mark for mark in field.metadata if isinstance(mark, Claim)), None)
        value = getattr(part, name)
        if name not in given:
            continue  # an older summary's
        if claim is not None:
            known = not claim.beside or claim.beside in given
            if known and version >= claim.since and (ended or not claim.of_end):
                found[name] = given[name]
        elif isinstance(value, BaseModel):
            found[name] = _claims(value, version, ended=ended)
        elif isinstance(value, dict):
            parts = {key: item for key, item in value.items() if isinstance(item, BaseModel)}
            found[name] = {key: _claims(item, version, ended=ended) for key, item in parts.items()}
    return found


_ABSENT = object()


def _differences(name: str, saved: Any, again: Any) -> Iterator[str]:
    """Claims that differ; one that is missing in an older summary doesn't count."""
    if isinstance(saved, Mapping) and isinstance(again, Mapping):
        for key in [*again, *(k for k in saved if k not in again)]:
            there, inner = saved.get(key, _ABSENT), f"{name}.{key}".lstrip(".")
            if there is _ABSENT and name and isinstance(again[key], Mapping):
                yield f"there is no {inner}, which there is when run again"
            else:
                yield from _differences(inner, there, again.get(key, _ABSENT))
    elif saved is _ABSENT or (saved is None and again is _ABSENT):
        return
    elif again is _ABSENT:
        yield f"{name} is {_short(saved)}, which there isn't when run again"
    elif type(saved) is not type(again) or saved != again:
        yield f"{name} is {_short(saved)}, {_short(again)} when run again"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 120 else text[:117] + "..."


def timeline_problems(saved: Brief, folder: RunFolder) -> list[str]:
    """Problems with the timeline that a summary names, if it is missing or changed; older summaries name
    none.
    """
    if not isinstance(saved, Summary) or saved.timeline_sha256 is None:
        return []
    if not folder.timeline.is_file() or folder.timeline.is_symlink():
        return [f"{folder.timeline}: is missing; rigidsim view draws it again"]
    if provenance.file_sha256(folder.timeline) != saved.timeline_sha256:
        return [f"{folder.timeline}: was damaged or changed since it was drawn; rigidsim view draws it again "
                "once it is removed"]  # fmt: skip
    return []
