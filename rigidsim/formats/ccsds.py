"""CCSDS ephemeris messages in KVN syntax: attitudes (AEM, 504.0-B-2) and orbits (OEM, 502.0-B), version 2.0.

Section 6 of 504.0-B-2, with which 502.0-B agrees: lines of at most 254 printable ASCII characters; numbers of
at most 16 digits, so that a double is rounded to a few parts in 1e16; no nan, infinity or negative zero; text
all upper case.

The AEM's quaternion "from frame A to frame B" turns the axes of A into the axes of B (annex F2: a turn by 90
degrees about Z is Q3 = QC = 0.7071, and [1, 0, 0] in A reads [0, -1, 0] in B). With the space axes as A and
the body axes as B that is the dataset's own quaternion, which turns a vector from its body coordinates to its
space coordinates; only the scalar goes last: Q1 Q2 Q3 QC = x y z w.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from decimal import Context, Decimal, localcontext
from pathlib import Path
from typing import Any, get_args

import mpmath
import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.formats.digits import decimals
from rigidsim.formats.registry import Format, Naming, TableSource, named_epoch
from rigidsim.formats.tables import Table, TableColumn
from rigidsim.scene.epochs import DIGITS, Epoch
from rigidsim.scene.rotations import product
from rigidsim.scene.space_axes import ECLIPTIC, EQUATOR, OBLIQUITY, SpaceAxes, obliquity, to_equator
from rigidsim.scene.validation_messages import nearest, shown

_LONGEST_LINE = 254
_KILO = -3  # metres to kilometres, exactly, as a shift of the decimal point
_BITS = 160  # far beyond the 16 digits of a message
_WIDE = Context(prec=60)


@dataclass(frozen=True)
class Labels:
    """Epoch and axes that a message names, with remarks for its comments.

    ``turn``: cosine and sine of the angle about X from the message's axes to the scene's, and of half of it;
    None if the standard knows the scene's.
    """

    epoch: Epoch
    frame: str
    notes: list[str]
    turn: tuple[Decimal, Decimal, Decimal, Decimal] | None = None


def labels(naming: Naming, attributes: Mapping[str, Any]) -> Labels:
    """Epoch and axes of a message, from the options given and the run's own attributes."""
    epoch = named_epoch(naming, attributes)
    given, known, names = naming.axes, str(attributes.get("axes", "")), get_args(SpaceAxes)
    if not given and not known:
        raise RigidsimError(
            "the run doesn't say what its space axes are, which a message must: give [frame] axes in the "
            f"config, or --axes here ({', '.join(names)}, or a name in capitals that sender and receiver "
            "agree on); csv needs none"
        )
    if known and given not in ("", known):
        raise RigidsimError(
            f'--axes: given {shown(given)}, but the run\'s axes are "{known}"; leave the option out'
        )
    near = nearest(given, names)
    if given and given not in names and (near or not re.fullmatch(r"[A-Z][A-Z0-9_]{0,60}", given)):
        raise RigidsimError(
            f"--axes: given {shown(given)}{near}; allowed: {', '.join(names)}, or another name in capitals, "
            "digits and underscores"
        )
    axes, note = given or known, f"{epoch} is time zero of the scene"
    if axes != ECLIPTIC:
        return Labels(epoch, axes, [note])
    arcsec = float(OBLIQUITY) * 180 / math.pi * 3600
    words = f"turned about X by the obliquity to {EQUATOR}: {arcsec:.3f} arcsec (IAU 2006)"
    context = mpmath.MPContext()
    context.prec = _BITS
    turns = (obliquity(context, part) for part in (1, 2))
    c, s, c_half, s_half = (Decimal(mpmath.nstr(x, 45)) for turn in turns for x in turn)
    notes = [note, f"its space axes, {axes}, were {words}"]
    return Labels(epoch, EQUATOR, notes, (c, s, c_half, s_half))


def write_aem(table: Table, path: Path, source: TableSource) -> None:
    """Write the attitude of one run, type QUATERNION."""
    columns = _columns("AEM", table, [f"quaternion_{x}" for x in "wxyz"])
    named = labels(source.naming, source.attributes)

    def scalar_last(state: list[Decimal]) -> list[Decimal]:
        if named.turn is not None:
            state = product([*named.turn[2:], Decimal(0), Decimal(0)], state)
        return [*state[1:], state[0]]

    keys = {"REF_FRAME_A": named.frame, "REF_FRAME_B": "SC_BODY_1"}
    opening = "ATTITUDE_TYPE = QUATERNION\nMETA_STOP\n\nDATA_START\n"
    _write("AEM", table, path, source, named, columns, keys, scalar_last, opening, "DATA_STOP\n")


