"""Opening of regular files only: recordings are found by name, and a name may lead to something else.

Opening a FIFO blocks until a writer opens it, and opening a device may have side effects.  The type is checked before
the file is opened, and again on the descriptor, because the name may lead to another file by then.
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
    """Why a path is not a regular file; None for a regular file."""
    try:
        _check(path.stat())
    except OSError as error:
        return error.strerror
    return None


def open_descriptor(path: Path, flags: int = os.O_RDONLY) -> int:
    """Descriptor of a regular file.  Raises OSError, with a sentence as ``strerror``, for anything else."""
    _check(path.stat())
    descriptor = os.open(path, flags | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        _check(os.fstat(descriptor))
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file for reading bytes.  Raises OSError as ``open_descriptor``."""
    return os.fdopen(open_descriptor(path), "rb")


def mcap_files(folder: Path) -> Iterator[Path]:
    """The regular MCAP files of a folder."""
    return (path for path in folder.glob("*.mcap") if why_not_regular(path) is None)


def _check(status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        kind = _KINDS.get(stat.S_IFMT(status.st_mode), "something else")
        raise OSError(None, f"it is {kind}; a recording is a regular file")
