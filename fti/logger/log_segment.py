"""Segment of a log: its consecutive files in one folder.

The next file is opened before the previous one is closed, so that a file stays open if the medium refuses the next.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from fti.errors import StorageError
from fti.logger.file_mode import create_file
from fti.logger.log_layout import LogLayout
from fti.logger.session import SessionFolder
from fti.logger.storage_target import LostFile, PathWatch, free_mb
from fti.logger.stream_writer import StreamWriter

COPY_BLOCK_BYTES = 2**20


class LogSegment:
    """The consecutive files of a log in one folder.  For one thread.

    number : of the current file
    writer : of the current file
    fault  : why the next file cannot be created or the previous one cannot be closed; else None.  Writing continues.
    """

    def __init__(self, log_layout: LogLayout, folder: SessionFolder) -> None:
        self._log_layout = log_layout
        self.folder = folder
        self._unclosed: list[StreamWriter] = []
        self._closed_bytes = 0
        self.fault: str | None = None
        self.number, self.writer = self._open_next()
        self._sync_new_file()
        self._path_watch = PathWatch(self.path, self.writer.fileno())

    def _sync_new_file(self) -> None:
        """Sync the empty file, so that its number is not missing if the medium fails within the first second.

        Later files of this segment are synced when the previous one is closed.
        """
        try:
            self.writer.sync()
        except StorageError:
            self.discard()
            raise

    @property
    def path(self) -> Path:
        """The file that is being written."""
        return self.writer.path

    @property
    def bytes_written(self) -> int:
        """Bytes in all files of this segment."""
        return self._closed_bytes + sum(w.bytes_written for w in {*self._unclosed, self.writer})

    def free_mb(self) -> float:
        """Free space on the medium [MiB].  Raises StorageError."""
        return free_mb(self.folder.path)

    def find_lost_file(self) -> LostFile | None:
        """The current file if its path no longer leads to it; else None."""
        return self._path_watch.find_lost_file()

    def flush(self, *, may_split: bool = True) -> None:
        """Write the buffer to the file; switch to the next file at a split limit.

        may_split : False while a file is being opened on another target, which a next file here would supersede
        Raises StorageError only when the file accepts no bytes.  Other errors are in ``fault``; the next flush retries.
        """
        self.writer.flush()
        try:
            self._close_old()
            if may_split and self._log_layout.is_full(self.writer):
                self._split()
        except StorageError as error:
            self.fault = str(error)
        else:
            self.fault = None

    def sync(self) -> None:
        """Sync the files to the medium.  After an error they accept no more bytes."""
        for writer in (*self._unclosed, self.writer):
            writer.sync()

    def close(self) -> None:
        """Finish all files.  Raises StorageError when the medium refuses; the files are then released unfinished."""
        refusal: StorageError | None = None
        for writer in dict.fromkeys((*self._unclosed, self.writer)):
            try:
                writer.close()
            except StorageError as error:  # the other files may still be closed
                refusal = refusal or error
        self.abandon()
        if refusal:
            raise refusal

    def abandon(self) -> None:
        """Release all files unfinished; a later repair closes them."""
        for writer in {*self._unclosed, self.writer}:
            writer.abandon()

    def discard(self) -> None:
        """Remove the only file, which holds no messages."""
        self.writer.abandon()
        with contextlib.suppress(OSError):
            self.path.unlink()
        self._log_layout.numbering.release_number(self.number)

    def copy_deleted_file(self, folder: SessionFolder) -> Path:
        """Close the current, deleted file and copy it to a folder; returns the path of the copy.

        The content exists as long as the file is open.  Raises StorageError.
        """
        copy_path = folder.file_path(self._log_layout.kind, self.number)
        fd = os.dup(self.writer.fileno())
        try:
            self.close()
            with os.fdopen(create_file(copy_path), "wb") as copy:
                at = 0
                while block := os.pread(fd, COPY_BLOCK_BYTES, at):
                    at += copy.write(block)
                copy.flush()
                os.fsync(copy.fileno())
        except OSError as error:
            raise StorageError(f"{copy_path}: cannot be copied: {error.strerror}") from error
        finally:
            os.close(fd)
        return copy_path

    def _split(self) -> None:
        number, fresh = self._open_next()
        self._log_layout.declare(fresh)
        self._log_layout.numbering.confirm(number)
        self._unclosed.append(self.writer)
        self.number, self.writer = number, fresh
        self._path_watch = PathWatch(self.path, fresh.fileno())
        self._close_old()

    def _close_old(self) -> None:
        while self._unclosed:
            self._unclosed[0].close()
            if self._unclosed[0] is not self.writer:
                self._closed_bytes += self._unclosed[0].bytes_written
            del self._unclosed[0]

    def _open_next(self) -> tuple[int, StreamWriter]:
        numbering = self._log_layout.numbering
        number = numbering.allocate(self.folder, self._log_layout.kind)
        try:
            writer = StreamWriter(self.folder.file_path(self._log_layout.kind, number))
        except StorageError:
            numbering.release_number(number)
            raise
        try:
            self._log_layout.write_head(writer, self.folder.name, number)
        except StorageError:
            writer.abandon()
            with contextlib.suppress(OSError):
                writer.path.unlink()  # it holds nothing that is not in the other files
            numbering.release_number(number)
            raise
        return number, writer
