"""Who holds a file: its writer has an exclusive lock on it, so that repair and pack leave it alone."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fti.errors import StorageError
from fti.logger.regular_file import open_descriptor


def is_being_written(path: Path) -> bool:
    """Does a writer hold the file?  Files that cannot be opened are not."""
    try:
        fd = open_descriptor(path)
    except OSError:
        return False
    try:
        fcntl.flock(fd, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(fd)
    return False


@contextmanager
def exclusive_lock(path: Path) -> Iterator[int]:
    """Hold a file against every writer, repair and pack; gives its descriptor.  Raises StorageError."""
    try:
        fd = open_descriptor(path, os.O_RDWR)
    except OSError as error:
        raise StorageError(f"{path}: cannot be opened for writing: {error.strerror}") from error
    try:
        _lock(path, fd)
        yield fd
    finally:
        os.close(fd)


def _lock(path: Path, fd: int) -> None:
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise StorageError(f"{path}: is being written by another process") from None
    except OSError as error:
        raise StorageError(f"{path}: cannot be locked: {error.strerror}") from error
