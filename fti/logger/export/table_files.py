"""The files of tables: drafts, which get their names when all are complete.  Existing files are not overwritten."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

from fti.errors import StorageError
from fti.logger.export import session_file
from fti.logger.export.columns import Column


class TableWriter(Protocol):
    """A table that is being written.  ``close`` completes it."""

    def write(self, row: Sequence[Any]) -> None:
        """Add a row, in the order of the columns."""

    def close(self) -> None:
        """Write the waiting rows and close the file."""


@dataclass(frozen=True, slots=True)
class Format:
    """A table format.  open : creates a writer from a path, columns and session metadata; raises OSError."""

    suffix: str
    open: Callable[[Path, Sequence[Column], Mapping[str, str]], TableWriter]


class TableFiles:
    """The tables being written, as drafts in the target folder; an error removes all of them.

    rows : number of rows of each file
    """

    def __init__(self, folder: Path, table_format: Format, session_metadata: Mapping[str, str]) -> None:
        self._folder = folder
        self._format = table_format
        self._session_metadata = session_metadata
        self._open: dict[str, tuple[Path, TableWriter]] = {}
        self.rows: dict[Path, int] = {}

    def __enter__(self) -> TableFiles:
        session_file.check(self._folder, self._session_metadata)
        return self

    def open(self, name: str, columns: Sequence[Column]) -> None:
        """Begin a table.  name : of its file, without suffix.  Raises StorageError."""
        path = self._folder / (name + self._format.suffix)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            if path in self.rows or os.path.lexists(path):
                raise FileExistsError(None, "it exists already")
            self.rows[path] = 0  # from here on its draft is removed at the end
            self._open[name] = path, self._format.open(_draft(path), columns, self._session_metadata)
        except OSError as error:
            raise _refusal(path, error) from error

    def write(self, name: str, row: Sequence[Any]) -> None:
        """Add a row to a table.  Raises StorageError."""
        path, writer = self._open[name]
        try:
            writer.write(row)
        except OSError as error:
            raise _refusal(path, error) from error
        self.rows[path] += 1

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            for path, writer in self._open.values():
                _close_writer(path, writer, quietly=error is not None)
            if error is None:
                self._rename_drafts()
        finally:
            for path in self.rows:
                _draft(path).unlink(missing_ok=True)

    def _rename_drafts(self) -> None:
        """Write ``session.json``, then give the complete tables their names.  Raises StorageError."""
        try:
            if self.rows:
                session_file.write(self._folder, self._session_metadata)
            for path in self.rows:
                _draft(path).rename(path)
        except OSError as error:
            raise _refusal(self._folder, error) from error


def _draft(path: Path) -> Path:
    return path.with_name(path.name + ".part")


def _close_writer(path: Path, writer: TableWriter, *, quietly: bool) -> None:
    try:
        writer.close()
    except OSError as error:
        if not quietly:
            raise _refusal(path, error) from error


def _refusal(path: Path, error: OSError) -> StorageError:
    return StorageError(f"{path}: cannot be written: {error.strerror or error}")
