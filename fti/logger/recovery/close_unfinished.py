"""Closing files that a kill or a power cut left open: in place, and without taking a byte away.

The last chunk keeps every whole record that is there, gets its size, times and checksum, and the file its message
index, summary and footer.  Bytes behind these records that are neither zeros nor what is written there are first saved
in a file beside it.  What no checksum proves is counted in the metadata ``fti.closed``.  A file that is damaged
elsewhere is left as it is.  A killed repair can be repeated: the footer comes last.
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
    """What became of an unfinished file.

    unproved      : messages that no checksum proves; unproved_ns : log time of the first of them
    missing_bytes : that are known to have been written at its end, and are missing, damaged or zero
    kept          : file beside it with bytes that are no whole records; kept_bytes : its size
    fault         : why the file was left alone; None when it is closed
    """

    path: Path
    messages: int = 0
    unproved: int = 0
    unproved_ns: int | None = None
    missing_bytes: int = 0
    kept: Path | None = None
    kept_bytes: int = 0
    fault: str | None = None

    def describe_loss(self) -> str:
        """Why not everything is closed and proved; empty when it is."""
        if self.fault:
            return self.fault
        parts = [f"{self.unproved} messages at its end are unproved"] if self.unproved else []
        if self.missing_bytes:
            parts.append(f"{self.missing_bytes} bytes at its end are missing or damaged")
        if self.kept:
            parts.append(f"{self.kept_bytes} bytes behind its last readable record are saved in {self.kept.name}")
        return f"{self.path}: closed; {', '.join(parts)}" if parts else ""


def close_unfinished(path: str | Path) -> CloseResult | None:
    """Close a file that has no footer; None when it has one.

    Raises StorageError when the file is being written or the medium refuses, RecordingError when the file is damaged
    in its middle or is no recording of this program; it is then as it was.
    """
    place = Path(path)
    if has_footer(place):
        return None
    with exclusive_lock(place) as fd, TolerantFile(place) as source:
        try:
            return _FileCloser(place, fd, inspect_unfinished(source), source.size).run()
        except OSError as error:
            raise StorageError(f"{place}: cannot be closed: {error.strerror}") from error


def close_all(
    directory: str | Path, in_use: Collection[Path] = (), should_continue: Callable[[], bool] = lambda: True
) -> list[CloseResult]:
    """Close every unfinished file in the session folders of a directory.

    in_use : session folders to leave alone; goes_on : asked before each file; False leaves the rest for later.
    Files that another process writes are left alone too.
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
    """Closes one file, whose lock is held."""

    def __init__(self, path: Path, fd: int, found: UnfinishedFile, size: int) -> None:
        self._path = path
        self._fd = fd
        self._found = found
        self._size = size
        self._end = found.end

    def run(self) -> CloseResult:
        """Save the rest, then write what comes behind the records, then the chunk's head, then the footer."""
        found = self._found
        begin = _FILE_HEAD if not found.begin else b""
        self._end = found.end or len(begin)
        kept = self._keep_rest()
        tail = self._tail(kept)
        os.ftruncate(self._fd, found.end)
        self._write(begin, 0)
        self._write(tail[: -len(MAGIC)], self._end)
        os.fsync(self._fd)
        if found.head and found.chunk:
            content = found.chunk.content
            self._write(records.chunk_head(*content.times, content.end, zlib.crc32(content.data)), found.head.at)
            os.fsync(self._fd)
        self._write(tail[-len(MAGIC) :], self._end + len(tail) - len(MAGIC))
        os.fsync(self._fd)
        return self._result(kept)

    def _result(self, kept: Path | None) -> CloseResult:
        chunk = self._found.chunk
        return CloseResult(
            self._path,
            self._found.summary.counts.total(),
            chunk.unproved if chunk else 0,
            chunk.unproved_ns if chunk else None,
            self._found.missing_bytes,
            kept,
            kept.stat().st_size if kept else 0,
        )

    def _keep_rest(self) -> Path | None:
        """Save what is cut off in a file beside this one; not zeros, nor the begin of what will be written there.

        Returns that file, or the one that a repair has saved before it was killed.
        """
        rest = os.pread(self._fd, self._size - self._found.end, self._found.end)
        before = next(iter(self._path.parent.glob(f"{glob.escape(self._path.stem)}.rest-at-*.bin")), None)
        index = self._found.message_index
        closed = index + self._found.summary.tail(self._end + len(index))
        expected = (closed, self._tail(before)) if self._found.begin else (_FILE_HEAD,)
        if not rest.strip(b"\0") or any(tail.startswith(rest) for tail in expected):
            return before
        kept = self._rest_path(rest)
        draft = kept.with_name(f".{kept.name}.part")
        draft.unlink(missing_ok=True)
        with os.fdopen(create_file(draft), "wb") as stream:
            stream.write(rest)
            stream.flush()
            os.fsync(stream.fileno())
        draft.replace(kept)
        sync_folder(kept.parent)
        return kept

    def _rest_path(self, rest: bytes) -> Path:
        """Where the rest is saved: a new file, or one with the same bytes; another rest that was saved here stays."""
        name = f"{self._path.stem}.rest-at-{self._found.end}"
        suffixes = itertools.chain([""], (f"-{number}" for number in itertools.count(2)))
        paths = (self._path.with_name(f"{name}{suffix}.bin") for suffix in suffixes)
        return next(p for p in paths if not os.path.lexists(p) or (p.is_file() and p.read_bytes() == rest))

    def _tail(self, kept: Path | None) -> bytes:
        """What comes behind the records: message index, what was found, summary, footer."""
        index, record = self._found.message_index, b""
        summary = copy.deepcopy(self._found.summary)
        if not self._found.data_ended and CLOSED_METADATA not in self._found.tables:
            record = records.metadata(CLOSED_METADATA, with_own_checksum(CLOSED_METADATA, self._table(kept)))
            summary.add_metadata(self._end + len(index), len(record), CLOSED_METADATA)
        return index + record + summary.tail(self._end + len(index) + len(record))

    def _table(self, kept: Path | None) -> dict[str, str]:
        chunk = self._found.chunk
        table = {"unproved_messages": str(chunk.unproved if chunk else 0)}
        if chunk and chunk.unproved_ns is not None:
            table["unproved_from_ns"] = str(chunk.unproved_ns)
        table["missing_bytes"] = str(self._found.missing_bytes)
        if kept:
            table["kept_file"] = kept.name
        return table

    def _write(self, data: bytes, at: int) -> None:
        """Write everything."""
        end = at + len(data)
        while at < end:
            at += os.pwrite(self._fd, data[len(data) - (end - at) :], at)
