"""Closing of files after a kill or a power cut: in place and without loss of a byte.

The last chunk keeps every whole record and gets its size, times and checksum; the file gets message index, summary and
footer.  Other bytes after these records, except zeros, are first saved in a file in the same folder.  The metadata
``fti.closed`` count the unverified messages.  A file with other damage stays unchanged.  A killed repair can be
repeated, because the footer is written last.
"""

from __future__ import annotations

import copy
import glob
import itertools
import os
import zlib
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from pathlib import Path

from fti.errors import FtiError, StorageError
from fti.logger import records
from fti.logger.file_mode import create_file
from fti.logger.folder_sync import sync_folder
from fti.logger.lock import exclusive_lock, is_being_written
from fti.logger.log_layout import CLOSED_METADATA
from fti.logger.metadata_checksum import with_own_checksum
from fti.logger.reading.mcap_file import has_footer
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import MAGIC
from fti.logger.recovery.unfinished_file import UnfinishedFile, inspect_unfinished

_FILE_HEAD = records.file_head()


@dataclass(frozen=True, slots=True)
class CloseResult:
    """Result for one unfinished file.

    unverified      : messages without a checksum; unverified_ns : log time of the first of them
    missing_bytes : bytes that were written at its end and are missing, damaged or zero
    rest_file     : file with the bytes that are not whole records; rest_bytes : its size
    fault         : why the file was not closed; None when it is closed
    """

    path: Path
    messages: int = 0
    unverified: int = 0
    unverified_ns: int | None = None
    missing_bytes: int = 0
    rest_file: Path | None = None
    rest_bytes: int = 0
    fault: str | None = None

    def describe_loss(self) -> str:
        """Text on unverified, missing or saved data, or the fault; empty without any."""
        if self.fault:
            return self.fault
        parts = [f"{self.unverified} messages at its end are unverified"] if self.unverified else []
        if self.missing_bytes:
            parts.append(f"{self.missing_bytes} bytes at its end are missing or damaged")
        if self.rest_file:
            parts.append(f"{self.rest_bytes} bytes behind its last readable record are saved in {self.rest_file.name}")
        return f"{self.path}: closed; {', '.join(parts)}" if parts else ""


def close_unfinished(path: str | Path) -> CloseResult | None:
    """Close a file that has no footer; None when it has one.

    Raises StorageError when the file is being written or the medium refuses, RecordingError when the file is damaged
    in its middle or is not a recording of this program; the file is then unchanged.
    """
    file = Path(path)
    if has_footer(file):
        return None
    with exclusive_lock(file) as fd, TolerantFile(file) as source:
        try:
            return _FileCloser(file, fd, inspect_unfinished(source), source.size).run()
        except OSError as error:
            raise StorageError(f"{file}: cannot be closed: {error.strerror}") from error


def close_all(
    directory: str | Path, in_use: Collection[Path] = (), should_continue: Callable[[], bool] = lambda: True
) -> list[CloseResult]:
    """Close every unfinished file in the session folders of a directory.

    in_use : session folders to skip; should_continue : called before each file; False skips the rest.
    Files that another process writes are skipped too.
    """
    skipped = {folder.resolve() for folder in in_use}
    paths = sorted(Path(directory).glob("*/*.mcap"))
    return _close_each(path for path in paths if path.parent.resolve() not in skipped and should_continue())


def close_session(folder: Path) -> list[CloseResult]:
    """Close every unfinished file of a session folder, except those that another process writes."""
    return _close_each(sorted(folder.glob("*.mcap")))


def _close_each(paths: Iterable[Path]) -> list[CloseResult]:
    closed = []
    for path in paths:
        if is_being_written(path):
            continue
        try:
            result = close_unfinished(path)
        except FtiError as error:
            result = CloseResult(path, fault=str(error))
        if result:
            closed.append(result)
    return closed


