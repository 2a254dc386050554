"""What the columns of a CCSDS message are: attitudes from body to space axes, rates along body axes, and the
path in SI.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.formats.attitude_messages import AttitudeRows, named_axes
from rigidsim.formats.messages import MessageSegment, read_segments
from rigidsim.scene.epochs import Epoch
from rigidsim.scene.space_axes import EQUATOR, SpaceAxes

MESSAGE_COLUMNS = {
    "quaternion": ("qw", "qx", "qy", "qz"), "angular_velocity": ("wx", "wy", "wz"),
    "position": ("x", "y", "z"), "velocity": ("vx", "vy", "vz"),
}  # fmt: skip
"""Names of a message's columns by the variable that they are."""
_ORBIT = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
_ACCELERATION = ("X_DDOT", "Y_DDOT", "Z_DDOT")
_KM = 1000.0


def message_columns(path: Path, kind: str) -> dict[str, Any]:
    """A message as what ``Trajectory`` is made of.

    Attitudes are unit quaternions from body to space axes, rates along body axes in deg/s, positions in m.

    Args:
        kind: "AEM" or "OEM".

    Raises:
        RigidsimError: something can't be read, with its line and what to do.
    """
    segments = read_segments(path, kind)
    epochs = [one.epochs() for one in segments]
    reading: Callable[[MessageSegment, list[Epoch]], Any] = AttitudeRows if kind == "AEM" else _OrbitRows
    parts = [reading(*each) for each in zip(segments, epochs, strict=True)]
    notes = [note for part in parts for note in part.notes]
    for n, (before, after) in enumerate(pairwise(epochs), 1):
        if before and after and after[0].since(before[-1]) == 0:  # the end of a segment begins the next one
            del segments[n].rows[0], after[0]
            parts[n].table = parts[n].table[1:]
            place = segments[n].where.rpartition(", ")[2]
            notes.append(f"segment at {place}: its first row, at the time of the row before, was left out")
    axes = {EQUATOR if part.axes in get_args(SpaceAxes) else part.axes for part in parts}
    if len(axes) > 1:
        names = ", ".join(sorted(axes))
        raise RigidsimError(f"{path}: segments in different frames, {names}; write all in one")
    width = min(part.table.shape[1] for part in parts)
    table = np.concatenate([part.table[:, :width] for part in parts])
    wanted = ("quaternion", "angular_velocity") if kind == "AEM" else ("position", "velocity")
    columns = [name for variable in wanted for name in MESSAGE_COLUMNS[variable]][:width]
    if width < max(part.table.shape[1] for part in parts):
        notes.append("rates were left out, since not all segments have them")
    numbers = np.array([row.number for one in segments for row in one.rows])
    return {
        "columns": {name: np.ascontiguousarray(table[:, n]) for n, name in enumerate(columns)},
        "units": {name: "deg/s" for name in MESSAGE_COLUMNS["angular_velocity"] if name in columns},
        "counted": segments[0].counted, "first": int(numbers[0]), "lines": numbers,
        "epochs": tuple(date for dates in epochs for date in dates),
        "axes": parts[0].axes, "settled": all(part.settled for part in parts),
        "resolution": parts[0].resolution, "notes": tuple(dict.fromkeys(notes)),
    }  # fmt: skip


class _OrbitRows:
    """Positions and velocities of a segment (rows, 6), m and m/s."""

    settled, resolution = True, None

    def __init__(self, segment: MessageSegment, dates: list[Epoch]) -> None:
        self.notes: list[str] = []
        self.axes = named_axes(segment.key("REF_FRAME"))
        self.table = segment.numbers(_ORBIT, _ACCELERATION) * _KM
