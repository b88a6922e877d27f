"""Checkpoints of a chunk: the number of its record bytes at each sync, and their CRC-32.

A private record of SLOTS slots precedes each chunk (opcode 0x81, which the MCAP specification reserves for applications
and readers skip).  Before each sync the writer fills the next slot.  The checksum is cumulative: the value of a slot
follows from the value of the previous slot and the bytes between them.  Each segment between two slots can therefore be
verified alone, even after a damaged segment, and every byte is summed once.

    slot: size u64 | CRC-32 of the records up to size u32 | CRC-32 of these twelve bytes u32; zeros: empty slot

See docs/decisions/0023.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from typing import NamedTuple

from fti.logger.records import HEAD, Op, record

#: The sync that fills the last slot ends the chunk.
SLOTS = 64
SLOT_BYTES = 16
RECORD_BYTES = HEAD.size + SLOTS * SLOT_BYTES
_VALUES = struct.Struct("<QI")


class Checkpoint(NamedTuple):
    """A number of record bytes of a chunk, and their CRC-32."""

    size: int
    crc: int


START = Checkpoint(0, 0)


def empty_record() -> bytes:
    """The record before a chunk, with empty slots."""
    return record(Op.CHECKPOINTS, bytes(SLOTS * SLOT_BYTES))


def slot(checkpoint: Checkpoint) -> bytes:
    """A filled slot."""
    values = _VALUES.pack(*checkpoint)
    return values + zlib.crc32(values).to_bytes(4, "little")


def read_slots(body: bytes) -> tuple[list[Checkpoint], int]:
    """Checkpoints in the body of a record, by increasing size, and the number of damaged slots."""
    found: list[Checkpoint] = []
    damaged = 0
    body = body.rstrip(b"\0")  # slots are filled in order: an empty slot before a filled one is damaged too
    for at in range(0, len(body), SLOT_BYTES):
        entry = body[at : at + SLOT_BYTES].ljust(SLOT_BYTES, b"\0")
        checkpoint = Checkpoint(*_VALUES.unpack_from(entry))
        if entry == slot(checkpoint) and checkpoint.size > (found[-1].size if found else 0):
            found.append(checkpoint)
        else:
            damaged += 1
    return found, damaged


class ChunkSegment(NamedTuple):
    """Records from ``begin`` to ``end`` of a chunk [B].  The CRC-32 up to begin is ``crc``; up to end, ``end_crc``."""

    begin: int
    end: int
    crc: int
    end_crc: int
    verified: bool


def segments(data: bytes, checkpoints: Sequence[Checkpoint]) -> list[ChunkSegment]:
    """Verify each segment of a chunk between two checkpoints.

    data : the records as found, which may end before a checkpoint; checkpoints : by increasing size
    """
    found, view, last = [], memoryview(data), START
    for checkpoint in checkpoints:
        piece = view[last.size : checkpoint.size]
        whole = len(piece) == checkpoint.size - last.size
        verified = whole and zlib.crc32(piece, last.crc) == checkpoint.crc
        found.append(ChunkSegment(last.size, checkpoint.size, last.crc, checkpoint.crc, verified))
        last = checkpoint
    return found
