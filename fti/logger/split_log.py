"""A log in several files: one class for the raw and the derived recording.

Files are split by time (of the messages) and by size.  Each is readable alone: it repeats attachments and metadata,
and declares its own channels.  The next file is opened before the last one is closed, so that a medium that refuses
leaves a file to write to.

The files that lie at one place (a folder on a medium) are a *part*.  A log can go on in a part at another place.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from fti.errors import StorageError
from fti.logger.burst_records import Share
from fti.logger.places import MEGABYTE, Stray, Trace, free_mb
from fti.logger.schemas import Schema
from fti.logger.seal import sealed
from fti.logger.session import Kind, Numbering, SessionFolder
from fti.logger.stream_writer import StreamWriter

SECOND_NS = 1_000_000_000
#: Name, media type, content.
Attachment = tuple[str, str, bytes]
Metadata = Mapping[str, Mapping[str, str]]
#: What each file says of itself: kind, session; ``place_0``, ``place_1``: the folders in which parts may lie.
FILE_METADATA = "fti.file"
PLACE_KEY = "place_"
RESCUE_BLOCK = 2**20


class SplitLog:
    """Writes the files of one kind of a session.  Raises StorageError as StreamWriter does; nothing is lost by it.

    folder    : where it begins; None : nothing can be written before a part is opened and adopted
    numbering : of its files, shared with who else numbers them
    places    : the folders in which files of the session may lie; every file names them
    """

    def __init__(
        self,
        folder: SessionFolder | None,
        kind: Kind,
        *,
        split_s: float,
        split_mb: float,
        attachments: Sequence[Attachment],
        metadata: Metadata,
        numbering: Numbering | None = None,
        places: Sequence[Path] = (),
    ) -> None:
        self.kind = kind
        self.numbering = numbering or Numbering()
        self.split_ns = round(split_s * SECOND_NS)
        self.split_bytes = round(split_mb * MEGABYTE)
        self._attachments = tuple(attachments)
        self._metadata = metadata
        self._places = {f"{PLACE_KEY}{n}": str(path) for n, path in enumerate(places)}
        self._schemas: dict[str, tuple[int, Schema]] = {}
        self._channels: list[tuple[str, str, int, Mapping[str, str]]] = []
        self._left_bytes = 0
        self._part: Part | None = None
        if folder:
            self.adopt(self.open_part(folder))

    # ---------------------------------------------------------------------------------------------------- its parts

    @property
    def part(self) -> Part:
        """Where it is written now.  Raises ValueError when nothing is open."""
        if self._part is None:
            raise ValueError(f"no file of the {self.kind} log is open")
        return self._part

    def open_part(self, folder: SessionFolder) -> Part:
        """A first file in a folder, ready to be adopted; for any thread.  Raises StorageError."""
        return Part(self, folder)

    def adopt(self, part: Part) -> None:
        """Go on in another part.  What waited for a flush is in neither: whoever wrote it writes it again."""
        if self._part is not None:
            self._left_bytes += self._part.bytes_written
        self.declare(part.writer)
        self._part = part

    def introduce(self, writer: StreamWriter, folder: SessionFolder) -> None:
        """Write what makes a file readable alone.  Raises StorageError."""
        about = {"kind": self.kind, "session": folder.name, **self._places}
        for name, table in sealed(FILE_METADATA, {FILE_METADATA: about, **self._metadata}).items():
            writer.add_metadata(name, table)
        for name, media_type, data in self._attachments:
            writer.add_attachment(name, media_type, data, log_time=0)

    def declare(self, writer: StreamWriter) -> None:
        """Make schemas and channels known to a file; the same ids in all files."""
        for _, schema in self._schemas.values():
            writer.add_schema(schema.name, schema.encoding, schema.data)
        for channel in self._channels:
            writer.add_channel(*channel)

    @property
    def bytes_written(self) -> int:
        """Bytes in all files of this log."""
        return self._left_bytes + (self._part.bytes_written if self._part else 0)

    # ------------------------------------------------------------------------------------------------------ filling

    def add_channel(
        self, topic: str, encoding: str, schema: Schema | None = None, metadata: Mapping[str, str] | None = None
    ) -> int:
        """Make a channel known in this and all later files; returns its id, counted from 1."""
        schema_id = self._add_schema(schema) if schema else 0
        self._channels.append((topic, encoding, schema_id, metadata or {}))
        if self._part:
            self._part.writer.add_channel(*self._channels[-1])
        return len(self._channels)

    def _add_schema(self, schema: Schema) -> int:
        if schema.name not in self._schemas:
            self._schemas[schema.name] = len(self._schemas) + 1, schema
            if self._part:
                self._part.writer.add_schema(schema.name, schema.encoding, schema.data)
        return self._schemas[schema.name][0]

    def write(
        self, channel_id: int, log_time: int, data: bytes, sequence: int = 0, publish_time: int | None = None
    ) -> None:
        """Buffer a message."""
        self.part.writer.write(channel_id, log_time, data, sequence, publish_time)

    def write_bursts(self, shares: Sequence[Share]) -> None:
        """Buffer what several channels have."""
        self.part.writer.write_bursts(shares)


class Part:
    """The files of a log in one folder, one after another.  For one thread.

    writer : of the present file
    fault  : why the next file cannot be made or the last one not be closed; the present one goes on.  Else None.
    """

    def __init__(self, log: SplitLog, folder: SessionFolder) -> None:
        self._log = log
        self.folder = folder
        self._unclosed: list[StreamWriter] = []
        self._closed_bytes = 0
        self.fault: str | None = None
        self._number, self.writer = self._open_next()
        self._make_known()
        self._trace = Trace(self.path, self.writer.fileno())

    def _make_known(self) -> None:
        """Bring the empty file onto the medium, so that its number is not missing when that fails in its first second.

        A later file of this part becomes known when the one before it is closed.
        """
        try:
            self.writer.sync()
        except StorageError:
            self.discard()
            raise

    @property
    def path(self) -> Path:
        """The file that is being written."""
        return self.writer.path

    @property
    def bytes_written(self) -> int:
        """Bytes in all files of this part."""
        return self._closed_bytes + sum(w.bytes_written for w in {*self._unclosed, self.writer})

    def free_mb(self) -> float:
        """Space left for us on the medium [MiB].  Raises StorageError."""
        return free_mb(self.folder.path)

    def stray(self) -> Stray | None:
        """Does its path still lead to the present file?  Then None."""
        return self._trace.stray()

    def flush(self) -> None:
        """Bring what is buffered into the file; go on to the next file when it is time.

        Raises StorageError only when the file takes nothing; see ``fault`` for the rest, which the next flush tries
        again.
        """
        self.writer.flush()
        try:
            self._close_old()
            if self.writer.span_ns >= self._log.split_ns or self.writer.bytes_written >= self._log.split_bytes:
                self._split()
        except StorageError as error:
            self.fault = str(error)
        else:
            self.fault = None

    def sync(self) -> None:
        """Bring what is in the files onto the medium.  When that fails they take nothing any more."""
        for writer in (*self._unclosed, self.writer):
            writer.sync()

    def close(self) -> None:
        """Finish all files.  When the medium refuses they are released as they are, and StorageError is raised."""
        refusal: StorageError | None = None
        for writer in dict.fromkeys((*self._unclosed, self.writer)):
            try:
                writer.close()
            except StorageError as error:  # the others may have better luck
                refusal = refusal or error
        self.abandon()
        if refusal:
            raise refusal

    def abandon(self) -> None:
        """Release all files as they are; a later repair closes them."""
        for writer in {*self._unclosed, self.writer}:
            writer.abandon()

    def discard(self) -> None:
        """Remove the only file, into which nothing was written."""
        self.writer.abandon()
        with contextlib.suppress(OSError):
            self.path.unlink()
        self._log.numbering.give_back(self._number)

    def rescue(self, folder: SessionFolder) -> Path:
        """Close the present file, which was deleted, and write it again in a folder; returns its path.

        Its content is there as long as it is open.  Raises StorageError.
        """
        rescued = folder.file_path(self._log.kind, self._number)
        fd = os.dup(self.writer.fileno())
        try:
            self.close()
            with rescued.open("xb") as copy:
                at = 0
                while block := os.pread(fd, RESCUE_BLOCK, at):
                    at += copy.write(block)
                copy.flush()
                os.fsync(copy.fileno())
        except OSError as error:
            raise StorageError(f"{rescued}: cannot be written again: {error.strerror}") from error
        finally:
            os.close(fd)
        return rescued

    def _split(self) -> None:
        number, fresh = self._open_next()
        self._log.declare(fresh)
        self._unclosed.append(self.writer)
        self._number, self.writer = number, fresh
        self._trace = Trace(self.path, fresh.fileno())
        self._close_old()

    def _close_old(self) -> None:
        while self._unclosed:
            self._unclosed[0].close()
            if self._unclosed[0] is not self.writer:
                self._closed_bytes += self._unclosed[0].bytes_written
            del self._unclosed[0]

    def _open_next(self) -> tuple[int, StreamWriter]:
        numbering = self._log.numbering
        number = numbering.take(self.folder, self._log.kind)
        try:
            writer = StreamWriter(self.folder.file_path(self._log.kind, number))
        except StorageError:
            numbering.give_back(number)
            raise
        try:
            self._log.introduce(writer, self.folder)
        except StorageError:
            writer.abandon()
            with contextlib.suppress(OSError):
                writer.path.unlink()  # it holds nothing that is not in the other files
            numbering.give_back(number)
            raise
        return number, writer


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

    def adopt(self, part: Part) -> None:
        """Go on in another part.  What waited for a flush is in neither: whoever wrote it writes it again."""
        self._log.adopt(part)
