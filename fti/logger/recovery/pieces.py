"""The pieces of a file that may be damaged."""

from __future__ import annotations

from dataclasses import dataclass

from fti.logger.reading.chunk_content import Content
from fti.logger.reading.record_validation import ChunkHead


@dataclass(frozen=True, slots=True)
class Messages:
    """Records of a chunk, or outside of chunks (head is None).

    proved : their checksum matches; flipped : the byte of the file with a corrected bit
    """

    begin: int
    end: int
    content: Content
    proved: bool
    head: ChunkHead | None = None
    flipped: int | None = None


@dataclass(frozen=True, slots=True)
class OtherRecord:
    """A valid record without messages."""

    begin: int
    end: int
    op: int


@dataclass(frozen=True, slots=True)
class LostBytes:
    """Bytes that are lost."""

    begin: int
    end: int


Piece = Messages | OtherRecord | LostBytes
