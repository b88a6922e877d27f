"""Folders that nobody else can have prepared: checked when they are opened, and used by their descriptor.

In a folder that everybody may write (``/tmp``) a name says nothing about who made what it names.  So a symlink is not
followed, owner and mode are those of the open descriptor, and files are reached through it: what the name means later
changes nothing.
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
    """The folder, created for us alone where there is none; returns its descriptor.

    Raises OSError when it cannot be made, MissingError as ``open_own``.
    """
    path.mkdir(parents=True, exist_ok=True, mode=0o700)
    return open_own(path)


def open_own(path: Path) -> int:
    """Descriptor of a folder that belongs to us and that only we can write.

    Raises MissingError when it is a symlink, another user's, or writable by others; OSError when it cannot be opened.
    """
    return _open_of(path, (os.geteuid(),))


def check_trusted(path: Path) -> None:
    """Raise MissingError when a folder is a symlink, neither ours nor root's, or writable by others.

    What is no folder, or may not be opened, is for whoever needs it to say.
    """
    with contextlib.suppress(OSError):
        os.close(_open_of(path, (os.geteuid(), ROOT_UID)))


def _open_of(path: Path, owners: tuple[int, ...]) -> int:
    if path.is_symlink():
        raise MissingError(f"{path}: is a symlink, which another user may have put there; name the directory itself")
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
    """Write a file of our own (0600) so that a reader sees the old one or the new one, never half of it."""
    draft = f"{name}.new"
    remove_file(folder_fd, draft)
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    with os.fdopen(os.open(draft, flags, 0o600, dir_fd=folder_fd), "wb") as file:
        file.write(data)
    os.replace(draft, name, src_dir_fd=folder_fd, dst_dir_fd=folder_fd)


def remove_file(folder_fd: int, name: str) -> None:
    """Remove a file of an open folder, if it is there."""
    with contextlib.suppress(FileNotFoundError):
        os.unlink(name, dir_fd=folder_fd)


def path_within(folder_fd: int, name: str) -> str:
    """A path that means a file of this open folder, whatever becomes of the folder's name: for bind and connect."""
    return f"/proc/self/fd/{folder_fd}/{name}"
