"""Closing files that a kill or a power cut left open: in place, and without touching what is good.

The last chunk keeps every whole record that is there, gets its size, times and checksum, and the file its message
index, summary and footer.  A file that is damaged elsewhere is left as it is.  A killed repair can be repeated.
"""

from __future__ import annotations

import os
import struct
import zlib
from array import array
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from pathlib import Path

from fti.errors import FtiError, RecordingError, StorageError
from fti.logger import records
from fti.logger.lock import is_being_written, locked
from fti.logger.reading.mcap_file import has_footer
from fti.logger.records import CHUNK, CHUNK_BODY, HEAD, MESSAGE, MESSAGE_BODY, Op
from fti.logger.summary import Summary

BLOCK = 4 * 2**20
_FILE_HEAD = records.file_head()
_MESSAGE = int(Op.MESSAGE)  # looking up a member of an enumeration is slow in a loop over all messages
_IN_CHUNKS = frozenset(int(op) for op in (Op.SCHEMA, Op.CHANNEL, Op.MESSAGE))


@dataclass(frozen=True, slots=True)
class Closed:
    """What became of an unfinished file.  dropped_bytes : torn rest that was cut off; fault : why it was left alone."""

    path: Path
    messages: int = 0
    dropped_bytes: int = 0
    fault: str | None = None


def close_unfinished(path: str | Path) -> Closed | None:
    """Close a file that has no footer; None when it has one.

    Raises StorageError when the file is being written or the medium refuses, RecordingError when the file is damaged
    in its middle or is no recording of this program; it is then as it was.
    """
    place = Path(path)
    if has_footer(place):
        return None
    with locked(place) as fd:
        try:
            return _Repair(place, fd).run()
        except OSError as error:
            raise StorageError(f"{place}: cannot be closed: {error.strerror}") from error


def close_all(
    directory: str | Path, in_use: Collection[Path] = (), goes_on: Callable[[], bool] = lambda: True
) -> list[Closed]:
    """Close every unfinished file in the session folders of a directory.

    in_use : session folders to leave alone; goes_on : asked before each file; False leaves the rest for later.
    Files that another process writes are left alone too.
    """
    skipped = {folder.resolve() for folder in in_use}
    paths = sorted(Path(directory).glob("*/*.mcap"))
    return _close_each(path for path in paths if path.parent.resolve() not in skipped and goes_on())


def close_session(folder: Path) -> list[Closed]:
    """Close every unfinished file of a session folder, except those that another process writes."""
    return _close_each(sorted(folder.glob("*.mcap")))


def _close_each(paths: Iterable[Path]) -> list[Closed]:
    closed = []
    for path in paths:
        if is_being_written(path):
            continue
        try:
            result = close_unfinished(path)
        except FtiError as error:
            result = Closed(path, fault=str(error))
        if result:
            closed.append(result)
    return closed


class _Records:
    """The whole records that a chunk holds: bytes, message index, schemas, channels, first and last log time."""

    def __init__(self, fd: int, begin: int, file_size: int) -> None:
        self.data = bytearray()
        self.schemas: dict[int, bytes] = {}
        self.channels: dict[int, bytes] = {}
        self.times = (2**64 - 1, 0)
        self._all: dict[int, array[int]] = {}
        self._fd = fd
        self._begin = begin
        self._file_size = file_size
        at = 0
        while end := self._next(at):
            at = end
        del self.data[at:]

    @property
    def index(self) -> dict[int, array[int]]:
        """Message index: channel -> log time and offset, in turn."""
        return {channel_id: entries for channel_id, entries in self._all.items() if entries}

    def _next(self, at: int) -> int:
        """Take the whole record at an offset; returns its end, 0 when there is none or it makes no sense."""
        if not self._have(at + HEAD.size):
            return 0
        op, length = HEAD.unpack_from(self.data, at)
        end: int = at + HEAD.size + length
        if op not in _IN_CHUNKS or not self._have(end) or length < 2:
            return 0
        taken = self._take_message(at, length) if op == _MESSAGE else self._take_declaration(op, at, end)
        return end if taken else 0

    def _have(self, size: int) -> bool:
        """Read on until that many bytes are here."""
        while len(self.data) < size:
            wanted = self._begin + size <= self._file_size
            block = os.pread(self._fd, BLOCK, self._begin + len(self.data)) if wanted else b""
            if not block:
                return False
            self.data += block
        return True

    def _take_message(self, at: int, length: int) -> bool:
        if length < MESSAGE_BODY:
            return False
        _, _, channel_id, _, log_time, _ = MESSAGE.unpack_from(self.data, at)
        entries = self._all.get(channel_id)
        if entries is None:
            return False
        entries.append(log_time)
        entries.append(at)
        first, last = self.times
        if not first <= log_time <= last:
            self.times = min(first, log_time), max(last, log_time)
        return True

    def _take_declaration(self, op: int, at: int, end: int) -> bool:
        (number,) = struct.unpack_from("<H", self.data, at + HEAD.size)
        known = self.schemas if op == Op.SCHEMA else self.channels
        known[number] = bytes(self.data[at:end])
        if op == Op.CHANNEL:
            self._all.setdefault(number, array("Q"))
        return True


