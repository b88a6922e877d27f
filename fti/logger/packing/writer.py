"""Writer of a packed file: the records of the original in their order, with compressed chunks, and the layout."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Callable, Iterator
from typing import BinaryIO

from fti.errors import RecordingError
from fti.logger import records
from fti.logger.packing.index import PackIndex, RecordLocation
from fti.logger.packing.restore_layout import RestoreLayout, StepKind
from fti.logger.reading.compression import compress
from fti.logger.reading.record_validation import ChunkHead, chunk_head, record_end
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import HEAD, MAGIC, Op

METADATA = "fti.packed"
LAYOUT = "fti.layout"
MEDIA_TYPE = "application/octet-stream"
_VERSION = "1"


class Packer:
    """Writes the packed file of a valid one, whose data section ends at ``data_end``.  Raises RecordingError."""

    def __init__(self, source: TolerantFile, data_end: int, stream: BinaryIO, progress: Callable[[int], None]) -> None:
        self._source = source
        self._data_end = data_end
        self._stream = stream
        self._progress = progress
        self._layout = RestoreLayout()
        self._locations: dict[int, RecordLocation] = {}
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
        head = chunk_head(self._source, at)
        end = record_end(self._source, at, limit)
        if end is None:
            raise RecordingError(f"{self._source.path}: is damaged at byte {at}; see fti recover")
        if head and not head.compression:
            self._take_chunk(head)
        elif self._source.read(at, 1)[0] in (Op.PADDING, Op.CHECKPOINTS):
            self._literal(at, end)
        else:
            self._take_record(at, end, head)
        return end

    def _take_chunk(self, head: ChunkHead) -> None:
        content = head.content(self._source)
        if content is None:
            raise RecordingError(f"{self._source.path}: the chunk at byte {head.at} is damaged; see fti recover")
        begin = self._literal(head.at, head.begin)
        times = struct.unpack_from("<QQ", begin, HEAD.size)
        self._sha256.update(content)
        self._layout.end_step(StepKind.CONTENT)
        stored = compress(content)
        offset = self._write(records.packed_chunk((times[0], times[1]), head.size, head.crc, "zstd", stored))
        self._locations[head.at] = RecordLocation(offset, ("zstd", len(stored)))

    def _take_record(self, at: int, end: int, head: ChunkHead | None) -> None:
        record = self._source.read(at, end - at)
        self._sha256.update(record)
        self._layout.end_step(StepKind.RECORD)
        packed = (head.compression, head.end - head.begin) if head else ("", 0)
        self._locations[at] = RecordLocation(self._write(record), packed)

    def _finish(self, tail: bytes) -> None:
        """Write layout, data on the original, and summary; tail : the original from the end of its data on."""
        index = PackIndex(self._locations)
        try:
            for record in _records_of(tail):
                index.add(record)
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


def _records_of(tail: bytes) -> Iterator[bytes]:
    at = 0
    while at < len(tail) - len(MAGIC):
        end = at + HEAD.size + HEAD.unpack_from(tail, at)[1]
        yield tail[at:end]
        at = end
