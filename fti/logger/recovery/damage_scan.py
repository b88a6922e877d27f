"""Scan of a file that may be damaged: verified records, unverified records and lost bytes.

A chunk with a matching checksum is accepted.  Otherwise the checkpoints before the chunk verify each segment between
two syncs (``chunk_segments``).  If one flipped bit explains the checksum of a segment, the bit is corrected and the
segment is accepted unverified, because other damage may look the same (``flipped_bit``).  A segment with another wrong
checksum is lost: nothing in it can be verified, and no message is invented.
Messages after the last checksum of an unfinished or cut file, and messages outside of chunks, are accepted unverified,
up to the first invalid record.  The record before an invalid one is rejected too, because the damage may begin in it.

After damage the scan continues at the next self-proving record: a chunk or attachment with a matching checksum, an open
chunk, or metadata or data end followed by a valid record.  A recording inside a message is not mistaken for one: if the
lengths of the damaged chunk agree, valid records must lead exactly to its end; with an undamaged summary, only the
offsets in the summary are tried, and a flipped bit is corrected there too.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator

from fti.errors import RecordingError
from fti.logger.reading.chunk_content import Content
from fti.logger.reading.chunk_marks import chunk_marks
from fti.logger.reading.limits import MAX_RECORD, DeclaredSizes, LimitError
from fti.logger.reading.open_chunk import Declarations, is_open
from fti.logger.reading.record_cursor import ChunkHead, channel_fields, chunk_head, record_at
from fti.logger.reading.record_validation import valid_record, valid_records
from fti.logger.reading.summary_index import SummaryIndex
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import HEAD, MAGIC, Op
from fti.logger.recovery.chunk_segments import (
    ChunkData,
    LostBytes,
    Messages,
    OtherRecord,
    Piece,
    headless_chunk,
    split,
)

BLOCK_BYTES = 4 * 2**20
#: Begin of a chunk, an attachment, metadata or the end of the data, shorter than 2^40 bytes.
_CANDIDATE = re.compile(rb"[\x06\x09\x0c\x0f](?=[\s\S]{5}\x00\x00\x00)")
_BARE = frozenset(int(op) for op in (Op.SCHEMA, Op.CHANNEL, Op.MESSAGE))


class Walk:
    """The pieces of a file in order; together they cover it.

    declared : channels and schemas of the pieces so far.  summary : the summary, if it is undamaged.
    """

    def __init__(self, source: TolerantFile, summary: SummaryIndex | None, progress: Callable[[int], None]) -> None:
        self.declared = Declarations()
        self._sizes = DeclaredSizes()
        self._source = source
        self._summary_index = summary
        self._progress = progress
        self._limit = summary.data_end if summary else source.size
        self._allows_bare_messages = not (summary and summary.chunks)  # outside of chunks
        known = summary if summary and not summary.shift else None
        self._summary_offsets = {*(c.offset for c in known.chunks), *known.others} if known else set[int]()
        self._last_chunk: tuple[ChunkHead, list[Piece]] | None = None
        self._queue: list[Piece] = []  # further pieces of the current chunk
        self._chunk_end = 0  # end of the records of the last chunk; more of an open one may follow
        self._verified_end = 0  # end of the last piece that cannot cover the begin of the next

    def pieces(self) -> Iterator[Piece]:
        """The pieces, from the begin of the file to the end of its data, or of the file without a summary."""
        at = len(MAGIC)
        if self._source.read(0, at) != MAGIC:
            at = min(at, self._source.size)
            if at:
                yield LostBytes(0, at)
        while at < self._limit:
            piece = self._queue.pop(0) if self._queue else self._take(at) or self._skip_damage(at)
            self._note(piece)
            yield piece
            at = piece.end
            self._progress(at)

    def _note(self, piece: Piece) -> None:
        if isinstance(piece, Messages):
            self._declare(piece.content)
            self._allows_bare_messages = piece.head is None
            self._chunk_end = piece.end
        if isinstance(piece, Messages) or (isinstance(piece, OtherRecord) and piece.op == Op.ATTACHMENT):
            self._verified_end = piece.end

    def _declare(self, content: Content) -> None:
        """Add schemas and channels.  Raises RecordingError beyond the limits."""
        try:
            for channel_id, record in content.channels.items():
                self._sizes.channel(channel_id, channel_fields(record).topic, len(record))
            for schema_id, record in content.schemas.items():
                self._sizes.schema(schema_id, len(record))
        except LimitError as error:
            raise RecordingError(f"{self._source.path}: is not recovered: {error}") from None
        self.declared.add(content)

    # ------------------------------------------------------------------------------------------------- one record

    def _take(self, at: int) -> Piece | None:
        """The piece at an offset; None when nothing valid begins there."""
        head = chunk_head(self._source, at)
        if head:
            return self._take_chunk(self._chunk(head)) or self._damaged_chunk(head)
        record = valid_record(self._source, at, self._limit)
        if record is None:
            return self._take_chunk(self._headless_chunk(at)) or self._private_record(at)
        op, _, end = record
        if op in _BARE and (self._allows_bare_messages or (at == self._chunk_end and not self._summary_index)):
            return self._bare_messages(at)
        if op == Op.FOOTER:
            end += len(MAGIC)
        return OtherRecord(at, end, op) if self._is_valid_outside_chunk(op, end) else None

    def _is_valid_outside_chunk(self, op: int, end: int) -> bool:
        """Is a record with this end allowed outside of chunks?"""
        if op == Op.FOOTER:
            return self._source.read(end - len(MAGIC), len(MAGIC)) == MAGIC
        if op == Op.METADATA:  # also before a damaged attachment: a table is checked by its own lengths
            return self._is_sound(end) or self._source.read(end, 1) == bytes([Op.ATTACHMENT])
        return op != Op.MESSAGE

    def _take_chunk(self, pieces: list[Piece]) -> Piece | None:
        """The first piece of a chunk; the others follow."""
        self._queue = pieces[1:]
        return pieces[0] if pieces else None

    def _private_record(self, at: int) -> LostBytes | None:
        """A private record of an application, followed by a valid record."""
        record = record_at(self._source, at, self._limit)
        is_private = record is not None and record.op >= Op.PADDING and self._is_sound(record.end)
        return LostBytes(at, record.end) if record and is_private else None

    def _is_sound(self, at: int) -> bool:
        """Does a valid record begin here, or is here the end?  Messages must be in chunks."""
        if at == self._limit:
            return True
        record = valid_record(self._source, at, self._limit)
        return record is not None and (self._allows_bare_messages or record.op != Op.MESSAGE)

    def _chunk(self, head: ChunkHead) -> list[Piece]:
        """The pieces of a chunk; empty when nothing of it is readable."""
        if self._last_chunk and self._last_chunk[0] == head:
            return self._last_chunk[1]
        stored = head.content(self._source) if head.end <= self._limit else None
        if stored is not None and head.crc:
            content = Content(None).feed(stored)
            found: list[Piece] = [Messages(head.at, head.end, content, True, head)] if content.whole else []
        elif head.compression:
            content = Content(self.declared.channels).feed(stored or b"")
            found = [Messages(head.at, head.end, content, False, head)] if stored is not None and content.whole else []
        elif head.crc and not (self._summary_index and head.end > self._limit):
            found = self._split(head)
        else:
            unverified = self._unverified(head, stored)
            found = [unverified] if unverified else []
        agree = all(self.declared.agree(piece.content) for piece in found if isinstance(piece, Messages))
        self._last_chunk = head, found if agree else []
        return self._last_chunk[1]

    def _split(self, head: ChunkHead) -> list[Piece]:
        """Split a chunk with a wrong checksum at its checkpoints."""
        marks = chunk_marks(self._source, head)
        size = max(checkpoint.size for checkpoint in marks.checkpoints)
        if size > MAX_RECORD:
            return []
        data = self._source.read(head.begin, min(size, self._limit - head.begin))
        unfinished = self._summary_index is None and is_open(self._source, head)
        return split(ChunkData(head, data, marks.checkpoints), self.declared.channels, open_end=unfinished)

    def _headless_chunk(self, at: int) -> list[Piece]:
        """Split a chunk with a damaged head at its checkpoints."""
        head = headless_chunk(self._source, at)
        if head is None or head.size > MAX_RECORD:
            return []
        pieces = self._split(head)
        if not any(isinstance(piece, Messages) and piece.verified for piece in pieces):
            return []
        return [LostBytes(at, head.begin), *pieces]

    def _unverified(self, head: ChunkHead, stored: bytes | None) -> Messages | None:
        """A chunk without a checksum, which may be longer than its head states."""
        if stored is None and (head.end <= self._limit or self._summary_index):
            return None
        size = min(head.end, self._limit) - head.begin
        if size > MAX_RECORD:
            return None
        content = Content(self.declared.channels).feed(self._source.read(head.begin, size))
        while content.torn and (more := self._read_more(head.begin + len(content.data))):
            content.feed(more)
        return self._as_messages(head, content)

    def _read_more(self, at: int) -> bytes:
        """Bytes that may continue the open chunk up to this offset."""
        first = self._source.read(at, 1)
        return self._source.read(at, min(BLOCK_BYTES, self._limit - at)) if first and first[0] in _BARE else b""

    def _as_messages(self, head: ChunkHead | None, content: Content, begin: int = 0) -> Messages | None:
        """The valid part of unverified records."""
        begin = head.begin if head else begin
        reaches_end = begin + len(content.data) >= self._limit and content.torn
        if not (reaches_end or self._is_sound(begin + content.end)):
            content = content.cut()
        if not content.end:
            return None
        return Messages(head.at if head else begin, begin + content.end, content.trim(), False, head)

    def _bare_messages(self, at: int) -> Messages | None:
        """Messages outside of chunks, as many as a block holds."""
        content = Content(self.declared.channels).feed(self._source.read(at, min(BLOCK_BYTES, self._limit - at)))
        if not content.end and (record := valid_record(self._source, at, self._limit)):
            content = Content(self.declared.channels).feed(self._source.read(at, record.end - at))
        if content.torn and content.end:
            return Messages(at, at + content.end, content.trim(), False)
        return self._as_messages(None, content, at)

    # ------------------------------------------------------------------------------------------------- past damage

    def _skip_damage(self, at: int) -> LostBytes:
        """The lost bytes from an offset to the next valid record.

        A shortened record before the offset may cover the begin of a chunk, which is searched first.
        """
        for offset in self._candidates(self._verified_end, at):
            head = chunk_head(self._source, offset)
            if head and self._proves_itself(offset):
                return LostBytes(self._verified_end, offset)
        return LostBytes(at, self._next_sound(at + 1, self._limit))

    def _damaged_chunk(self, head: ChunkHead) -> LostBytes | None:
        """The lost bytes of a chunk, up to its end or to a valid record in it that leads there (bytes were cut out)."""
        if head.end > self._limit or not self._is_sound(head.end):
            return None
        return LostBytes(head.at, self._next_sound(head.at + 1, head.end, must_reach_end=True))

    def _next_sound(self, at: int, end: int, *, must_reach_end: bool = False) -> int:
        """Offset of the next self-proving record; ``end`` without one."""
        for offset in self._candidates(at, end):
            if self._proves_itself(offset) and (not must_reach_end or self._leads_to(offset, end)):
                return offset
        return end

    def _candidates(self, at: int, end: int) -> Iterator[int]:
        while at < end:
            block = self._source.read(at, min(BLOCK_BYTES, end - at) + HEAD.size - 1)
            for found in _CANDIDATE.finditer(block):
                yield at + found.start()
            at += BLOCK_BYTES
            self._progress(min(at, end))

    def next_verified(self, at: int) -> int | None:
        """Offset of the next self-proving chunk or attachment; None without one."""
        for offset in self._candidates(at, self._limit):
            if self._source.read(offset, 1)[0] in (Op.CHUNK, Op.ATTACHMENT) and self._proves_itself(offset):
                return offset
        return None

    def _proves_itself(self, at: int) -> bool:
        if self._summary_offsets and at not in self._summary_offsets:
            return False
        head = chunk_head(self._source, at)
        if head:
            return any(self._is_proof(piece, head) for piece in self._chunk(head))
        record = valid_record(self._source, at, self._limit)
        if record is None:
            return False
        is_checked = record.op in (Op.METADATA, Op.DATA_END) and self._is_sound(record.end)
        return record.op == Op.ATTACHMENT or is_checked

    def _is_proof(self, piece: Piece, head: ChunkHead) -> bool:
        """Does this piece prove a chunk?  A chunk with checksum 0 is verified by its form."""
        if not isinstance(piece, Messages) or not piece.content.messages:
            return False
        return piece.verified or (piece.flipped is None and not head.crc) or bool(self._summary_offsets)

    def _leads_to(self, at: int, end: int) -> bool:
        """Do consecutive valid records lead exactly from one offset to another?"""
        ends = (record.end for record in valid_records(self._source, at, self._limit))
        return at >= end or any(reached >= end for reached in ends)


def unknown_channels(content: Content, declared: Collection[int]) -> list[int]:
    """Channels of messages that are declared neither in the chunk nor before."""
    return sorted(content.undeclared - set(content.channels) - set(declared))
