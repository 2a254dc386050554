"""Common parts of the CCSDS ephemeris messages: time tags, numbers and lines of their KVN syntax.

Attitude Data Messages, CCSDS 504.0-B-2, section 6 (the orbit messages, CCSDS 502.0-B, agree with it): lines
of at most 254 printable ASCII characters; numbers of at most 16 digits, so that a double is rounded to a
few parts in 1e16; no nan, infinity or negative zero; text all upper case.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from decimal import Decimal

import numpy as np

from rigidsim.errors import RigidsimError
from rigidsim.formats.decimals import decimals
from rigidsim.formats.naming import Labels
from rigidsim.formats.registry import TableSource
from rigidsim.formats.tables import Table, TableColumn
from rigidsim.scene.epochs import DIGITS, Epoch

LONGEST_LINE = 254


def tag(epoch: Epoch, seconds: Decimal) -> str:
    """The time tag ``YYYY-MM-DDThh:mm:ss.d`` of a time of the scene, in the epoch's scale, to 1e-14 s."""
    try:
        return epoch.after(seconds).calendar()
    except ValueError as error:
        raise RigidsimError(
            f"a sample at {seconds:.6g} s after {epoch} has no time tag: {error}; or export csv"
        ) from None


def number(value: Decimal) -> str:
    """Sixteen significant digits, as ``-1.234567890123456e-1``; zero without a sign."""
    return f"{value:.15e}" if value else "0.000000000000000e+0"


def _keyword(name: str, value: str) -> str:
    """A ``NAME = VALUE`` line."""
    text = value.upper()
    if not re.fullmatch(r"[\x21-\x7e]([\x20-\x7e]*[\x21-\x7e])?", text) or len(text) > 200:
        raise RigidsimError(f"{name}: given {value[:60]!a}; 1 to 200 printable ASCII characters are allowed")
    return f"{name} = {text}"


def opening(
    message: str,
    table: Table,
    source: TableSource,
    labels: Labels,
    frames: Sequence[tuple[str, str]],
    *ending: str,
) -> list[str]:
    """The lines above a message's data: header and metadata."""
    naming = source.naming
    start, stop = _span(table, labels.epoch, source.bits)
    notes = [
        f"rigidsim run {source.title}, numbers rounded to the 16 digits that the standard allows",
        *labels.notes,
    ]
    return [
        f"CCSDS_{message}_VERS = 2.0",
        *_comments(notes),
        f"CREATION_DATE = {datetime.now(UTC).strftime('%Y-%m-%dT%H:%M:%S')}",
        "ORIGINATOR = RIGIDSIM",
        "",
        "META_START",
        _keyword("OBJECT_NAME", naming.object_name or source.title),
        _keyword("OBJECT_ID", naming.object_id),
        *(_keyword(name, value) for name, value in frames),
        f"TIME_SYSTEM = {labels.epoch.scale}",
        f"START_TIME = {start}",
        f"STOP_TIME = {stop}",
        *ending,
        "META_STOP",
        "",
    ]


def _comments(lines: Sequence[str]) -> list[str]:
    """COMMENT lines, in printable ASCII, none too long."""
    plain = ("".join(c if " " <= c <= "~" else "?" for c in line) for line in lines)
    return [f"COMMENT {line[: LONGEST_LINE - 8]}" for line in plain]


def columns_of(table: Table, variable: str, labels: Sequence[str], message: str) -> list[TableColumn]:
    """The columns of a variable."""
    found = [table.column(f"{variable}_{label}") for label in labels]
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
        ends.append(tag(epoch, decimals(parts, bits)[0]))
    return ends[0], ends[1]


def data_lines(
    table: Table,
    columns: Sequence[TableColumn],
    epoch: Epoch,
    bits: int,
    shown: Callable[[list[Decimal]], list[Decimal]],
) -> Iterator[str]:
    """Data lines ``TAG NUMBER ...``.

    Args:
        shown: converts a row's numbers: units, order, axes.
    """
    previous, row = "", 0
    for block in table.blocks([table.columns[0], *columns]):
        _refuse_non_finite(block, "sample", row)
        times, *values = (decimals(parts, bits) for parts in block)
        for time, *state in zip(times, *values, strict=True):
            now = tag(epoch, time)
            if now == previous:
                raise RigidsimError(
                    f"samples {row - 1} and {row} are closer than 1e-{DIGITS} s, which time tags can't "
                    "tell apart; export csv, or sample less often"
                )
            yield " ".join([now, *(number(value) for value in shown(state))])
            previous, row = now, row + 1


def _refuse_non_finite(block: Sequence[Sequence[np.ndarray]], what: str, row: int) -> None:
    for parts in block:
        bad = np.flatnonzero(~np.isfinite(parts[0]))
        if bad.size:
            raise RigidsimError(
                f"{what} {row + int(bad[0])} holds a number that isn't finite, which no message can carry; "
                "export csv"
            )
