"""Reading a file that may be damaged, on a medium that may be too."""

from __future__ import annotations

import os
from pathlib import Path

from fti.errors import MissingError

#: What is read as zeros when the medium refuses to give it [B].
SECTOR = 4096
_STEP = 2**30


class Source:
    """A file by position.  What the medium refuses to give is read as zeros and counted in ``unreadable`` [B].

    Raises MissingError when the file cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.unreadable = 0
        try:
            self._fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        except OSError as error:
            raise MissingError(f"{path}: cannot be read: {error.strerror}") from error
        self.size = os.fstat(self._fd).st_size

    def __enter__(self) -> Source:
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
        """One read; zeros where there is nothing to be had, so that the caller goes on."""
        try:
            return os.pread(self._fd, size, at) or bytes(size)
        except OSError:
            if size > SECTOR:
                return self._piece(at, SECTOR - at % SECTOR)
            self.unreadable += size
            return bytes(size)
