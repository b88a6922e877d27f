"""Where a session can be recorded: its folder is made on the main medium, or else on the fallback."""

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
from fti.service.supervisor.event_publisher import Announce


class RepairNotice(NamedTuple):
    """What is to be known of a file that was closed, or left alone.  level : warning or error"""

    level: str
    text: str


class SessionStorage:
    """The places of one session, the main one first, and the folder that was made for it.

    Raises StorageError when neither directory can hold it, ConfigError when both are the same.
    """

    def __init__(self, session: Session, started_ns: int, announce: Announce) -> None:
        self.directories = [Path(text).absolute() for text in (session.directory, session.fallback) if text]
        if len({directory.resolve() for directory in self.directories}) < len(self.directories):
            raise ConfigError(f"session.fallback = {session.fallback!r}: is session.directory itself")
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
        """The session's folder at each place, there or not."""
        return [place.folder for place in self.all]

    def close_others(self, should_continue: Callable[[], bool]) -> list[RepairNotice]:
        """Close what killed sessions left open beside this one; ``should_continue`` is asked before each file.

        Returns what is not whole, or was left alone.
        """
        closed = [
            found
            for directory in self.directories
            for found in close_unfinished.close_all(directory, in_use=self.folders, should_continue=should_continue)
        ]
        for folder, count in Counter(c.path.parent for c in closed if not c.fault).items():
            self._announce(f"closed {count} files of {folder}, which a killed session had left open")
        return _notices(closed)

    def close_files(self, healthy_folders: Sequence[Path]) -> list[RepairNotice]:
        """Close what a killed child left open in those folders; folders that hold nothing go."""
        remarks = []
        for folder in healthy_folders:
            remarks += _notices(close_unfinished.close_session(folder))
            with contextlib.suppress(OSError):
                folder.rmdir()
        return remarks


def _notices(closed: Sequence[close_unfinished.CloseResult]) -> list[RepairNotice]:
    return [
        RepairNotice("error" if found.fault else "warning", text) for found in closed if (text := found.describe_loss())
    ]
