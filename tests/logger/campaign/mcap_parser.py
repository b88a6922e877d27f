"""A reader of MCAP files that shares nothing with the product: the ground truth of the campaign.

It reads a file that nobody has damaged, open or closed, from its begin to its end, and notes where each record stands.
See https://mcap.dev/spec.
"""

from __future__ import annotations

import struct
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

MAGIC = b"\x89MCAP0\r\n"
SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX = 0x03, 0x04, 0x05, 0x06, 0x07
ATTACHMENT, METADATA, DATA_END, CHECKPOINTS = 0x09, 0x0C, 0x0F, 0x81
RECORD_HEAD_BYTES = 9
#: Start and end time, size, checksum, an empty compression, length of the records.
CHUNK_HEAD_BYTES = RECORD_HEAD_BYTES + 8 + 8 + 8 + 4 + 4 + 8

#: Topic, encoding, metadata, and the schema's name, encoding and text.
ChannelKey = tuple[str, str, tuple[tuple[str, str], ...], str, str, bytes]


class Content(NamedTuple):
    """What two messages are compared by."""

    channel: ChannelKey
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


class Message(NamedTuple):
    """A message, and where its record stands in the file."""

    begin: int
    end: int
    content: Content


class Record(NamedTuple):
    """A record outside of chunks (chunk None), or in the chunk that begins there."""

    op: int
    begin: int
    end: int
    chunk: int | None


@dataclass(slots=True)
class ParsedFile:
    """What a file holds.  end : of its last whole record; ``has_summary``: the data section has an end."""

    records: list[Record] = field(default_factory=list)
    messages: list[Message] = field(default_factory=list)
    end: int = 0
    has_summary: bool = False

    def of(self, *ops: int) -> list[Record]:
        """The records of some kinds."""
        return [record for record in self.records if record.op in ops]

    def top_level(self) -> list[Record]:
        """The records outside of chunks."""
        return [record for record in self.records if record.chunk is None]

    def message_at(self, offset: int) -> Message | None:
        """The message in whose record a byte stands."""
        at = bisect_right(self.messages, offset, key=lambda message: message.begin) - 1
        return self.messages[at] if at >= 0 and offset < self.messages[at].end else None


def parse(data: bytes) -> ParsedFile:
    """Read a file.  Records that are torn at its end are left out.  Raises ValueError where it is no such file."""
    if not data.startswith(MAGIC):
        raise ValueError("no magic")
    return _Parser(data).run()


class _Parser:
    def __init__(self, data: bytes) -> None:
        self._data = data
        self._found = ParsedFile(end=len(MAGIC))
        self._schemas: dict[int, tuple[str, str, bytes]] = {0: ("", "", b"")}
        self._channels: dict[int, ChannelKey] = {}

    def run(self) -> ParsedFile:
        at, found, chunk = len(MAGIC), self._found, None
        while (record := self._record(at)) is not None:
            op, _, end, _ = record
            if op == DATA_END:
                found.has_summary = True
                break
            if op == CHUNK:
                chunk, end = at, self._chunk(at, end)
            else:  # records of an open chunk that its head does not cover stand behind it
                open_records = op in (SCHEMA, CHANNEL, MESSAGE)
                found.records.append(record._replace(chunk=chunk if open_records else None))
                self._take(op, at, end)
            found.end = at = end
        return found

    def _record(self, at: int) -> Record | None:
        if at + RECORD_HEAD_BYTES > len(self._data):
            return None
        op, length = struct.unpack_from("<BQ", self._data, at)
        end = at + RECORD_HEAD_BYTES + length
        return Record(op, at, end, None) if op and end <= len(self._data) else None

    def _chunk(self, at: int, end: int) -> int:
        (name_bytes,) = struct.unpack_from("<I", self._data, at + 37)
        if name_bytes:
            raise ValueError(f"compressed chunk at byte {at}")
        self._found.records.append(Record(CHUNK, at, end, None))
        inner = at + CHUNK_HEAD_BYTES
        while inner < end:
            record = self._record(inner)
            if record is None or record.end > end:
                raise ValueError(f"chunk at byte {at}: no record at byte {inner}")
            self._found.records.append(record._replace(chunk=at))
            self._take(record.op, inner, record.end)
            inner = record.end
        return end

    def _take(self, op: int, begin: int, end: int) -> None:
        body = self._data[begin + RECORD_HEAD_BYTES : end]
        if op == SCHEMA:
            (number,) = struct.unpack_from("<H", body)
            name, encoding, text = _fields(body, 2)
            self._schemas[number] = (name.decode(), encoding.decode(), text)
        elif op == CHANNEL:
            number, schema = struct.unpack_from("<HH", body)
            fields = _fields(body, 4, table=True)
            topic, message_encoding, *pairs = (part.decode() for part in fields)
            table = tuple(sorted(zip(pairs[::2], pairs[1::2], strict=True)))
            self._channels[number] = (topic, message_encoding, table, *self._schemas[schema])
        elif op == MESSAGE:
            channel, sequence, log_time, publish_time = struct.unpack_from("<HIQQ", body)
            content = Content(self._channels[channel], sequence, log_time, publish_time, body[22:])
            self._found.messages.append(Message(begin, end, content))


def _fields(body: bytes, at: int, *, table: bool = False) -> list[bytes]:
    """The texts of a record; table : two texts, then the bytes of a table, then what stands in it."""
    return list(_texts(body, at, 2 if table else 3, table=table))


def _texts(body: bytes, at: int, count: int, *, table: bool) -> Iterator[bytes]:
    for _ in range(count):
        (size,) = struct.unpack_from("<I", body, at)
        yield body[at + 4 : at + 4 + size]
        at += 4 + size
    if table:
        at += 4
        while at < len(body):
            (size,) = struct.unpack_from("<I", body, at)
            yield body[at + 4 : at + 4 + size]
            at += 4 + size
