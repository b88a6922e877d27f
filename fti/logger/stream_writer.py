"""The MCAP writer of the recorder: flushed data survive a kill and are readable while the file grows.

A flush appends the buffered records to the open, uncompressed chunk with one write, and then patches length, size,
times and checksum of the chunk's head with a second one.  The first flush of a chunk writes head and records together.
At every moment the file therefore holds whole records, a chunk whose head covers whole records and has their checksum,
and perhaps records that no head covers yet.  A sync writes size and checksum of the open chunk to the next slot of the
record before it (``checkpoints``): a power cut costs at most the data since the last sync, and a damaged byte at most
the data between two syncs.

Schemas and channels are repeated in every chunk that uses them, so that damage to one chunk affects no other.
The writer holds an exclusive ``flock`` on the file while it is open; repair leaves such a file alone.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import struct
import zlib
from array import array
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from fti.errors import StorageError
from fti.logger import checkpoints, records
from fti.logger.batch_encoder import NO_TIME, ChannelBatches, encode_batches, truncate_index
from fti.logger.checkpoints import SLOT_BYTES, SLOTS, Checkpoint
from fti.logger.file_mode import create_file
from fti.logger.folder_sync import sync_folder
from fti.logger.records import MESSAGE, MESSAGE_BODY
from fti.logger.summary import Summary

_PACK = MESSAGE.pack


class StreamWriter:
    """Writes one MCAP file, which must not exist yet.

    Raises StorageError when the medium refuses.  Unwritten data then stay buffered, the file stays readable, and the
    call can be repeated.
    """

    def __init__(self, path: Path, *, profile: str = "fti", library: str = "fti", chunk_bytes: int = 4 * 2**20) -> None:
        self.path = path
        self._chunk_bytes = chunk_bytes
        self._schemas: list[bytes] = []
        self._channels: list[tuple[int, bytes]] = []
        self._summary = Summary()
        self._fd = _create(path)
        self._end = 0  # valid bytes of the file; a torn append may follow
        self._torn = False
        self._finished = False
        self._entry_synced = False
        self._write_fault = ""  # why the file accepts no more writes
        self._pending = bytearray()
        self._begin_chunk()
        try:
            self._append(records.file_head(profile, library))
        except StorageError:
            self.abandon()
            with contextlib.suppress(OSError):
                path.unlink()
            raise

    def _begin_chunk(self) -> None:
        self._chunk_at: int | None = None
        self._size = 0  # bytes of records in the file's open chunk
        self._crc = 0
        self._stale = False  # the head does not cover all records of the file
        self._slots = 0  # checkpoints of this chunk
        self._checked_size = 0  # bytes of records before the last of them
        self._first = NO_TIME
        self._last = 0
        self._index: dict[int, array[int]] = {}

    # --------------------------------------------------------------------------------------------------------- state

    def fileno(self) -> int:
        """Descriptor of the file; negative when it has been released."""
        return self._fd

    @property
    def bytes_written(self) -> int:
        """Size of the file [B]."""
        return self._end

    @property
    def pending_bytes(self) -> int:
        """Bytes that wait for a flush."""
        return len(self._pending)

    @property
    def span_ns(self) -> int:
        """Time between the first and the last message of the file [ns]."""
        first = self._first if self._summary.first_ns is None else min(self._first, self._summary.first_ns)
        return max(self._last, self._summary.last_ns) - first if first != NO_TIME else 0

    # ------------------------------------------------------------------------------------------------------ filling

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Declare a schema; returns its id, counted from 1."""
        self._schemas.append(records.schema(len(self._schemas) + 1, name, encoding, data))
        return len(self._schemas)

    def add_channel(
        self, topic: str, message_encoding: str, schema_id: int = 0, metadata: Mapping[str, str] | None = None
    ) -> int:
        """Declare a channel; returns its id, counted from 1.  schema_id 0 : no schema."""
        if not 0 <= schema_id <= len(self._schemas):
            raise ValueError(f"channel {topic}: schema id {schema_id} is not in 0..{len(self._schemas)}")
        channel_id = len(self._channels) + 1
        self._channels.append(
            (schema_id, records.channel(channel_id, topic, message_encoding, schema_id, metadata or {}))
        )
        return channel_id

    def write(
        self, channel_id: int, log_time: int, data: bytes, sequence: int = 0, publish_time: int | None = None
    ) -> None:
        """Buffer a message; times in ns, sequence in 32 bits.  publish_time None : the log time."""
        published = log_time if publish_time is None else publish_time
        try:
            head = _PACK(5, MESSAGE_BODY + len(data), channel_id, sequence, log_time, published)
        except struct.error as error:
            raise ValueError(f"message with sequence {sequence}, times {log_time}, {published}: {error}") from None
        entries = self._index.get(channel_id)
        if entries is None:
            entries = self._declare(channel_id)
        pending = self._pending
        entries.append(log_time)
        entries.append(self._size + len(pending))
        pending += head
        pending += data
        if log_time < self._first:  # noqa: PLR1730  (a call of min costs three times as much)
            self._first = log_time
        if log_time > self._last:  # noqa: PLR1730
            self._last = log_time

    def write_batches(self, channel_batches: Sequence[ChannelBatches]) -> None:
        """Buffer the batches of several channels, all or none; sequence is the low 32 bits of the position."""
        for channel_id, _ in channel_batches:
            if channel_id not in self._index:
                self._declare(channel_id)
        begin = self._size + len(self._pending)
        parts: list[bytes] = []
        try:
            first, last = encode_batches(channel_batches, self._index, begin, parts)
        except struct.error as error:
            for channel_id, _ in channel_batches:
                truncate_index(self._index[channel_id], begin)
            raise ValueError(f"a message has a position or a time out of range: {error}") from None
        self._pending += b"".join(parts)
        self._first = min(self._first, first)
        self._last = max(self._last, last)

    def _declare(self, channel_id: int) -> array[int]:
        """Repeat a channel and its schema in this chunk, before its first message there."""
        if not 1 <= channel_id <= len(self._channels):
            raise ValueError(f"channel id {channel_id} is not in 1..{len(self._channels)}")
        schema_id, channel = self._channels[channel_id - 1]
        if schema_id:
            self._pending += self._schemas[schema_id - 1]
            self._summary.schemas[schema_id] = self._schemas[schema_id - 1]
        self._pending += channel
        self._summary.channels[channel_id] = channel
        return self._index.setdefault(channel_id, array("Q"))

    # ------------------------------------------------------------------------------------------------------ writing

    def flush(self) -> None:
        """Write the buffer to the file, so that it survives the end of this process."""
        self._commit()
        if self._size >= self._chunk_bytes:
            self.close_chunk()

    def sync(self) -> None:
        """Sync the file to the medium, so that it survives a power cut.

        After an error the file accepts no more writes: the kernel reports a failed write once and drops the data, and
        the next call would succeed (fsync(2)).
        """
        self._checkpoint()
        try:
            self._attempt(lambda: os.fdatasync(self._fd))
            if not self._entry_synced:
                self._attempt(lambda: sync_folder(self.path.parent))
                self._entry_synced = True
        except StorageError as error:
            self._write_fault = self._write_fault or f"{error}, and a part of it may be lost"
            raise

    def _checkpoint(self) -> None:
        """Write size and checksum of the open chunk to the next slot; close a chunk without a free slot."""
        if self._chunk_at is None or self._checked_size == self._size:
            return
        if self._slots == SLOTS:
            self.close_chunk()
            return
        entry = checkpoints.slot(Checkpoint(self._size, self._crc))
        at = self._chunk_at - (SLOTS - self._slots) * SLOT_BYTES
        self._attempt(lambda: _write_all(self._fd, entry, at))
        self._slots, self._checked_size = self._slots + 1, self._size

    def close_chunk(self) -> None:
        """Flush and write the message index of the open chunk.  The next message begins a new chunk."""
        self._commit()
        if self._chunk_at is None:
            return
        tail, offsets = self._summary.chunk_tail(self._end, self._index)
        self._append(tail)
        self._summary.add_chunk(self._chunk_at, self._size, (self._first, self._last), self._index, offsets)
        self._begin_chunk()

    def add_attachment(self, name: str, media_type: str, data: bytes, log_time: int) -> None:
        """Write an attachment; closes the open chunk first."""
        self.close_chunk()
        record = records.attachment(name, media_type, data, log_time)
        at = self._end
        self._append(record)
        self._summary.add_attachment((at, len(record)), log_time, len(data), name, media_type)

    def add_metadata(self, name: str, table: Mapping[str, str]) -> None:
        """Write a metadata record; closes the open chunk first."""
        self.close_chunk()
        record = records.metadata(name, table)
        at = self._end
        self._append(record)
        self._summary.add_metadata(at, len(record), name)

    def close(self) -> None:
        """Close the chunk, write summary and footer, sync everything, release the file."""
        if self._fd < 0:
            return
        if not self._finished:
            self.close_chunk()
            self._append(self._summary.tail(self._end))
            self._finished = True
        self._entry_synced = False
        self.sync()
        self.abandon()

    def abandon(self) -> None:
        """Release the file unfinished; a later repair closes it."""
        if self._fd >= 0:
            os.close(self._fd)
        self._fd = -1

    # ------------------------------------------------------------------------------------------------------- moving

    def _commit(self) -> None:
        """Append the buffer, then patch the head of the chunk to cover it."""
        pending = self._pending
        if pending:
            crc = zlib.crc32(pending, self._crc)
            if self._chunk_at is None:
                before = records.padding(self._end + checkpoints.RECORD_BYTES) + checkpoints.empty_record()
                at = self._end + len(before)
                self._append(before + records.chunk_head(self._first, self._last, len(pending), crc) + pending)
                self._chunk_at = at
            else:
                self._append(pending)
                self._stale = True
            self._crc = crc
            self._size += len(pending)
            pending.clear()
        if self._stale:
            self._patch()
            self._stale = False

    def _patch(self) -> None:
        assert self._chunk_at is not None
        at, head = self._chunk_at, records.chunk_head(self._first, self._last, self._size, self._crc)
        self._attempt(lambda: _write_all(self._fd, head, at))

    def _append(self, data: bytes | bytearray) -> None:
        """Append to the file, completely or, as seen by readers, not at all."""
        if self._finished or self._fd < 0:
            raise ValueError(f"{self.path}: is closed")
        self._truncate()
        self._torn = True
        try:
            self._attempt(lambda: _write_all(self._fd, data, self._end))
        except StorageError:
            with contextlib.suppress(StorageError):  # the next append tries again, before it writes
                self._truncate()
            raise
        self._torn = False
        self._end += len(data)

    def _truncate(self) -> None:
        """Remove the bytes of a failed append."""
        if self._torn:
            self._attempt(lambda: os.ftruncate(self._fd, self._end))
            self._torn = False

    def _attempt(self, action: Callable[[], None]) -> None:
        if self._write_fault:
            raise StorageError(self._write_fault)
        try:
            action()
        except OSError as error:
            raise StorageError(f"{self.path}: cannot be written: {error.strerror or error}") from error


def _create(path: Path) -> int:
    """Create a file exclusively and lock it."""
    try:
        fd = create_file(path)
    except OSError as error:
        raise StorageError(f"{path}: cannot be created: {error.strerror}") from error
    with contextlib.suppress(OSError):  # a file system without locks: repair cannot lock either and leaves it alone
        fcntl.flock(fd, fcntl.LOCK_EX)
        os.ftruncate(fd, 0)  # a repair may have seen the file before the lock
    return fd


def _write_all(fd: int, data: bytes | bytearray, offset: int) -> None:
    """pwrite until everything is written; a medium that accepts no byte is full."""
    with memoryview(data) as view:
        done = os.pwrite(fd, view, offset)
        while done < len(view):
            written = os.pwrite(fd, view[done:], offset + done)
            if written == 0:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            done += written
