"""The rows of a profile as text: file, line and cells.  ``fault_table`` interprets them."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from fti import config as configuration
from fti.errors import ConfigError

COLUMNS = ("time", "channel", "value", "fault", "expected", "plus", "minus", "within")
REQUIRED_COLUMNS = ("time", "channel")


@dataclass(frozen=True, slots=True)
class FaultTableRow:
    """A row of the table: file and line, for error messages, and its stripped cells."""

    file: str
    line: int
    cells: Mapping[str, str]

    def __getitem__(self, column: str) -> str:
        return self.cells.get(column, "")

    def error(self, column: str, allowed: str) -> ConfigError:
        """The error of a cell."""
        return ConfigError(f"{self.file}: line {self.line}, {column} = {self[column]!r}: {allowed}")

    def number(self, column: str, otherwise: float) -> float:
        """The number in a cell; ``otherwise`` if it is empty.  Raises ConfigError."""
        try:
            return float(self[column]) if self[column] else otherwise
        except ValueError:
            raise self.error(column, "must be a number") from None

    def bind_model(self, model: type[Any], table: Mapping[str, Any], column: str) -> Any:
        """The model of a table from this row.  Raises ConfigError."""
        return configuration.bind(model, table, self.file, f"line {self.line}, {column}")


def rows(text: str, file: str) -> Iterator[FaultTableRow]:
    """The rows below the header.  Raises ConfigError."""
    header: list[str] | None = None
    reader = csv.reader(text.removeprefix("\ufeff").splitlines(keepends=True), strict=True, skipinitialspace=True)
    try:
        for cells in reader:
            if not any(cell.strip() for cell in cells) or cells[0].lstrip().startswith("#"):
                continue
            stripped = [cell.strip() for cell in cells]
            if header is None:
                header = _checked_header(stripped, file, reader.line_num)
            else:
                yield _row(header, stripped, file, reader.line_num)
    except csv.Error as error:
        raise ConfigError(f"{file}: line {reader.line_num}: is not valid CSV: {error}") from None
    if header is None:
        raise ConfigError(f"{file}: is empty; its first line must name the columns: {', '.join(COLUMNS)}")


def _checked_header(names: list[str], file: str, line: int) -> list[str]:
    for name in names:
        if name not in COLUMNS or names.count(name) > 1:
            fault = "duplicate" if name in COLUMNS else "unknown"
            raise ConfigError(f"{file}: line {line}: {fault} column {name!r}; allowed: {', '.join(COLUMNS)}")
    if missing := [name for name in REQUIRED_COLUMNS if name not in names]:
        raise ConfigError(
            f"{file}: line {line}: missing column {missing[0]!r}; required: {', '.join(REQUIRED_COLUMNS)}"
        )
    return names


def _row(header: list[str], cells: list[str], file: str, line: int) -> FaultTableRow:
    if extra := [cell for cell in cells[len(header) :] if cell]:
        raise ConfigError(f"{file}: line {line}: {extra[0]!r} is beyond the last column; the header has {len(header)}")
    return FaultTableRow(file, line, dict(zip(header, cells, strict=False)))
