"""CCSDS Attitude Ephemeris Message (504.0-B-2, version 2.0, KVN), attitude type QUATERNION.

The message's quaternion "from frame A to frame B" turns the axes of A into the axes of B (annex F2 of the
standard: a turn by 90 degrees about Z is Q3 = QC = 0.7071, and [1, 0, 0] in A reads [0, -1, 0] in B). With
the space axes as A and the body axes as B that is the dataset's own quaternion, which turns a vector from
its body coordinates to its space coordinates; only the scalar goes last: Q1 Q2 Q3 QC = x y z w.
"""

from __future__ import annotations

from pathlib import Path

from rigidsim.formats import ccsds
from rigidsim.formats.registry import Format, Source
from rigidsim.formats.tables import Table


def write_aem(table: Table, path: Path, source: Source) -> None:
    """Write the attitude of one run.

    Args:
        table: along time.
        path: the file; replaced.
        source: the run; its naming says epoch, object and frame.

    Raises:
        RigidsimError: no quaternion was recorded, or something that the standard can't express.
    """
    quaternion = ccsds.columns_of(table, "quaternion", "xyzw", "AEM")
    naming = source.naming
    tags = ccsds.Tags(naming.epoch)
    start, stop = ccsds.span(table, tags, source.bits)
    lines = [
        "CCSDS_AEM_VERS = 2.0",
        *ccsds.comments(
            [
                f"rigidsim run {source.title}, numbers rounded to the 16 digits that the standard allows",
                f"{naming.epoch} {ccsds.TIME_SYSTEM} is time zero of the scene",
                f"{naming.frame} stands for the space axes X Y Z of the scene, SC_BODY_1 for its body axes",
            ]
        ),
        f"CREATION_DATE = {ccsds.created()}",
        "ORIGINATOR = RIGIDSIM",
        "",
        "META_START",
        ccsds.keyword("OBJECT_NAME", naming.object_name or source.title),
        ccsds.keyword("OBJECT_ID", naming.object_id),
        ccsds.keyword("REF_FRAME_A", naming.frame),
        "REF_FRAME_B = SC_BODY_1",
        f"TIME_SYSTEM = {ccsds.TIME_SYSTEM}",
        f"START_TIME = {start}",
        f"STOP_TIME = {stop}",
        "ATTITUDE_TYPE = QUATERNION",
        "META_STOP",
        "",
        "DATA_START",
    ]
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("\n".join(lines) + "\n")
        file.writelines(line + "\n" for line in ccsds.data_lines(table, quaternion, tags, source.bits))
        file.write("DATA_STOP\n")


FORMAT = Format(write_aem)
