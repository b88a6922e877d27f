"""Rows that wait in a temporary file until the columns of their tables are known: the recording is read once."""

from __future__ import annotations

import contextlib
import pickle
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from fti.errors import StorageError

#: Rows that are written together.
BATCH = 256


class JsonRow(NamedTuple):
    """A message: log time and publish time [ns], and the cells that it has, by column."""

    topic: str
    times: tuple[int, int]
    cells: dict[str, Any]


class RowSpool:
    """A file without a name, on the medium of a folder: the tables will be there.  Raises StorageError."""

    def __init__(self, folder: Path) -> None:
        self._place = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.is_dir())
        self._batch: list[JsonRow] = []
        with self._refusals():
            self._file = tempfile.TemporaryFile(dir=self._place)  # noqa: SIM115 - the spool closes it

    def __enter__(self) -> RowSpool:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with contextlib.suppress(OSError):  # a full medium: the bytes are not needed any more
            self._file.close()

    def add(self, row: JsonRow) -> None:
        """Add a row."""
        self._batch.append(row)
        if len(self._batch) >= BATCH:
            with self._refusals():
                self._write()

    def rows(self) -> Iterator[JsonRow]:
        """All rows, in their order."""
        with self._refusals():
            self._write()
            end = self._file.tell()
            self._file.seek(0)
        while self._file.tell() < end:
            yield from pickle.load(self._file)  # noqa: S301 - no other program can write to it

    def _write(self) -> None:
        pickle.dump(self._batch, self._file, pickle.HIGHEST_PROTOCOL)
        self._batch = []

    @contextlib.contextmanager
    def _refusals(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise StorageError(f"{self._place}: cannot be written: {error.strerror or error}") from error
