"""CCSDS messages in KVN syntax, version 2.0: attitudes (AEM and APM, 504.0-B-2) and orbits (OEM, 502.0-B);
the AEM also in version 1.0.

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
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from decimal import Context, Decimal, localcontext
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args

import mpmath
import numpy as np

from rigidsim.errors import RigidsimError, ensure
from rigidsim.formats.digits import decimals
from rigidsim.formats.registry import Format, Naming, TableSource, named_epoch
from rigidsim.formats.tables import Table, TableColumn
from rigidsim.scene.attitude import euler_from_matrix, rotation_matrix, unit_quaternion
from rigidsim.scene.epochs import DIGITS, SCALES, Epoch
from rigidsim.scene.exact import parse_number
from rigidsim.scene.rotations import SEQUENCES, product
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


# --- what is asked of an attitude message -------------------------------------------------------------------

_TYPES = (
    "quaternion", "quaternion/derivative", "quaternion/angvel", "euler_angle", "euler_angle/angvel", "spin"
)  # fmt: skip
_FROM = ("space", "body")
_BODY = "SC_BODY_1"


@dataclass(frozen=True)
class _Asked:
    """Options of an attitude message, from ``Naming.message``.

    Attributes:
        type: of the attitude, one of ``_TYPES``. sequence: of its Euler angles.
        source: the frame from which it leads, of space or the body.
        time: scale of its dates; empty for the epoch's.
        segment: intervals, or seconds, of a segment; None for a single one.
        at: time of the scene, s, of an APM; None for the last sample.
        version: of an AEM, "1" or "2".
    """

    type: str = "quaternion"
    sequence: str = "zyx"
    source: str = "space"
    time: str = ""
    segment: int | float | None = None
    at: float | None = None
    version: str = "2"

    @classmethod
    def of(cls, naming: Naming, kind: str) -> "_Asked":
        """Those given, checked."""
        given = {key.strip(): str(value).strip() for key, value in naming.message.items()}
        last = "segment" if kind == "AEM" else "at"
        choices = {"type": _TYPES, "from": _FROM, "time": SCALES, "sequence": SEQUENCES, last: ()}
        choices |= {"version": ("1", "2")} if kind == "AEM" else {}
        for key, text in given.items():
            near = nearest(key, list(choices))
            what = f"--message: given {shown(key)}{near}; allowed: {', '.join(choices)}"
            ensure(key in choices, RigidsimError(what))
            text = text.upper() if key == "time" else text.lower()
            what = f"--message {key}: given {shown(text)}; allowed: {', '.join(choices[key])}"
            ensure(not choices[key] or text in choices[key], RigidsimError(what))
            given[key] = text
        found: dict[str, Any] = {("source" if k == "from" else k): v for k, v in given.items() if k != last}
        if last in given:
            text = given[last]
            try:
                whole = last == "segment" and text.isdigit()
                number = int(text) if whole else float(parse_number(text, "s"))
                found[last] = number
                ensure(last == "at" or number > 0, ValueError())
            except ValueError:
                what = f'--message {last}: given {shown(text)}; a time with its unit, such as "10 min", '
                more = "or a number of rows " if last == "segment" else ""
                raise RigidsimError(f"{what}{more}is allowed") from None
        asked = cls(**found)
        what = "--message from: given body; a spin leads from space: leave it out"
        ensure(not (asked.type == "spin" and asked.source == "body"), RigidsimError(what))
        return asked

    @property
    def rates(self) -> bool:
        """Whether rates are written."""
        return "/" in self.type or self.type == "spin"

    @property
    def old(self) -> bool:
        """Whether by version 1."""
        return self.version == "1"


class _Attitude:
    """Rows of an attitude message, as decimals in its units, order and axes."""

    def __init__(self, message: str, table: Table, source: TableSource) -> None:
        self.asked = _Asked.of(source.naming, message)
        names = [f"quaternion_{x}" for x in "wxyz"]
        names += [f"angular_velocity_{x}" for x in "xyz"] if self.asked.rates else []
        self.columns = _columns(message, table, names)
        self.named = labels(source.naming, source.attributes)
        self._context = mpmath.MPContext()
        self._context.prec = _BITS
        self._degrees = Decimal(mpmath.nstr(self._context.degrees(1), 45))

    @property
    def frames(self) -> tuple[str, str]:
        """From which frame the attitude leads to which."""
        return (self.named.frame, _BODY) if self.asked.source == "space" else (_BODY, self.named.frame)

    def parts(self, state: list[Decimal]) -> tuple[list[Decimal], list[Decimal]]:
        """Attitude, and rates if there are any."""
        quaternion, rates, zero = state[:4], state[4:], Decimal(0)
        if self.named.turn is not None:
            quaternion = product([*self.named.turn[2:], zero, zero], quaternion)
        turning = [x / 2 for x in product(quaternion, [zero, *rates])] if rates else []
        if self.asked.source == "body":
            quaternion, turning = ([q[0], *(-x for x in q[1:])] if q else q for q in (quaternion, turning))
            rates = [-w for w in rates]
        found = [*quaternion[1:], quaternion[0]]
        spin = self.asked.type == "spin"
        if spin or self.asked.type.startswith("euler"):
            q = unit_quaternion(self._context, [self._context.mpf(str(x)) for x in quaternion])
            sequence = "zxz" if spin else self.asked.sequence
            angles = euler_from_matrix(self._context, rotation_matrix(q), sequence)
            found = [Decimal(mpmath.nstr(self._context.degrees(x), 25)) for x in angles]
        if spin:  # turns by alpha + 90 deg, 90 deg - delta and the spin angle
            return [found[0] - 90, 90 - found[1], found[2]], [rates[2] * self._degrees]
        if self.asked.type.endswith("derivative"):
            return found, [*turning[1:], turning[0]]
        return found, [w * self._degrees for w in rates]


def write_aem(table: Table, path: Path, source: TableSource) -> None:
    """Write the attitude of one run, by default of type QUATERNION."""
    rows = _Attitude("AEM", table, source)
    asked = rows.asked
    keys = dict(zip(("REF_FRAME_A", "REF_FRAME_B"), rows.frames, strict=True))
    kind, sequence = asked.type.upper(), asked.sequence.upper()
    if asked.old:
        kind, sequence = kind.replace("ANGVEL", "RATE"), sequence.translate(str.maketrans("XYZ", "123"))
    opening = "ATTITUDE_DIR = A2B\n" * asked.old + f"ATTITUDE_TYPE = {kind}\n"
    opening += "QUATERNION_TYPE = LAST\n" * (asked.old and kind.startswith("QUATERNION"))
    opening += f"EULER_ROT_SEQ = {sequence}\n" * kind.startswith("EULER")
    if asked.type.endswith("angvel"):
        along = f"REF_FRAME_{'B' if asked.source == 'space' else 'A'}"
        opening += f"RATE_FRAME = {along}\n" if asked.old else f"ANGVEL_FRAME = {_BODY}\n"
    opening += "META_STOP\n\nDATA_START\n"

    def row(state: list[Decimal]) -> list[Decimal]:
        return [x for part in rows.parts(state) for x in part]

    _write("AEM", table, path, source, rows.named, rows.columns, keys, row, opening, "DATA_STOP\n", asked)


def write_apm(table: Table, path: Path, source: TableSource) -> None:
    """Write the attitude of one sample, by default the last."""
    rows = _Attitude("APM", table, source)
    named, asked, time = rows.named, rows.asked, _time_of(table)
    row = table.rows - 1
    if asked.at is not None:
        times = table.dataset["time"].values
        row = int(np.argmin(np.abs(times - asked.at)))
        near = f"--message at: no sample is at {asked.at!r} s; the nearest is at {float(times[row])!r} s"
        ensure(abs(times[row] - asked.at) <= 1e-9 * max(abs(asked.at), 1e-9), RigidsimError(near))
    columns = [time, *rows.columns]
    values = [
        [np.atleast_1d(table.dataset[part].isel(time=row).values[column.index]) for part in column.parts]
        for column in columns
    ]
    seconds, *state = (decimals(parts, source.bits)[0] for parts in values)
    with localcontext(_WIDE):
        attitude, rates = rows.parts(state)
    block, names = "QUAT", ["Q1", "Q2", "Q3", "QC"]
    if asked.type == "spin":
        block, names = "SPIN", ["SPIN_ALPHA", "SPIN_DELTA", "SPIN_ANGLE", "SPIN_ANGLE_VEL"]
        attitude, rates = [*attitude, *rates], []
    elif asked.type.startswith("euler"):
        block, names = "EULER", ["ANGLE_1", "ANGLE_2", "ANGLE_3"]
    frames = [f"REF_FRAME_{x} = {name}" for x, name in zip("AB", rows.frames, strict=True)]
    own = rates if asked.type.endswith("derivative") else []
    lines = [
        *_head("APM", source, named, {}, asked),
        f"EPOCH = {_tag(named.epoch, seconds, asked.time)}", "",
        f"{block}_START", *frames,
        *([f"EULER_ROT_SEQ = {asked.sequence.upper()}"] if block == "EULER" else []),
        *(f"{name} = {_number(x)}" for name, x in zip(names, attitude, strict=True)),
        *(f"{name}_DOT = {_number(x)}" for name, x in zip(names, own, strict=False)),
        f"{block}_STOP",
    ]  # fmt: skip
    if asked.type.endswith("angvel"):
        components = (f"ANGVEL_{x} = {_number(w)}" for x, w in zip("XYZ", rates, strict=True))
        lines += ["", "ANGVEL_START", *frames, f"ANGVEL_FRAME = {_BODY}", *components, "ANGVEL_STOP"]
    path.write_text("\n".join([*lines, ""]), encoding="ascii", newline="\n")


# --- messages along time ------------------------------------------------------------------------------------


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
        known = {column.name for column in columns}
        lacking = next(name for name in names if name not in known).rpartition("_")[0]
        raise RigidsimError(
            f"the run recorded no {lacking}, which an {message} is made of; name it in "
            "[output] record (a body that only turns has no position)"
        )
    return columns


def _time_of(table: Table) -> TableColumn:
    time = table.columns[0]
    if not table.rows or time.name != "time":
        raise RigidsimError("the run holds no samples yet; there is nothing to export")
    return time


def _head(
    message: str, source: TableSource, named: Labels, keys: Mapping[str, str], asked: _Asked
) -> list[str]:
    """The header, and the metadata that all segments share."""
    notes = [
        f"rigidsim run {source.title}, numbers rounded to the 16 digits that the standard allows",
        *named.notes,
    ]
    plain = ("".join(c if " " <= c <= "~" else "?" for c in note) for note in notes)
    return [
        f"CCSDS_{message}_VERS = {asked.version}.0",
        *(f"COMMENT {note[: _LONGEST_LINE - 8]}" for note in plain),
        f"CREATION_DATE = {datetime.now(UTC).strftime('%Y-%m-%dT%H:%M:%S')}",
        "ORIGINATOR = RIGIDSIM",
        "",
        *(["META_START"] if message != "APM" else []),
        _keyword("OBJECT_NAME", source.naming.object_name or source.title),
        _keyword("OBJECT_ID", source.naming.object_id or "UNKNOWN"),
        *(_keyword(name, value) for name, value in keys.items()),
        f"TIME_SYSTEM = {asked.time or named.epoch.scale}",
    ]


def _segment_ends(table: Table, asked: _Asked) -> list[tuple[int, int]]:
    """First and last row of each segment; a row that ends one begins the next."""
    last = table.rows - 1
    if asked.segment is None or last == 0:
        return [(0, last)]
    if isinstance(asked.segment, int):
        edges = [*range(0, last, asked.segment), last]
    else:
        passed = np.abs(table.dataset["time"].values - table.dataset["time"].values[0])
        starts = np.searchsorted(passed, np.arange(0.0, passed[-1], asked.segment))
        edges = [*dict.fromkeys(int(row) for row in starts if row < last), last]
    return list(pairwise(edges))


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
    asked: _Asked | None = None,
) -> None:
    """Write the lines ``TAG NUMBER ...`` of some columns, whose rows are ``shown`` in the message's units,
    order and axes, below its header and, in each segment, its metadata with some ``keys``.
    """
    time, asked = _time_of(table), asked or _Asked()
    ends = _segment_ends(table, asked)
    head = _head(message, source, named, keys, asked)
    metadata = head[head.index("META_START") :]

    def begin(number: int) -> str:
        lines = ["", *metadata] if number else [*head]
        for word, row in zip(("START", "STOP"), ends[number], strict=True):
            parts = [np.atleast_1d(table.dataset[x].isel(time=row).values) for x in time.parts]
            lines.append(f"{word}_TIME = {_tag(named.epoch, decimals(parts, source.bits)[0], asked.time)}")
        return "\n".join([*lines, opening])

    previous, row, segment = "", 0, 0
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write(begin(0))
        for block in table.blocks([time, *columns]):
            bad = np.flatnonzero(~np.isfinite([parts[0] for parts in block]).all(axis=0))
            if bad.size:
                raise RigidsimError(
                    f"sample {row + int(bad[0])} holds a number that isn't finite, which no message can "
                    "carry; export csv"
                )
            for seconds, *state in zip(*(decimals(parts, source.bits) for parts in block), strict=True):
                now = _tag(named.epoch, seconds, asked.time)
                if now == previous:
                    raise RigidsimError(
                        f"samples {row - 1} and {row} are closer than 1e-{DIGITS} s, which time tags can't "
                        "distinguish; export csv, or sample less often"
                    )
                with localcontext(_WIDE):
                    line = " ".join([now, *map(_number, shown(state))]) + "\n"
                file.write(line)
                if row == ends[segment][1] and segment < len(ends) - 1:
                    segment += 1
                    file.write(closing + begin(segment) + line)
                previous, row = now, row + 1
        file.write(closing)


def _tag(epoch: Epoch, seconds: Decimal, scale: str = "") -> str:
    """The time tag ``YYYY-MM-DDThh:mm:ss.d`` of a time of the scene, by default in the epoch's scale, to
    1e-14 s.
    """
    try:
        found = epoch.after(seconds)
        return (found if scale in ("", epoch.scale) else found.in_scale(scale)).calendar()
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


_NAMES = ("epoch", "axes", "object_name", "object_id")
APM = Format(write_apm, names=(*_NAMES, "center", "message"))
AEM = replace(APM, write=write_aem, ascending=True)
OEM = Format(write_oem, ascending=True)
