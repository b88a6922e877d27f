"""Summary of a packed file: the summary of the original with new offsets."""

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
    """Offset of a record in the packed file; for a chunk also its compression and stored bytes."""

    offset: int
    packed: tuple[str, int] = ("", 0)


@dataclass(slots=True)
class PackIndex:
    """The summary under construction.  locations : of each record of the original, by its original offset.

    ``add`` raises KeyError when the original's summary lists a missing record.
    """

    locations: Mapping[int, RecordLocation]
    groups: dict[Op, list[bytes]] = field(default_factory=lambda: {op: [] for op in _GROUPS})

    def add(self, record: bytes) -> None:
        """Add a record of the original's summary."""
        op = record[0]
        if op == Op.CHUNK_INDEX:
            record = self._chunk(record)
        elif op in (Op.ATTACHMENT_INDEX, Op.METADATA_INDEX):
            (offset,) = struct.unpack_from("<Q", record, HEAD.size)
            record = record[: HEAD.size] + struct.pack("<Q", self.locations[offset].offset) + record[HEAD.size + 8 :]
        elif op == Op.STATISTICS:
            record = _with_two_more(record)
        if op in self.groups:
            self.groups[Op(op)].append(record)

    def add_new(self, record: bytes) -> None:
        """Add an index record of a record that the original does not have."""
        self.groups[Op(record[0])].append(record)

    def _chunk(self, record: bytes) -> bytes:
        first, last, offset, _, table_size = _CHUNK.unpack_from(record, HEAD.size)
        begin = HEAD.size + _CHUNK.size
        table = record[begin : begin + table_size]
        (index_length,) = struct.unpack_from("<Q", record, begin + table_size)
        _, at = read_text(record, begin + table_size + 8)
        _, size = struct.unpack_from("<QQ", record, at)
        offsets = {cid: self.locations[location].offset for cid, location in _INDEX_ENTRY.iter_unpack(table)}
        location = self.locations[offset]
        return records.chunk_index((first, last), location.offset, size, offsets, index_length, packed=location.packed)

    def tail(self, offset: int) -> bytes:
        """Everything after the data section, which ends at ``offset``."""
        return records.end_of_file(offset, self.groups.items())


def _with_two_more(statistics: bytes) -> bytes:
    """Statistics with one more attachment and one more metadata record."""
    messages, schemas, channels, attachments, metadata = _STATISTICS.unpack_from(statistics, HEAD.size)
    head = _STATISTICS.pack(messages, schemas, channels, attachments + 1, metadata + 1)
    return statistics[: HEAD.size] + head + statistics[HEAD.size + len(head) :]