class _Repair:
    """Closes one file, whose lock is held."""

    def __init__(self, path: Path, fd: int) -> None:
        self._path = path
        self._fd = fd
        self._size = os.fstat(fd).st_size
        self._summary = Summary()
        self._open_chunk: tuple[int, bytes] | None = None  # where it begins, and its head as it should be

    def run(self) -> Closed:
        """Find the end of what is good; cut there, complete the chunk and the file."""
        begin = self._header_end()
        end, tail = self._survey(begin or 0)
        self._refuse_later_chunk(end + 1)
        os.ftruncate(self._fd, end)
        if begin is None:
            end = self._write(_FILE_HEAD, 0)
        if self._open_chunk:
            self._write(self._open_chunk[1], self._open_chunk[0])
        self._write(tail + self._summary.tail(end + len(tail)), end)
        os.fsync(self._fd)
        return Closed(self._path, self._summary.counts.total(), max(self._size - end, 0))

    def _header_end(self) -> int | None:
        """End of magic and header; None when the file ends within them."""
        start = self._read(0, len(_FILE_HEAD))
        if start == _FILE_HEAD:
            return len(_FILE_HEAD)
        if not _FILE_HEAD.startswith(start):
            raise RecordingError(f"{self._path}: was not written by this program; it is left as it is")
        return None

    def _survey(self, at: int) -> tuple[int, bytes]:
        """End of the good part, and what must follow it before the summary."""
        while at and at + HEAD.size <= self._size:
            op, length = HEAD.unpack(self._read(at, HEAD.size))
            end = at + HEAD.size + length
            if op == Op.CHUNK and at + CHUNK.size <= self._size:
                end, tail = self._survey_chunk(at)
                if tail is not None:
                    return end, tail
            elif end > self._size or not self._note(op, at, end):
                break
            at = end
        return at, b""

    def _survey_chunk(self, at: int) -> tuple[int, bytes | None]:
        """End of a finished chunk and its index; of an open one the end of its records, and its index."""
        _, length, _, _, size, crc, name_length, records_size = CHUNK.unpack(self._read(at, CHUNK.size))
        if name_length:
            raise RecordingError(f"{self._path}: has a compressed chunk at byte {at}; it is left as it is")
        begin = at + CHUNK.size
        found = _Records(self._fd, begin, self._size)
        index, end = found.index, begin + len(found.data)
        if not index:
            return at, b""
        tail, offsets = self._summary.chunk_tail(end, index)
        self._summary.schemas |= found.schemas
        self._summary.channels |= found.channels
        self._summary.add_chunk(at, len(found.data), found.times, index, offsets)
        true_crc = zlib.crc32(found.data)
        told = (length, size, records_size, crc)
        if told == (CHUNK_BODY + size, len(found.data), size, true_crc) and self._read(end, len(tail)) == tail:
            return end + len(tail), None
        self._open_chunk = at, records.chunk_head(*found.times, len(found.data), true_crc)
        return end, tail

    def _note(self, op: int, at: int, end: int) -> bool:
        """Take a record outside of chunks into the summary; False when the data section ends here."""
        if op == Op.PADDING:
            return True
        if op not in (Op.ATTACHMENT, Op.METADATA):
            return False
        body = self._read(at + HEAD.size, end - at - HEAD.size)
        try:
            return self._note_attachment(at, body) if op == Op.ATTACHMENT else self._note_metadata(at, body)
        except (struct.error, UnicodeDecodeError):
            return False

    def _note_attachment(self, at: int, body: bytes) -> bool:
        (log_time,) = struct.unpack_from("<Q", body)
        name, offset = records.read_text(body, 16)
        media_type, offset = records.read_text(body, offset)
        (size,) = struct.unpack_from("<Q", body, offset)
        self._summary.add_attachment((at, HEAD.size + len(body)), log_time, size, name, media_type)
        return body[-4:] == struct.pack("<I", zlib.crc32(body[:-4]))

    def _note_metadata(self, at: int, body: bytes) -> bool:
        self._summary.add_metadata(at, HEAD.size + len(body), records.read_text(body, 0)[0])
        return True

    def _refuse_later_chunk(self, at: int) -> None:
        """What is cut off must be a torn rest: a chunk in it means that the file is damaged before it."""
        while at < self._size:
            block = self._read(at, BLOCK)
            position = -1
            while (position := block.find(Op.CHUNK, position + 1)) >= 0:
                self._refuse_chunk(at + position, self._read(at + position, CHUNK.size))
            at += len(block)

    def _refuse_chunk(self, at: int, head: bytes) -> None:
        if len(head) < CHUNK.size:
            return
        _, length, _, _, size, _, name_length, records_size = CHUNK.unpack(head)
        if (name_length, length, records_size) == (0, CHUNK_BODY + size, size) and at + CHUNK.size + size <= self._size:
            raise RecordingError(f"{self._path}: is damaged before the chunk at byte {at}; it is left as it is")

    def _read(self, at: int, size: int) -> bytes:
        return os.pread(self._fd, size, at)

    def _write(self, data: bytes, at: int) -> int:
        """Write everything; returns where it ends."""
        end = at + len(data)
        while at < end:
            at += os.pwrite(self._fd, data[len(data) - (end - at) :], at)
        return end
