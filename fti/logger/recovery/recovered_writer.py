"""Writer of a recovered file: the found records in order, with new index, summary and footer."""

from __future__ import annotations

import os
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

from fti.errors import StorageError
from fti.logger import records
from fti.logger.file_mode import create_file
from fti.logger.reading.chunk_content import Content
from fti.logger.reading.record_cursor import attachment_fields, metadata_table, record_id
from fti.logger.summary import Summary


class RecoveredWriter:
    """Writes one finished file.  Raises StorageError; the caller then removes the file."""

    def __init__(self, path: Path, head: bytes) -> None:
        self.path = path
        self.messages = 0
        self._summary = Summary()
        self._at = 0
        try:
            self._stream: BinaryIO = os.fdopen(create_file(path), "wb")
        except OSError as error:
            raise _refusal(path, error) from error
        self._write(head)

    def __enter__(self) -> RecoveredWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    def _write(self, data: bytes | bytearray) -> None:
        try:
            self._stream.write(data)
        except OSError as error:
            raise _refusal(self.path, error) from error
        self._at += len(data)

    def chunk(self, content: Content, compression: str = "", stored: bytes = b"") -> None:
        """Write a chunk.  stored : its compressed bytes; an uncompressed chunk is written from its content."""
        size, crc, at = len(content.data), zlib.crc32(content.data), self._at
        if compression:
            self._write(records.packed_chunk(content.times, size, crc, compression, stored))
        else:
            self._write(records.chunk_head(*content.times, size, crc))
            self._write(content.data)
        tail, offsets = self._summary.chunk_tail(self._at, content.index)
        self._write(tail)
        self._summary.add_chunk(at, size, content.times, content.index, offsets, packed=(compression, len(stored)))
        self._summary.schemas |= content.schemas
        self._summary.channels |= content.channels
        self.messages += content.messages

    @property
    def channels(self) -> Mapping[int, bytes]:
        """Channels declared so far."""
        return self._summary.channels

    def declare(self, channel_id: int, channel: bytes, schema: bytes | None) -> None:
        """Declare a channel and its schema outside of chunks."""
        if schema:
            self._write(schema)
            self._summary.schemas[record_id(schema)] = schema
        self._write(channel)
        self._summary.channels[channel_id] = channel

    def attachment(self, record: bytes) -> None:
        """Write a valid attachment record."""
        self._summary.add_attachment((self._at, len(record)), *attachment_fields(record))
        self._write(record)

    def metadata(self, record: bytes) -> None:
        """Write a valid metadata record."""
        self._summary.add_metadata(self._at, len(record), metadata_table(record)[0])
        self._write(record)

    def finish(self) -> None:
        """Write summary and footer; sync everything."""
        self._write(self._summary.tail(self._at))
        try:
            self._stream.flush()
            os.fsync(self._stream.fileno())
        except OSError as error:
            raise _refusal(self.path, error) from error


def _refusal(path: Path, error: OSError) -> StorageError:
    return StorageError(f"{path.parent}: cannot hold the recovered file: {error.strerror}")
