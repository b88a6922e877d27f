"""A log in several files: one class for the raw and the derived recording.

Files are split by time (of the messages) and by size.  Each is readable alone: it repeats attachments and metadata,
and declares its own channels (``log_layout``).

The files that lie at one place (a folder on a medium) are a ``segment``.  A log can go on in a part at another place.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from fti.logger.batch_encoder import ChannelBatches
from fti.logger.log_layout import LogLayout
from fti.logger.log_segment import LogSegment
from fti.logger.schemas import Schema
from fti.logger.session import SessionFolder


class SplitLog:
    """Writes the files of one kind of a session.  Raises StorageError as StreamWriter does; nothing is lost by it.

    folder : where it begins; None : nothing can be written before a part is opened and adopted
    """

    def __init__(self, folder: SessionFolder | None, log_layout: LogLayout) -> None:
        self.log_layout = log_layout
        self._left_bytes = 0
        self._segment: LogSegment | None = None
        if folder:
            self.switch_to(self.open_segment(folder))

    # ---------------------------------------------------------------------------------------------------- its parts

    @property
    def segment(self) -> LogSegment:
        """Where it is written now.  Raises ValueError when nothing is open."""
        if self._segment is None:
            raise ValueError(f"no file of the {self.log_layout.kind} log is open")
        return self._segment

    def open_segment(self, folder: SessionFolder) -> LogSegment:
        """A first file in a folder, ready to be adopted; for any thread.  Raises StorageError."""
        return LogSegment(self.log_layout, folder)

    def switch_to(self, segment: LogSegment) -> None:
        """Go on in another part.  What waited for a flush is in neither: whoever wrote it writes it again."""
        if self._segment is not None:
            self._left_bytes += self._segment.bytes_written
        self.log_layout.numbering.confirm(segment.number)
        self.log_layout.declare(segment.writer)
        self._segment = segment

    @property
    def bytes_written(self) -> int:
        """Bytes in all files of this log."""
        return self._left_bytes + (self._segment.bytes_written if self._segment else 0)

    # ------------------------------------------------------------------------------------------------------ filling

    def add_channel(
        self, topic: str, encoding: str, schema: Schema | None = None, metadata: Mapping[str, str] | None = None
    ) -> int:
        """Make a channel known in this and all later files; returns its id, counted from 1."""
        writer = self._segment.writer if self._segment else None
        return self.log_layout.add_channel(writer, topic, encoding, schema, metadata)

    def write(
        self, channel_id: int, log_time: int, data: bytes, sequence: int = 0, publish_time: int | None = None
    ) -> None:
        """Buffer a message."""
        self.segment.writer.write(channel_id, log_time, data, sequence, publish_time)

    def write_batches(self, channel_batches: Sequence[ChannelBatches]) -> None:
        """Buffer what several channels have."""
        self.segment.writer.write_batches(channel_batches)


class Log:
    """What the raw and the derived log share: files that are flushed, synced and finished."""

    def __init__(self, log: SplitLog) -> None:
        self._log = log

    @property
    def path(self) -> Path:
        """The file that is being written."""
        return self._log.segment.path

    @property
    def folder(self) -> SessionFolder:
        """The folder of that file."""
        return self._log.segment.folder

    @property
    def bytes_written(self) -> int:
        """Bytes in all files of this log."""
        return self._log.bytes_written

    @property
    def pending_bytes(self) -> int:
        """Bytes that wait for a flush."""
        return self._log.segment.writer.pending_bytes

    @property
    def fault(self) -> str | None:
        """Why the file cannot be split, though it takes what is written; else None."""
        return self._log.segment.fault

    def free_mb(self) -> float:
        """Space left on the medium [MiB].  Raises StorageError."""
        return self._log.segment.free_mb()

    def flush(self) -> None:
        """Bring what is buffered into the file, so that it survives the end of this process."""
        self._log.segment.flush()

    def sync(self) -> None:
        """Bring what is in the file onto the medium, so that it survives a power cut."""
        self._log.segment.sync()

    def close(self) -> None:
        """Finish the files."""
        self._log.segment.close()

    def open_segment(self, folder: SessionFolder) -> LogSegment:
        """A first file in another folder, ready to be adopted; for any thread.  Raises StorageError."""
        return self._log.open_segment(folder)

    def is_superseded(self, segment: LogSegment) -> bool:
        """Has a later file been written to since the part was opened?  Then it must not be adopted."""
        return self._log.log_layout.numbering.is_superseded(segment.number)

    def switch_to(self, segment: LogSegment) -> None:
        """Go on in another part.  What waited for a flush is in neither: whoever wrote it writes it again."""
        self._log.switch_to(segment)