class _FileCloser:
    def __init__(self, path: Path, fd: int, inspection: UnfinishedFile, size: int) -> None:
        self._path = path
        self._fd = fd
        self._inspection = inspection
        self._size = size
        self._end = inspection.end

    def run(self) -> CloseResult:
        """Save the rest, then write the tail, the chunk's head and the footer, in this order."""
        inspection = self._inspection
        begin = _FILE_HEAD if not inspection.begin else b""
        self._end = inspection.end or len(begin)
        rest_file = self._save_rest()
        tail = self._tail(rest_file)
        os.ftruncate(self._fd, inspection.end)
        self._write(begin, 0)
        self._write(tail[: -len(MAGIC)], self._end)
        os.fsync(self._fd)
        if inspection.head and inspection.chunk:
            content = inspection.chunk.content
            self._write(records.chunk_head(*content.times, content.end, zlib.crc32(content.data)), inspection.head.at)
            os.fsync(self._fd)
        self._write(tail[-len(MAGIC) :], self._end + len(tail) - len(MAGIC))
        os.fsync(self._fd)
        return self._result(rest_file)

    def _result(self, rest_file: Path | None) -> CloseResult:
        chunk = self._inspection.chunk
        return CloseResult(
            self._path,
            self._inspection.summary.counts.total(),
            chunk.unverified if chunk else 0,
            chunk.unverified_ns if chunk else None,
            self._inspection.missing_bytes,
            rest_file,
            rest_file.stat().st_size if rest_file else 0,
        )

    def _save_rest(self) -> Path | None:
        """Save the bytes to be cut off in another file, except zeros and the begin of the tail to be written.

        Returns that file, or the one of an earlier, killed repair.
        """
        rest = os.pread(self._fd, self._size - self._inspection.end, self._inspection.end)
        earlier = next(iter(self._path.parent.glob(f"{glob.escape(self._path.stem)}.rest-at-*.bin")), None)
        index = self._inspection.message_index
        closed = index + self._inspection.summary.tail(self._end + len(index))
        expected = (closed, self._tail(earlier)) if self._inspection.begin else (_FILE_HEAD,)
        if not rest.strip(b"\0") or any(tail.startswith(rest) for tail in expected):
            return earlier
        rest_file = self._rest_path(rest)
        draft = rest_file.with_name(f".{rest_file.name}.part")
        draft.unlink(missing_ok=True)
        with os.fdopen(create_file(draft), "wb") as stream:
            stream.write(rest)
            stream.flush()
            os.fsync(stream.fileno())
        draft.replace(rest_file)
        sync_folder(rest_file.parent)
        return rest_file

    def _rest_path(self, rest: bytes) -> Path:
        """Path of the saved rest: a new file, or one with the same bytes.  Other saved files are not overwritten."""
        name = f"{self._path.stem}.rest-at-{self._inspection.end}"
        suffixes = itertools.chain([""], (f"-{number}" for number in itertools.count(2)))
        paths = (self._path.with_name(f"{name}{suffix}.bin") for suffix in suffixes)
        return next(p for p in paths if not os.path.lexists(p) or (p.is_file() and p.read_bytes() == rest))

    def _tail(self, rest_file: Path | None) -> bytes:
        """The data after the records: message index, ``fti.closed``, summary, footer."""
        index, record = self._inspection.message_index, b""
        summary = copy.deepcopy(self._inspection.summary)
        if not self._inspection.data_ended and CLOSED_METADATA not in self._inspection.tables:
            record = records.metadata(CLOSED_METADATA, with_own_checksum(CLOSED_METADATA, self._table(rest_file)))
            summary.add_metadata(self._end + len(index), len(record), CLOSED_METADATA)
        return index + record + summary.tail(self._end + len(index) + len(record))

    def _table(self, rest_file: Path | None) -> dict[str, str]:
        chunk = self._inspection.chunk
        table = {"unproved_messages": str(chunk.unverified if chunk else 0)}
        if chunk and chunk.unverified_ns is not None:
            table["unproved_from_ns"] = str(chunk.unverified_ns)
        table["missing_bytes"] = str(self._inspection.missing_bytes)
        if rest_file:
            table["kept_file"] = rest_file.name
        return table

    def _write(self, data: bytes, at: int) -> None:
        """Write everything."""
        end = at + len(data)
        while at < end:
            at += os.pwrite(self._fd, data[len(data) - (end - at) :], at)
