"""CCSDS Orbit Ephemeris Message (502.0-B, version 2.0, KVN): position and velocity of the centre of mass."""

from __future__ import annotations

from pathlib import Path

from rigidsim.formats import ccsds
from rigidsim.formats.registry import Format, Source
from rigidsim.formats.tables import Table

_KILO = -3  # metres to kilometres, exactly, as a shift of the decimal point


def write_oem(table: Table, path: Path, source: Source) -> None:
    """Write the flight of one run, km and km/s.

    Args:
        table: along time.
        path: the file; replaced.
        source: the run; its naming says epoch, object, frame and centre.

    Raises:
        RigidsimError: no position and velocity were recorded, or something that the standard can't express.
    """
    state = [
        *ccsds.columns_of(table, "position", "XYZ", "OEM"),
        *ccsds.columns_of(table, "velocity", "XYZ", "OEM"),
    ]
    naming = source.naming
    tags = ccsds.Tags(naming.epoch)
    start, stop = ccsds.span(table, tags, source.bits)
    lines = [
        "CCSDS_OEM_VERS = 2.0",
        *ccsds.comments(
            [
                f"rigidsim run {source.title}, numbers rounded to the 16 digits that the standard allows",
                f"{naming.epoch} {ccsds.TIME_SYSTEM} is time zero of the scene",
                f"{naming.frame} stands for the scene's space axes X Y Z, {naming.center} for its origin",
            ]
        ),
        f"CREATION_DATE = {ccsds.created()}",
        "ORIGINATOR = RIGIDSIM",
        "",
        "META_START",
        ccsds.keyword("OBJECT_NAME", naming.object_name or source.title),
        ccsds.keyword("OBJECT_ID", naming.object_id),
        ccsds.keyword("CENTER_NAME", naming.center),
        ccsds.keyword("REF_FRAME", naming.frame),
        f"TIME_SYSTEM = {ccsds.TIME_SYSTEM}",
        f"START_TIME = {start}",
        f"STOP_TIME = {stop}",
        "META_STOP",
        "",
    ]
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("\n".join(lines) + "\n")
        file.writelines(line + "\n" for line in ccsds.data_lines(table, state, tags, source.bits, _KILO))


FORMAT = Format(write_oem)
