"""Where a session can be recorded: its folder is made on the main medium, or else on the fallback."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from fti.config import Session
from fti.errors import ConfigError, StorageError
from fti.logger.places import Place
from fti.logger.recovery import repair
from fti.logger.session import SessionFolder
from fti.service.bulletin import Announce


class SessionPlaces:
    """The places of one session, the main one first, and the folder that was made for it.

    Raises StorageError when neither directory can hold it, ConfigError when both are the same.
    """

    def __init__(self, session: Session, started_ns: int, announce: Announce) -> None:
        self.directories = [Path(text).absolute() for text in (session.directory, session.fallback) if text]
        if len({directory.resolve() for directory in self.directories}) < len(self.directories):
            raise ConfigError(f"session.fallback = {session.fallback!r}: is session.directory itself")
        self._announce = announce
        self.folder = self._make(session.name, started_ns)
        self.all = [Place.of(directory / self.folder.name) for directory in self.directories]

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

    def repair_others(self, goes_on: Callable[[], bool]) -> None:
        """Close what killed sessions left open beside this one, and say so; ``goes_on`` is asked before each file."""
        closed = [
            found
            for directory in self.directories
            for found in repair.close_all(directory, in_use=self.folders, goes_on=goes_on)
        ]
        for found in closed:
            if text := found.describe_loss():
                self._announce(f"error: {text}" if found.fault else f"warning: {text}")
        for folder, count in Counter(c.path.parent for c in closed if not c.fault).items():
            self._announce(f"closed {count} files of {folder}, which a killed session had left open")

    def close_files(self, well: Sequence[Path]) -> None:
        """Close what a killed child left open in those folders; folders that hold nothing go."""
        for folder in well:
            repair.close_session(folder)
            with contextlib.suppress(OSError):
                folder.rmdir()
