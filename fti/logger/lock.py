"""File locks: a writer holds an exclusive lock, so that repair and pack do not touch its file."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fti.errors import StorageError
from fti.logger.regular_file import open_descriptor


def is_being_written(path: Path) -> bool:
    """Does a writer hold the lock of the file?  False for a file that cannot be opened."""
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
    """Lock a file against writers, repair and pack; yields its descriptor.  Raises StorageError."""
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
