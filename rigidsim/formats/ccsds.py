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
from collections.abc import Callable, Iterator, Mapping, Sequence
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

    def attitude(self, quaternion: list[Decimal]) -> list[Decimal]:
        """Quaternions w x y z from body axes to the message's axes, given those to the scene's."""
        if self.turn is None:
            return quaternion
        with localcontext(_WIDE):
            return product([*self.turn[2:], Decimal(0), Decimal(0)], quaternion)

    def vector(self, components: list[Decimal]) -> list[Decimal]:
        """A vector in the scene's axes resolved along the message's."""
        if self.turn is None:
            return components
        with localcontext(_WIDE):
            return to_equator(components, self.turn[:2])


def labels(naming: Naming, attributes: Mapping[str, Any]) -> Labels:
    """Epoch and axes of a message, from the options given and the run's own attributes."""
    epoch = named_epoch(naming, attributes)
    axes = _axes(naming.axes, str(attributes.get("axes", "")))
    note = f"{epoch} is time zero of the scene"
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


def _axes(given: str, known: str) -> str:
    names = get_args(SpaceAxes)
    if not given and not known:
        raise RigidsimError(
            "the run doesn't say what its space axes are, which a message must: give [frame] axes in the "
            f"config, or --axes here ({', '.join(names)}, or a name in capitals that sender and receiver "
            "agree on); csv needs none"
        )
    if known and given and given != known:
        raise RigidsimError(
            f'--axes: given {shown(given)}, but the run\'s axes are "{known}"; leave the option out'
        )
    near = nearest(given, names)
    if given and given not in names and (near or not re.fullmatch(r"[A-Z][A-Z0-9_]{0,60}", given)):
        raise RigidsimError(
            f"--axes: given {shown(given)}{near}; allowed: {', '.join(names)}, or another name in capitals, "
            "digits and underscores"
        )
    return given or known


def write_aem(table: Table, path: Path, source: TableSource) -> None:
    """Write the attitude of one run, type QUATERNION."""
    quaternion = _columns(table, "quaternion", "wxyz", "AEM")
    named = labels(source.naming, source.attributes)
    frames = [("REF_FRAME_A", named.frame), ("REF_FRAME_B", "SC_BODY_1")]
    head = [*_opening("AEM", table, source, named, frames, "ATTITUDE_TYPE = QUATERNION"), "DATA_START"]

    def scalar_last(state: list[Decimal]) -> list[Decimal]:
        w, x, y, z = named.attitude(state)
        return [x, y, z, w]

    rows = _data_lines(table, quaternion, named.epoch, source.bits, scalar_last)
    _write(path, head, rows, ["DATA_STOP"])


def write_oem(table: Table, path: Path, source: TableSource) -> None:
    """Write position and velocity of the centre of mass of one run, km and km/s."""
    state = [c for name in ("position", "velocity") for c in _columns(table, name, "XYZ", "OEM")]
    named = labels(source.naming, source.attributes)
    frames = [("CENTER_NAME", source.naming.center), ("REF_FRAME", named.frame)]
    head = _opening("OEM", table, source, named, frames)

    def kilometres(state: list[Decimal]) -> list[Decimal]:
        return [x.scaleb(_KILO) for x in [*named.vector(state[:3]), *named.vector(state[3:])]]

    _write(path, head, _data_lines(table, state, named.epoch, source.bits, kilometres), [])


def _write(path: Path, head: Sequence[str], rows: Iterator[str], end: Sequence[str]) -> None:
    with path.open("w", encoding="ascii", newline="\n") as file:
        for lines in (head, rows, end):
            file.writelines(line + "\n" for line in lines)


def _tag(epoch: Epoch, seconds: Decimal) -> str:
    """The time tag ``YYYY-MM-DDThh:mm:ss.d`` of a time of the scene, in the epoch's scale, to 1e-14 s."""
    try:
        return epoch.after(seconds).calendar()
    except ValueError as error:
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


def _opening(
    message: str,
    table: Table,
    source: TableSource,
    named: Labels,
    frames: Sequence[tuple[str, str]],
    *ending: str,
) -> list[str]:
    """The lines above a message's data: header and metadata."""
    start, stop = _span(table, named.epoch, source.bits)
    notes = [
        f"rigidsim run {source.title}, numbers rounded to the 16 digits that the standard allows",
        *named.notes,
    ]
    plain = ("".join(c if " " <= c <= "~" else "?" for c in note) for note in notes)
    return [
        f"CCSDS_{message}_VERS = 2.0",
        *(f"COMMENT {note[: _LONGEST_LINE - 8]}" for note in plain),
        f"CREATION_DATE = {datetime.now(UTC).strftime('%Y-%m-%dT%H:%M:%S')}",
        "ORIGINATOR = RIGIDSIM",
        "",
        "META_START",
        _keyword("OBJECT_NAME", source.naming.object_name or source.title),
        _keyword("OBJECT_ID", source.naming.object_id or "UNKNOWN"),
        *(_keyword(name, value) for name, value in frames),
        f"TIME_SYSTEM = {named.epoch.scale}",
        f"START_TIME = {start}",
        f"STOP_TIME = {stop}",
        *ending,
        "META_STOP",
        "",
    ]


def _columns(table: Table, variable: str, components: Sequence[str], message: str) -> list[TableColumn]:
    found = [table.column(f"{variable}_{component}") for component in components]
    if any(column is None for column in found):
        raise RigidsimError(
            f"the run recorded no {variable}, which an {message} is made of; name it in [output] record (a "
            "body that only turns has no position)"
        )
    return [column for column in found if column is not None]


def _span(table: Table, epoch: Epoch, bits: int) -> tuple[str, str]:
    """Time tags of the first and the last sample."""
    time = table.columns[0]
    if not table.rows or time.name != "time":
        raise RigidsimError("the run holds no samples yet; there is nothing to export")
    ends = []
    for row in (0, -1):
        parts = [np.atleast_1d(table.dataset[part].isel(time=row).values) for part in time.parts]
        _refuse_non_finite([parts], "time", row)
        ends.append(_tag(epoch, decimals(parts, bits)[0]))
    return ends[0], ends[1]


def _data_lines(
    table: Table,
    columns: Sequence[TableColumn],
    epoch: Epoch,
    bits: int,
    shown: Callable[[list[Decimal]], list[Decimal]],
) -> Iterator[str]:
    """Data lines ``TAG NUMBER ...``; ``shown`` converts a row's numbers: units, order, axes."""
    previous, row = "", 0
    for block in table.blocks([table.columns[0], *columns]):
        _refuse_non_finite(block, "sample", row)
        times, *values = (decimals(parts, bits) for parts in block)
        for time, *state in zip(times, *values, strict=True):
            now = _tag(epoch, time)
            if now == previous:
                raise RigidsimError(
                    f"samples {row - 1} and {row} are closer than 1e-{DIGITS} s, which time tags can't "
                    "tell apart; export csv, or sample less often"
                )
            yield " ".join([now, *(_number(value) for value in shown(state))])
            previous, row = now, row + 1


def _refuse_non_finite(block: Sequence[Sequence[np.ndarray]], what: str, row: int) -> None:
    for parts in block:
        bad = np.flatnonzero(~np.isfinite(parts[0]))
        if bad.size:
            raise RigidsimError(
                f"{what} {row + int(bad[0])} holds a number that isn't finite, which no message can carry; "
                "export csv"
            )


AEM, OEM = Format(write_aem), Format(write_oem)
