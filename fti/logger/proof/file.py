"""One MCAP file under proof: every record, every checksum, every entry of every index.

A finished file of this program has no byte that is not held by something: chunks, attachments and the summary have
checksums, message indexes follow from the messages, padding is zero, the metadata have a checksum in their first table.
``pages`` gives what the chunks hold, chunk by chunk, for the proofs of the session; what does not hold is in
``faults``, and ``broken`` tells where a file without a footer ends.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from fti.logger import records
from fti.logger.blueprint import FILE_METADATA, RECOVERED_METADATA
from fti.logger.reading.mcap_file import FOOTER_BYTES, Topic, has_footer
from fti.logger.reading.source import Source
from fti.logger.reading.structure import ChunkHead, chunk_head, record_end
from fti.logger.records import HEAD, MAGIC, MESSAGE, MESSAGE_BODY, Op, read_text
from fti.logger.seal import broken

_MESSAGE, _SCHEMA, _CHANNEL = int(Op.MESSAGE), int(Op.SCHEMA), int(Op.CHANNEL)
_IN_CHUNKS = (_SCHEMA, _CHANNEL, _MESSAGE)
_HEAD = HEAD.size
_TIMES = struct.Struct("<QQ")
_BLOCK = 2**22
_SUMMARY = frozenset((Op.SCHEMA, Op.CHANNEL, Op.STATISTICS, Op.CHUNK_INDEX, Op.ATTACHMENT_INDEX))
_IN_SUMMARY = _SUMMARY | {Op.METADATA_INDEX, Op.SUMMARY_OFFSET, Op.FOOTER}
_IN_DATA = frozenset((Op.CHUNK, Op.MESSAGE_INDEX, Op.ATTACHMENT, Op.METADATA, Op.PADDING, Op.DATA_END))


#: A message: sequence (32 bits), log time [ns], where its record begins in the page, length of the record's body.
Row = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class Page:
    """The messages of one chunk, by topic.  at, end : where it stands in the file [B]."""

    data: bytes
    rows: list[tuple[Topic, list[Row]]]
    at: int
    end: int

    def body(self, row: Row) -> bytes:
        """The bytes of a message."""
        _, _, at, length = row
        return self.data[at + MESSAGE.size : at + _HEAD + length]


class ProofFile:
    """A file; ``pages`` reads it once.

    messages : of each channel id; chunks : where they begin; metadata : the tables as they stand, by name
    size     : so far it was read [B]; it may have grown since
    doubts   : what is not known of it because it was made by a recovery
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.faults: list[str] = []
        self.broken: str | None = None
        self.size = 0
        self.messages: Counter[int] = Counter()
        self.chunks: list[int] = []
        self.metadata: dict[str, dict[str, str]] = {}
        self.doubts: list[str] = []
        self.finished = has_footer(path)
        self._topics: dict[int, Topic] = {}
        self._index: dict[int, bytes] = {}  # what must follow the last chunk
        self._ended = False  # the data section

    def pages(self, at: int = 0) -> Iterator[Page]:
        """What the chunks hold.  Raises MissingError when the file cannot be opened.

        at : where a page begins that is to be had again, with those behind it
        """
        with Source(self.path) as source:
            self.size = source.size
            at = at or self._begin(source)
            while at and at < source.size:
                op = source.read(at, 1)[0]
                if not self.finished and op in _IN_CHUNKS:
                    yield from self._tail(source, at)
                    return
                end = record_end(source, at, source.size)
                if end is None or op not in (_IN_SUMMARY if self._ended else _IN_DATA):
                    self._break(source, at)
                    return
                if op == Op.CHUNK:
                    yield from self._chunk(source, at, end)
                else:
                    self._other(source, op, at, end)
                at = end
                if op == Op.FOOTER:
                    return
            if at and not self.finished:
                self._break(source, at)

    # --------------------------------------------------------------------------------------------- begin and end

    def _begin(self, source: Source) -> int:
        head = records.file_head()
        found = source.read(0, len(head))
        if found == head:
            return len(head)
        if self.finished or not head.startswith(found):
            self.faults.append("does not begin as a file of this program")
        else:
            self.broken = f"ends after byte {len(found)}, within its head"
        return 0

    def _break(self, source: Source, at: int) -> None:
        """What stands here is no record of this place."""
        if self.finished:
            self.faults.append(f"is damaged at byte {at}")
        else:
            self.broken = f"ends after byte {at} without a footer: it is being written, or was cut off"

    def _tail(self, source: Source, at: int) -> Iterator[Page]:
        """Records that were appended, and that no head of a chunk covers yet."""
        data = source.read(at, source.size - at)
        rows, end = self._walk(data)
        if rows:
            yield self._page(data, rows, at, at + end)
        self._break(source, at + end)

    # --------------------------------------------------------------------------------------------------- records

    def _chunk(self, source: Source, at: int, end: int) -> Iterator[Page]:
        self._expect_no_index()
        head = self._chunk_head(source, at, end)
        data = head.content(source) if head else None
        if head is None or data is None:
            self.faults.append(f"the chunk at byte {at} is damaged")
            return
        rows, walked = self._walk(data)
        if walked != len(data):
            self.faults.append(f"the chunk at byte {at} does not hold whole records")
        self.chunks.append(at)
        if self.finished:
            if not head.crc and zlib.crc32(data):
                self.faults.append(f"the chunk at byte {at} has no checksum")
            self._check_times(source, at, rows)
            self._index = {channel: _index_of(channel, found) for channel, found in rows.items()}
        yield self._page(data, rows, at, end)

    def _chunk_head(self, source: Source, at: int, end: int) -> ChunkHead | None:
        """The head as it was when the chunk ended at ``end``: a writer may have gone on since."""
        head = chunk_head(source, at)
        if head and not self.finished and end < head.end:
            return replace(head, end=end, size=end - head.begin, crc=0)
        return head

    def _page(self, data: bytes, rows: dict[int, list[Row]], at: int, end: int) -> Page:
        named = []
        for channel, found in rows.items():
            self.messages[channel] += len(found)
            named.append((self._topics[channel], found))
        return Page(data, named, at, end)

    def _walk(self, data: bytes) -> tuple[dict[int, list[Row]], int]:
        """Messages by channel, and where the whole records end."""
        rows: dict[int, list[Row]] = defaultdict(list)
        unpack, body = MESSAGE.unpack_from, MESSAGE_BODY
        at, size = 0, len(data)
        last = size - MESSAGE.size
        while at <= last:
            op, length, channel, sequence, log_time, _ = unpack(data, at)
            end = at + _HEAD + length
            if op == _MESSAGE and length >= body and end <= size:
                rows[channel].append((sequence, log_time, at, length))
            elif op not in (_SCHEMA, _CHANNEL) or end > size:
                break
            elif op == _CHANNEL:
                self._declare(data[at + _HEAD : end])
            at = end
        for channel in rows.keys() - self._topics.keys():
            self.faults.append(f"{len(rows.pop(channel))} messages are of channel {channel}, which is not declared")
        return rows, at

    def _declare(self, body: bytes) -> None:
        channel, _ = struct.unpack_from("<HH", body)
        name, at = read_text(body, 4)
        encoding, at = read_text(body, at)
        self._topics[channel] = Topic(name, encoding, _table(body, at))

    def _check_times(self, source: Source, at: int, rows: dict[int, list[Row]]) -> None:
        times = [log_time for found in rows.values() for _, log_time, _, _ in found]
        told = _TIMES.unpack(source.read(at + _HEAD, _TIMES.size))
        if times and told != (min(times), max(times)):
            self.faults.append(f"the chunk at byte {at} has other times than its messages")

    def _other(self, source: Source, op: int, at: int, end: int) -> None:
        """A record outside of chunks; its inner lengths, the checksum of an attachment and empty padding hold."""
        if op == Op.MESSAGE_INDEX:
            self._take_index(source.read(at, end - at), at)
            return
        self._expect_no_index()
        if op == Op.METADATA:
            body = source.read(at + _HEAD, end - at - _HEAD)
            name, begin = read_text(body, 0)
            self.metadata[name] = table = _table(body, begin)
            if name == RECOVERED_METADATA:
                self._doubt(table)
        elif op == Op.DATA_END:
            self._ended = True
            self._check_metadata()
            self._check_data_crc(source, at)
        elif op == Op.FOOTER:
            self._check_summary_crc(source, at)

    def _doubt(self, recovered: dict[str, str]) -> None:
        """Its checksums were made by the recovery: that they hold proves nothing of what came before."""
        unproved = recovered.get("unproved", "?")
        if unproved != "0":
            self.doubts.append(f"was recovered, {unproved} messages of it without a checksum that held")
        if recovered.get("complete") != "true":
            self.doubts.append("was recovered from a file of which not everything was whole")

    def _take_index(self, found: bytes, at: int) -> None:
        channel = int.from_bytes(found[_HEAD : _HEAD + 2], "little")
        if self.finished and self._index.pop(channel, None) != found:
            self.faults.append(f"the message index at byte {at} is not that of the messages")

    def _expect_no_index(self) -> None:
        if self._index:
            self.faults.append(f"the chunk at byte {self.chunks[-1]} has no message index of all its channels")
            self._index = {}

    def _check_metadata(self) -> None:
        for name in broken(FILE_METADATA, self.metadata):
            self.faults.append(f"its table {name} is not as it was written")

    def _check_data_crc(self, source: Source, at: int) -> None:
        told = int.from_bytes(source.read(at + _HEAD, 4), "little")
        crc, done = 0, 0
        while told and done < at:
            block = source.read(done, min(_BLOCK, at - done))
            crc, done = zlib.crc32(block, crc), done + len(block)
        if told and crc != told:
            self.faults.append("the checksum of its data section does not hold")

    def _check_summary_crc(self, source: Source, at: int) -> None:
        start, _, told = struct.unpack("<QQI", source.read(at + _HEAD, 20))
        if at + FOOTER_BYTES != source.size or source.read(at + 29, 8) != MAGIC:
            self.faults.append("does not end with its footer")
        elif not told or zlib.crc32(source.read(start, at + 25 - start)) != told:
            self.faults.append("its summary is damaged")


def _index_of(channel: int, rows: list[Row]) -> bytes:
    """The message index record of one channel in one chunk."""
    entries = array("Q", [number for _, log_time, at, _ in rows for number in (log_time, at)])
    return records.message_index(channel, entries.tobytes())


def _table(body: bytes, at: int) -> dict[str, str]:
    end = at + 4 + int.from_bytes(body[at : at + 4], "little")
    at += 4
    found = {}
    while at < end:
        key, at = read_text(body, at)
        found[key], at = read_text(body, at)
    return found
