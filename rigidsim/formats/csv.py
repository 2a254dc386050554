"""CSV with all digits: comment lines, one line of names, then decimal text.

    pandas.read_csv(path, comment="#", float_precision="round_trip")

reads it as float64 (which rounds numbers beyond double to the nearest one); ``dtype=str`` keeps every digit.
"""

from __future__ import annotations

from pathlib import Path

from rigidsim.formats.decimals import texts
from rigidsim.formats.registry import Format, Source
from rigidsim.formats.tables import Table


def write_csv(table: Table, path: Path, source: Source) -> None:
    """Write one table.

    Args:
        table: rows and columns.
        path: the file; replaced.
        source: the run, for the comment at the top and for the digits.
    """
    wide = any(len(column.parts) > 1 for column in table.columns)
    head = [
        f"# {_plain(source.title)}: {table.rows} rows along {table.dim}",
        'read with pandas.read_csv(path, comment="#", float_precision="round_trip")',
        "units: " + ", ".join(f"{column.name} [{column.units}]" for column in table.columns),
    ]
    if wide:
        head.insert(2, f"numbers have {source.bits} bits; dtype=str keeps the digits that float64 can't hold")
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write("\n# ".join(head) + "\n")
        file.write(",".join(column.name for column in table.columns) + "\n")
        for block in table.blocks():
            columns = [texts(parts, source.bits) for parts in block]
            file.writelines(",".join(row) + "\n" for row in zip(*columns, strict=True))


def _plain(text: str) -> str:
    """On one line, whatever a title holds."""
    return "".join(c if c.isprintable() else " " for c in text)[:200]


FORMAT = Format(write_csv, side_tables=True)
