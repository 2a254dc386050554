"""Apache Parquet: float64 columns with their residuals, units in each column's metadata."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from rigidsim.formats.registry import Format, TableSource
from rigidsim.formats.tables import Table


def write_parquet(table: Table, path: Path, source: TableSource) -> None:
    """Write one table; residuals become columns such as ``time_lo``."""
    kinds = {"f": pa.float64(), "i": pa.int64(), "M": pa.timestamp("ns"), "U": pa.string()}
    fields = []
    for column in table.columns:
        for part in range(len(column.parts)):
            told = {"units": column.units, "long_name": str(column.attributes.get("long_name", ""))}
            if part:
                told["residual_of"] = column.name
            elif column.flags:
                told["flags"] = column.flags
            elif "exact_value" in column.attributes:
                told["exact_value"] = " + ".join(
                    column.part_name(n) for n in reversed(range(len(column.parts)))
                )
            kind = kinds[column.kind]
            fields.append(pa.field(column.part_name(part), kind, nullable=column.kind == "M", metadata=told))
    schema = pa.schema(fields, metadata={str(key): str(value) for key, value in source.attributes.items()})
    with pq.ParquetWriter(path, schema, compression="zstd", use_dictionary=False) as writer:
        for block in table.blocks():
            arrays = [pa.array(part) for parts in block for part in parts]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))


FORMAT = Format(write_parquet, angles=True, side_tables=True, names=())
