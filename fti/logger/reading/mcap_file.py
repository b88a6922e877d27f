"""Reader of one MCAP file: finished, being written, cut off or damaged.

The official package parses metadata, attachments, channels and the heads of chunks.  This module parses the messages of
a chunk (five times as fast), and skips the indexes, which a reader in the order of the file does not need.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import IO, Any, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, InvalidMagic, McapError, RecordLengthLimitExceeded
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata

from fti.errors import MissingError
from fti.logger.reading.compression import decompress
from fti.logger.reading.limits import MAX_RECORD, MAX_TIME_NS, DeclaredSizes, LimitError, check_messages
from fti.logger.reading.open_chunk import DamagedChunkError, Declarations, is_open, read_open_chunk
from fti.logger.reading.record_validation import chunk_head, record_end
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import HEAD, MAGIC, MESSAGE, Op
from fti.logger.regular_file import open_regular

_MESSAGE = int(Op.MESSAGE)  # looking up a member of an enumeration is slow in a loop over all messages
_STAMPS = struct.Struct("<HIQQ")
FOOTER_BYTES = 9 + 20 + len(MAGIC)
#: Messages of a large chunk that are yielded together.
_MAX_BATCH_MESSAGES = 2**16


class McapChannel(NamedTuple):
    """A channel: its topic, the encoding of its messages and its metadata."""

    name: str
    encoding: str
    metadata: dict[str, str]


class McapMessage(NamedTuple):
    """A message.  Times in ns; sequence is 32 bits wide."""

    topic: McapChannel
    log_time: int
    publish_time: int
    sequence: int
    data: bytes


@dataclass(slots=True)
class Head:
    """Content of a file before its first chunk."""

    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)


class McapFile:
    """A file.  ``fault``, after the messages were read: why reading ended before a footer; else None."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.fault: str | None = None
        self._topics: dict[int, McapChannel] = {}
        self._sizes = DeclaredSizes()
        self._at = 0

    def is_finished(self) -> bool:
        """Does the file end with a footer?"""
        return has_footer(self.path)

    @property
    def position(self) -> int:
        """Bytes read so far."""
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

    def compression(self) -> str:
        """Compression of the first chunk; "" when it has none, or there is no chunk."""
        return next((record.compression for record in self._records() if isinstance(record, Chunk)), "")

    def chunks(self) -> Iterator[list[McapMessage]]:
        """The messages by chunk (a large chunk in parts), in the order of the file, up to its end or a fault."""
        for record in self._records():
            try:
                for items in self._take(record):
                    if items:
                        yield items
            except LimitError as error:
                self.fault = _limit_fault(self._at, error)
                return
            except (McapError, ValueError, struct.error) as error:
                self.fault = f"is damaged after byte {self._at}: {error}"
                break
        if self.fault and not self.is_finished():
            yield from self._unfinished()

    def _unfinished(self) -> Iterator[list[McapMessage]]:
        """Messages of the last chunk of a file that was cut off, when the checksum in its head does not match."""
        with TolerantFile(self.path) as source:
            head = chunk_head(source, _chunk_at(source, self._at))
            if head is None or not is_open(source, head):
                return
            try:
                chunk = read_open_chunk(source, head, Declarations())
                data = bytes(chunk.content.data)
                yield from self._walk(data, len(data))
            except (DamagedChunkError, McapError, ValueError, KeyError, struct.error):
                return  # the fault remains

    def items(self) -> Iterator[McapMessage]:
        """The messages in the order of the file."""
        for chunk in self.chunks():
            yield from chunk

    def _records(self) -> Iterator[Any]:
        """The records outside of chunks; sets ``fault`` where they end early."""
        self.fault = None
        self._at = 0
        self._sizes = DeclaredSizes()
        try:
            with open_regular(self.path) as stream:
                limit = os.fstat(stream.fileno()).st_size
                for record in _read_records(stream, limit):
                    end = stream.tell()
                    if record:
                        self._count(record, end - self._at)
                        yield record
                    self._at = end
        except LimitError as error:
            self.fault = _limit_fault(self._at, error)
        except (EndOfFile, RecordLengthLimitExceeded, struct.error):
            self.fault = f"ends after byte {self._at} without a footer: it is being written, or was cut off"
        except (McapError, ValueError) as error:
            self.fault = f"is damaged after byte {self._at}: {error}"
        except OSError as error:
            raise MissingError(f"{self.path}: cannot be read: {error.strerror}") from error

    def _count(self, record: Any, size: int) -> None:
        """Count the size of metadata and attachments.  Raises LimitError."""
        if isinstance(record, Metadata):
            self._sizes.metadata(size)
        elif isinstance(record, Attachment):
            self._sizes.attachment(size)

    def _take(self, record: Any) -> Iterator[list[McapMessage]]:
        if isinstance(record, Chunk):
            yield from self._walk(_content(record), len(record.data))
        elif isinstance(record, Channel):
            self._declare(record)
        elif isinstance(record, Message):  # appended, not yet covered by the head of its chunk
            _check_times(record.log_time, record.publish_time)
            topic = self._topic(record.channel_id)
            yield [McapMessage(topic, record.log_time, record.publish_time, record.sequence, record.data)]

    def _declare(self, channel: Channel) -> None:
        table = channel.metadata
        texts = len(channel.topic) + len(channel.message_encoding) + sum(len(key) + len(table[key]) for key in table)
        self._sizes.channel(channel.id, channel.topic, texts)
        self._topics[channel.id] = McapChannel(channel.topic, channel.message_encoding, table)

    def _topic(self, channel_id: int) -> McapChannel:
        topic = self._topics.get(channel_id)
        if topic is None:
            raise ValueError(f"a message belongs to channel {channel_id}, which is not declared")
        return topic

    def _walk(self, data: bytes, stored: int) -> Iterator[list[McapMessage]]:
        """The messages in the records of a chunk with ``stored`` bytes in the file."""
        items: list[McapMessage] = []
        yielded = 0
        at, size, topics = 0, len(data), self._topics
        while at < size:
            op, length = HEAD.unpack_from(data, at)
            end = at + HEAD.size + length
            if end > size:
                raise ValueError("a record is longer than its chunk")
            if op == _MESSAGE:
                channel_id, sequence, log_time, publish_time = _STAMPS.unpack_from(data, at + HEAD.size)
                if log_time > MAX_TIME_NS or publish_time > MAX_TIME_NS:
                    _check_times(log_time, publish_time)
                body = data[at + MESSAGE.size : end]
                topic = topics.get(channel_id) or self._topic(channel_id)
                items.append(McapMessage(topic, log_time, publish_time, sequence, body))
                if len(items) == _MAX_BATCH_MESSAGES:
                    yielded += _MAX_BATCH_MESSAGES
                    check_messages(yielded, stored)
                    yield items
                    items = []
            elif op == Op.CHANNEL:
                self._declare(Channel.read(ReadDataStream(BytesIO(data[at + HEAD.size : end]))))
            at = end
        yield items


