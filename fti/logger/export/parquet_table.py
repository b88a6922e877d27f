"""Apache Parquet tables: typed columns, units in the metadata of each field and of the file.

The file's metadata ``units`` is a JSON table of column and unit.  ``session``, ``origin``, ``mode`` and more identify
the session; ``note`` marks a snapshot.  pandas, Polars, DuckDB and MATLAB read the columns.  The metadata ``pandas``
keep integers with unknown values integers there (``Int64``), which would lose the last digits of a time as floats.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from fti.logger.export.columns import Column, Type
from fti.logger.export.table_files import Format

#: Rows of one row group, which is collected in memory.
GROUP_ROWS = 4096
TYPES = {
    Type.INT: pa.int64(),
    Type.FLOAT: pa.float64(),
    Type.BOOL: pa.bool_(),
    Type.TEXT: pa.string(),
    Type.TEXTS: pa.list_(pa.string()),
    Type.BYTES: pa.binary(),
    Type.UTC: pa.timestamp("ns", "UTC"),
}


class ParquetTable:
    """A Parquet file (zstd).  An unknown value is null."""

    def __init__(self, path: Path, columns: Sequence[Column], session_metadata: Mapping[str, str]) -> None:
        self._schema = make_schema(columns, session_metadata)
        self._writer = pq.ParquetWriter(path, self._schema, compression="zstd")
        self._waiting: list[Sequence[Any]] = []

    def write(self, row: Sequence[Any]) -> None:
        """Add a row."""
        self._waiting.append(row)
        if len(self._waiting) >= GROUP_ROWS:
            self._write_group()

    def close(self) -> None:
        """Write the waiting rows and close the file."""
        try:
            self._write_group()
        finally:
            self._writer.close()

    def _write_group(self) -> None:
        columns = zip(*self._waiting, strict=True) if self._waiting else ()
        arrays = [pa.array(values, field.type) for values, field in zip(columns, self._schema, strict=False)]
        self._waiting.clear()
        if arrays:
            self._writer.write_table(pa.Table.from_arrays(arrays, schema=self._schema))


def make_schema(columns: Sequence[Column], session_metadata: Mapping[str, str]) -> pa.Schema:
    """The schema of a table with its units and the session metadata."""
    units = {column.name: column.unit for column in columns if column.unit}
    fields = [
        pa.field(column.name, TYPES[column.type], metadata={"unit": column.unit} if column.unit else None)
        for column in columns
    ]
    pandas = json.dumps({"index_columns": [], "column_indexes": [], "columns": _pandas_columns(columns)})
    return pa.schema(fields, metadata={**session_metadata, "units": json.dumps(units), "pandas": pandas})


def _pandas_columns(columns: Sequence[Column]) -> list[dict[str, Any]]:
    """The types of integers that may be unknown, in the form of pandas' own metadata."""
    int64 = {"pandas_type": "int64", "numpy_type": "Int64", "metadata": None}
    names = [column.name for column in columns if column.type is Type.INT and column.nullable]
    return [{"name": name, "field_name": name, **int64} for name in names]


PARQUET = Format(".parquet", ParquetTable)
