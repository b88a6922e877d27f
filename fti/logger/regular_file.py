"""Opening files that were found by their names: only regular files are recordings, and nothing else is waited for.

Opening a FIFO waits for whoever writes into it, and opening a device may do anything.  What a name stands for is asked
before it is opened, and again of the open file, which may be another one by then.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

_KINDS = {
    stat.S_IFIFO: "a FIFO",
    stat.S_IFSOCK: "a socket",
    stat.S_IFDIR: "a folder",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def why_not_regular(path: Path) -> str | None:
    """Why this is not a file to be read, in words; None for a regular file."""
    try:
        _check(path.stat())
    except OSError as error:
        return error.strerror
    return None


def open_descriptor(path: Path, flags: int = os.O_RDONLY) -> int:
    """A descriptor of a regular file.  Raises OSError, with a sentence as ``strerror``, for anything else."""
    _check(path.stat())
    descriptor = os.open(path, flags | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        _check(os.fstat(descriptor))
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def open_regular(path: Path) -> BinaryIO:
    """A regular file, for reading bytes.  Raises OSError as ``open_descriptor``."""
    return os.fdopen(open_descriptor(path), "rb")


def mcap_files(folder: Path) -> Iterator[Path]:
    """The MCAP files of a folder; other things of such a name are left out."""
    return (path for path in folder.glob("*.mcap") if why_not_regular(path) is None)


def _check(status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        kind = _KINDS.get(stat.S_IFMT(status.st_mode), "something else")
        raise OSError(None, f"it is {kind}; a recording is a regular file")
