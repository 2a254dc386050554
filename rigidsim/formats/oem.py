"""CCSDS Orbit Ephemeris Message (502.0-B, version 2.0, KVN): position and velocity of the centre of mass."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

from rigidsim.formats import ccsds
from rigidsim.formats.naming import labels
from rigidsim.formats.registry import Format, TableSource
from rigidsim.formats.tables import Table

_KILO = -3  # metres to kilometres, exactly, as a shift of the decimal point


def write_oem(table: Table, path: Path, source: TableSource) -> None:
    """Write the flight of one run, km and km/s.

    Args:
        path: the file, which is replaced.
        source: the run, whose attributes or naming give epoch and axes.
    """
    state = [
        *ccsds.columns_of(table, "position", "XYZ", "OEM"),
        *ccsds.columns_of(table, "velocity", "XYZ", "OEM"),
    ]
    named = labels(source.naming, source.attributes)
    frames = [("CENTER_NAME", source.naming.center), ("REF_FRAME", named.frame)]
    lines = ccsds.opening("OEM", table, source, named, frames)

    def kilometres(state: list[Decimal]) -> list[Decimal]:
        return [x.scaleb(_KILO) for x in [*named.vector(state[:3]), *named.vector(state[3:])]]

    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("\n".join([*lines, ""]))
        rows = ccsds.data_lines(table, state, named.epoch, source.bits, kilometres)
        file.writelines(line + "\n" for line in rows)


FORMAT = Format(write_oem)
