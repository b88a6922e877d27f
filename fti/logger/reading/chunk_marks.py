"""Checksums of a chunk, from its head and from the checkpoints before it."""

from __future__ import annotations

from dataclasses import dataclass

from fti.logger.checkpoints import RECORD_BYTES, SLOT_BYTES, SLOTS, Checkpoint, read_slots
from fti.logger.reading.record_cursor import ChunkHead
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import HEAD, Op

_RECORD_HEAD = HEAD.pack(Op.CHECKPOINTS, SLOTS * SLOT_BYTES)


@dataclass(frozen=True, slots=True)
class ChunkMarks:
    """Known checksums of an uncompressed chunk.

    checkpoints : by increasing size, including the one of the chunk's head
    synced      : size at the last sync [B]; 0 without a sync
    damaged     : number of damaged slots in the record of the checkpoints; None: there is no such record
    """

    checkpoints: list[Checkpoint]
    synced: int = 0
    damaged: int | None = None

    @property
    def reliable(self) -> bool:
        """The record of the checkpoints exists and none of its slots is damaged."""
        return self.damaged == 0


def chunk_marks(source: TolerantFile, head: ChunkHead) -> ChunkMarks:
    """The marks of a chunk.  A head with checksum 0 has no checksum: an open chunk of fti 0.1."""
    record = source.read(head.at - RECORD_BYTES, RECORD_BYTES) if head.at >= RECORD_BYTES else b""
    if head.compression:
        return ChunkMarks([])
    is_there = record.startswith(_RECORD_HEAD)
    found, damaged = read_slots(record[HEAD.size :]) if is_there else ([], None)
    synced = found[-1].size if found else 0
    if head.crc and all(checkpoint.size != head.size for checkpoint in found):
        found = sorted([*found, Checkpoint(head.size, head.crc)])
    return ChunkMarks(found, synced, damaged)
