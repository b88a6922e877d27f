"""The folder of a session and the names of its files.  Existing files are never overwritten."""

from __future__ import annotations

import errno
import os
import re
import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import cast

from fti.constants import SECOND_NS
from fti.errors import FtiError, MissingError, StorageError
from fti.logger.file_mode import make_folder
from fti.logger.regular_file import why_not_regular
from fti.messages.topics import FileKind

#: The attachment of every file that holds the configuration of the session.
CONFIG_ATTACHMENT = "config.toml"
#: Kind of a file of a session.
Kind = FileKind
_FILE = re.compile(r"(?:_(?P<kind>derived|truth|snapshot))?_(?P<number>\d{3,})\.mcap$")


@dataclass(frozen=True, slots=True)
class SessionFolder:
    """A folder ``<name>_<UTC>_<n>`` with files ``FOLDER_NNN.mcap``, ``FOLDER_derived_NNN.mcap`` and so on."""

    path: Path

    @classmethod
    def create(
        cls, directory: str | Path, name: str, started_ns: int, other: str | Path | None = None
    ) -> SessionFolder:
        """Create a folder in ``directory``, which is created too; started_ns : real time [ns].

        n is the smallest number free in ``directory`` and in ``other``, the fallback directory.  Raises StorageError.
        """
        parent = Path(directory)
        stem = f"{name}_{datetime.fromtimestamp(started_ns // SECOND_NS, UTC):%Y%m%dT%H%M%SZ}"
        try:
            parent.mkdir(parents=True, exist_ok=True)
            for n in count():
                path = parent / f"{stem}_{n}"
                if not (other and os.path.lexists(Path(other) / path.name)) and _create_folder(path):
                    return cls(path)
        except OSError as error:
            raise _refusal(parent, error) from error
        raise AssertionError("unreachable: count() does not end")

    @classmethod
    def open(cls, path: str | Path) -> SessionFolder:
        """The folder of an existing session.  Raises MissingError."""
        if not Path(path).is_dir():
            raise MissingError(f"{path}: there is no such session folder")
        return cls(Path(path))

    @property
    def name(self) -> str:
        """Name of the folder, the prefix of its file names."""
        return self.path.absolute().name

    def file_path(self, kind: Kind, number: int) -> Path:
        """Path of a file."""
        part = "" if kind == "raw" else f"_{kind}"
        return self.path / f"{self.name}{part}_{number:03d}.mcap"

    def next_number(self, kind: Kind) -> int:
        """One above the highest existing number."""
        return max((number for number, _ in self._named(kind)), default=-1) + 1

    def next_path(self, kind: Kind) -> Path:
        """Path of the next file of a kind."""
        return self.file_path(kind, self.next_number(kind))

    def files(self, kind: Kind) -> list[Path]:
        """The regular files of a kind, in order of their numbers."""
        return [path for _, path in sorted(self._named(kind)) if why_not_regular(path) is None]

    def _named(self, kind: Kind) -> list[tuple[int, Path]]:
        """All paths with the name of such a file, with their numbers."""
        return [(number, path) for path in self.path.glob("*.mcap") for k, number in [name_parts(path)] if k == kind]


class Numbering:
    """Allocates the numbers of the files of one kind of a session, on all storage targets.  Thread-safe.

    A number is allocated before its file is created, confirmed when the file is written to, and released when the file
    was not created.  Files of a process have different numbers and are written in the order of their numbers.
    first_number    : the first number to allocate; smaller ones may be on a target that is absent
    skipped_numbers : numbers below ``first_number`` that an earlier process allocated and did not confirm
    on_change       : called with each number and False before its file is created, and with True when it is confirmed
    """

    def __init__(
        self,
        first_number: int = 0,
        skipped_numbers: Iterable[int] = (),
        on_change: Callable[[int, bool], None] | None = None,
    ) -> None:
        self._next = first_number
        self._unconfirmed = set(skipped_numbers)
        self._last_confirmed = -1
        self._on_change = on_change or (lambda number, confirmed: None)
        self._lock = threading.Lock()

    def allocate(self, folder: SessionFolder, kind: Kind) -> int:
        """Allocate the next number above all allocated ones and all in the folder."""
        next_in_folder = folder.next_number(kind)
        with self._lock:
            number = max(self._next, next_in_folder)
            self._next = number + 1
            self._unconfirmed.add(number)
        self._on_change(number, False)
        return number

    def confirm(self, number: int) -> None:
        """Note that the file is written to."""
        with self._lock:
            self._unconfirmed.discard(number)
            self._last_confirmed = max(self._last_confirmed, number)
        self._on_change(number, True)

    def release_number(self, number: int) -> None:
        """Release the number of a file that was not created; it is reused unless a greater one was allocated."""
        with self._lock:
            if self._next == number + 1:
                self._next = number
                self._unconfirmed.discard(number)

    def is_superseded(self, number: int) -> bool:
        """Has a file with a greater number been written to?  Then this number is too late."""
        with self._lock:
            return number < self._last_confirmed

    def unconfirmed_before(self, number: int) -> list[int]:
        """Smaller numbers that were allocated and not confirmed."""
        with self._lock:
            return sorted(other for other in self._unconfirmed if other < number)


def name_parts(path: Path) -> tuple[Kind, int]:
    """Kind and number in the name of a file; a foreign name is raw, number 0."""
    match = _FILE.search(path.name)
    if match is None:
        return "raw", 0
    return cast(Kind, match["kind"] or "raw"), int(match["number"])


def _create_folder(path: Path) -> bool:
    try:
        make_folder(path)
    except FileExistsError:
        return False
    return True


def _refusal(directory: Path, error: OSError) -> FtiError:
    reasons = {
        errno.EACCES: "you have no permission to write there",
        errno.EPERM: "you have no permission to write there",
        errno.EROFS: "it is on a read-only file system",
        errno.EEXIST: "it is a file, not a directory",
        errno.ENOTDIR: "a part of the path is a file, not a directory",
        errno.ENOSPC: "no space is left on the device",
    }
    reason = reasons.get(error.errno or 0, error.strerror or str(error))
    return StorageError(f"{directory}: cannot hold the recording: {reason}")
