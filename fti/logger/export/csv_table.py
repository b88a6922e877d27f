"""CSV tables: units in the heads (``height_agl [m]``); an empty cell is an unknown value; times as in ISO 8601.

An apostrophe before texts that begin like a formula prevents evaluation by spreadsheets.  Control characters are
written as ``\\u001b``, so that a row is a line.  Parquet tables hold the original texts.

``session.json`` names the session, because most programs would read a comment in the file as a row.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

from fti.logger.export.columns import Column, Type
from fti.logger.export.table_files import Format
from fti.terminal_text import escape_controls

#: Spreadsheets evaluate cells with these begins, except numbers.
_FORMULA = ("=", "+", "-", "@")


def escape_formula(text: str) -> str:
    """Escape a text so that spreadsheets do not evaluate it; numbers stay numbers."""
    escaped = escape_controls(text)
    return f"'{escaped}" if escaped.startswith(_FORMULA) and not _is_number(escaped) else escaped


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def format_utc(t_ns: int) -> str:
    """``2026-01-02T03:04:05.000000006Z`` for a time in ns since 1970."""
    second, rest = divmod(t_ns, 1_000_000_000)
    return f"{_format_second(second)}.{rest:09d}Z"


@lru_cache(maxsize=64)
def _format_second(second: int) -> str:
    return datetime.fromtimestamp(second, UTC).strftime("%Y-%m-%dT%H:%M:%S")


class CsvTable:
    """A CSV file in UTF-8.  Bytes are hexadecimal; a list of texts is one cell, ``a b``."""

    def __init__(self, path: Path, columns: Sequence[Column], session_metadata: Mapping[str, str]) -> None:
        del session_metadata
        self._stream = path.open("w", newline="", encoding="utf-8")
        self._table = csv.writer(self._stream, lineterminator="\n")
        self._table.writerow([escape_formula(column.head) for column in columns])
        self._texts = [n for n, column in enumerate(columns) if column.type is Type.TEXT]
        self._words = [n for n, column in enumerate(columns) if column.type is Type.TEXTS]
        self._bytes = [n for n, column in enumerate(columns) if column.type is Type.BYTES]
        self._times = [n for n, column in enumerate(columns) if column.type is Type.UTC]

    def write(self, row: Sequence[Any]) -> None:
        """Add a row."""
        cells = list(row)
        for n in self._words:
            cells[n] = None if cells[n] is None else escape_formula(" ".join(cells[n]))
        for n in self._texts:
            cells[n] = None if cells[n] is None else escape_formula(cells[n])
        for n in self._bytes:
            cells[n] = cells[n].hex()
        for n in self._times:
            cells[n] = format_utc(cells[n])
        self._table.writerow(cells)

    def close(self) -> None:
        """Write the waiting rows and close the file."""
        self._stream.close()


CSV = Format(".csv", CsvTable)
