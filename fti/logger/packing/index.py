"""Summary of a packed file: that of the original, with the places that its records have now."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field

from fti.logger import records
from fti.logger.records import HEAD, Op, read_text

_CHUNK = struct.Struct("<QQQQI")
_INDEX_ENTRY = struct.Struct("<HQ")
_STATISTICS = struct.Struct("<QHIII")
_GROUPS = (Op.SCHEMA, Op.CHANNEL, Op.STATISTICS, Op.CHUNK_INDEX, Op.ATTACHMENT_INDEX, Op.METADATA_INDEX)


@dataclass(frozen=True, slots=True)
class RecordLocation:
    """Where a record stands in the packed file; for a chunk with its compression and stored bytes."""

    offset: int
    packed: tuple[str, int] = ("", 0)


@dataclass(slots=True)
class PackIndex:
    """The summary as it grows.  places : where each record of the original stands now.

    ``add`` raises KeyError when the original's summary tells of a record that is not there.
    """

    places: Mapping[int, RecordLocation]
    groups: dict[Op, list[bytes]] = field(default_factory=lambda: {op: [] for op in _GROUPS})

    def add(self, record: bytes) -> None:
        """A record of the original's summary."""
        op = record[0]
        if op == Op.CHUNK_INDEX:
            record = self._chunk(record)
        elif op in (Op.ATTACHMENT_INDEX, Op.METADATA_INDEX):
            (offset,) = struct.unpack_from("<Q", record, HEAD.size)
            record = record[: HEAD.size] + struct.pack("<Q", self.places[offset].offset) + record[HEAD.size + 8 :]
        elif op == Op.STATISTICS:
            record = _with_two_more(record)
        if op in self.groups:
            self.groups[Op(op)].append(record)

    def add_new(self, record: bytes) -> None:
        """An index record of something that the original does not have."""
        self.groups[Op(record[0])].append(record)

    def _chunk(self, record: bytes) -> bytes:
        first, last, offset, _, table_size = _CHUNK.unpack_from(record, HEAD.size)
        begin = HEAD.size + _CHUNK.size
        table = record[begin : begin + table_size]
        (index_length,) = struct.unpack_from("<Q", record, begin + table_size)
        _, at = read_text(record, begin + table_size + 8)
        _, size = struct.unpack_from("<QQ", record, at)
        offsets = {cid: self.places[place].offset for cid, place in _INDEX_ENTRY.iter_unpack(table)}
        place = self.places[offset]
        return records.chunk_index((first, last), place.offset, size, offsets, index_length, packed=place.packed)

    def tail(self, offset: int) -> bytes:
        """Everything after the data section, which ends at ``offset``."""
        return records.end_of_file(offset, self.groups.items())


def _with_two_more(statistics: bytes) -> bytes:
    """Statistics with one more attachment and one more metadata record."""
    messages, schemas, channels, attachments, metadata = _STATISTICS.unpack_from(statistics, HEAD.size)
    head = _STATISTICS.pack(messages, schemas, channels, attachments + 1, metadata + 1)
    return statistics[: HEAD.size] + head + statistics[HEAD.size + len(head) :]
