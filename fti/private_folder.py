"""Folders of this user alone: checked when they are opened, and used by their descriptor.

In a world-writable folder (``/tmp``) another user may have created or may replace any name.  So a symlink is not
followed, owner and mode are read from the open descriptor, and files are reached through that descriptor.
"""

from __future__ import annotations

import contextlib
import os
import stat
from pathlib import Path

from fti.errors import MissingError
from fti.peer_credentials import ROOT_UID, user_name

OPEN_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def make_own(path: Path) -> int:
    """Create the folder for this user alone if it does not exist; returns its descriptor.

    Raises OSError when it cannot be created, MissingError as ``open_own``.
    """
    path.mkdir(parents=True, exist_ok=True, mode=0o700)
    return open_own(path)


def open_own(path: Path) -> int:
    """Descriptor of a folder that belongs to this user and that no other user can write.

    Raises MissingError when it is a symlink, another user's, or writable by others; OSError when it cannot be opened.
    """
    return _open_of(path, (os.geteuid(),))


def check_trusted(path: Path) -> None:
    """Raise MissingError when a folder is a symlink, neither ours nor root's, or writable by others.

    A missing folder, or one that may not be opened, is not an error here.
    """
    with contextlib.suppress(OSError):
        os.close(_open_of(path, (os.geteuid(), ROOT_UID)))


def _open_of(path: Path, owners: tuple[int, ...]) -> int:
    if path.is_symlink():
        raise MissingError(f"{path}: is a symlink, which another user may have created; name the directory itself")
    fd = os.open(path, OPEN_FOLDER)
    found = os.fstat(fd)
    if found.st_uid not in owners:
        fault = f"belongs to {user_name(found.st_uid)}, not to {user_name(os.geteuid())}; only that user may use it"
    elif found.st_mode & WRITABLE_BY_OTHERS:
        fault = f"other users can write to it (mode {stat.S_IMODE(found.st_mode):04o}); chmod go-w {path}"
    else:
        return fd
    os.close(fd)
    raise MissingError(f"{path}: {fault}")


def read_file(folder_fd: int, name: str) -> bytes:
    """The content of a file in an open folder.  Raises OSError, also when it is a symlink."""
    with os.fdopen(os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=folder_fd), "rb") as file:
        return file.read()


def write_file(folder_fd: int, name: str, data: bytes) -> None:
    """Replace a file (mode 0600) atomically."""
    draft = f"{name}.new"
    remove_file(folder_fd, draft)
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    with os.fdopen(os.open(draft, flags, 0o600, dir_fd=folder_fd), "wb") as file:
        file.write(data)
    os.replace(draft, name, src_dir_fd=folder_fd, dst_dir_fd=folder_fd)


def remove_file(folder_fd: int, name: str) -> None:
    """Remove a file of an open folder, if it exists."""
    with contextlib.suppress(FileNotFoundError):
        os.unlink(name, dir_fd=folder_fd)


def path_within(folder_fd: int, name: str) -> str:
    """A path of a file in this open folder, also after the folder was renamed: for bind and connect."""
    return f"/proc/self/fd/{folder_fd}/{name}"
