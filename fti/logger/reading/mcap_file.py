"""One MCAP file as it is found: finished, still being written, killed or damaged.

The official ``StreamReader`` walks the file; the messages of a chunk are taken apart here (five times as fast).
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError, RecordLengthLimitExceeded
from mcap.records import Attachment, Channel, Chunk, Message, Metadata
from mcap.stream_reader import StreamReader

from fti.errors import MissingError
from fti.logger.reading.compression import decompress
from fti.logger.reading.open_chunk import DamagedChunkError, Declarations, is_open, read_open_chunk
from fti.logger.reading.source import Source
from fti.logger.reading.structure import chunk_head, record_end
from fti.logger.records import HEAD, MAGIC, MESSAGE, Op
from fti.logger.regular_file import open_regular

_MESSAGE = int(Op.MESSAGE)  # looking up a member of an enumeration is slow in a loop over all messages
_STAMPS = struct.Struct("<HIQQ")
FOOTER_BYTES = 9 + 20 + len(MAGIC)


class Topic(NamedTuple):
    """A channel: its topic, the encoding of its messages and what is said of it."""

    name: str
    encoding: str
    metadata: dict[str, str]


class Item(NamedTuple):
    """A message.  Times in ns; sequence is 32 bits wide."""

    topic: Topic
    log_time: int
    publish_time: int
    sequence: int
    data: bytes


@dataclass(slots=True)
class Head:
    """What stands in a file before its first chunk."""

    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)


class McapFile:
    """A file.  ``fault`` tells, once the messages were read, why reading ended before a footer; else None."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.fault: str | None = None
        self._topics: dict[int, Topic] = {}
        self._at = 0

    @property
    def finished(self) -> bool:
        """Does the file end with a footer?"""
        return has_footer(self.path)

    @property
    def position(self) -> int:
        """How far it has been read [bytes]."""
        return self._at

    def head(self) -> Head:
        """Metadata and attachments before the first chunk."""
        head = Head()
        for record in self._records():
            if isinstance(record, Metadata):
                head.metadata[record.name] = record.metadata
            elif isinstance(record, Attachment):
                head.attachments[record.name] = record.data
            elif isinstance(record, Chunk | Message):
                break
        return head

    def chunks(self) -> Iterator[list[Item]]:
        """The messages, chunk by chunk, in the order of the file, up to the end or the break."""
        for record in self._records():
            try:
                items = self._take(record)
            except (McapError, ValueError, KeyError, struct.error) as error:
                self.fault = f"is damaged after byte {self._at}: {error}"
                break
            if items:
                yield items
        if self.fault and not self.finished:
            yield from self._unfinished()

    def _unfinished(self) -> Iterator[list[Item]]:
        """What the last chunk holds where a cut or a power cut has left it without the checksum that its head tells."""
        with Source(self.path) as source:
            head = chunk_head(source, _chunk_at(source, self._at))
            if head is None or not is_open(source, head):
                return
            try:
                chunk = read_open_chunk(source, head, Declarations())
                yield self._walk(bytes(chunk.content.data))
            except (DamagedChunkError, McapError, ValueError, KeyError, struct.error):
                return  # the fault stands

    def items(self) -> Iterator[Item]:
        """The messages in the order of the file."""
        for chunk in self.chunks():
            yield from chunk

    def _records(self) -> Iterator[Any]:
        """The records outside of chunks; sets ``fault`` where they break off."""
        self.fault = None
        self._at = 0
        try:
            with open_regular(self.path) as stream:
                limit = os.fstat(stream.fileno()).st_size
                for record in StreamReader(stream, emit_chunks=True, record_size_limit=limit).records:
                    yield record
                    self._at = stream.tell()
        except (EndOfFile, RecordLengthLimitExceeded, struct.error):
            self.fault = f"ends after byte {self._at} without a footer: it is being written, or was cut off"
        except (McapError, ValueError) as error:
            self.fault = f"is damaged after byte {self._at}: {error}"
        except OSError as error:
            raise MissingError(f"{self.path}: cannot be read: {error.strerror}") from error

    def _take(self, record: Any) -> list[Item]:
        if isinstance(record, Chunk):
            return self._walk(_content(record))
        if isinstance(record, Channel):
            self._topics[record.id] = Topic(record.topic, record.message_encoding, record.metadata)
        elif isinstance(record, Message):  # appended, not yet covered by the head of its chunk
            topic = self._topics[record.channel_id]
            return [Item(topic, record.log_time, record.publish_time, record.sequence, record.data)]
        return []

    def _walk(self, data: bytes) -> list[Item]:
        """The messages among the records of a chunk."""
        items: list[Item] = []
        at, size, topics = 0, len(data), self._topics
        while at < size:
            op, length = HEAD.unpack_from(data, at)
            end = at + HEAD.size + length
            if end > size:
                raise ValueError("a record is longer than its chunk")
            if op == _MESSAGE:
                channel_id, sequence, log_time, publish_time = _STAMPS.unpack_from(data, at + HEAD.size)
                body = data[at + MESSAGE.size : end]
                items.append(Item(topics[channel_id], log_time, publish_time, sequence, body))
            elif op == Op.CHANNEL:
                self._take(Channel.read(ReadDataStream(BytesIO(data[at + HEAD.size : end]))))
            at = end
        return items


def _content(chunk: Chunk) -> bytes:
    """The records of a chunk.  Raises ValueError when they are damaged."""
    content = decompress(chunk.compression, chunk.data, chunk.uncompressed_size)
    if chunk.uncompressed_crc not in (0, zlib.crc32(content)):
        raise ValueError("the checksum of a chunk does not hold")
    return content


def _chunk_at(source: Source, at: int) -> int:
    """Where the next record stands that is no filling before a chunk."""
    while source.read(at, 1) in (bytes([Op.PADDING]), bytes([Op.CHECKPOINTS])):
        end = record_end(source, at, source.size)
        if end is None:
            break
        at = end
    return at


def has_footer(path: Path) -> bool:
    """Does a file end with a footer and the magic, as a finished one does?  Raises MissingError."""
    try:
        with open_regular(path) as stream:
            stream.seek(-min(FOOTER_BYTES, stream.seek(0, os.SEEK_END)), os.SEEK_END)
            tail = stream.read()
    except OSError as error:
        raise MissingError(f"{path}: cannot be read: {error.strerror}") from error
    return tail[:9] == HEAD.pack(Op.FOOTER, 20) and tail.endswith(MAGIC)
