"""The last chunk of a file that was not finished: what of it is proved, what is taken unproved, and what is damage.

A kill leaves a chunk whose head covers and proves all but the last flush.  A power cut leaves a chunk that is proved
up to the last sync; behind it pages may be missing, old or zero.  The whole records behind the proof are taken and
counted, up to the first that makes no sense; where that is not a torn one, the one before it is not taken either, for
the damage may begin in it.  Anything else is damage, and such a file is not closed: a proved stretch behind an unproved
one, damage before the last sync, records in the proved part that make no sense.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from fti.logger.checkpoints import ChunkSegment, segments
from fti.logger.reading.chunk_content import NO_TIME, Content
from fti.logger.reading.chunk_marks import ChunkMarks, chunk_marks
from fti.logger.reading.limits import MAX_RECORD
from fti.logger.reading.record_validation import ChunkHead
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import HEAD, Op

#: More than this behind the proof is not what one sync period leaves [ns].
MAX_UNPROVED_NS = 30 * 10**9


class DamagedChunkError(Exception):
    """The chunk is damaged where neither a kill nor a power cut can have done it."""


@dataclass(slots=True)
class Declarations:
    """Schema and channel records that were found so far, by id."""

    schemas: dict[int, bytes] = field(default_factory=dict)
    channels: dict[int, bytes] = field(default_factory=dict)

    def add(self, content: Content) -> None:
        """Take those of a chunk."""
        self.schemas |= content.schemas
        self.channels |= content.channels

    def agree(self, content: Content) -> bool:
        """Does the chunk declare nothing that is declared otherwise?"""
        return _agree(self.schemas, content.schemas) and _agree(self.channels, content.channels)

    def suffice(self, content: Content) -> bool:
        """Do they agree, and is the schema of each channel known?"""
        schemas = {**self.schemas, **content.schemas}
        return self.agree(content) and all(_schema_id(r) in (0, *schemas) for r in content.channels.values())


def _schema_id(channel: bytes) -> int:
    return int(struct.unpack_from("<H", channel, HEAD.size + 2)[0])


def is_open(source: TolerantFile, head: ChunkHead) -> bool:
    """Has the chunk no message index behind it?  Then it is the last one of a file that was not finished."""
    return source.read(head.end, 1) != bytes([Op.MESSAGE_INDEX])


def _agree(known: Mapping[int, bytes], found: Mapping[int, bytes]) -> bool:
    return all(known.get(key, record) == record for key, record in found.items())


@dataclass(slots=True)
class OpenChunk:
    """What was found.

    content        : the records taken
    unproved       : messages among them that no checksum proves; unproved_ns : log time of the first of them
    missing_bytes  : bytes that the head or a checkpoint counts as records and that are not taken: cut off or damaged
    """

    content: Content
    unproved: int = 0
    unproved_ns: int | None = None
    missing_bytes: int = 0


def read_open_chunk(source: TolerantFile, head: ChunkHead, known: Declarations, *, growing: bool = False) -> OpenChunk:
    """The last chunk of a file that was not finished.  Raises DamagedChunkError.

    growing : the file is being written, so that the head may tell of more than was there when it was opened
    """
    if head.size > MAX_RECORD:
        raise DamagedChunkError(f"it has {head.size} bytes; at most {MAX_RECORD} are read")
    marks = chunk_marks(source, head)
    if marks.damaged and not growing:
        raise DamagedChunkError("its checkpoints are damaged")
    data = source.read(head.begin, min(source.size - head.begin, MAX_RECORD))
    if growing and head.size > len(data):
        there = [mark for mark in marks.checkpoints if mark.size <= len(data)]
        head = replace(head, size=there[-1].size if there else 0, crc=there[-1].crc if there else 0)
        marks = replace(marks, checkpoints=there)
    return judge_open_chunk(data, head, marks, known)


def judge_open_chunk(data: bytes, head: ChunkHead, marks: ChunkMarks, known: Declarations) -> OpenChunk:
    """Judge the last chunk of a file.  Raises DamagedChunkError.

    data : all bytes of the file behind the chunk's head
    """
    covered = max([head.size, *(checkpoint.size for checkpoint in marks.checkpoints)])
    if not marks.checkpoints:
        return _without_proof(data, covered, known)
    proved = _proved_bytes(data, head, marks)
    content = _content(data[:proved], known)
    if not content.whole:
        raise DamagedChunkError(f"its records are damaged {content.end} bytes behind its head")
    found = OpenChunk(content)
    _take_unproved(found, data[proved:], known)
    found.missing_bytes = max(0, covered - found.content.end)
    return found


def _content(data: bytes, known: Declarations) -> Content:
    content = Content(set(known.channels)).feed(data)
    if not known.suffice(content):
        raise DamagedChunkError("it declares a channel or schema in another way than the file before it")
    return content


def _without_proof(data: bytes, covered: int, known: Declarations) -> OpenChunk:
    """An open chunk of fti 0.1: its head has no checksum, but what it covers are whole records."""
    content = _content(data[:covered], known)
    if not content.whole and covered <= len(data):
        raise DamagedChunkError(f"its records are damaged {content.end} bytes behind its head")
    content = _content(data, known)
    first = None if content.times[0] == NO_TIME else content.times[0]
    return OpenChunk(content.trim(), content.messages, first, max(0, covered - content.end))


def _proved_bytes(data: bytes, head: ChunkHead, marks: ChunkMarks) -> int:
    """How far the records are proved without a break.  Raises DamagedChunkError."""
    if head.crc and len(data) >= head.size and zlib.crc32(memoryview(data)[: head.size]) == head.crc:
        return head.size
    found = segments(data, marks.checkpoints)
    count = next((n for n, segment in enumerate(found) if not segment.proved), len(found))
    proved = found[count - 1].end if count else 0
    if any(segment.proved for segment in found[count:]) or _is_before_last_sync(found, count, len(data), marks):
        raise DamagedChunkError(f"the checksum of its records from {proved} bytes behind its head on does not hold")
    return proved


def _is_before_last_sync(found: list[ChunkSegment], unproved: int, size: int, marks: ChunkMarks) -> bool:
    """Is a stretch unproved that the last sync but one has brought onto the medium?

    The last checkpoint is written before its sync, which may not have ended; the head may tell of more behind it.  What
    a cut file does not hold is missing and not damaged.
    """
    allowed = len(found) - 1 - (found[-1].end > marks.synced) if marks.reliable else len(found)
    return any(segment.end <= size for segment in found[unproved : max(allowed, 0)])


def _take_unproved(found: OpenChunk, data: bytes, known: Declarations) -> None:
    """Add the whole records behind the proof that make sense."""
    content = found.content
    proved, messages, proved_ns = content.end, content.messages, content.times[1]
    content.feed(data)
    if not content.torn and content.last >= proved:
        content = found.content = content.cut()
    if not known.suffice(content):
        found.content = _content(bytes(content.data[:proved]), known)
        return
    content.trim()
    times = [at_ns for entries in content.index.values() for at_ns in _times_behind(entries, proved)]
    found.unproved = content.messages - messages
    found.unproved_ns = min(times, default=None)
    if messages and times and max(times) - proved_ns > MAX_UNPROVED_NS:
        raise DamagedChunkError(f"its records from {proved} bytes behind its head on are of more than one sync period")


def _times_behind(entries: array[int], proved: int) -> list[int]:
    """Log times of the messages from an offset on; entries : log time and offset, in turn."""
    return [at_ns for at_ns, at in zip(entries[::2], entries[1::2], strict=True) if at >= proved]
