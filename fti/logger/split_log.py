"""A log in several files: one class for the raw and the derived recording.

Files are split by time (of the messages) and by size.  Each is readable alone: it repeats attachments and metadata,
and declares its own channels.  The next file is opened before the last one is closed, so that a medium that refuses
leaves a file to write to.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from fti.errors import StorageError
from fti.logger.schemas import Schema
from fti.logger.session import Kind, SessionFolder
from fti.logger.stream_writer import StreamWriter

MEGABYTE = 2**20
SECOND_NS = 1_000_000_000
#: Name, media type, content.
Attachment = tuple[str, str, bytes]
Metadata = Mapping[str, Mapping[str, str]]
FILE_METADATA = "fti.file"


class SplitLog:
    """Writes the files of one kind of a session.  Raises StorageError as StreamWriter does; nothing is lost by it.

    fault : why the next file cannot be made or the last one not be closed; the present one goes on.  Else None.
    """

    def __init__(
        self,
        folder: SessionFolder,
        kind: Kind,
        *,
        split_s: float,
        split_mb: float,
        attachments: Sequence[Attachment],
        metadata: Metadata,
    ) -> None:
        self._folder = folder
        self._kind = kind
        self._split_ns = round(split_s * SECOND_NS)
        self._split_bytes = round(split_mb * MEGABYTE)
        self._attachments = tuple(attachments)
        self._metadata = metadata
        self._schemas: dict[str, tuple[int, Schema]] = {}
        self._channels: list[tuple[str, str, int, Mapping[str, str]]] = []
        self._unclosed: list[StreamWriter] = []
        self._closed_bytes = 0
        self.fault: str | None = None
        self._writer = self._open_next()

    @property
    def path(self) -> Path:
        """The file that is being written."""
        return self._writer.path

    @property
    def bytes_written(self) -> int:
        """Bytes in all files of this log."""
        return self._closed_bytes + sum(w.bytes_written for w in {*self._unclosed, self._writer})

    @property
    def pending_bytes(self) -> int:
        """Bytes that wait for a flush."""
        return self._writer.pending_bytes

    def free_mb(self) -> float:
        """Space left for us on the medium [MiB].  Raises StorageError."""
        try:
            state = os.statvfs(self._folder.path)
        except OSError as error:
            raise StorageError(f"{self._folder.path}: cannot be asked for its free space: {error.strerror}") from error
        return state.f_bavail * state.f_frsize / MEGABYTE

    def add_channel(
        self, topic: str, encoding: str, schema: Schema | None = None, metadata: Mapping[str, str] | None = None
    ) -> int:
        """Make a channel known in this and all later files; returns its id."""
        schema_id = self._add_schema(schema) if schema else 0
        self._channels.append((topic, encoding, schema_id, metadata or {}))
        return self._writer.add_channel(*self._channels[-1])

    def _add_schema(self, schema: Schema) -> int:
        if schema.name not in self._schemas:
            self._schemas[schema.name] = self._writer.add_schema(schema.name, schema.encoding, schema.data), schema
        return self._schemas[schema.name][0]

    def write(
        self, channel_id: int, log_time: int, data: bytes, sequence: int = 0, publish_time: int | None = None
    ) -> None:
        """Buffer a message."""
        self._writer.write(channel_id, log_time, data, sequence, publish_time)

    def flush(self) -> None:
        """Bring what is buffered into the file; go on to the next file when it is time.

        Raises StorageError only when the file takes nothing; see ``fault`` for the rest, which the next flush tries
        again.
        """
        self._writer.flush()
        try:
            self._close_old()
            if self._writer.span_ns >= self._split_ns or self._writer.bytes_written >= self._split_bytes:
                self._split()
        except StorageError as error:
            self.fault = str(error)
        else:
            self.fault = None

    def sync(self) -> None:
        """Bring what is in the file onto the medium."""
        self._writer.sync()

    def close(self) -> None:
        """Finish all files.  When the medium refuses they are released as they are, and StorageError is raised."""
        self._unclosed.append(self._writer)
        try:
            self._close_old()
        finally:
            for writer in self._unclosed:
                writer.abandon()

    def _split(self) -> None:
        fresh = self._open_next()
        self._unclosed.append(self._writer)
        self._writer = fresh
        self._close_old()

    def _close_old(self) -> None:
        while self._unclosed:
            self._unclosed[0].close()
            if self._unclosed[0] is not self._writer:
                self._closed_bytes += self._unclosed[0].bytes_written
            del self._unclosed[0]

    def _open_next(self) -> StreamWriter:
        writer = StreamWriter(self._folder.next_path(self._kind))
        try:
            self._introduce(writer)
        except StorageError:
            writer.abandon()
            with contextlib.suppress(OSError):
                writer.path.unlink()  # it holds nothing that is not in the other files
            raise
        return writer

    def _introduce(self, writer: StreamWriter) -> None:
        """Make a file readable alone."""
        about = {"kind": self._kind, "session": self._folder.name}
        for name, table in {FILE_METADATA: about, **self._metadata}.items():
            writer.add_metadata(name, table)
        for name, media_type, data in self._attachments:
            writer.add_attachment(name, media_type, data, log_time=0)
        for _, schema in self._schemas.values():
            writer.add_schema(schema.name, schema.encoding, schema.data)
        for channel in self._channels:
            writer.add_channel(*channel)


class Log:
    """What the raw and the derived log share: files that are flushed, synced and finished."""

    def __init__(self, log: SplitLog) -> None:
        self._log = log

    @property
    def path(self) -> Path:
        """The file that is being written."""
        return self._log.path

    @property
    def bytes_written(self) -> int:
        """Bytes in all files of this log."""
        return self._log.bytes_written

    @property
    def pending_bytes(self) -> int:
        """Bytes that wait for a flush."""
        return self._log.pending_bytes

    @property
    def fault(self) -> str | None:
        """Why the file cannot be split, though it takes what is written; else None."""
        return self._log.fault

    def free_mb(self) -> float:
        """Space left on the medium [MiB].  Raises StorageError."""
        return self._log.free_mb()

    def flush(self) -> None:
        """Bring what is buffered into the file, so that it survives the end of this process."""
        self._log.flush()

    def sync(self) -> None:
        """Bring what is in the file onto the medium, so that it survives a power cut."""
        self._log.sync()

    def close(self) -> None:
        """Finish the files."""
        self._log.close()