def _read_records(stream: IO[bytes], size: int) -> Iterator[McapRecord | None]:
    """The records of a file of this size [B] up to its footer; None for one that is not parsed.

    Raises InvalidMagic, EndOfFile, RecordLengthLimitExceeded, LimitError, ValueError, struct.error.
    """
    _check_magic(stream)
    op = 0
    while op != Op.FOOTER:
        op, length = HEAD.unpack(_read(stream, HEAD.size))
        if length > size:
            raise RecordLengthLimitExceeded(op, length, size)
        body = _read(stream, length)
        parse = _PARSERS.get(op)
        yield parse(ReadDataStream(_Body(body)), length) if parse else None
    _check_magic(stream)


def _check_magic(stream: IO[bytes]) -> None:
    if (magic := _read(stream, len(MAGIC))) != MAGIC:
        raise InvalidMagic(tuple(magic))


class _Body(BytesIO):
    """The body of a record, from which no more can be read than it has."""

    def read(self, length: int | None = -1) -> bytes:
        """Read exactly so many bytes.  Raises LimitError, ValueError."""
        _check_length(length or 0)
        data = super().read(length)
        if len(data) < (length or 0):
            raise ValueError("a field is longer than its record")
        return data


def _check_length(length: int) -> None:
    """Check a length that a file states, before so much is read.  Raises LimitError."""
    if length > MAX_RECORD:
        raise LimitError(f"a length of {length} bytes; at most {MAX_RECORD} are read at once")


def _read(stream: IO[bytes], length: int) -> bytes:
    """Read exactly so many bytes.  Raises EndOfFile, LimitError."""
    _check_length(length)
    data = stream.read(length)
    if len(data) < length:
        raise EndOfFile
    return data


#: Opcode -> parser of the records that a reader needs.
_PARSERS: dict[int, Callable[[ReadDataStream, int], McapRecord]] = {
    Op.ATTACHMENT: lambda stream, _: Attachment.read(stream),
    Op.CHANNEL: lambda stream, _: Channel.read(stream),
    Op.CHUNK: lambda stream, _: Chunk.read(stream),
    Op.MESSAGE: Message.read,
    Op.METADATA: lambda stream, _: Metadata.read(stream),
}


def _limit_fault(at: int, error: LimitError) -> str:
    """The fault of a file that exceeds a limit."""
    return f"reading stops after byte {at}: {error}"


def _check_times(*times: int) -> None:
    if max(times) > MAX_TIME_NS:
        raise LimitError(f"a message has the time {max(times)} ns; at most {MAX_TIME_NS} is allowed")


def _content(chunk: Chunk) -> bytes:
    """The records of a chunk.  Raises ValueError when they are damaged."""
    content = decompress(chunk.compression, chunk.data, chunk.uncompressed_size)
    if chunk.uncompressed_crc not in (0, zlib.crc32(content)):
        raise ValueError("the checksum of a chunk does not match")
    return content


def _chunk_at(source: TolerantFile, at: int) -> int:
    """Offset of the next record that is neither padding nor checkpoints."""
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
