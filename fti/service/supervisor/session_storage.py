"""Storage of a session: creates its folder on the main medium, or else on the fallback."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from fti.config import Session
from fti.errors import ConfigError, StorageError
from fti.logger.file_mode import set_file_mode
from fti.logger.recovery import close_unfinished
from fti.logger.session import SessionFolder
from fti.logger.storage_target import StorageTarget
from fti.messages.control import FileNumber
from fti.service.supervisor.event_publisher import Announce


class RepairNotice(NamedTuple):
    """A message about a repaired file, or a file that could not be repaired.  level : warning or error"""

    level: str
    text: str


class SessionStorage:
    """The storage targets of a session, the main one first, and the folder created for it.

    Raises StorageError when neither directory can be used, ConfigError when both are the same.
    """

    def __init__(self, session: Session, started_ns: int, announce: Announce) -> None:
        self.directories = [Path(text).absolute() for text in (session.directory, session.fallback) if text]
        if len({directory.resolve() for directory in self.directories}) < len(self.directories):
            raise ConfigError(f"session.fallback = {session.fallback!r}: must differ from session.directory")
        self._announce = announce
        set_file_mode(int(session.file_mode, 8))
        self.folder = self._make(session.name, started_ns)
        self.all = [StorageTarget.of(directory / self.folder.name) for directory in self.directories]

    def _make(self, name: str, started_ns: int) -> SessionFolder:
        main, *fallback = self.directories
        other = fallback[0] if fallback else None
        try:
            return SessionFolder.create(main, name, started_ns, other)
        except StorageError as error:
            if other is None:
                raise
            self._announce(f"error: storage: {error}; the session begins in {other}")
            return SessionFolder.create(other, name, started_ns, main)

    @property
    def folders(self) -> list[Path]:
        """The session's folder at each target, whether it exists or not."""
        return [target.folder for target in self.all]

    def close_killed_sessions(self, should_continue: Callable[[], bool]) -> list[RepairNotice]:
        """Close open files of killed sessions in the same directories; ``should_continue`` is called before each file.

        Returns notices about incomplete files, and about files that could not be closed.
        """
        closed = [
            found
            for directory in self.directories
            for found in close_unfinished.close_all(directory, in_use=self.folders, should_continue=should_continue)
        ]
        for folder, count in Counter(c.path.parent for c in closed if not c.fault).items():
            self._announce(f"closed {count} files in {folder}, left open by a killed session")
        return _notices(closed)

    def close_files(self, healthy_folders: Sequence[Path]) -> list[RepairNotice]:
        """Close open files of killed children in these folders; remove empty folders."""
        notices = []
        for folder in healthy_folders:
            notices += _notices(close_unfinished.close_session(folder))
            with contextlib.suppress(OSError):
                folder.rmdir()
        return notices


def _notices(closed: Sequence[close_unfinished.CloseResult]) -> list[RepairNotice]:
    return [
        RepairNotice("error" if found.fault else "warning", text) for found in closed if (text := found.describe_loss())
    ]


class FileNumbers:
    """The numbers that the recorders have taken, and the numbers of the written files."""

    def __init__(self) -> None:
        self._taken: set[int] = set()
        self._confirmed: set[int] = set()

    def handle_report(self, report: FileNumber) -> None:
        """Handle a report of a recorder."""
        (self._confirmed if report.confirmed else self._taken).add(report.number)

    @property
    def next(self) -> int:
        """The first number that the next recorder may take."""
        return max(self._taken | self._confirmed, default=-1) + 1

    @property
    def skipped_numbers(self) -> list[int]:
        """Smaller numbers without a known written file."""
        return sorted(self._taken - self._confirmed)
