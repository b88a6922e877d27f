"""Validation of the records of an MCAP file by the lengths within each record.

Specification: https://mcap.dev/spec, version 0.  The length of a record must equal the sum of its own fields.  Bytes
that look like a record after a bit flip, a hole or by chance fail this check.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from fti.logger.checkpoints import SLOT_BYTES, SLOTS
from fti.logger.reading.compression import decompress
from fti.logger.reading.limits import (
    MAX_ATTACHMENTS,
    MAX_CHUNK_MESSAGES,
    MAX_RECORD,
    MAX_SMALL_RECORD,
    LimitError,
    check_messages,
)
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import CHUNK, CHUNK_BODY, HEAD, MESSAGE, MESSAGE_BODY, SECTOR, Op, read_text

_CHUNK_BEGIN = re.compile(rb"\x06(?=[\s\S]{5}\x00\x00\x00)")  # shorter than 2^40 bytes
_LONG = (Op.ATTACHMENT, Op.MESSAGE_INDEX)
_CHUNK_HEAD = struct.Struct("<BQQQQII")  # a chunk up to the name of its compression
COMPRESSIONS = (b"", b"zstd", b"lz4")
#: Largest torn write outside of chunks, except attachments and message indexes [B].
MAX_TORN_BYTES = 4096


@dataclass(frozen=True, slots=True)
class ChunkHead:
    """Head of a chunk.  begin, end : of its stored bytes in the file; size : of its records, unpacked [B]."""

    at: int
    begin: int
    end: int
    size: int
    crc: int
    compression: str

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
    if len(content) // MESSAGE.size <= MAX_CHUNK_MESSAGES:
        return
    messages = at = 0
    while at + HEAD.size <= len(content):
        op, length = HEAD.unpack_from(content, at)
        messages += op == Op.MESSAGE
        at += HEAD.size + length
    check_messages(messages, stored)


def chunk_head(source: TolerantFile, at: int) -> ChunkHead | None:
    """Head of the chunk at an offset; None when its lengths disagree.  Its end may be after the end of the file."""
    head = source.read(at, CHUNK.size + 4)
    if len(head) < CHUNK.size:
        return None
    op, length, _, _, size, crc, name_length = _CHUNK_HEAD.unpack_from(head)
    name = head[_CHUNK_HEAD.size : _CHUNK_HEAD.size + name_length]
    if op != Op.CHUNK or name not in COMPRESSIONS or len(head) < CHUNK.size + len(name) or name_length != len(name):
        return None
    (stored,) = struct.unpack_from("<Q", head, _CHUNK_HEAD.size + name_length)
    if length != CHUNK_BODY + name_length + stored or (not name and stored != size):
        return None
    begin = at + CHUNK.size + name_length
    return ChunkHead(at, begin, begin + stored, size, crc, name.decode())


def is_torn_write(source: TolerantFile, at: int) -> bool:
    """Can the bytes from an offset on be an interrupted write outside of chunks?

    They are then short, or a long record that the end of the file cuts off, or zeros; and no chunk begins in them.
    """
    rest = source.read(at, min(source.size - at, MAX_SMALL_RECORD)).rstrip(b"\0")
    if next(_chunks_after(source, at), None):
        return False
    if len(rest) <= MAX_TORN_BYTES:
        return True
    op, length = HEAD.unpack_from(rest)
    return op in _LONG and at + HEAD.size + length > source.size


def is_followed_by_chunk(source: TolerantFile, at: int) -> bool:
    """Does a chunk begin after an offset?  Its checksum is not checked."""
    return any(_chunks_after(source, at))


def _chunks_after(source: TolerantFile, at: int) -> Iterator[ChunkHead]:
    rest = source.read(at, min(source.size - at, MAX_SMALL_RECORD))
    heads = (chunk_head(source, at + found.start()) for found in _CHUNK_BEGIN.finditer(rest, 1))
    yield from (head for head in heads if head)


def record_end(source: TolerantFile, at: int, limit: int) -> int | None:
    """End of the record at an offset; None when it is invalid or ends after ``limit``."""
    head = source.read(at, HEAD.size)
    if len(head) < HEAD.size:
        return None
    op, length = HEAD.unpack(head)
    end: int = at + HEAD.size + length
    if end > limit:
        return None
    if op == Op.CHUNK:
        return end if chunk_head(source, at) else None
    if op in _LENGTHS:
        return end if length == _LENGTHS[op] else None
    return end if _has_form(source, op, at + HEAD.size, length) else None


def _has_form(source: TolerantFile, op: int, at: int, length: int) -> bool:
    """Is the body at an offset valid for this opcode?  A long record with an invalid begin is not read completely."""
    check, begins = _FORMS.get(op), _BEGINNINGS.get(op)
    if check is None or length > (MAX_ATTACHMENTS if op == Op.ATTACHMENT else MAX_SMALL_RECORD):
        return False
    try:
        fits = begins is None or begins(source.read(at, _BEGINNING), length)
        return fits and check(source.read(at, length))
    except (struct.error, UnicodeDecodeError):
        return False


def _texts_end(body: bytes, at: int, count: int = 1) -> int:
    for _ in range(count):
        _, at = read_text(body, at)
        if at > len(body):
            raise struct.error("a string is longer than its record")
    return at


def _u32(body: bytes, at: int) -> int:
    return int(struct.unpack_from("<I", body, at)[0])


def _is_table(body: bytes, at: int) -> bool:
    """Is this a table of strings, up to the end of the body?"""
    end = at + 4 + _u32(body, at)
    at += 4
    while at < end:
        at = _texts_end(body, at, 2)
    return at == end == len(body)


def _is_array(body: bytes, at: int, entry: int) -> bool:
    size = _u32(body, at)
    return at + 4 + size == len(body) and size % entry == 0


def is_schema(body: bytes) -> bool:
    """Is this the body of a schema record?"""
    at = _texts_end(body, 2, 2)
    return body[:2] != b"\0\0" and at + 4 + _u32(body, at) == len(body)


def is_channel(body: bytes) -> bool:
    """Is this the body of a channel record?"""
    return _is_table(body, _texts_end(body, 4, 2))


def _is_chunk_index(body: bytes) -> bool:
    at = 36 + _u32(body, 32) + 8
    return _texts_end(body, at) + 16 == len(body)


def _begins_attachment(begin: bytes, length: int) -> bool:
    at = _texts_end(begin, 16, 2)
    return bool(at + 8 + struct.unpack_from("<Q", begin, at)[0] + 4 == length)


def _is_attachment(body: bytes) -> bool:
    return zlib.crc32(memoryview(body)[:-4]) == _u32(body, len(body) - 4)


def _begins_metadata(begin: bytes, length: int) -> bool:
    at = _texts_end(begin, 0)
    return at + 4 + _u32(begin, at) == length


_BEGINNING = 4096  # names are shorter
_BEGINNINGS: dict[int, Callable[[bytes, int], bool]] = {
    Op.ATTACHMENT: _begins_attachment,
    Op.METADATA: _begins_metadata,
}
_LENGTHS = {
    int(Op.DATA_END): 4,
    int(Op.FOOTER): 20,
    int(Op.SUMMARY_OFFSET): 17,
    int(Op.CHECKPOINTS): SLOTS * SLOT_BYTES,
}
_FORMS: dict[int, Callable[[bytes], bool]] = {
    Op.HEADER: lambda body: _texts_end(body, 0, 2) == len(body),
    Op.SCHEMA: is_schema,
    Op.CHANNEL: is_channel,
    Op.MESSAGE: lambda body: len(body) >= MESSAGE_BODY,
    Op.MESSAGE_INDEX: lambda body: _is_array(body, 2, 16),
    Op.CHUNK_INDEX: _is_chunk_index,
    Op.ATTACHMENT: _is_attachment,
    Op.ATTACHMENT_INDEX: lambda body: _texts_end(body, 40, 2) == len(body),
    Op.STATISTICS: lambda body: _is_array(body, 42, 10),
    Op.METADATA: lambda body: _is_table(body, _texts_end(body, 0)),
    Op.METADATA_INDEX: lambda body: _texts_end(body, 16) == len(body),
    Op.PADDING: lambda body: len(body) < 2 * SECTOR and not any(body),
}
