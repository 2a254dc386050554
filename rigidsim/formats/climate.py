"""Precession and obliquity as columns without names, as programs for cyclostratigraphy read them.

``snvec``: kyr, obliquity, precession of the equinox along the moving orbit and e sin of the longitude of
perihelion from it (Zeebe & Lourens 2022, Paleoceanography and Paleoclimatology 37, e2021PA004349; files
``PT.De1.0000Td1.0000.dat``). ``la2004``: kyr, eccentricity, obliquity and longitude of perihelion from the
moving equinox, 0 to 2 pi (Laskar et al. 2004, A&A 428, 261; files ``INSOLN``). Angles in rad; kyr from J2000,
negative in the past; 17 digits, or more for more than double precision.
"""

import json
import math
from collections.abc import Sequence
from decimal import Context, Decimal
from functools import partial
from pathlib import Path

import mpmath

from rigidsim.errors import RigidsimError
from rigidsim.formats.digits import decimals
from rigidsim.formats.registry import Format, TableSource, named_epoch
from rigidsim.formats.tables import Table

_KYR = Decimal(31_557_600_000)  # s
_SNVEC = ("obliquity_figure", "precession", "climatic_precession")
_LA2004 = ("orbit_eccentricity", "obliquity_figure", "longitude_of_perihelion_of_date")
_BEGIN = {"precession": Decimal("-0.5"), "longitude_of_perihelion_of_date": Decimal(0)}
"""Where the turn begins that angles are brought into, in turns."""
_DOUBLE, _SPARE = 17, 40  # digits


def _write(names: Sequence[str], table: Table, path: Path, source: TableSource) -> None:
    columns = [column for name in ("time", *names) if (column := table.column(name)) is not None]
    missing = sorted({"time", *names} - {column.name for column in columns})
    if missing:
        recorded = ", ".join(name.removesuffix("_figure") for name in missing)
        raise RigidsimError(
            f"--format: the run has no {recorded}, which this format holds; add it to [output] record of a "
            "scene whose first orbit is a table, and run again"
        )
    if json.loads(source.attributes["scene"])["reference"] != "moving":
        raise RigidsimError(
            "--format: the run has its obliquity against a fixed plane, and this format holds it against the "
            'moving orbit; set [frame] reference = "orbit", and run again'
        )
    wide = any(len(column.parts) > 1 for column in columns)
    digits = math.ceil(source.bits * math.log10(2)) + 1 if wide else _DOUBLE
    start, context = (
        named_epoch(source.naming, source.attributes).since_j2000(),
        Context(prec=digits + _SPARE),
    )
    ahead = context.divide(start.numerator, start.denominator)
    with mpmath.workdps(digits + _SPARE):
        turn = Decimal(str(2 * mpmath.pi))
    with path.open("w", encoding="utf-8", newline="\n") as file:
        for block in table.blocks(columns):
            parts = zip(columns, block, strict=True)
            times, *values = (decimals(found, column.bits(source.bits)) for column, found in parts)
            shown = [[context.divide(context.add(ahead, time), _KYR) for time in times], *values]
            for n, name in enumerate(names, 1):
                if (begin := _BEGIN.get(name)) is not None:
                    shown[n] = [_within(context, angle, turn, turn * begin) for angle in shown[n]]
            rows = zip(*([_text(x, digits, wide) for x in column] for column in shown), strict=True)
            file.writelines("".join(row) + "\n" for row in rows)


def _within(context: Context, angle: Decimal, turn: Decimal, begin: Decimal) -> Decimal:
    """The angle in the turn that begins there."""
    above = context.remainder(context.subtract(angle, begin), turn)
    return context.add(begin, above if above >= 0 else context.add(above, turn))


def _text(value: Decimal, digits: int, wide: bool) -> str:
    number = value if wide and value else float(value)  # the exponent of a Decimal's zero is odd
    return f" {number:{digits + 8}.{digits - 1}e}"


SNVEC = Format(partial(_write, _SNVEC), suffix=".dat", names=("epoch",))
LA2004 = Format(partial(_write, _LA2004), suffix=".asc", names=("epoch",))
