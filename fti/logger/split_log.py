"""A log in several files, for the raw and the derived recording.

Files are split by message time and by size.  Each is readable alone: it repeats attachments and metadata, and declares
its channels (``log_layout``).

The files in one folder are a ``segment``.  A log can switch to a segment on another storage target.
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
    """Writes the files of one kind of a session.  Raises StorageError as StreamWriter; no buffered data are lost by it.

    folder : of the first segment; None : open a segment and switch to it before the first write
    """

    def __init__(self, folder: SessionFolder | None, log_layout: LogLayout) -> None:
        self.log_layout = log_layout
        self._left_bytes = 0
        self._segment: LogSegment | None = None
        if folder:
            self.switch_to(self.open_segment(folder))

    # ----------------------------------------------------------------------------------------------------- segments

    @property
    def path(self) -> Path:
        """The file that is being written."""
        return self.segment.path

    @property
    def folder(self) -> SessionFolder:
        """The folder of the current file."""
        return self.segment.folder

    @property
    def segment(self) -> LogSegment:
        """The current segment.  Raises ValueError when none is open."""
        if self._segment is None:
            raise ValueError(f"no file of the {self.log_layout.kind} log is open")
        return self._segment

    def open_segment(self, folder: SessionFolder) -> LogSegment:
        """Open a segment in a folder, for ``switch_to``; for any thread.  Raises StorageError."""
        return LogSegment(self.log_layout, folder)

    def switch_to(self, segment: LogSegment) -> None:
        """Continue in another segment.  Unflushed data are dropped; the caller writes them again."""
        if self._segment is not None:
            self._left_bytes += self._segment.bytes_written
        self.log_layout.numbering.confirm(segment.number)
        self.log_layout.declare(segment.writer)
        self._segment = segment

    @property
    def bytes_written(self) -> int:
        """Bytes in all files of this log."""
        return self._left_bytes + (self._segment.bytes_written if self._segment else 0)

    @property
    def pending_bytes(self) -> int:
        """Bytes to write with the next flush."""
        return self.segment.writer.pending_bytes

    @property
    def fault(self) -> str | None:
        """Why the file cannot be split, although it accepts bytes; else None."""
        return self.segment.fault

    def is_superseded(self, segment: LogSegment) -> bool:
        """Has a later file been written to since the segment was opened?  Then do not switch to it."""
        return self.log_layout.numbering.is_superseded(segment.number)

    def free_mb(self) -> float:
        """Free space on the medium [MiB].  Raises StorageError."""
        return self.segment.free_mb()

    # ------------------------------------------------------------------------------------------------------ filling

    def add_channel(
        self, topic: str, encoding: str, schema: Schema | None = None, metadata: Mapping[str, str] | None = None
    ) -> int:
        """Declare a channel in this and all later files; returns its id, counted from 1."""
        writer = self._segment.writer if self._segment else None
        return self.log_layout.add_channel(writer, topic, encoding, schema, metadata)

    def write(
        self, channel_id: int, log_time: int, data: bytes, sequence: int = 0, publish_time: int | None = None
    ) -> None:
        """Buffer a message."""
        self.segment.writer.write(channel_id, log_time, data, sequence, publish_time)

    def write_batches(self, channel_batches: Sequence[ChannelBatches]) -> None:
        """Buffer the batches of several channels."""
        self.segment.writer.write_batches(channel_batches)

    # ------------------------------------------------------------------------------------------------------ writing

    def flush(self) -> None:
        """Write the buffer to the file, so that it survives the end of this process."""
        self.segment.flush()

    def sync(self) -> None:
        """Sync the file to the medium, so that it survives a power cut."""
        self.segment.sync()

    def close(self) -> None:
        """Finish the files."""
        self.segment.close()
