"""Reader of an undamaged summary of a file: a second source for a recovery."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from typing import NamedTuple

from fti.logger.reading import record_cursor
from fti.logger.reading.mcap_file import FOOTER_BYTES
from fti.logger.reading.record_validation import valid_records
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import HEAD, MAGIC, Op

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
    start, crc = record_cursor.footer_fields(foot)
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


def _parse(source: TolerantFile, summary: SummaryIndex, begin: int, end: int) -> SummaryIndex | None:
    parsed = begin
    for op, at, parsed in valid_records(source, begin, end):
        record = source.read(at, parsed - at)
        if op == Op.SCHEMA:
            summary.schemas[record_cursor.record_id(record)] = record
        elif op == Op.CHANNEL:
            summary.channels[record_cursor.record_id(record)] = record
        elif op == Op.STATISTICS:
            summary.messages = record_cursor.message_count(record)
        elif op == Op.CHUNK_INDEX:
            fields = record_cursor.chunk_index_fields(record)
            summary.chunks.append(ChunkLocation(fields.offset, *fields.times))
        elif op in (Op.ATTACHMENT_INDEX, Op.METADATA_INDEX):
            offset, name = record_cursor.indexed_record(record)
            summary.others.append(offset)
            summary.named[name] = offset
    return summary if parsed == end else None
