"""Inspection of a file without a footer: its content, and whether it can be closed without loss of a byte."""

from __future__ import annotations

from dataclasses import dataclass, field

from fti.errors import RecordingError
from fti.logger import records
from fti.logger.log_layout import altered_tables
from fti.logger.reading.chunk_content import Content
from fti.logger.reading.limits import MAX_RECORD
from fti.logger.reading.open_chunk import DamagedChunkError, Declarations, OpenChunk, is_open, read_open_chunk
from fti.logger.reading.record_cursor import ChunkHead, attachment_fields, chunk_head, metadata_table
from fti.logger.reading.record_validation import MAX_TORN_BYTES, is_followed_by_chunk, valid_record
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import HEAD, Op
from fti.logger.recovery.damage_scan import Walk
from fti.logger.summary import Summary

_FILE_HEAD = records.file_head()
DATA_END_HEAD = HEAD.pack(Op.DATA_END, 4)


@dataclass(slots=True)
class UnfinishedFile:
    """Content of an unfinished file.

    begin  : end of magic and header; 0 when the file ends within them
    end    : end of the valid data [B]
    chunk  : the open chunk, if any, and its head; ``summary`` covers everything finished
    zeros  : number of bytes after it if all are zero: pages that a power cut has left empty
    tables : the metadata; data_ended : the writer had begun the summary, of which a part is missing
    """

    begin: int = 0
    end: int = 0
    head: ChunkHead | None = None
    chunk: OpenChunk | None = None
    summary: Summary = field(default_factory=Summary)
    tables: dict[str, dict[str, str]] = field(default_factory=dict)
    data_ended: bool = False
    zeros: int = 0

    @property
    def missing_bytes(self) -> int:
        """Bytes that were written at the end and are lost."""
        return max(self.chunk.missing_bytes if self.chunk else 0, self.zeros)

    @property
    def message_index(self) -> bytes:
        """The message index to write after the open chunk."""
        return self.summary.chunk_tail(self.end, self.chunk.content.index)[0] if self.chunk else b""


def inspect_unfinished(source: TolerantFile) -> UnfinishedFile:
    """Inspect a file.  Raises RecordingError when it must not be closed: damaged, or of another program."""
    return _Inspector(source).run()


class _Inspector:
    def __init__(self, source: TolerantFile) -> None:
        self._source = source
        self._known = Declarations()
        self._result = UnfinishedFile()

    def run(self) -> UnfinishedFile:
        found = self._result
        found.begin = found.end = self._header_end()
        while found.begin and found.end < self._source.size and found.chunk is None:
            end = self._take(found.end)
            if end is None:
                break
            found.end = end
        if altered := altered_tables(found.tables):
            raise self._refusal(f"the checksum of its metadata {', '.join(altered)} does not match")
        self._check_rest()
        if self._source.unreadable:
            raise self._refusal("the medium cannot read all of it")
        return found

    def _refusal(self, why: str) -> RecordingError:
        path = self._source.path
        return RecordingError(f"{path}: is damaged: {why}; it is left as it is, see: fti recover {path}")

    def _header_end(self) -> int:
        start = self._source.read(0, len(_FILE_HEAD))
        if start == _FILE_HEAD:
            return len(_FILE_HEAD)
        if not _FILE_HEAD.startswith(start):
            raise RecordingError(f"{self._source.path}: was not written by this program; it is left as it is")
        return 0

    # --------------------------------------------------------------------------------------------------- records

    def _take(self, at: int) -> int | None:
        """Read the record at an offset; returns its end, or None at the end of the valid data."""
        head = chunk_head(self._source, at)
        if head:
            return self._take_chunk(head)
        record = valid_record(self._source, at, self._source.size)
        if record is None or record.op not in (Op.PADDING, Op.CHECKPOINTS, Op.ATTACHMENT, Op.METADATA):
            return None
        end = record.end
        if record.op == Op.ATTACHMENT:
            fields = attachment_fields(self._source.read(at, min(end - at, MAX_TORN_BYTES)))
            self._result.summary.add_attachment((at, end - at), *fields)
        elif record.op == Op.METADATA:
            name, table = metadata_table(self._source.read(at, end - at))
            self._result.tables[name] = table
            self._result.summary.add_metadata(at, end - at, name)
        return end

    def _take_chunk(self, head: ChunkHead) -> int | None:
        """Read a finished chunk and its message index, or the open chunk, which is the last."""
        if head.compression:
            raise self._refusal(f"it has a compressed chunk at byte {head.at}, which an unfinished file cannot have")
        chunk = self._open_chunk(head) if is_open(self._source, head) else OpenChunk(self._finished_content(head))
        if not chunk.content.index:
            return None
        end = head.begin + chunk.content.end
        tail = self._note_chunk(head, chunk.content)
        if self._source.read(end, len(tail)) == tail:
            return end + len(tail)
        self._result.head, self._result.chunk = head, chunk
        return end

    def _finished_content(self, head: ChunkHead) -> Content:
        data = head.content(self._source)
        content = Content(set(self._known.channels)).feed(data) if data is not None else None
        if content is None or not content.whole or not head.crc or not self._known.suffice(content):
            raise self._refusal(f"the chunk at byte {head.at} is damaged")
        return content

    def _open_chunk(self, head: ChunkHead) -> OpenChunk:
        try:
            return read_open_chunk(self._source, head, self._known)
        except DamagedChunkError as error:
            raise self._refusal(f"the chunk at byte {head.at}: {error}") from None

    def _note_chunk(self, head: ChunkHead, content: Content) -> bytes:
        """Add a chunk to the summary; returns its message index."""
        self._known.add(content)
        summary = self._result.summary
        summary.schemas |= content.schemas
        summary.channels |= content.channels
        tail, offsets = summary.chunk_tail(head.begin + content.end, content.index)
        summary.add_chunk(head.at, content.end, content.times, content.index, offsets)
        return tail

    def _check_rest(self) -> None:
        """Check that the rest is a torn write: it must hold no self-proving record."""
        found, size = self._result, self._source.size
        if size - found.end > MAX_RECORD:
            raise self._refusal(f"{size - found.end} bytes behind byte {found.end} are not a record")
        rest = self._source.read(found.end, size - found.end)
        found.data_ended = rest.startswith(DATA_END_HEAD)
        if not rest.strip(b"\0"):
            found.zeros = len(rest)
            return
        later = Walk(self._source, None, lambda done: None).next_verified(found.end + 1)
        if later is not None:
            raise self._refusal(f"its records are invalid from byte {found.end} on, but valid again at byte {later}")
        if is_followed_by_chunk(self._source, found.end):
            raise self._refusal(f"its records are invalid from byte {found.end} on, and a chunk begins behind that")
        if found.chunk is None and not found.data_ended and len(rest) > MAX_TORN_BYTES:
            raise self._refusal(f"its records are invalid from byte {found.end} on")
