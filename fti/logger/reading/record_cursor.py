"""Cursor over the records of an MCAP file or of a chunk, and parser of their fields: the counterpart of ``records``.

The bytes may be cut off or damaged.  A walk stops before the first record that is not whole; the end of the record
before it is the end of what is readable.  ``record_validation`` also checks the form of the records.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from fti.logger.reading.compression import decompress
from fti.logger.reading.limits import MAX_CHUNK_MESSAGES, MAX_RECORD, LimitError, check_messages
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import CHUNK, HEAD, MESSAGE, MESSAGE_BODY, Op, read_text

#: Opcode, length of the body; of a message also channel, sequence, log time and publish time.
RecordHead = tuple[int, int, int, int, int, int]
_MESSAGE = int(Op.MESSAGE)  # looking up a member of an enumeration is slow in a loop over all messages
_CHUNK_HEAD = struct.Struct("<QQQI")  # first and last log time, size, checksum; the name of the compression follows
_MAX_CHUNK_HEAD = 4096
_CHUNK_INDEX = struct.Struct("<QQQQI")
_INDEX_ENTRY = struct.Struct("<HQ")
_U64 = struct.Struct("<Q")
COMPRESSIONS = ("", "zstd", "lz4")


class Record(NamedTuple):
    """A record outside of chunks.  at, end : its offsets in the file [B]."""

    op: int
    at: int
    end: int


def records_in(data: bytes | bytearray, at: int = 0) -> Iterator[tuple[int, int, RecordHead]]:
    """Begin, end and head of the records in a buffer, up to the first that is cut off or a message without its head.

    One call unpacks the whole head of a message: this is the loop over all messages of a session.
    """
    unpack, size = MESSAGE.unpack_from, len(data)
    last = size - MESSAGE.size
    while at + HEAD.size <= size:
        head = unpack(data, at) if at <= last else (*HEAD.unpack_from(data, at), 0, 0, 0, 0)
        end = at + HEAD.size + head[1]
        if end > size or (head[0] == _MESSAGE and head[1] < MESSAGE_BODY):
            return
        yield at, end, head
        at = end


def head_at(data: bytes | bytearray, at: int = 0) -> tuple[int, int] | None:
    """Opcode and length of the body of the record at an offset, which may be cut off; None without a whole head."""
    return HEAD.unpack_from(data, at) if at + HEAD.size <= len(data) else None


def record_at(source: TolerantFile, at: int, limit: int) -> Record | None:
    """The record at an offset by its length alone; None when it is cut off or ends after ``limit``."""
    head = head_at(source.read(at, HEAD.size))
    end = at + HEAD.size + head[1] if head else 0
    return Record(head[0], at, end) if head and end <= limit else None


# ------------------------------------------------------------------------------------------------------------- chunks


@dataclass(frozen=True, slots=True)
class ChunkHead:
    """Head of a chunk.

    begin, end : of its stored bytes in the file; size : of its records, unpacked [B]; times : first and last log time
    """

    at: int
    begin: int
    end: int
    size: int
    crc: int
    compression: str
    times: tuple[int, int] = (0, 0)

    def content(self, source: TolerantFile) -> bytes | None:
        """The unpacked, checked records; None when they are damaged or exceed a limit."""
        try:
            return self.read(source)
        except ValueError:
            return None

    def read(self, source: TolerantFile) -> bytes:
        """The unpacked, checked records.  Raises ValueError when they are damaged, LimitError beyond a limit."""
        stored = self.end - self.begin
        if self.end > source.size:
            raise ValueError("a chunk ends behind its file")
        if stored > MAX_RECORD:
            raise LimitError(f"a chunk of {stored} bytes; at most {MAX_RECORD} are read")
        content = decompress(self.compression, source.read(self.begin, stored), self.size)
        if self.crc not in (0, zlib.crc32(content)):
            raise ValueError("the checksum of a chunk does not match")
        check_content(content, stored)
        return content


def check_content(content: bytes, stored: int) -> None:
    """Check the number of messages of a chunk with ``stored`` bytes in the file.  Raises LimitError."""
    if len(content) // MESSAGE.size > MAX_CHUNK_MESSAGES:
        check_messages(sum(head[0] == _MESSAGE for _, _, head in records_in(content)), stored)


def chunk_head(source: TolerantFile, at: int) -> ChunkHead | None:
    """Head of the chunk at an offset; None when its lengths disagree.  Its end may be after the end of the file."""
    data = source.read(at, CHUNK.size + max(map(len, COMPRESSIONS)))
    try:
        head = _parse_chunk_head(data, at)
    except (struct.error, UnicodeDecodeError):
        return None
    op, length = HEAD.unpack_from(data)
    agree = head.end == at + HEAD.size + length and (head.compression or head.end - head.begin == head.size)
    return head if op == Op.CHUNK and head.compression in COMPRESSIONS and agree else None


def stated_chunk_head(source: TolerantFile, record: Record) -> ChunkHead:
    """Head of a chunk whose record may be longer than its fields.  Raises ValueError or struct.error."""
    head = _parse_chunk_head(source.read(record.at, min(record.end - record.at, _MAX_CHUNK_HEAD)), record.at)
    if head.end > record.end:
        raise ValueError("a field is longer than its record")
    return head


def _parse_chunk_head(data: bytes, at: int) -> ChunkHead:
    first, last, size, crc = _CHUNK_HEAD.unpack_from(data, HEAD.size)
    compression, end = read_text(data, HEAD.size + _CHUNK_HEAD.size)
    begin = at + end + _U64.size
    return ChunkHead(at, begin, begin + _U64.unpack_from(data, end)[0], size, crc, compression, (first, last))


# ------------------------------------------------------------------------------------------------------------- fields
# Of whole records with a valid form.  All raise struct.error or UnicodeDecodeError for others.


class ChannelFields(NamedTuple):
    """A channel record."""

    channel_id: int
    schema_id: int
    topic: str
    encoding: str
    metadata: dict[str, str]


class AttachmentFields(NamedTuple):
    """An attachment record without its content of ``size`` bytes."""

    log_time: int
    size: int
    name: str
    media_type: str


class ChunkIndexFields(NamedTuple):
    """A chunk index record.

    times : first and last log time; offset, size : of the chunk and of its records [B]; index_offsets, index_length :
    of its message indexes, by channel, and of all together [B]
    """

    times: tuple[int, int]
    offset: int
    size: int
    index_offsets: dict[int, int]
    index_length: int


def record_id(record: bytes) -> int:
    """Id of a schema or channel."""
    return int.from_bytes(record[HEAD.size : HEAD.size + 2], "little")


def channel_fields(record: bytes) -> ChannelFields:
    """The fields of a channel record."""
    channel_id, schema_id = struct.unpack_from("<HH", record, HEAD.size)
    topic, at = read_text(record, HEAD.size + 4)
    encoding, at = read_text(record, at)
    return ChannelFields(channel_id, schema_id, topic, encoding, _text_table(record, at))


def attachment_fields(record: bytes) -> AttachmentFields:
    """The fields of an attachment record, which may be cut off in its content."""
    return _attachment(record)[0]


def attachment_content(record: bytes) -> tuple[str, bytes]:
    """Name and content of an attachment record."""
    fields, begin = _attachment(record)
    if begin + fields.size > len(record):
        raise struct.error("a field is longer than its record")
    return fields.name, record[begin : begin + fields.size]


def _attachment(record: bytes) -> tuple[AttachmentFields, int]:
    """The fields of an attachment, and where its content begins."""
    (log_time,) = _U64.unpack_from(record, HEAD.size)
    name, at = read_text(record, HEAD.size + 16)
    media_type, at = read_text(record, at)
    return AttachmentFields(log_time, _U64.unpack_from(record, at)[0], name, media_type), at + _U64.size


def metadata_table(record: bytes) -> tuple[str, dict[str, str]]:
    """Name and table of a metadata record."""
    name, at = read_text(record, HEAD.size)
    return name, _text_table(record, at)


def chunk_index_fields(record: bytes) -> ChunkIndexFields:
    """The fields of a chunk index record."""
    first, last, offset, _, table_size = _CHUNK_INDEX.unpack_from(record, HEAD.size)
    begin = HEAD.size + _CHUNK_INDEX.size
    end = begin + table_size
    _, at = read_text(record, end + 8)
    _, size = struct.unpack_from("<QQ", record, at)
    offsets = dict(_INDEX_ENTRY.iter_unpack(record[begin:end]))
    return ChunkIndexFields((first, last), offset, size, offsets, _U64.unpack_from(record, end)[0])


def indexed_record(record: bytes) -> tuple[int, str]:
    """Offset and name of the record of an attachment or metadata index record."""
    name_at = 40 if record[0] == Op.ATTACHMENT_INDEX else 16
    return _U64.unpack_from(record, HEAD.size)[0], read_text(record, HEAD.size + name_at)[0]


def message_count(statistics: bytes) -> int:
    """Number of messages of a statistics record."""
    return int(_U64.unpack_from(statistics, HEAD.size)[0])


def footer_fields(record: bytes) -> tuple[int, int]:
    """Offset of the summary, and checksum of summary and footer."""
    start, _, crc = struct.unpack_from("<QQI", record, HEAD.size)
    return start, crc


def _text_table(data: bytes, at: int) -> dict[str, str]:
    end = at + 4 + int.from_bytes(data[at : at + 4], "little")
    at += 4
    found = {}
    while at < end:
        key, at = read_text(data, at)
        found[key], at = read_text(data, at)
    return found
