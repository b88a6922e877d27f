"""A log in several files: one class for the raw and the derived recording.

Files are split by time (of the messages) and by size.  Each is readable alone: it repeats attachments and metadata,
and declares its own channels (``blueprint``).

The files that lie at one place (a folder on a medium) are a ``part``.  A log can go on in a part at another place.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from fti.logger.blueprint import Blueprint
from fti.logger.burst_records import Share
from fti.logger.part import Part
from fti.logger.schemas import Schema
from fti.logger.session import SessionFolder


class SplitLog:
    """Writes the files of one kind of a session.  Raises StorageError as StreamWriter does; nothing is lost by it.

    folder : where it begins; None : nothing can be written before a part is opened and adopted
    """

    def __init__(self, folder: SessionFolder | None, blueprint: Blueprint) -> None:
        self.blueprint = blueprint
        self._left_bytes = 0
        self._part: Part | None = None
        if folder:
            self.adopt(self.open_part(folder))

    # ---------------------------------------------------------------------------------------------------- its parts

    @property
    def part(self) -> Part:
        """Where it is written now.  Raises ValueError when nothing is open."""
        if self._part is None:
            raise ValueError(f"no file of the {self.blueprint.kind} log is open")
        return self._part

    def open_part(self, folder: SessionFolder) -> Part:
        """A first file in a folder, ready to be adopted; for any thread.  Raises StorageError."""
        return Part(self.blueprint, folder)

    def adopt(self, part: Part) -> None:
        """Go on in another part.  What waited for a flush is in neither: whoever wrote it writes it again."""
        if self._part is not None:
            self._left_bytes += self._part.bytes_written
        self.blueprint.numbering.confirm(part.number)
        self.blueprint.declare(part.writer)
        self._part = part

    @property
    def bytes_written(self) -> int:
        """Bytes in all files of this log."""
        return self._left_bytes + (self._part.bytes_written if self._part else 0)

    # ------------------------------------------------------------------------------------------------------ filling

    def add_channel(
        self, topic: str, encoding: str, schema: Schema | None = None, metadata: Mapping[str, str] | None = None
    ) -> int:
        """Make a channel known in this and all later files; returns its id, counted from 1."""
        writer = self._part.writer if self._part else None
        return self.blueprint.add_channel(writer, topic, encoding, schema, metadata)

    def write(
        self, channel_id: int, log_time: int, data: bytes, sequence: int = 0, publish_time: int | None = None
    ) -> None:
        """Buffer a message."""
        self.part.writer.write(channel_id, log_time, data, sequence, publish_time)

    def write_bursts(self, shares: Sequence[Share]) -> None:
        """Buffer what several channels have."""
        self.part.writer.write_bursts(shares)


class Log:
    """What the raw and the derived log share: files that are flushed, synced and finished."""

    def __init__(self, log: SplitLog) -> None:
        self._log = log

    @property
    def path(self) -> Path:
        """The file that is being written."""
        return self._log.part.path

    @property
    def folder(self) -> SessionFolder:
        """The folder of that file."""
        return self._log.part.folder

    @property
    def bytes_written(self) -> int:
        """Bytes in all files of this log."""
        return self._log.bytes_written

    @property
    def pending_bytes(self) -> int:
        """Bytes that wait for a flush."""
        return self._log.part.writer.pending_bytes

    @property
    def fault(self) -> str | None:
        """Why the file cannot be split, though it takes what is written; else None."""
        return self._log.part.fault

    def free_mb(self) -> float:
        """Space left on the medium [MiB].  Raises StorageError."""
        return self._log.part.free_mb()

    def flush(self) -> None:
        """Bring what is buffered into the file, so that it survives the end of this process."""
        self._log.part.flush()

    def sync(self) -> None:
        """Bring what is in the file onto the medium, so that it survives a power cut."""
        self._log.part.sync()

    def close(self) -> None:
        """Finish the files."""
        self._log.part.close()

    def open_part(self, folder: SessionFolder) -> Part:
        """A first file in another folder, ready to be adopted; for any thread.  Raises StorageError."""
        return self._log.open_part(folder)

    def is_overtaken(self, part: Part) -> bool:
        """Has a later file been written to since the part was opened?  Then it must not be adopted."""
        return self._log.blueprint.numbering.is_overtaken(part.number)

    def adopt(self, part: Part) -> None:
        """Go on in another part.  What waited for a flush is in neither: whoever wrote it writes it again."""
        self._log.adopt(part)
