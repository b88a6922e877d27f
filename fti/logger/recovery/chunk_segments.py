"""The pieces of a file that may be damaged, and how a chunk with a wrong checksum is split at its checkpoints."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from fti.logger.checkpoints import Checkpoint, ChunkSegment, segments
from fti.logger.reading.chunk_content import Content
from fti.logger.reading.chunk_marks import chunk_marks
from fti.logger.reading.record_cursor import ChunkHead
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import CHUNK, HEAD
from fti.logger.recovery.flipped_bit import correct_bit

#: Offset of the checksum in a chunk.
CRC_AT = HEAD.size + 24


@dataclass(frozen=True, slots=True)
class Messages:
    """Records of a chunk, or outside of chunks (head is None).

    verified : their checksum matches; flipped : the byte of the file with a corrected bit
    """

    begin: int
    end: int
    content: Content
    verified: bool
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


@dataclass(frozen=True, slots=True)
class ChunkData:
    """An uncompressed chunk.  data : its records, which the end of the file may cut off."""

    head: ChunkHead
    data: bytes
    checkpoints: Sequence[Checkpoint]


def headless_chunk(source: TolerantFile, at: int) -> ChunkHead | None:
    """Head of a chunk with a damaged head, from the checkpoints before it; None without checkpoints."""
    begin = at + CHUNK.size
    blank = ChunkHead(at, begin, begin, 0, 0, "")
    found = chunk_marks(source, blank).checkpoints
    return ChunkHead(at, begin, begin + found[-1].size, found[-1].size, found[-1].crc, "") if found else None


def split(chunk: ChunkData, channels: Collection[int], *, open_end: bool) -> list[Piece]:
    """The pieces of a chunk.

    channels : known before it; open_end : the file is unfinished: the data after the last verified segment may be
    incomplete, and whole records of them are accepted unverified
    """
    found = _merge_segments(segments(chunk.data, chunk.checkpoints))
    last = max((n for n, segment in enumerate(found) if segment.verified), default=-1)
    known = set(channels)
    pieces: list[Piece] = []
    for n, segment in enumerate(found):
        piece = _piece(chunk, segment, known, unverified_end=n > last and (open_end or segment.end > len(chunk.data)))
        if isinstance(piece, Messages):
            known |= piece.content.channels.keys()
        if piece.end > piece.begin:
            pieces.append(piece)
        if piece.end < chunk.head.begin + min(segment.end, len(chunk.data)):
            break
    return pieces if any(isinstance(piece, Messages) for piece in pieces) else []


def _merge_segments(found: Sequence[ChunkSegment]) -> list[ChunkSegment]:
    merged: list[ChunkSegment] = []
    for segment in found:
        if merged and merged[-1].verified and segment.verified:
            merged[-1] = ChunkSegment(merged[-1].begin, segment.end, merged[-1].crc, segment.end_crc, True)
        else:
            merged.append(segment)
    return merged


def _piece(chunk: ChunkData, segment: ChunkSegment, known: set[int], *, unverified_end: bool) -> Piece:
    head, data = chunk.head, chunk.data[segment.begin : segment.end]
    begin = head.at if segment.begin == 0 else head.begin + segment.begin
    end = head.begin + segment.begin + len(data)
    if segment.verified:
        content = Content(None).feed(data)
        return Messages(begin, end, content, True, head) if content.whole else LostBytes(begin, end)
    mended = _correct_segment(data, segment) if len(data) == segment.end - segment.begin else None
    if mended:
        content, flipped = mended
        at = head.begin + segment.begin + flipped if flipped < len(data) else head.at + CRC_AT
        return Messages(begin, end, content, False, head, at)
    content = Content(known).feed(data)
    if unverified_end and content.end:
        whole = content if content.torn else content.cut()
        return Messages(begin, head.begin + segment.begin + whole.end, whole.trim(), False, head)
    return LostBytes(begin, end)


def _correct_segment(data: bytes, segment: ChunkSegment) -> tuple[Content, int] | None:
    """The records with one corrected bit, and the offset of its byte."""
    stored = bytearray(data)
    flipped = correct_bit(stored, segment.end_crc, segment.crc)
    content = Content(None)
    if flipped is None or not content.feed(bytes(stored)).whole:
        return None
    return content, flipped
