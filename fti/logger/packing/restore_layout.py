"""Layout of a packed file: instructions to restore the original byte for byte.

A packed file holds the records of the original in their order, with compressed chunks.  The layout is a list of steps.
Each step has literal bytes of the original (magic, paddings, heads of chunks, summary) and the kind of data that
follow them: the next record of the packed file unchanged, or the unpacked content of the next chunk.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from enum import IntEnum

from fti.errors import RecordingError
from fti.logger.reading.compression import compress, decompress
from fti.logger.reading.record_cursor import chunk_head, record_at
from fti.logger.reading.tolerant_file import TolerantFile

_STEP = struct.Struct("<QB")
_SIZE = struct.Struct("<Q")


class StepKind(IntEnum):
    """Kind of data that follow the bytes of a step."""

    END = 0
    RECORD = 1
    CONTENT = 2


class RestoreLayout:
    """Collects the steps."""

    def __init__(self) -> None:
        self._steps: list[bytes] = []
        self._bytes = b""

    def add(self, data: bytes) -> None:
        """Add bytes of the original that the packed file does not hold."""
        self._bytes += data

    def end_step(self, kind: StepKind) -> None:
        """End the step; kind : of the data that follow its bytes."""
        self._steps.append(_STEP.pack(len(self._bytes), kind) + self._bytes)
        self._bytes = b""

    def to_bytes(self) -> bytes:
        """The encoded layout for the packed file."""
        steps = b"".join(self._steps)
        return _SIZE.pack(len(steps)) + compress(steps)


def restore_original(source: TolerantFile, begin: int, end: int, layout: bytes) -> Iterator[bytes]:
    """The original, in pieces; begin, end : of its records in the packed file.

    Raises RecordingError when layout and records do not fit together.
    """
    try:
        at = begin
        for data, kind in _steps(layout):
            yield data
            if kind == StepKind.RECORD:
                record = record_at(source, at, end)
                if record is None:
                    raise ValueError(f"the record at byte {at} is damaged")
                yield source.read(at, record.end - at)
                at = record.end
            elif kind == StepKind.CONTENT:
                head = chunk_head(source, at)
                content = head.content(source) if head and head.end <= end else None
                if head is None or content is None:
                    raise ValueError(f"the chunk at byte {at} is damaged")
                yield content
                at = head.end
    except (ValueError, struct.error) as error:
        raise RecordingError(f"{source.path}: cannot be unpacked: {error}") from None
    if at != end:
        raise RecordingError(f"{source.path}: cannot be unpacked: it holds more than its layout states")


def _steps(layout: bytes) -> Iterator[tuple[bytes, int]]:
    (size,) = _SIZE.unpack_from(layout)
    steps = decompress("zstd", layout[_SIZE.size :], size)
    at = 0
    while at < size:
        length, kind = _STEP.unpack_from(steps, at)
        at += _STEP.size + length
        yield steps[at - length : at], kind
