"""Tables as CSV: units in the heads (``height_agl [m]``), an empty cell is a value that is not known.

A text that begins as a formula of a spreadsheet gets an apostrophe in front, so that none is evaluated; characters that
control a terminal are written as ``\\u001b``, so that a row is a line.  Parquet has texts as they are.

A comment in the file would be a row to most programs that read it; of which session it is, ``session.json`` says.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fti.logger.export.columns import Column, Type
from fti.logger.export.tables import Format
from fti.terminal_text import escape_controls

#: A cell that begins so is evaluated by spreadsheets, unless it is a number.
_FORMULA = ("=", "+", "-", "@")


def escape_formula(text: str) -> str:
    """The text as a spreadsheet takes it for a text; a number stays one."""
    shown = escape_controls(text)
    return f"'{shown}" if shown.startswith(_FORMULA) and not _is_number(shown) else shown


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


class CsvTable:
    """A CSV file in UTF-8.  Bytes are hexadecimal, texts of a list stand in one cell, as ``a b``."""

    def __init__(self, path: Path, columns: Sequence[Column], session_metadata: Mapping[str, str]) -> None:
        del session_metadata
        self._stream = path.open("w", newline="", encoding="utf-8")
        self._table = csv.writer(self._stream, lineterminator="\n")
        self._table.writerow([escape_formula(column.head) for column in columns])
        self._texts = [n for n, column in enumerate(columns) if column.type is Type.TEXT]
        self._words = [n for n, column in enumerate(columns) if column.type is Type.TEXTS]
        self._bytes = [n for n, column in enumerate(columns) if column.type is Type.BYTES]

    def write(self, row: Sequence[Any]) -> None:
        """Add a row."""
        cells = list(row)
        for n in self._words:
            cells[n] = None if cells[n] is None else escape_formula(" ".join(cells[n]))
        for n in self._texts:
            cells[n] = None if cells[n] is None else escape_formula(cells[n])
        for n in self._bytes:
            cells[n] = cells[n].hex()
        self._table.writerow(cells)

    def close(self) -> None:
        """Write what waits and close the file."""
        self._stream.close()


CSV = Format(".csv", CsvTable)
