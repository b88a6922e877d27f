"""Permissions of what a session makes: its files and folders, whatever the umask of the process is."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

#: For the owner and his group, and for nobody else.
DEFAULT = 0o640
_READ = 0o444

_mode = DEFAULT


def set_file_mode(mode: int) -> None:
    """Permissions of the files that this process makes from now on."""
    global _mode  # noqa: PLW0603 - of the process, as its umask is
    _mode = mode


def folder_mode(mode: int) -> int:
    """Who may read the files may enter their folder: 0750 for 0640."""
    return mode | (mode & _READ) >> 2


def create_file(path: Path) -> int:
    """Create a file that must not exist, for reading and writing; returns its descriptor.  Raises OSError."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    with contextlib.suppress(OSError):  # file systems without permissions, as those of memory sticks
        os.fchmod(descriptor, _mode)
    return descriptor


def make_folder(path: Path) -> None:
    """Make a folder that must not exist.  Raises OSError."""
    path.mkdir(mode=0o700)
    with contextlib.suppress(OSError):
        path.chmod(folder_mode(_mode))
