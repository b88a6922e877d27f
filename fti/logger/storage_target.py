"""Storage target of a recording: the folder of the session on one medium, which may be absent at times."""

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
    """A session folder that may be absent.

    mount : its mount point.  A different mount point means that the medium is absent: files written then would be
            hidden when it is mounted again.
    """

    folder: Path
    mount: Path

    @classmethod
    def of(cls, folder: str | Path) -> StorageTarget:
        """The target of a folder whose medium is mounted now."""
        return cls(Path(folder), find_mount_point(Path(folder)))

    def prepare(self, min_free_mb: float = 0.0) -> SessionFolder:
        """The folder, created if necessary.  Raises StorageError when the medium is absent, refuses, or has less space.

        May block for as long as the medium does.
        """
        mount = find_mount_point(self.folder)
        if mount != self.mount:
            raise StorageError(f"{self.folder}: no medium is mounted on {self.mount}")
        try:
            self.folder.parent.mkdir(parents=True, exist_ok=True)
            if not self.folder.is_dir():
                make_folder(self.folder)
        except OSError as error:
            raise StorageError(f"{self.folder}: cannot be created: {error.strerror}") from error
        if min_free_mb and (free := free_mb(self.folder)) < min_free_mb:
            raise StorageError(
                f"{self.folder}: only {free:.0f} MB of {min_free_mb:g} MB (session.min_free_mb) are free"
            )
        return SessionFolder(self.folder)


def find_mount_point(path: Path) -> Path:
    """The mount point of a path, which need not exist."""
    point = path.absolute()
    while not os.path.ismount(point) and point != point.parent:
        point = point.parent
    return point


def free_mb(folder: Path) -> float:
    """Free space of the medium of a folder [MiB].  Raises StorageError."""
    try:
        state = os.statvfs(folder)
    except OSError as error:
        raise StorageError(f"{folder}: cannot read its free space: {error.strerror}") from error
    return state.f_bavail * state.f_frsize / MEGABYTE


@dataclass(frozen=True, slots=True)
class LostFile:
    """A file to which its path no longer leads.  is_deleted : no path leads to it."""

    text: str
    is_deleted: bool


class PathWatch:
    """Checks whether a path still leads to the file that was opened by it."""

    def __init__(self, path: Path, fd: int) -> None:
        self._path = path
        self._fd = fd
        self._was_reachable = self._is_reachable()  # some file systems change the number of a file with every access

    def find_lost_file(self) -> LostFile | None:
        """The file if the path no longer leads to it; else None."""
        if os.fstat(self._fd).st_nlink == 0:
            return LostFile(f"{self._path}: was deleted while it was being written", is_deleted=True)
        if self._was_reachable and not self._is_reachable():
            text = f"{self._path}: its folder has vanished; recording continues in the open file"
            return LostFile(text, is_deleted=False)
        return None

    def _is_reachable(self) -> bool:
        try:
            path_status = self._path.stat()
        except OSError:
            return False
        file_status = os.fstat(self._fd)
        return (file_status.st_dev, file_status.st_ino) == (path_status.st_dev, path_status.st_ino)
