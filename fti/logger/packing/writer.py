"""Writer of a packed file: the records of the original in their order, with compressed chunks, and the layout.

Its summary is that of the original with new offsets.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import BinaryIO

from fti.errors import RecordingError
from fti.logger import records
from fti.logger.packing.restore_layout import RestoreLayout, StepKind
from fti.logger.reading.compression import compress
from fti.logger.reading.record_cursor import ChunkHead, chunk_head, chunk_index_fields, indexed_record, records_in
from fti.logger.reading.record_validation import valid_record
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import HEAD, MAGIC, Op

METADATA = "fti.packed"
LAYOUT = "fti.layout"
MEDIA_TYPE = "application/octet-stream"
_VERSION = "1"
_STATISTICS = struct.Struct("<QHIII")
_GROUPS = (Op.SCHEMA, Op.CHANNEL, Op.STATISTICS, Op.CHUNK_INDEX, Op.ATTACHMENT_INDEX, Op.METADATA_INDEX)


@dataclass(frozen=True, slots=True)
class _RecordLocation:
    """Offset of a record in the packed file; for a chunk also its compression and stored bytes."""

    offset: int
    packed: tuple[str, int] = ("", 0)


@dataclass(slots=True)
class _PackIndex:
    """The summary under construction.  locations : of each record of the original, by its original offset.

    ``add`` raises KeyError when the original's summary lists a missing record.
    """

    locations: Mapping[int, _RecordLocation]
    groups: dict[Op, list[bytes]] = field(default_factory=lambda: {op: [] for op in _GROUPS})

    def add(self, record: bytes) -> None:
        """Add a record of the original's summary."""
        op = record[0]
        if op == Op.CHUNK_INDEX:
            record = self._chunk(record)
        elif op in (Op.ATTACHMENT_INDEX, Op.METADATA_INDEX):
            location = self.locations[indexed_record(record)[0]]
            record = record[: HEAD.size] + struct.pack("<Q", location.offset) + record[HEAD.size + 8 :]
        elif op == Op.STATISTICS:
            record = _with_two_more(record)
        if op in self.groups:
            self.groups[Op(op)].append(record)

    def add_new(self, record: bytes) -> None:
        """Add an index record of a record that the original does not have."""
        self.groups[Op(record[0])].append(record)

    def _chunk(self, record: bytes) -> bytes:
        times, offset, size, index_offsets, index_length = chunk_index_fields(record)
        offsets = {channel_id: self.locations[at].offset for channel_id, at in index_offsets.items()}
        location = self.locations[offset]
        return records.chunk_index(times, location.offset, size, offsets, index_length, packed=location.packed)

    def tail(self, offset: int) -> bytes:
        """Everything after the data section, which ends at ``offset``."""
        return records.end_of_file(offset, self.groups.items())


def _with_two_more(statistics: bytes) -> bytes:
    """Statistics with one more attachment and one more metadata record."""
    messages, schemas, channels, attachments, metadata = _STATISTICS.unpack_from(statistics, HEAD.size)
    head = _STATISTICS.pack(messages, schemas, channels, attachments + 1, metadata + 1)
    return statistics[: HEAD.size] + head + statistics[HEAD.size + len(head) :]


class Packer:
    """Writes the packed file of a valid one, whose data section ends at ``data_end``.  Raises RecordingError."""

    def __init__(self, source: TolerantFile, data_end: int, stream: BinaryIO, progress: Callable[[int], None]) -> None:
        self._source = source
        self._data_end = data_end
        self._stream = stream
        self._progress = progress
        self._layout = RestoreLayout()
        self._locations: dict[int, _RecordLocation] = {}
        self._at = 0
        self._sha256 = hashlib.sha256()

    def run(self) -> str:
        """Write everything; returns the SHA-256 of the original."""
        self._write(self._literal(0, len(MAGIC)))
        at = len(MAGIC)
        while at < self._data_end:
            at = self._take(at, self._data_end)
            self._progress(at)
        tail = self._literal(at, self._source.size)
        self._layout.end_step(StepKind.END)
        self._finish(tail)
        return self._sha256.hexdigest()

    def _literal(self, begin: int, end: int) -> bytes:
        """Bytes of the original that go into the layout."""
        data = self._source.read(begin, end - begin)
        self._sha256.update(data)
        self._layout.add(data)
        return data

    def _write(self, data: bytes) -> int:
        """Append data; returns their offset."""
        self._stream.write(data)
        self._at += len(data)
        return self._at - len(data)

    def _take(self, at: int, limit: int) -> int:
        """Write one record of the original; returns its end."""
        record = valid_record(self._source, at, limit)
        if record is None:
            raise RecordingError(f"{self._source.path}: is damaged at byte {at}; see fti recover")
        head = chunk_head(self._source, at)
        if head and not head.compression:
            self._take_chunk(head)
        elif record.op in (Op.PADDING, Op.CHECKPOINTS):
            self._literal(at, record.end)
        else:
            data = self._source.read(at, record.end - at)
            self._sha256.update(data)
            self._layout.end_step(StepKind.RECORD)
            packed = (head.compression, head.end - head.begin) if head else ("", 0)
            self._locations[at] = _RecordLocation(self._write(data), packed)
        return record.end

    def _take_chunk(self, head: ChunkHead) -> None:
        content = head.content(self._source)
        if content is None:
            raise RecordingError(f"{self._source.path}: the chunk at byte {head.at} is damaged; see fti recover")
        self._literal(head.at, head.begin)
        self._sha256.update(content)
        self._layout.end_step(StepKind.CONTENT)
        stored = compress(content)
        offset = self._write(records.packed_chunk(head.times, head.size, head.crc, "zstd", stored))
        self._locations[head.at] = _RecordLocation(offset, ("zstd", len(stored)))

    def _finish(self, tail: bytes) -> None:
        """Write layout, data on the original, and summary; tail : the original from the end of its data on."""
        index = _PackIndex(self._locations)
        try:
            for at, end, _ in records_in(tail[: -len(MAGIC)]):
                index.add(tail[at:end])
        except KeyError:
            raise RecordingError(f"{self._source.path}: its index is damaged; see fti recover") from None
        layout = self._layout.to_bytes()
        record = records.attachment(LAYOUT, MEDIA_TYPE, layout, 0)
        at = self._write(record)
        index.add_new(records.attachment_index((at, len(record)), 0, len(layout), LAYOUT, MEDIA_TYPE))
        original_info = {"sha256": self._sha256.hexdigest(), "size": str(self._source.size), "version": _VERSION}
        record = records.metadata(METADATA, original_info)
        index.add_new(records.metadata_index(self._write(record), len(record), METADATA))
        self._stream.write(index.tail(self._at))
