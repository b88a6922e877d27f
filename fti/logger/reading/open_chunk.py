"""The last chunk of an unfinished file: verified records, unverified records and damage.

After a kill the checksum in the chunk's head proves everything except the last flush.  After a power cut the chunk is
verified up to the last sync; later pages may be missing, old or zero.  Whole records after the verified part are
accepted and counted up to the first invalid one.  If that is not a torn record, the record before it is rejected too,
because the damage may begin in it.  Everything else is damage, and such a file is not closed: a verified segment after
an unverified one, damage before the last sync, invalid records in the verified part.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import chain

from fti.logger.checkpoints import ChunkSegment, segments
from fti.logger.reading.chunk_content import NO_TIME, Content
from fti.logger.reading.chunk_marks import ChunkMarks, chunk_marks
from fti.logger.reading.limits import MAX_RECORD
from fti.logger.reading.record_cursor import ChunkHead, channel_fields
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import Op

#: Largest time span of the unverified records after one sync period [ns].
MAX_UNPROVED_NS = 30 * 10**9


class DamagedChunkError(Exception):
    """The chunk has damage that neither a kill nor a power cut can cause."""


@dataclass(slots=True)
class Declarations:
    """Schema and channel records found so far, by id."""

    schemas: dict[int, bytes] = field(default_factory=dict)
    channels: dict[int, bytes] = field(default_factory=dict)

    def add(self, content: Content) -> None:
        """Add those of a chunk."""
        self.schemas |= content.schemas
        self.channels |= content.channels

    def agree(self, content: Content) -> bool:
        """Do the declarations of the chunk agree with the known ones?"""
        return _agree(self.schemas, content.schemas) and _agree(self.channels, content.channels)

    def suffice(self, content: Content) -> bool:
        """Do they agree, and is the schema of each channel known?"""
        schemas = {**self.schemas, **content.schemas}
        return self.agree(content) and all(
            channel_fields(record).schema_id in (0, *schemas) for record in content.channels.values()
        )


def is_open(source: TolerantFile, head: ChunkHead) -> bool:
    """Does no message index follow the chunk?  Then it is the last one of an unfinished file."""
    return source.read(head.end, 1) != bytes([Op.MESSAGE_INDEX])


def _agree(known: Mapping[int, bytes], found: Mapping[int, bytes]) -> bool:
    return all(known.get(key, record) == record for key, record in found.items())


@dataclass(slots=True)
class OpenChunk:
    """Content of an open chunk.

    content        : the accepted records
    unverified       : messages among them without a checksum; unverified_ns : log time of the first of them
    missing_bytes  : bytes that the head or a checkpoint counts as records and that are cut off or damaged
    """

    content: Content
    unverified: int = 0
    unverified_ns: int | None = None
    missing_bytes: int = 0


def read_open_chunk(source: TolerantFile, head: ChunkHead, known: Declarations, *, growing: bool = False) -> OpenChunk:
    """Read the last chunk of an unfinished file.  Raises DamagedChunkError.

    growing : the file is being written, so that the head may state more than the file had when it was opened
    """
    if head.size > MAX_RECORD:
        raise DamagedChunkError(f"it has {head.size} bytes; at most {MAX_RECORD} are read")
    marks = chunk_marks(source, head)
    if marks.damaged and not growing:
        raise DamagedChunkError("its checkpoints are damaged")
    data = source.read(head.begin, min(source.size - head.begin, MAX_RECORD))
    if growing and head.size > len(data):
        present = [mark for mark in marks.checkpoints if mark.size <= len(data)]
        head = replace(head, size=present[-1].size if present else 0, crc=present[-1].crc if present else 0)
        marks = replace(marks, checkpoints=present)
    return inspect_open_chunk(data, head, marks, known)


def inspect_open_chunk(data: bytes, head: ChunkHead, marks: ChunkMarks, known: Declarations) -> OpenChunk:
    """Inspect the last chunk of a file.  Raises DamagedChunkError.

    data : all bytes of the file after the chunk's head
    """
    covered = max([head.size, *(checkpoint.size for checkpoint in marks.checkpoints)])
    if not marks.checkpoints:
        return _without_proof(data, covered, known)
    verified = _verified_bytes(data, head, marks)
    content = _content(data[:verified], known)
    if not content.whole:
        raise DamagedChunkError(f"its records are damaged {content.end} bytes behind its head")
    found = OpenChunk(content)
    _take_unverified(found, data[verified:], known)
    found.missing_bytes = max(0, covered - found.content.end)
    return found


def _content(data: bytes, known: Declarations) -> Content:
    content = Content(set(known.channels)).feed(data)
    if not known.suffice(content):
        raise DamagedChunkError("it declares a channel or schema differently from the file before it")
    return content


def _without_proof(data: bytes, covered: int, known: Declarations) -> OpenChunk:
    """An open chunk of fti 0.1: its head has no checksum, but covers whole records."""
    content = _content(data[:covered], known)
    if not content.whole and covered <= len(data):
        raise DamagedChunkError(f"its records are damaged {content.end} bytes behind its head")
    content = _content(data, known)
    first = None if content.times[0] == NO_TIME else content.times[0]
    return OpenChunk(content.trim(), content.messages, first, max(0, covered - content.end))


def _verified_bytes(data: bytes, head: ChunkHead, marks: ChunkMarks) -> int:
    """Number of bytes that are verified from the begin on.  Raises DamagedChunkError."""
    if head.crc and len(data) >= head.size and zlib.crc32(memoryview(data)[: head.size]) == head.crc:
        return head.size
    found = segments(data, marks.checkpoints)
    count = next((n for n, segment in enumerate(found) if not segment.verified), len(found))
    verified = found[count - 1].end if count else 0
    if any(segment.verified for segment in found[count:]) or _is_before_last_sync(found, count, len(data), marks):
        raise DamagedChunkError(f"the checksum of its records from {verified} bytes behind its head on does not match")
    return verified


def _is_before_last_sync(found: list[ChunkSegment], unverified: int, size: int, marks: ChunkMarks) -> bool:
    """Is a segment unverified that the last sync but one has written to the medium?

    The last checkpoint is written before its sync, which may not have ended; the head may cover more after it.  Bytes
    after the end of a cut file are missing, not damaged.
    """
    allowed = len(found) - 1 - (found[-1].end > marks.synced) if marks.reliable else len(found)
    return any(segment.end <= size for segment in found[unverified : max(allowed, 0)])


def _take_unverified(found: OpenChunk, data: bytes, known: Declarations) -> None:
    """Add the whole, valid records after the verified part."""
    content = found.content
    verified, messages, verified_ns = content.end, content.messages, content.times[1]
    content.feed(data)
    if not content.torn and content.last >= verified:
        content = found.content = content.cut()
    if not known.suffice(content):
        found.content = _content(bytes(content.data[:verified]), known)
        return
    content.trim()
    pairs = (zip(entries[::2], entries[1::2], strict=True) for entries in content.index.values())
    times = [at_ns for at_ns, at in chain.from_iterable(pairs) if at >= verified]
    found.unverified = content.messages - messages
    found.unverified_ns = min(times, default=None)
    if messages and times and max(times) - verified_ns > MAX_UNPROVED_NS:
        raise DamagedChunkError(f"its records from {verified} bytes behind its head on span more than one sync period")
