"""CCSDS Attitude Ephemeris Message (504.0-B-2, version 2.0, KVN), attitude type QUATERNION.

The message's quaternion "from frame A to frame B" turns the axes of A into the axes of B (annex F2 of the
standard: a turn by 90 degrees about Z is Q3 = QC = 0.7071, and [1, 0, 0] in A reads [0, -1, 0] in B). With
the space axes as A and the body axes as B that is the dataset's own quaternion, which turns a vector from
its body coordinates to its space coordinates; only the scalar goes last: Q1 Q2 Q3 QC = x y z w.
"""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

from rigidsim.formats import ccsds
from rigidsim.formats.naming import labels
from rigidsim.formats.registry import Format, TableSource
from rigidsim.formats.tables import Table


def write_aem(table: Table, path: Path, source: TableSource) -> None:
    """Write the attitude of one run.

    Args:
        path: the file, which is replaced.
        source: the run, whose attributes or naming give epoch and axes.
    """
    quaternion = ccsds.columns_of(table, "quaternion", "wxyz", "AEM")
    named = labels(source.naming, source.attributes)
    frames = [("REF_FRAME_A", named.frame), ("REF_FRAME_B", "SC_BODY_1")]
    lines = ccsds.opening("AEM", table, source, named, frames, "ATTITUDE_TYPE = QUATERNION")

    def scalar_last(state: list[Decimal]) -> list[Decimal]:
        w, x, y, z = named.attitude(state)
        return [x, y, z, w]

    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("\n".join([*lines, "DATA_START", ""]))
        rows = ccsds.data_lines(table, quaternion, named.epoch, source.bits, scalar_last)
        file.writelines(line + "\n" for line in rows)
        file.write("DATA_STOP\n")


FORMAT = Format(write_aem)
