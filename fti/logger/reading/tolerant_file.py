"""Reader of a file that may be damaged, on a medium that may be damaged."""

from __future__ import annotations

import os
from pathlib import Path

from fti.errors import MissingError
from fti.logger.regular_file import open_descriptor

#: Unit that is read as zeros after a read error [B].
SECTOR = 4096
_STEP = 2**30


class TolerantFile:
    """A file, or a part of it, by position.  Unreadable bytes are zeros, counted in ``unreadable``.

    begin, end : the part [B]; position 0 is its begin; end None : to the end of the file
    strict     : raise MissingError at unreadable bytes
    Raises MissingError when the file cannot be opened.
    """

    def __init__(self, path: Path, begin: int = 0, end: int | None = None, *, strict: bool = False) -> None:
        self.path = path
        self.unreadable = 0
        self._begin = begin
        self._is_strict = strict
        try:
            self._fd = open_descriptor(path)
        except OSError as error:
            raise MissingError(f"{path}: cannot be read: {error.strerror}") from error
        self.size = (os.fstat(self._fd).st_size if end is None else end) - begin

    def __enter__(self) -> TolerantFile:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._fd)

    def read(self, at: int, size: int) -> bytes:
        """``size`` bytes from ``at``; fewer only at the end of the file."""
        if at >= self.size:
            return b""
        size = min(size, self.size - at)
        data = self._piece(at, min(size, _STEP))
        if len(data) == size:
            return data
        parts = bytearray(data)
        while len(parts) < size:
            parts += self._piece(at + len(parts), min(size - len(parts), _STEP))
        return bytes(parts)

    def _piece(self, at: int, size: int) -> bytes:
        """One read; zeros for unreadable bytes, so that the caller can continue."""
        try:
            return os.pread(self._fd, size, self._begin + at) or bytes(size)
        except OSError as error:
            if self._is_strict:
                raise MissingError(f"{self.path}: cannot be read: {error.strerror}") from error
            if size > SECTOR:
                return self._piece(at, SECTOR - at % SECTOR)
            self.unreadable += size
            return bytes(size)
