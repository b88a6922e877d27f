"""Validation of the records of an MCAP file by the lengths within each record.

Specification: https://mcap.dev/spec, version 0.  The length of a record must equal the sum of its own fields.  Bytes
that look like a record after a bit flip, a hole or by chance fail this check.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable, Iterator

from fti.logger.checkpoints import SLOT_BYTES, SLOTS
from fti.logger.reading.limits import MAX_ATTACHMENTS, MAX_SMALL_RECORD
from fti.logger.reading.record_cursor import ChunkHead, Record, chunk_head, record_at
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import HEAD, MESSAGE_BODY, SECTOR, Op, read_text

_CHUNK_BEGIN = re.compile(rb"\x06(?=[\s\S]{5}\x00\x00\x00)")  # shorter than 2^40 bytes
_LONG = (Op.ATTACHMENT, Op.MESSAGE_INDEX)
#: Largest torn write outside of chunks, except attachments and message indexes [B].
MAX_TORN_BYTES = 4096


def is_torn_write(source: TolerantFile, at: int) -> bool:
    """Can the bytes from an offset on be an interrupted write outside of chunks?

    They are then short, or a long record that the end of the file cuts off, or zeros; and no chunk begins in them.
    """
    rest = source.read(at, min(source.size - at, MAX_SMALL_RECORD)).rstrip(b"\0")
    if next(_chunks_after(source, at), None):
        return False
    if len(rest) <= MAX_TORN_BYTES:
        return True
    return rest[0] in _LONG and record_at(source, at, source.size) is None


def is_followed_by_chunk(source: TolerantFile, at: int) -> bool:
    """Does a chunk begin after an offset?  Its checksum is not checked."""
    return any(_chunks_after(source, at))


def _chunks_after(source: TolerantFile, at: int) -> Iterator[ChunkHead]:
    rest = source.read(at, min(source.size - at, MAX_SMALL_RECORD))
    heads = (chunk_head(source, at + found.start()) for found in _CHUNK_BEGIN.finditer(rest, 1))
    yield from (head for head in heads if head)


def valid_record(source: TolerantFile, at: int, limit: int) -> Record | None:
    """The record at an offset; None when it is invalid or ends after ``limit``."""
    record = record_at(source, at, limit)
    if record is None:
        return None
    op, length = record.op, record.end - at - HEAD.size
    if op == Op.CHUNK:
        is_valid = chunk_head(source, at) is not None
    elif op in _LENGTHS:
        is_valid = length == _LENGTHS[op]
    else:
        is_valid = _has_form(source, op, at + HEAD.size, length)
    return record if is_valid else None


def valid_records(source: TolerantFile, at: int, limit: int) -> Iterator[Record]:
    """Consecutive records from an offset on, up to the first that is invalid or ends after ``limit``."""
    while record := valid_record(source, at, limit):
        yield record
        at = record.end


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
    return _u32(body, 32) % 10 == 0 and _texts_end(body, at) + 16 == len(body)


def _begins_attachment(begin: bytes, length: int) -> bool:
    at = _texts_end(begin, 16, 2)
    return bool(at + 8 + struct.unpack_from("<Q", begin, at)[0] + 4 == length)


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
    Op.ATTACHMENT: lambda body: zlib.crc32(memoryview(body)[:-4]) == _u32(body, len(body) - 4),
    Op.ATTACHMENT_INDEX: lambda body: _texts_end(body, 40, 2) == len(body),
    Op.STATISTICS: lambda body: _is_array(body, 42, 10),
    Op.METADATA: lambda body: _is_table(body, _texts_end(body, 0)),
    Op.METADATA_INDEX: lambda body: _texts_end(body, 16) == len(body),
    Op.PADDING: lambda body: len(body) < 2 * SECTOR and not any(body),
}
