"""Reader of one MCAP file: finished, being written, cut off or damaged.

The indexes are skipped, which a reader in the order of the file does not need.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from fti.errors import MissingError
from fti.logger.reading import record_cursor
from fti.logger.reading.limits import MAX_RECORD, MAX_TIME_NS, DeclaredSizes, LimitError
from fti.logger.reading.open_chunk import DamagedChunkError, Declarations, is_open, read_open_chunk
from fti.logger.reading.record_validation import valid_records
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import HEAD, MAGIC, MESSAGE, Op
from fti.logger.regular_file import open_regular

_MESSAGE = int(Op.MESSAGE)  # looking up a member of an enumeration is slow in a loop over all messages
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
        self.position = 0  # bytes read so far

    def is_finished(self) -> bool:
        """Does the file end with a footer?"""
        return has_footer(self.path)

    def head(self) -> Head:
        """Metadata and attachments before the first chunk."""
        head = Head()
        with TolerantFile(self.path, strict=True) as source:
            for op, content in self._records(source):
                if op == Op.METADATA:
                    head.metadata[content[0]] = content[1]
                elif op == Op.ATTACHMENT:
                    head.attachments[content[0]] = content[1]
                elif op in (Op.CHUNK, Op.MESSAGE):
                    break
        return head

    def compression(self) -> str:
        """Compression of the first chunk; "" when it has none, or there is no chunk."""
        with TolerantFile(self.path, strict=True) as source:
            return next((head.compression for op, head in self._records(source) if op == Op.CHUNK), "")

    def chunks(self) -> Iterator[list[McapMessage]]:
        """The messages by chunk (a large chunk in parts), in the order of the file, up to its end or a fault."""
        with TolerantFile(self.path, strict=True) as source:
            for op, content in self._records(source):
                try:
                    if op == Op.CHANNEL:
                        self._declare(content)
                    elif op in (Op.CHUNK, Op.MESSAGE):  # a message that the head of its chunk does not cover yet
                        data = content.read(source) if op == Op.CHUNK else content
                        yield from filter(None, self._walk(data))
                except (ValueError, struct.error) as error:
                    self.fault = _fault(self.position, error)
                    break
        if self.fault and not self.fault.startswith(_STOPPED) and not self.is_finished():
            yield from self._unfinished()

    def _unfinished(self) -> Iterator[list[McapMessage]]:
        """Messages of the last chunk of a file that was cut off, when the checksum in its head does not match."""
        with TolerantFile(self.path) as source:
            at = self.position
            for record in valid_records(source, at, source.size):
                if record.op not in (Op.PADDING, Op.CHECKPOINTS):
                    break
                at = record.end
            head = record_cursor.chunk_head(source, at)
            if head is None or not is_open(source, head):
                return
            try:
                yield from self._walk(bytes(read_open_chunk(source, head, Declarations()).content.data))
            except (DamagedChunkError, ValueError, struct.error):
                return  # the fault remains

    def items(self) -> Iterator[McapMessage]:
        """The messages in the order of the file."""
        for chunk in self.chunks():
            yield from chunk

    def _records(self, source: TolerantFile) -> Iterator[tuple[int, Any]]:
        """Opcode and content of the records outside of chunks; sets ``fault`` where they end early."""
        self.fault, self.position, self._sizes = None, 0, DeclaredSizes()
        try:
            for record in _read_records(source):
                if record.op in _PARSERS:
                    if record.op == Op.METADATA:
                        self._sizes.metadata(record.end - record.at)
                    elif record.op == Op.ATTACHMENT:
                        self._sizes.attachment(record.end - record.at)
                    yield record.op, _PARSERS[record.op](source, record)
                self.position = record.end
        except EOFError:
            self.fault = f"ends after byte {self.position} without a footer: it is being written, or was cut off"
        except (ValueError, struct.error) as error:
            self.fault = _fault(self.position, error)

    def _declare(self, channel: record_cursor.ChannelFields) -> None:
        table = channel.metadata
        texts = len(channel.topic) + len(channel.encoding) + sum(len(key) + len(table[key]) for key in table)
        self._sizes.channel(channel.channel_id, channel.topic, texts)
        self._topics[channel.channel_id] = McapChannel(channel.topic, channel.encoding, table)

    def _topic(self, channel_id: int) -> McapChannel:
        topic = self._topics.get(channel_id)
        if topic is None:
            raise ValueError(f"a message belongs to channel {channel_id}, which is not declared")
        return topic

    def _walk(self, data: bytes) -> Iterator[list[McapMessage]]:
        """The messages in the records of a chunk."""
        items: list[McapMessage] = []
        topics, walked = self._topics, 0
        for at, end, (op, _, channel_id, sequence, log_time, publish_time) in record_cursor.records_in(data):
            if op == _MESSAGE:
                if log_time > MAX_TIME_NS or publish_time > MAX_TIME_NS:
                    latest = max(log_time, publish_time)
                    raise LimitError(f"a message has the time {latest} ns; at most {MAX_TIME_NS} is allowed")
                topic = topics.get(channel_id) or self._topic(channel_id)
                items.append(McapMessage(topic, log_time, publish_time, sequence, data[at + MESSAGE.size : end]))
                if len(items) == _MAX_BATCH_MESSAGES:
                    yield items
                    items = []
            elif op == Op.CHANNEL:
                self._declare(record_cursor.channel_fields(data[at:end]))
            walked = end
        if walked < len(data):
            raise ValueError("a record is longer than its chunk")
        yield items


def _read_records(source: TolerantFile) -> Iterator[record_cursor.Record]:
    """The records of a file up to its footer.  Raises EOFError at its end, ValueError without magic, LimitError."""
    op, at = 0, _magic_end(source, 0)
    while op != Op.FOOTER:
        record = record_cursor.record_at(source, at, source.size)
        if record is None:
            raise EOFError
        if record.end - at - HEAD.size > MAX_RECORD:
            raise LimitError(f"a length of {record.end - at - HEAD.size} bytes; at most {MAX_RECORD} are read at once")
        yield record
        op, _, at = record
    _magic_end(source, at)


def _magic_end(source: TolerantFile, at: int) -> int:
    magic = source.read(at, len(MAGIC))
    if len(magic) < len(MAGIC):
        raise EOFError
    if magic != MAGIC:
        raise ValueError("it does not have the magic of an MCAP file")
    return at + len(MAGIC)


def _read_record(source: TolerantFile, record: record_cursor.Record) -> bytes:
    return source.read(record.at, record.end - record.at)


#: Opcode -> parser of the records that a reader needs.
_PARSERS: dict[int, Callable[[TolerantFile, record_cursor.Record], Any]] = {
    Op.ATTACHMENT: lambda source, record: record_cursor.attachment_content(_read_record(source, record)),
    Op.CHANNEL: lambda source, record: record_cursor.channel_fields(_read_record(source, record)),
    Op.CHUNK: record_cursor.stated_chunk_head,
    Op.MESSAGE: _read_record,
    Op.METADATA: lambda source, record: record_cursor.metadata_table(_read_record(source, record)),
}
_STOPPED = "reading stops"


def _fault(at: int, error: Exception) -> str:
    """The fault of a file that is damaged or exceeds a limit."""
    why = "a field is longer than its record" if isinstance(error, struct.error) else error
    return f"{_STOPPED if isinstance(error, LimitError) else 'is damaged'} after byte {at}: {why}"


def has_footer(path: Path) -> bool:
    """Does a file end with a footer and the magic, as a finished one does?  Raises MissingError."""
    try:
        with open_regular(path) as stream:
            stream.seek(-min(FOOTER_BYTES, stream.seek(0, os.SEEK_END)), os.SEEK_END)
            tail = stream.read()
    except OSError as error:
        raise MissingError(f"{path}: cannot be read: {error.strerror}") from error
    return tail[:9] == HEAD.pack(Op.FOOTER, 20) and tail.endswith(MAGIC)
