"""Encoder of MCAP records, for the writer and for repair.

Specification: https://mcap.dev/spec, version 0.  A record is opcode (u8), length of the body (u64), body.  Numbers are
little-endian; a u32 length precedes each string.  This module imports no other of the product: the recorder uses it.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Mapping
from enum import IntEnum

MAGIC = b"\x89MCAP0\r\n"
SECTOR = 512
#: Alignment of chunk heads, and so of the checkpoints before them [B].
ALIGNMENT = 16


class Op(IntEnum):
    """Opcodes of the records.  The specification reserves those from 0x80 on for applications."""

    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    CHUNK_INDEX = 0x08
    ATTACHMENT = 0x09
    ATTACHMENT_INDEX = 0x0A
    STATISTICS = 0x0B
    METADATA = 0x0C
    METADATA_INDEX = 0x0D
    SUMMARY_OFFSET = 0x0E
    DATA_END = 0x0F
    PADDING = 0x80
    CHECKPOINTS = 0x81


HEAD = struct.Struct("<BQ")  # opcode, length of the body
MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time; the data follows
MESSAGE_BODY = MESSAGE.size - HEAD.size
#: opcode, length, start time, end time, uncompressed size, crc, length of the compression name (0), records length
CHUNK = struct.Struct("<BQQQQIIQ")
CHUNK_BODY = CHUNK.size - HEAD.size
_FOOTER = struct.Struct("<BQQQI")
_CHUNK_INDEX = struct.Struct("<QQQQI")
_STATISTICS = struct.Struct("<QHIIIIQQI")


def record(op: int, *parts: bytes) -> bytes:
    """One record."""
    body = b"".join(parts)
    return HEAD.pack(op, len(body)) + body


def _text(value: str) -> bytes:
    data = value.encode()
    return struct.pack("<I", len(data)) + data


def read_text(data: bytes, at: int) -> tuple[str, int]:
    """String at an offset, and its end.  Raises struct.error or UnicodeDecodeError when it is invalid."""
    (length,) = struct.unpack_from("<I", data, at)
    end = at + 4 + length
    if end > len(data):
        raise struct.error("a field is longer than its record")
    return data[at + 4 : end].decode(), end


def _text_map(table: Mapping[str, str]) -> bytes:
    data = b"".join(_text(key) + _text(value) for key, value in table.items())
    return struct.pack("<I", len(data)) + data


def header(profile: str, library: str) -> bytes:
    """Header record."""
    return record(Op.HEADER, _text(profile), _text(library))


def file_head(profile: str = "fti", library: str = "fti") -> bytes:
    """Magic and header, with which a file begins."""
    return MAGIC + header(profile, library)


def schema(schema_id: int, name: str, encoding: str, data: bytes) -> bytes:
    """Schema record."""
    head = struct.pack("<H", schema_id) + _text(name) + _text(encoding)
    return record(Op.SCHEMA, head, struct.pack("<I", len(data)), data)


def channel(channel_id: int, topic: str, encoding: str, schema_id: int, metadata: Mapping[str, str]) -> bytes:
    """Channel record."""
    head = struct.pack("<HH", channel_id, schema_id)
    return record(Op.CHANNEL, head, _text(topic), _text(encoding), _text_map(metadata))


def chunk_head(first_ns: int, last_ns: int, size: int, crc: int) -> bytes:
    """Head of an uncompressed chunk with ``size`` bytes of records."""
    return CHUNK.pack(Op.CHUNK, CHUNK_BODY + size, first_ns, last_ns, size, crc, 0, size)


def padding(offset: int) -> bytes:
    """Padding at ``offset`` that puts the following chunk head within one sector, at a multiple of ALIGNMENT.

    A patch of the head or of a checkpoint then stays within one page, which a kill cannot split, and within one sector,
    which a power cut rarely splits.
    """
    gap = -offset % ALIGNMENT
    while 0 < gap < HEAD.size or (offset + gap) % SECTOR > SECTOR - CHUNK.size:
        gap += ALIGNMENT
    return record(Op.PADDING, bytes(gap - HEAD.size)) if gap else b""


def message_index(channel_id: int, entries: bytes) -> bytes:
    """Message index record; entries : pairs of log time and offset in the chunk, u64 each."""
    return record(Op.MESSAGE_INDEX, struct.pack("<HI", channel_id, len(entries)), entries)


def packed_chunk(times: tuple[int, int], size: int, crc: int, compression: str, stored: bytes) -> bytes:
    """Chunk record of ``size`` bytes of records, stored compressed."""
    head = struct.pack("<QQQI", *times, size, crc)
    return record(Op.CHUNK, head, _text(compression), struct.pack("<Q", len(stored)), stored)


def chunk_index(
    times: tuple[int, int],
    offset: int,
    size: int,
    index_offsets: Mapping[int, int],
    index_length: int,
    *,
    packed: tuple[str, int] = ("", 0),
) -> bytes:
    """Chunk index record of a chunk of ``size`` bytes of records that begins at ``offset``.

    packed : compression and stored bytes of a compressed chunk.
    """
    compression, stored = packed if packed[0] else ("", size)
    table = b"".join(struct.pack("<HQ", cid, at) for cid, at in index_offsets.items())
    head = _CHUNK_INDEX.pack(*times, offset, CHUNK.size + len(compression) + stored, len(table))
    sizes = struct.pack("<QQ", stored, size)
    return record(Op.CHUNK_INDEX, head, table, struct.pack("<Q", index_length), _text(compression), sizes)


def attachment(name: str, media_type: str, data: bytes, log_time: int) -> bytes:
    """Attachment record with its checksum."""
    body = (
        struct.pack("<QQ", log_time, log_time) + _text(name) + _text(media_type) + struct.pack("<Q", len(data)) + data
    )
    return record(Op.ATTACHMENT, body, struct.pack("<I", zlib.crc32(body)))


def attachment_index(location: tuple[int, int], log_time: int, size: int, name: str, media_type: str) -> bytes:
    """Attachment index record; place : offset and length of the attachment record."""
    head = struct.pack("<QQQQQ", *location, log_time, log_time, size)
    return record(Op.ATTACHMENT_INDEX, head, _text(name), _text(media_type))


def metadata(name: str, table: Mapping[str, str]) -> bytes:
    """Metadata record."""
    return record(Op.METADATA, _text(name), _text_map(table))


def metadata_index(offset: int, length: int, name: str) -> bytes:
    """Metadata index record; length : of the whole metadata record."""
    return record(Op.METADATA_INDEX, struct.pack("<QQ", offset, length), _text(name))


def statistics(sizes: tuple[int, int, int, int], times: tuple[int, int], counts: Mapping[int, int]) -> bytes:
    """Statistics record; sizes : schemas, attachments, metadata, chunks; counts : messages of each channel."""
    table = b"".join(struct.pack("<HQ", cid, n) for cid, n in sorted(counts.items()))
    schemas, attachments, metadata_records, chunks = sizes
    totals = (sum(counts.values()), schemas, len(counts), attachments, metadata_records, chunks)
    return record(Op.STATISTICS, _STATISTICS.pack(*totals, *times, len(table)), table)


def end_of_file(offset: int, groups: Iterable[tuple[Op, Iterable[bytes]]]) -> bytes:
    """Data end, summary, summary offsets, footer and magic of a file whose data section ends at ``offset``."""
    data_end = record(Op.DATA_END, bytes(4))
    start = offset + len(data_end)
    summary, offsets = b"", b""
    for op, members in groups:
        group = b"".join(members)
        if group:
            offsets += record(Op.SUMMARY_OFFSET, struct.pack("<BQQ", op, start + len(summary), len(group)))
            summary += group
    offsets_start = start + len(summary)
    foot = _FOOTER.pack(Op.FOOTER, 20, start, offsets_start, 0)
    crc = zlib.crc32(summary + offsets + foot[:-4])
    return data_end + summary + offsets + foot[:-4] + struct.pack("<I", crc) + MAGIC
