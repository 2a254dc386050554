"""What the CCSDS ephemeris messages share: time tags, numbers and lines of their KVN syntax.

Attitude Data Messages, CCSDS 504.0-B-2, section 6 (the orbit messages, CCSDS 502.0-B, agree with it): lines
of at most 254 printable ASCII characters; numbers of at most 16 digits, so that a double is rounded to a
few parts in 1e16; no nan, infinity or negative zero; text all upper case.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime
from decimal import ROUND_HALF_EVEN, Decimal

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.formats.decimals import decimals
from rigidsim.formats.tables import Column, Table

TIME_SYSTEM = "TT"
LONGEST_LINE = 254
_FRACTION = 14  # digits of a second: 16 with the two of "ss", which is what a number may have
_DAY = 86400
_EPOCH = re.compile(r"(\d{4})-(\d{2})-(\d{2})T(\d{2}):(\d{2}):(\d{2}(?:\.\d{1,14})?)")


@dataclass(frozen=True)
class Naming:
    """What a dataset doesn't know of itself and a message must say.

    Attributes:
        epoch: ISO 8601 date and time (Terrestrial Time) of time zero of the scene.
        object_name: of the body; empty for the run's name.
        object_id: its international designator, or UNKNOWN.
        frame: what the scene's space axes are called.
        center: what the origin of positions is called.
    """

    epoch: str = "2000-01-01T12:00:00"
    object_name: str = ""
    object_id: str = "UNKNOWN"
    frame: str = "EME2000"
    center: str = "UNKNOWN"


class Tags:
    """Time tags ``YYYY-MM-DDThh:mm:ss.d`` of seconds since an epoch, by decimal arithmetic.

    Raises:
        RigidsimError: not a date and time.
    """

    def __init__(self, epoch: str) -> None:
        match = _EPOCH.fullmatch(epoch)
        try:
            if match is None:
                raise ValueError
            year, month, day, hour, minute = (int(match[n]) for n in range(1, 6))
            second = Decimal(match[6])
            if hour > 23 or minute > 59 or second >= 60:
                raise ValueError
            days = date(year, month, day).toordinal()
        except ValueError:
            raise RigidsimError(
                f'--epoch: given "{epoch[:60]}"; a date and time such as 2000-01-01T12:00:00 is allowed'
            ) from None
        self._origin = days * _DAY + hour * 3600 + minute * 60 + second

    def tag(self, seconds: Decimal) -> str:
        """The tag of a time, to 1e-14 s.

        Raises:
            RigidsimError: not between the years 1 and 9999.
        """
        whole = seconds.to_integral_value(rounding="ROUND_FLOOR")
        step = Decimal(1).scaleb(-_FRACTION)
        fraction = (seconds - whole).quantize(step, rounding=ROUND_HALF_EVEN) + self._origin % 1
        total = int(whole) + int(self._origin // 1) + int(fraction)
        day, second = divmod(total, _DAY)
        if not 1 <= day <= date.max.toordinal():
            raise RigidsimError(
                f"a sample at {seconds:.6g} s after the epoch isn't between the years 1 and 9999, which time "
                "tags can name; choose another --epoch, or csv"
            )
        digits = f"{fraction % 1:.{_FRACTION}f}"[2:].rstrip("0")
        clock = f"{second // 3600:02}:{second // 60 % 60:02}:{second % 60:02}"
        return f"{date.fromordinal(day).isoformat()}T{clock}.{digits or '0'}"


def number(value: Decimal) -> str:
    """Sixteen significant digits, as ``-1.234567890123456e-1``; zero without a sign."""
    return f"{value:.15e}" if value else "0.000000000000000e+0"


def keyword(name: str, value: str) -> str:
    """A ``NAME = VALUE`` line.

    Raises:
        RigidsimError: the value holds characters that a message can't.
    """
    text = value.upper()
    if not re.fullmatch(r"[\x21-\x7e]([\x20-\x7e]*[\x21-\x7e])?", text) or len(text) > 200:
        raise RigidsimError(f"{name}: given {value[:60]!a}; 1 to 200 printable ASCII characters are allowed")
    return f"{name} = {text}"


def comments(lines: Sequence[str]) -> list[str]:
    """COMMENT lines, in printable ASCII, none too long."""
    plain = ("".join(c if " " <= c <= "~" else "?" for c in line) for line in lines)
    return [f"COMMENT {line[: LONGEST_LINE - 8]}" for line in plain]


def created() -> str:
    """CREATION_DATE, UTC."""
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%S")


def columns_of(table: Table, variable: str, labels: Sequence[str], message: str) -> list[Column]:
    """The columns of a variable.

    Raises:
        RigidsimError: it wasn't recorded.
    """
    found = [table.column(f"{variable}_{label}") for label in labels]
    if any(column is None for column in found):
        raise RigidsimError(
            f"the run recorded no {variable}, which an {message} is made of; name it in [output] record (a "
            "body that only turns has no position)"
        )
    return [column for column in found if column is not None]


def span(table: Table, tags: Tags, bits: int) -> tuple[str, str]:
    """Tags of the first and the last sample.

    Raises:
        RigidsimError: no samples, or times that have no tag.
    """
    time = table.columns[0]
    if not table.rows or time.name != "time":
        raise RigidsimError("the run holds no samples yet; there is nothing to export")
    ends = []
    for row in (0, -1):
        parts = [np.atleast_1d(table.dataset[part].isel(time=row).values) for part in time.parts]
        _refuse_non_finite([parts], "time", row)
        ends.append(tags.tag(decimals(parts, bits)[0]))
    return ends[0], ends[1]


def data_lines(
    table: Table, columns: Sequence[Column], tags: Tags, bits: int, power_of_ten: int = 0
) -> Iterator[str]:
    """Lines ``TAG NUMBER ...``, the numbers times ``10**power_of_ten``.

    Raises:
        RigidsimError: a number that isn't finite, or neighbours in time with the same tag.
    """
    previous, row = "", 0
    for block in table.blocks([table.columns[0], *columns]):
        _refuse_non_finite(block, "sample", row)
        times, *values = (decimals(parts, bits) for parts in block)
        for time, *state in zip(times, *values, strict=True):
            tag = tags.tag(time)
            if tag == previous:
                raise RigidsimError(
                    f"samples {row - 1} and {row} are closer than 1e-{_FRACTION} s, which time tags can't "
                    "tell apart; export csv, or sample less often"
                )
            yield " ".join([tag, *(number(value.scaleb(power_of_ten)) for value in state)])
            previous, row = tag, row + 1


def _refuse_non_finite(block: Sequence[Sequence[np.ndarray]], what: str, row: int) -> None:
    for parts in block:
        bad = np.flatnonzero(~np.isfinite(parts[0]))
        if bad.size:
            raise RigidsimError(
                f"{what} {row + int(bad[0])} holds a number that isn't finite, which no message can carry; "
                "export csv"
            )
