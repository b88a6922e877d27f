"""Walk through a file that may be damaged: what is there and proved, what is there and unproved, what is lost.

A chunk whose checksum holds is taken whole.  Where it does not hold, the checkpoints before the chunk prove each
stretch between two syncs by itself (``by_segment``).  Where the checksum of a stretch would hold with one bit the other
way, that bit is turned back and the stretch is taken, unproved, for other damage may look like that (``flipped_bit``).
A stretch whose checksum does not hold otherwise is lost: nothing in it can be proved, and no message is invented.
Unproved, and counted as such, are besides the messages behind the last checksum of a file that was not finished, or cut
off, and messages that stand outside of chunks; of these all whole records are taken up to the first that makes no
sense, and where one makes none, the one before it is not taken either: the damage may begin in it.

Past damage the walk goes on at the next record that proves itself: a chunk or attachment whose checksum holds, an
open chunk, metadata or the end of the data with a sound record behind it.  A recording inside a message is not taken
for one: where the lengths of the damaged chunk agree, what is found in it must lead exactly to its end; where the
summary is whole, only what stands where the summary tells is looked at, and there a flipped bit is turned back, too.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator

from fti.errors import RecordingError
from fti.logger.reading.chunk_content import Content, channel_name
from fti.logger.reading.chunk_marks import chunk_marks
from fti.logger.reading.limits import MAX_RECORD, DeclaredSizes, LimitError
from fti.logger.reading.open_chunk import Declarations, is_open
from fti.logger.reading.record_validation import ChunkHead, chunk_head, record_end
from fti.logger.reading.summary_index import SummaryIndex
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import HEAD, MAGIC, Op
from fti.logger.recovery.chunk_segments import ChunkData, headless_chunk, split
from fti.logger.recovery.pieces import LostBytes, Messages, OtherRecord, Piece

BLOCK_BYTES = 4 * 2**20
#: Begin of a chunk, an attachment, metadata or the end of the data, shorter than 2^40 bytes.
_CANDIDATE = re.compile(rb"[\x06\x09\x0c\x0f](?=[\s\S]{5}\x00\x00\x00)")
_BARE = frozenset(int(op) for op in (Op.SCHEMA, Op.CHANNEL, Op.MESSAGE))


class Walk:
    """The pieces of a file in its order; together they cover it.  ``at`` : where the walk stands.

    declared : channels and schemas of what was taken so far.  told : the summary, if it is whole.
    """

    def __init__(self, source: TolerantFile, told: SummaryIndex | None, progress: Callable[[int], None]) -> None:
        self.declared = Declarations()
        self._sizes = DeclaredSizes()
        self._source = source
        self._summary_index = told
        self._progress = progress
        self._limit = told.data_end if told else source.size
        self._bare = not (told and told.chunks)  # messages outside of chunks are possible
        self._places = {*(c.offset for c in told.chunks), *told.others} if told and not told.shift else set[int]()
        self._found: tuple[ChunkHead, list[Piece]] | None = None  # the chunk that was looked at last
        self._queue: list[Piece] = []  # what follows of the chunk that is being taken
        self._chunk_end = 0  # where the records of the last chunk end; more of an open one may follow
        self._proved = 0  # end of the last piece that cannot have swallowed the begin of the next

    def pieces(self) -> Iterator[Piece]:
        """The pieces, from the begin of the file to the end of its data, or of the file when there is no summary."""
        at = len(MAGIC)
        if self._source.read(0, at) != MAGIC:
            at = min(at, self._source.size)
            if at:
                yield LostBytes(0, at)
        while at < self._limit:
            piece = self._queue.pop(0) if self._queue else self._take(at) or self._damage(at)
            self._note(piece)
            yield piece
            at = piece.end
            self._progress(at)

    def _note(self, piece: Piece) -> None:
        if isinstance(piece, Messages):
            self._declare(piece.content)
            self._bare = piece.head is None
            self._chunk_end = piece.end
        if isinstance(piece, Messages) or (isinstance(piece, OtherRecord) and piece.op == Op.ATTACHMENT):
            self._proved = piece.end

    def _declare(self, content: Content) -> None:
        """Keep schemas and channels.  Raises RecordingError where they are beyond the limits."""
        try:
            for channel_id, record in content.channels.items():
                self._sizes.channel(channel_id, channel_name(record)[0], len(record))
            for schema_id, record in content.schemas.items():
                self._sizes.schema(schema_id, len(record))
        except LimitError as error:
            raise RecordingError(f"{self._source.path}: is not recovered: {error}") from None
        self.declared.add(content)

    # ------------------------------------------------------------------------------------------------- one record

    def _take(self, at: int) -> Piece | None:
        """The piece at an offset; None when nothing there makes sense."""
        head = chunk_head(self._source, at)
        if head:
            return self._take_chunk(self._chunk(head)) or self._damaged_chunk(head)
        end = record_end(self._source, at, self._limit)
        if end is None:
            return self._take_chunk(self._headless(at)) or self._private(at)
        op = self._source.read(at, 1)[0]
        if op in _BARE and (self._bare or (at == self._chunk_end and not self._summary_index)):
            return self._bare_messages(at)
        if op == Op.FOOTER:
            end += len(MAGIC)
        return OtherRecord(at, end, op) if self._is_in_place(op, end) else None

    def _is_in_place(self, op: int, end: int) -> bool:
        """May a record that ends there stand outside of chunks?"""
        if op == Op.FOOTER:
            return self._source.read(end - len(MAGIC), len(MAGIC)) == MAGIC
        if op == Op.METADATA:  # before an attachment that is damaged, too: a table is checked by its own lengths
            return self._sound(end) or self._source.read(end, 1) == bytes([Op.ATTACHMENT])
        return op != Op.MESSAGE

    def _take_chunk(self, pieces: list[Piece]) -> Piece | None:
        """The first piece of a chunk; the others follow."""
        self._queue = pieces[1:]
        return pieces[0] if pieces else None

    def _private(self, at: int) -> LostBytes | None:
        """A record of a kind that applications may have for themselves, with a sound one behind it."""
        head = self._source.read(at, HEAD.size)
        if len(head) < HEAD.size or head[0] < Op.PADDING:
            return None
        end = at + HEAD.unpack(head)[1] + HEAD.size
        return LostBytes(at, end) if end <= self._limit and self._sound(end) else None

    def _sound(self, at: int) -> bool:
        """Does a sound record stand here, or is here the end?  Messages stand in chunks."""
        if at == self._limit:
            return True
        ends = record_end(self._source, at, self._limit) is not None
        return ends and (self._bare or self._source.read(at, 1)[0] != Op.MESSAGE)

    def _chunk(self, head: ChunkHead) -> list[Piece]:
        """The pieces of a chunk; none when there is nothing to be had of it."""
        if self._found and self._found[0] == head:
            return self._found[1]
        stored = head.content(self._source) if head.end <= self._limit else None
        if stored is not None and head.crc:
            content = Content(None).feed(stored)
            found: list[Piece] = [Messages(head.at, head.end, content, True, head)] if content.whole else []
        elif head.compression:
            found = _listed(self._unproved_packed(head, stored))
        elif head.crc and not (self._summary_index and head.end > self._limit):
            found = self._split(head)
        else:
            found = _listed(self._unproved(head, stored))
        agree = all(self.declared.agree(piece.content) for piece in found if isinstance(piece, Messages))
        self._found = head, found if agree else []
        return self._found[1]

    def _split(self, head: ChunkHead) -> list[Piece]:
        """A chunk whose checksum does not hold, by the checkpoints before it."""
        marks = chunk_marks(self._source, head)
        size = max(checkpoint.size for checkpoint in marks.checkpoints)
        if size > MAX_RECORD:
            return []
        data = self._source.read(head.begin, min(size, self._limit - head.begin))
        unfinished = self._summary_index is None and is_open(self._source, head)
        return split(ChunkData(head, data, marks.checkpoints), self.declared.channels, open_end=unfinished)

    def _headless(self, at: int) -> list[Piece]:
        """A chunk whose head is damaged, by the checkpoints before it."""
        head = headless_chunk(self._source, at)
        if head is None or head.size > MAX_RECORD:
            return []
        pieces = self._split(head)
        if not any(isinstance(piece, Messages) and piece.proved for piece in pieces):
            return []
        return [LostBytes(at, head.begin), *pieces]

    def _unproved_packed(self, head: ChunkHead, stored: bytes | None) -> Messages | None:
        if stored is None:
            return None
        content = Content(self.declared.channels).feed(stored)
        return Messages(head.at, head.end, content, False, head) if content.whole else None

    def _unproved(self, head: ChunkHead, stored: bytes | None) -> Messages | None:
        """A chunk without checksum, which may go on behind what its head tells."""
        if stored is None and (head.end <= self._limit or self._summary_index):
            return None
        size = min(head.end, self._limit) - head.begin
        if size > MAX_RECORD:
            return None
        content = Content(self.declared.channels).feed(self._source.read(head.begin, size))
        while content.torn and (more := self._more(head.begin + len(content.data))):
            content.feed(more)
        return self._as_messages(head, content)

    def _more(self, at: int) -> bytes:
        """Bytes that may belong to the open chunk which reaches to this offset."""
        first = self._source.read(at, 1)
        return self._source.read(at, min(BLOCK_BYTES, self._limit - at)) if first and first[0] in _BARE else b""

    def _as_messages(self, head: ChunkHead | None, content: Content, begin: int = 0) -> Messages | None:
        """What was found without proof, up to where it makes sense."""
        begin = head.begin if head else begin
        reaches_end = begin + len(content.data) >= self._limit and content.torn
        if not (reaches_end or self._sound(begin + content.end)):
            content = content.cut()
        if not content.end:
            return None
        return Messages(head.at if head else begin, begin + content.end, content.trim(), False, head)

    def _bare_messages(self, at: int) -> Messages | None:
        """Messages outside of chunks, as many as a block holds."""
        content = Content(self.declared.channels).feed(self._source.read(at, min(BLOCK_BYTES, self._limit - at)))
        if not content.end and (end := record_end(self._source, at, self._limit)):
            content = Content(self.declared.channels).feed(self._source.read(at, end - at))
        if content.torn and content.end:
            return Messages(at, at + content.end, content.trim(), False)
        return self._as_messages(None, content, at)

    # ------------------------------------------------------------------------------------------------- past damage

    def _damage(self, at: int) -> LostBytes:
        """From where nothing makes sense to what does.

        A record before it, shortened, may have swallowed the begin of a chunk: that is looked for first.
        """
        for place in self._candidates(self._proved, at):
            head = chunk_head(self._source, place)
            if head and self._proves_itself(place):
                return LostBytes(self._proved, place)
        return LostBytes(at, self._next_sound(at + 1, self._limit))

    def _damaged_chunk(self, head: ChunkHead) -> LostBytes | None:
        """The chunk as lost, up to its end or to a sound record in it that leads to its end (bytes were cut out)."""
        if head.end > self._limit or not self._sound(head.end):
            return None
        return LostBytes(head.at, self._next_sound(head.at + 1, head.end, leads=True))

    def _next_sound(self, at: int, end: int, *, leads: bool = False) -> int:
        """Where the next record stands that proves itself; ``end`` when none does."""
        for place in self._candidates(at, end):
            if self._proves_itself(place) and (not leads or self._leads(place, end)):
                return place
        return end

    def _candidates(self, at: int, end: int) -> Iterator[int]:
        while at < end:
            block = self._source.read(at, min(BLOCK_BYTES, end - at) + HEAD.size - 1)
            for found in _CANDIDATE.finditer(block):
                yield at + found.start()
            at += BLOCK_BYTES
            self._progress(min(at, end))

    def next_proved(self, at: int) -> int | None:
        """Where the next chunk or attachment stands that proves itself; None when there is none."""
        for place in self._candidates(at, self._limit):
            if self._source.read(place, 1)[0] in (Op.CHUNK, Op.ATTACHMENT) and self._proves_itself(place):
                return place
        return None

    def _proves_itself(self, at: int) -> bool:
        if self._places and at not in self._places:
            return False
        head = chunk_head(self._source, at)
        if head:
            return any(self._is_proof(piece, head) for piece in self._chunk(head))
        end = record_end(self._source, at, self._limit)
        if end is None:
            return False
        op = self._source.read(at, 1)[0]
        return op == Op.ATTACHMENT or (op in (Op.METADATA, Op.DATA_END) and self._sound(end))

    def _is_proof(self, piece: Piece, head: ChunkHead) -> bool:
        """Does this piece show that there is a chunk?  One whose checksum is 0 shows it by its form."""
        if not isinstance(piece, Messages) or not piece.content.messages:
            return False
        return piece.proved or (piece.flipped is None and not head.crc) or bool(self._places)

    def _leads(self, at: int, goal: int) -> bool:
        """Do sound records, one behind the other, lead from here to there, or beyond, so that there nothing ends?"""
        following: int | None = at
        while following is not None and following < goal:
            following = record_end(self._source, following, self._limit)
        return following is not None


def _listed(piece: Piece | None) -> list[Piece]:
    return [piece] if piece else []


def unknown_channels(content: Content, declared: Collection[int]) -> list[int]:
    """Channels of messages of which no record stands in the chunk nor among those declared."""
    return sorted(content.undeclared - set(content.channels) - set(declared))