def write_oem(table: Table, path: Path, source: TableSource) -> None:
    """Write position and velocity of the centre of mass of one run, km and km/s."""
    names = [f"{variable}_{x}" for variable in ("position", "velocity") for x in "XYZ"]
    columns = _columns("OEM", table, names)
    named = labels(source.naming, source.attributes)

    def kilometres(state: list[Decimal]) -> list[Decimal]:
        if named.turn is not None:
            state = [x for n in (0, 3) for x in to_equator(state[n : n + 3], named.turn[:2])]
        return [x.scaleb(_KILO) for x in state]

    keys = {"CENTER_NAME": source.naming.center, "REF_FRAME": named.frame}
    _write("OEM", table, path, source, named, columns, keys, kilometres, "META_STOP\n\n", "")


def _columns(message: str, table: Table, names: Sequence[str]) -> list[TableColumn]:
    columns = [column for name in names if (column := table.column(name)) is not None]
    if len(columns) < len(names):
        raise RigidsimError(
            f"the run recorded no {names[0].partition('_')[0]}, which an {message} is made of; name it in "
            "[output] record (a body that only turns has no position)"
        )
    return columns


def _write(
    message: str,
    table: Table,
    path: Path,
    source: TableSource,
    named: Labels,
    columns: Sequence[TableColumn],
    keys: Mapping[str, str],
    shown: Callable[[list[Decimal]], list[Decimal]],
    opening: str,
    closing: str,
) -> None:
    """Write the lines ``TAG NUMBER ...`` of some columns, whose rows are ``shown`` in the message's units,
    order and axes, below its header and its metadata with some ``keys``.
    """
    time = table.columns[0]
    if not table.rows or time.name != "time":
        raise RigidsimError("the run holds no samples yet; there is nothing to export")
    ends = [[np.atleast_1d(table.dataset[x].isel(time=row).values) for x in time.parts] for row in (0, -1)]
    start, stop = (_tag(named.epoch, decimals(parts, source.bits)[0]) for parts in ends)
    notes = [
        f"rigidsim run {source.title}, numbers rounded to the 16 digits that the standard allows",
        *named.notes,
    ]
    plain = ("".join(c if " " <= c <= "~" else "?" for c in note) for note in notes)
    head = [
        f"CCSDS_{message}_VERS = 2.0",
        *(f"COMMENT {note[: _LONGEST_LINE - 8]}" for note in plain),
        f"CREATION_DATE = {datetime.now(UTC).strftime('%Y-%m-%dT%H:%M:%S')}",
        "ORIGINATOR = RIGIDSIM",
        "",
        "META_START",
        _keyword("OBJECT_NAME", source.naming.object_name or source.title),
        _keyword("OBJECT_ID", source.naming.object_id or "UNKNOWN"),
        *(_keyword(name, value) for name, value in keys.items()),
        f"TIME_SYSTEM = {named.epoch.scale}",
        f"START_TIME = {start}",
        f"STOP_TIME = {stop}",
        opening,
    ]
    previous, row = "", 0
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("\n".join(head))
        for block in table.blocks([time, *columns]):
            bad = np.flatnonzero(~np.isfinite([parts[0] for parts in block]).all(axis=0))
            if bad.size:
                raise RigidsimError(
                    f"sample {row + int(bad[0])} holds a number that isn't finite, which no message can "
                    "carry; export csv"
                )
            for seconds, *state in zip(*(decimals(parts, source.bits) for parts in block), strict=True):
                now = _tag(named.epoch, seconds)
                if now == previous:
                    raise RigidsimError(
                        f"samples {row - 1} and {row} are closer than 1e-{DIGITS} s, which time tags can't "
                        "distinguish; export csv, or sample less often"
                    )
                with localcontext(_WIDE):
                    file.write(" ".join([now, *map(_number, shown(state))]) + "\n")
                previous, row = now, row + 1
        file.write(closing)


def _tag(epoch: Epoch, seconds: Decimal) -> str:
    """The time tag ``YYYY-MM-DDThh:mm:ss.d`` of a time of the scene, in the epoch's scale, to 1e-14 s."""
    try:
        return epoch.after(seconds).calendar()
    except (ValueError, OverflowError) as error:
        raise RigidsimError(
            f"a sample at {seconds:.6g} s after {epoch} has no time tag: {error}; or export csv"
        ) from None


def _number(value: Decimal) -> str:
    """Sixteen significant digits, as ``-1.234567890123456e-1``; zero without a sign."""
    return f"{value:.15e}" if value else "0.000000000000000e+0"


def _keyword(name: str, value: str) -> str:
    text = value.upper()
    if not re.fullmatch(r"[\x21-\x7e]([\x20-\x7e]*[\x21-\x7e])?", text) or len(text) > 200:
        raise RigidsimError(f"{name}: given {value[:60]!a}; 1 to 200 printable ASCII characters are allowed")
    return f"{name} = {text}"


AEM, OEM = Format(write_aem), Format(write_oem)
