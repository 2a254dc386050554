"""CSV with all digits: comment lines, one header line, then decimal text.

    pandas.read_csv(path, comment="#", float_precision="round_trip")

reads it as float64 (which rounds numbers beyond double to the nearest one); ``dtype=str`` keeps every digit.
"""

import re
from decimal import Decimal
from pathlib import Path

import numpy as np

from rigidsim.formats.digits import texts
from rigidsim.formats.registry import Format, TableSource, named_epoch
from rigidsim.formats.tables import Table, TableColumn
from rigidsim.scene.epochs import DIGITS, Epoch


def write_csv(table: Table, path: Path, source: TableSource) -> None:
    """Write one table."""
    columns = [column for column in table.columns if column.kind != "M"]
    dates = _dates(table, source)
    wide = any(len(column.parts) > 1 for column in columns if "significant_bits" not in column.attributes)
    head = [
        f"# {_plain(source.title)}: {table.extent}",
        'read with pandas.read_csv(path, comment="#", float_precision="round_trip")',
        "units: " + ", ".join(f"{c.name} [{c.units}]" for c in columns if c.kind != "U"),
        *(f"{column.name}: {column.flags}" for column in columns if column.flags),
    ]
    swept = {c.variable: c.attributes["swept_key"] for c in columns if "swept_key" in c.attributes}
    if swept:
        head.append("axes: " + ", ".join(f"{name} is {_plain(key)}" for name, key in swept.items()))
    if wide:
        head.insert(2, f"numbers have {source.bits} bits; dtype=str keeps the digits that float64 can't hold")
    names = [column.name for column in columns]
    if dates is not None:
        epoch, dated = dates
        head.append(f"time 0 is {epoch}; dates are {epoch.scale}, to 1e-{DIGITS} s")
        names.insert(1, f"{dated.variable.removesuffix('time')}date")
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write("\n# ".join(head) + "\n")
        file.write(",".join(names) + "\n")
        for block in table.blocks(columns):
            shown = [_shown(c, parts, source) for c, parts in zip(columns, block, strict=True)]
            if dates is not None:
                shown.insert(1, [_date(epoch, time) for time in shown[columns.index(dated)]])
            file.writelines(",".join(row) + "\n" for row in zip(*shown, strict=True))


def _shown(column: TableColumn, parts: list[np.ndarray], source: TableSource) -> list[str]:
    """One column's numbers, or its strings in quotes."""
    if column.kind == "U":
        return [f'"{_on_one_line(text).replace(chr(34), chr(34) * 2)}"' for text in parts[0]]
    return texts(parts, column.bits(source.bits))


def _dates(table: Table, source: TableSource) -> tuple[Epoch, TableColumn] | None:
    """Date of time 0 and the column of times, if known and the calendar covers all rows; else None."""
    if table.members:  # datasets of sweeps hold no dates
        return None
    times = next((c for c in table.columns if re.fullmatch(r"(.*_)?time", c.variable)), None)
    if times is None or not table.rows or not (source.naming.epoch or source.attributes.get("epoch")):
        return None
    epoch = named_epoch(source.naming, source.attributes)
    try:
        for row in (0, -1):
            _date(epoch, repr(float(table.dataset[times.variable][row])))
    except (ValueError, ArithmeticError):
        return None
    return epoch, times


def _date(epoch: Epoch, seconds: str) -> str:
    return epoch.after(Decimal(seconds)).calendar()


def _plain(text: str) -> str:
    """Text on a single line of limited length."""
    return _on_one_line(text)[:200]


def _on_one_line(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)


FORMAT = Format(write_csv, angles=True, side_tables=True, names=("epoch",))
