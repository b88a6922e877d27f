"""Check of one MCAP file: every record, every checksum, every index entry.

A finished file of this program has no unchecked byte: chunks, attachments, metadata and the summary have checksums,
message indexes follow from the messages, and padding is zero.  ``pages`` yields the content of the chunks for the
checks of the session.  ``faults`` lists mismatches; ``unfinished_fault`` states the end of a file without a footer.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from fti.logger import records
from fti.logger.checkpoints import segments
from fti.logger.lock import is_being_written
from fti.logger.log_layout import altered_tables
from fti.logger.reading import record_cursor
from fti.logger.reading.chunk_marks import chunk_marks
from fti.logger.reading.integrity_notes import has_unverified_end, list_end_warnings, list_notes, list_warnings
from fti.logger.reading.limits import DeclaredSizes, LimitError
from fti.logger.reading.mcap_file import FOOTER_BYTES, McapChannel, has_footer
from fti.logger.reading.open_chunk import DamagedChunkError, Declarations, is_open, read_open_chunk
from fti.logger.reading.record_validation import (
    is_channel,
    is_followed_by_chunk,
    is_schema,
    is_torn_write,
    valid_record,
)
from fti.logger.reading.text_format import clock_text
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import HEAD, MAGIC, MESSAGE, Op

_MESSAGE = int(Op.MESSAGE)  # looking up a member of an enumeration is slow in a loop over all messages
_BLOCK = 2**22
_SUMMARY = frozenset((Op.SCHEMA, Op.CHANNEL, Op.STATISTICS, Op.CHUNK_INDEX, Op.ATTACHMENT_INDEX))
_IN_SUMMARY = _SUMMARY | {Op.METADATA_INDEX, Op.SUMMARY_OFFSET, Op.FOOTER}
_IN_DATA = frozenset((Op.CHUNK, Op.MESSAGE_INDEX, Op.ATTACHMENT, Op.METADATA, Op.PADDING, Op.DATA_END, Op.CHECKPOINTS))


#: A message: sequence (32 bits), log time [ns], offset of its record in the page, length of the record's body.
MessageRow = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class Page:
    """The messages of one chunk, by topic.  at, end : of the chunk in the file [B]."""

    data: bytes
    rows: list[tuple[McapChannel, list[MessageRow]]]
    at: int
    end: int

    def body(self, row: MessageRow) -> bytes:
        """The bytes of a message."""
        _, _, at, length = row
        return self.data[at + MESSAGE.size : at + HEAD.size + length]


class FileCheck:
    """A file; ``pages`` reads it once.

    messages     : of each channel id; chunks : their offsets; metadata : the tables by name
    size         : bytes read; the file may have grown since
    warnings     : unverified data: the file was not finished, was closed later or was made by a recovery
    end_warnings : missing bytes at the end of a file that was closed later; other files may hold their content
    notes        : remarks that do not mean a loss
    verified       : False when the last chunk of an unfinished file holds less, or more, than its checksum covers
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.faults: list[str] = []
        self.unfinished_fault: str | None = None
        self.size = 0
        self.messages: Counter[int] = Counter()
        self.chunks: list[int] = []
        self.metadata: dict[str, dict[str, str]] = {}
        self.verified = True
        self.warnings: list[str] = []
        self.end_warnings: list[str] = []
        self.notes: list[str] = []
        self.finished = has_footer(path)
        self._topics: dict[int, McapChannel] = {}
        self._sizes = DeclaredSizes()
        self._index: dict[int, bytes] = {}  # expected after the last chunk
        self._ended = False  # the data section has ended
        self._unverified_chunks: list[int] = []  # chunks that do not match their checkpoints

    def pages(self, at: int = 0) -> Iterator[Page]:
        """The content of the chunks, up to the limits.  Raises MissingError when the file cannot be opened.

        at : offset of the first page; 0 : of the file
        """
        try:
            yield from self._pages(at)
        except LimitError as error:
            self.faults.append(f"reading stopped: {error}")

    def _pages(self, at: int) -> Iterator[Page]:
        with TolerantFile(self.path) as source:
            self.size = source.size
            at = at or self._begin(source)
            while at and at < source.size:
                op = source.read(at, 1)[0]
                head = record_cursor.chunk_head(source, at) if op == Op.CHUNK else None
                if head and not self.finished and is_open(source, head):
                    yield from self._open_chunk(source, head)
                    break
                record = valid_record(source, at, source.size)
                if record is None or op not in (_IN_SUMMARY if self._ended else _IN_DATA):
                    # A summary that a writer has begun may be long, but holds no chunk.
                    torn = not is_followed_by_chunk(source, at) if self._ended else is_torn_write(source, at)
                    self._break(at, torn=torn)
                    return
                if head:
                    yield from self._chunk(source, head)
                else:
                    self._check_record(source, record)
                at = record.end
                if op == Op.FOOTER:
                    return
            if at and not self.finished:
                self._check_metadata()
                self._break(at)

    # --------------------------------------------------------------------------------------------- begin and end

    def _begin(self, source: TolerantFile) -> int:
        head = records.file_head()
        found = source.read(0, len(head))
        if found == head:
            return len(head)
        if self.finished or not head.startswith(found):
            self.faults.append("does not begin like a file of this program")
        else:
            self.unfinished_fault = f"ends after byte {len(found)}, within its head"
        return 0

    def _break(self, at: int, *, torn: bool = True) -> None:
        """Report an invalid record; torn : an interrupted writer may have left it."""
        if self.finished or not (torn or is_being_written(self.path)):
            self.faults.append(f"is damaged at byte {at}")
        elif self.unfinished_fault is None:
            self.unfinished_fault = f"ends after byte {at} without a footer: it is being written, or was cut off"

    def _open_chunk(self, source: TolerantFile, head: record_cursor.ChunkHead) -> Iterator[Page]:
        """The last chunk of a file without a footer."""
        self._expect_no_index()
        growing = is_being_written(self.path)
        try:
            found = read_open_chunk(source, head, Declarations(), growing=growing)
        except DamagedChunkError as error:
            self.faults.append(f"the chunk at byte {head.at} is damaged: {error}")
            return
        data = bytes(found.content.data)
        rows, end = self._walk(data)
        self.verified = not (found.unverified or found.missing_bytes)
        if found.unverified and not growing:
            since = "" if found.unverified_ns is None else f" from {clock_text(found.unverified_ns)} on"
            self.warnings.append(f"{found.unverified} messages{since} are unverified: no checksum covers them")
        if found.missing_bytes:
            self.warnings.append(f"{found.missing_bytes} bytes at its end are missing or damaged")
        self._break(head.begin + end, torn=not is_followed_by_chunk(source, head.begin + end))
        yield self._page(data, rows, head.at, head.begin + end)

    # --------------------------------------------------------------------------------------------------- records

    def _chunk(self, source: TolerantFile, head: record_cursor.ChunkHead) -> Iterator[Page]:
        self._expect_no_index()
        at = head.at
        try:
            data = head.read(source)
        except LimitError:
            raise
        except ValueError:
            self.faults.append(f"the chunk at byte {at} is damaged")
            return
        rows, walked = self._walk(data)
        if walked != len(data):
            self.faults.append(f"the chunk at byte {at} does not hold whole records")
        self.chunks.append(at)
        self._check_checkpoints(source, head, data)
        if not head.crc and zlib.crc32(data):
            self.faults.append(f"the chunk at byte {at} has no checksum")
        times = {channel: [log_time for _, log_time, _, _ in found] for channel, found in rows.items()}
        if rows and head.times != (min(map(min, times.values())), max(map(max, times.values()))):
            self.faults.append(f"the chunk at byte {at} states other times than its messages have")
        self._index = {channel: _index_of(channel, times[channel], found) for channel, found in rows.items()}
        yield self._page(data, rows, at, head.end)

    def _check_checkpoints(self, source: TolerantFile, head: record_cursor.ChunkHead, data: bytes) -> None:
        """Do the checkpoints before a chunk match its records?"""
        marks = chunk_marks(source, head)
        if marks.damaged:
            self.faults.append(f"the checkpoints before the chunk at byte {head.at} are damaged")
        elif not all(segment.verified for segment in segments(data, marks.checkpoints)):
            self._unverified_chunks.append(head.at)

    def _page(self, data: bytes, rows: dict[int, list[MessageRow]], at: int, end: int) -> Page:
        named = []
        for channel, found in rows.items():
            self.messages[channel] += len(found)
            named.append((self._topics[channel], found))
        return Page(data, named, at, end)

    def _walk(self, data: bytes) -> tuple[dict[int, list[MessageRow]], int]:
        """Messages by channel, and the end of the whole records."""
        rows: dict[int, list[MessageRow]] = defaultdict(list)
        walked = 0
        for at, end, (op, length, channel, sequence, log_time, _) in record_cursor.records_in(data):
            if op == _MESSAGE:
                rows[channel].append((sequence, log_time, at, length))
            elif not self._declare(op, data[at:end]):
                break
            walked = end
        for channel in rows.keys() - self._topics.keys():
            self.faults.append(f"{len(rows.pop(channel))} messages belong to channel {channel}, which is not declared")
        return rows, walked

    def _declare(self, op: int, record: bytes) -> bool:
        """Add a schema or a channel; False for another record, or when its lengths or texts are invalid."""
        body = record[HEAD.size :]
        try:
            if op != Op.CHANNEL or not is_channel(body):
                return op == Op.SCHEMA and is_schema(body)
            channel = record_cursor.channel_fields(record)
            self._sizes.channel(channel.channel_id, channel.topic, len(body))
            self._topics[channel.channel_id] = McapChannel(channel.topic, channel.encoding, channel.metadata)
        except (struct.error, UnicodeDecodeError):
            return False
        return True

    def _check_record(self, source: TolerantFile, record: record_cursor.Record) -> None:
        """Check a record outside of chunks; ``valid_record`` has checked lengths, attachment checksums and padding."""
        op, at, end = record
        if op == Op.MESSAGE_INDEX:
            index = source.read(at, end - at)
            if self._index.pop(record_cursor.record_id(index), None) != index:
                self.faults.append(f"the message index at byte {at} does not match the messages")
            return
        self._expect_no_index()
        if op == Op.METADATA:
            self._sizes.metadata(end - at)
            name, table = record_cursor.metadata_table(source.read(at, end - at))
            self.metadata[name] = table
            self.warnings += list_warnings(name, table)
            self.end_warnings += list_end_warnings(name, table)
            self.notes += list_notes(name, table)
        elif op == Op.DATA_END:
            self._ended = True
            self._check_metadata()
            self._check_data_crc(source, at)
        elif op == Op.FOOTER:
            self._check_summary_crc(source, at)

    def _expect_no_index(self) -> None:
        if self._index:
            self.faults.append(f"the chunk at byte {self.chunks[-1]} lacks the message index of a channel")
            self._index = {}

    def _check_metadata(self) -> None:
        if has_unverified_end(self.metadata):  # the last chunk of one that was closed later
            self._unverified_chunks = [at for at in self._unverified_chunks if at != self.chunks[-1]]
        for at in self._unverified_chunks:
            self.faults.append(f"the checkpoints before the chunk at byte {at} do not match its records")
        for name in altered_tables(self.metadata):
            self.faults.append(f"the checksum of its metadata {name} does not match")

    def _check_data_crc(self, source: TolerantFile, at: int) -> None:
        stated_crc = int.from_bytes(source.read(at + HEAD.size, 4), "little")
        crc, done = 0, 0
        while stated_crc and done < at:
            block = source.read(done, min(_BLOCK, at - done))
            crc, done = zlib.crc32(block, crc), done + len(block)
        if stated_crc and crc != stated_crc:
            self.faults.append("the checksum of its data section does not match")

    def _check_summary_crc(self, source: TolerantFile, at: int) -> None:
        start, stated_crc = record_cursor.footer_fields(source.read(at, HEAD.size + 20))
        if at + FOOTER_BYTES != source.size or source.read(at + 29, 8) != MAGIC:
            self.faults.append("does not end with its footer")
        elif not stated_crc or zlib.crc32(source.read(start, at + 25 - start)) != stated_crc:
            self.faults.append("its summary is damaged")


def _index_of(channel: int, times: list[int], rows: list[MessageRow]) -> bytes:
    """The message index record of one channel in one chunk."""
    entries = array("Q", bytes(16 * len(rows)))
    entries[::2] = array("Q", times)
    entries[1::2] = array("Q", [at for _, _, at, _ in rows])
    return records.message_index(channel, entries.tobytes())
