"""A place that a recording can go to: the folder of the session on one medium, which may come and go."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from fti.errors import StorageError
from fti.logger.file_mode import make_folder
from fti.logger.session import SessionFolder

MEGABYTE = 2**20


@dataclass(frozen=True, slots=True)
class StorageTarget:
    """A session folder that may not exist (yet, or for a while).

    mount : the mount point that it lies below.  When another one is in its place, the medium is not there, and what
            is written would hide behind the medium when it comes back.
    """

    folder: Path
    mount: Path

    @classmethod
    def of(cls, folder: str | Path) -> StorageTarget:
        """A place whose medium is there now."""
        return cls(Path(folder), find_mount_point(Path(folder)))

    def prepare(self, min_free_mb: float = 0.0) -> SessionFolder:
        """The folder, made if need be.  Raises StorageError when the medium is not there, refuses, or has less space.

        May take as long as the medium likes.
        """
        mount = find_mount_point(self.folder)
        if mount != self.mount:
            raise StorageError(f"{self.folder}: no medium is mounted on {self.mount}")
        try:
            self.folder.parent.mkdir(parents=True, exist_ok=True)
            if not self.folder.is_dir():
                make_folder(self.folder)
        except OSError as error:
            raise StorageError(f"{self.folder}: cannot be made: {error.strerror}") from error
        if min_free_mb and (free := free_mb(self.folder)) < min_free_mb:
            raise StorageError(
                f"{self.folder}: only {free:.0f} MB of {min_free_mb:g} MB (session.min_free_mb) are free"
            )
        return SessionFolder(self.folder)


def find_mount_point(path: Path) -> Path:
    """The mount point that a path lies below, or would lie below if it were made."""
    here = path.absolute()
    while not os.path.ismount(here) and here != here.parent:
        here = here.parent
    return here


def free_mb(folder: Path) -> float:
    """Space left for us where a folder lies [MiB].  Raises StorageError."""
    try:
        state = os.statvfs(folder)
    except OSError as error:
        raise StorageError(f"{folder}: cannot be asked for its free space: {error.strerror}") from error
    return state.f_bavail * state.f_frsize / MEGABYTE


@dataclass(frozen=True, slots=True)
class LostFile:
    """A file that its path does not lead to any more.  lost : it has been deleted, no path leads to it."""

    text: str
    lost: bool


class PathWatch:
    """Whether a path still leads to the file that was opened by it."""

    def __init__(self, path: Path, fd: int) -> None:
        self._path = path
        self._fd = fd
        self._tells = self._leads()  # some file systems number a file anew at every look

    def stray(self) -> LostFile | None:
        """None while the path leads to the file."""
        if os.fstat(self._fd).st_nlink == 0:
            return LostFile(f"{self._path}: was deleted while it was being written", lost=True)
        if self._tells and not self._leads():
            return LostFile(f"{self._path}: its folder has vanished; what comes goes on into the open file", lost=False)
        return None

    def _leads(self) -> bool:
        try:
            there = self._path.stat()
        except OSError:
            return False
        here = os.fstat(self._fd)
        return (here.st_dev, here.st_ino) == (there.st_dev, there.st_ino)
