"""Permissions of the files and folders of a session, independent of the umask of the process."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

#: Owner and group only.
DEFAULT = 0o640
_READ = 0o444

_mode = DEFAULT


def set_file_mode(mode: int) -> None:
    """Set the permissions of all files that this process creates from now on."""
    global _mode  # noqa: PLW0603 - a property of the process, like its umask
    _mode = mode


def create_file(path: Path) -> int:
    """Create a file that must not exist, for reading and writing; returns its descriptor.  Raises OSError."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    with contextlib.suppress(OSError):  # file systems without permissions, as on memory sticks
        os.fchmod(descriptor, _mode)
    return descriptor


def make_folder(path: Path) -> None:
    """Create a folder that must not exist.  Raises OSError."""
    path.mkdir(mode=0o700)
    with contextlib.suppress(OSError):
        path.chmod(_mode | (_mode & _READ) >> 2)  # readers of the files may enter the folder: 0750 for 0640
