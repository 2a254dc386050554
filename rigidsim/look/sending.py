"""Columns of an entity, sent to a recording in chunks that the viewer reads well.

Turning numbers into Arrow costs some hundred microseconds of Python a call, whatever the rows: many are
turned at once, and slices of that are sent, which copy nothing.

Imports rerun when it is loaded, so load it only where a timeline is written.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import pyarrow as pa
import rerun as rr

from rigidsim.look.recording import CHUNK


@dataclass(frozen=True)
class _Times:
    """Some rows of a time column, for Arrow."""

    name: str
    rows: pa.Array

    def timeline_name(self) -> str:
        """Name of the timeline."""
        return self.name

    def as_arrow_array(self) -> pa.Array:
        """The column's integers."""
        return self.rows


class _Component(rr.ComponentColumn):
    """Some rows of a component's column."""

    def __init__(self, descriptor: rr.ComponentDescriptor, rows: pa.Array) -> None:
        self.descriptor = descriptor
        self._rows = rows

    def as_arrow_array(self) -> pa.Array:
        """The component's values, a list for each row."""
        return self._rows


def send(
    recording: rr.RecordingStream,
    path: str,
    times: Iterable[rr.TimeColumn],
    columns: Iterable[rr.ComponentColumn],
) -> None:
    """Send any number of rows of one entity, ``CHUNK`` of them at a time."""
    clocks = [(time.timeline_name(), time.as_arrow_array()) for time in times]
    values = [(column.component_descriptor(), column.as_arrow_array()) for column in columns]
    for start in range(0, len(clocks[0][1]), CHUNK):
        recording.send_columns(
            path,
            indexes=[_Times(name, rows[start : start + CHUNK]) for name, rows in clocks],
            columns=[_Component(descriptor, rows[start : start + CHUNK]) for descriptor, rows in values],
        )
