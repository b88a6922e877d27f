"""Reader of an undamaged summary of a file: a second source for a recovery."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field
from typing import NamedTuple

from fti.logger.reading.mcap_file import FOOTER_BYTES
from fti.logger.reading.record_validation import record_end
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import HEAD, MAGIC, Op, read_text

_DATA_END = HEAD.pack(Op.DATA_END, 4)
_DATA_END_SIZE = HEAD.size + 4
_MAX_SEARCH_BYTES = 64 * 2**20  # a summary is smaller
_MAX_TRIES = 50


class ChunkLocation(NamedTuple):
    """A chunk in the summary: its original offset, and its first and last log time [ns]."""

    offset: int
    first_ns: int
    last_ns: int


@dataclass(slots=True)
class SummaryIndex:
    """A summary.  data_end : end of the data section in the file as found.

    shift : number of bytes that the file has lost; offsets in the summary are too high by it at the end of the file.
    others : original offsets of attachments and metadata; named : the same, by name.
    """

    data_end: int
    shift: int
    chunks: list[ChunkLocation] = field(default_factory=list)
    others: list[int] = field(default_factory=list)
    named: dict[str, int] = field(default_factory=dict)
    messages: int | None = None
    schemas: dict[int, bytes] = field(default_factory=dict)
    channels: dict[int, bytes] = field(default_factory=dict)


def read_summary_index(source: TolerantFile) -> SummaryIndex | None:
    """The summary of a file; None when it is missing or damaged."""
    foot_at = source.size - FOOTER_BYTES
    foot = source.read(foot_at, FOOTER_BYTES) if foot_at >= 0 else b""
    if foot[: HEAD.size] != HEAD.pack(Op.FOOTER, 20) or not foot.endswith(MAGIC):
        return None
    start, _, crc = struct.unpack_from("<QQI", foot, HEAD.size)
    searched_at = max(0, source.size - _MAX_SEARCH_BYTES)
    block = source.read(searched_at, source.size - searched_at)
    at = len(block) - FOOTER_BYTES
    for _ in range(_MAX_TRIES):
        at = block.rfind(_DATA_END, 0, at)
        if at < 0:
            break
        begin = searched_at + at + _DATA_END_SIZE
        found = zlib.crc32(memoryview(block)[at + _DATA_END_SIZE : -len(MAGIC) - 4])
        if (crc == found if crc else start == begin) and start >= begin:
            return _parse(source, SummaryIndex(begin - _DATA_END_SIZE, start - begin), begin, foot_at)
    return None


def _parse(source: TolerantFile, summary: SummaryIndex, at: int, end: int) -> SummaryIndex | None:
    while at < end:
        following = record_end(source, at, end)
        if following is None:
            return None
        op, length = HEAD.unpack(source.read(at, HEAD.size))
        if op in _PARTS:
            _PARTS[op](summary, source.read(at, HEAD.size + length))
        at = following
    return summary


def _schema(summary: SummaryIndex, record: bytes) -> None:
    summary.schemas[_first_u16(record)] = record


def _channel(summary: SummaryIndex, record: bytes) -> None:
    summary.channels[_first_u16(record)] = record


def _statistics(summary: SummaryIndex, record: bytes) -> None:
    (summary.messages,) = struct.unpack_from("<Q", record, HEAD.size)


def _chunk(summary: SummaryIndex, record: bytes) -> None:
    first, last, offset = struct.unpack_from("<QQQ", record, HEAD.size)
    summary.chunks.append(ChunkLocation(offset, first, last))


def _attachment(summary: SummaryIndex, record: bytes) -> None:
    _other(summary, record, HEAD.size + 40)


def _metadata(summary: SummaryIndex, record: bytes) -> None:
    _other(summary, record, HEAD.size + 16)


def _other(summary: SummaryIndex, record: bytes, name_at: int) -> None:
    (offset,) = struct.unpack_from("<Q", record, HEAD.size)
    summary.others.append(offset)
    summary.named[read_text(record, name_at)[0]] = offset


def _first_u16(record: bytes) -> int:
    return int(struct.unpack_from("<H", record, HEAD.size)[0])


_PARTS = {
    int(Op.SCHEMA): _schema,
    int(Op.CHANNEL): _channel,
    int(Op.STATISTICS): _statistics,
    int(Op.CHUNK_INDEX): _chunk,
    int(Op.ATTACHMENT_INDEX): _attachment,
    int(Op.METADATA_INDEX): _metadata,
}
