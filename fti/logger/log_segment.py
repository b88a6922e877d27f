"""The part of a log that lies at one place: its files in one folder, one after another.

The next file is opened before the last one is closed, so that a medium that refuses leaves a file to write to.
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
    """The files of a log in one folder, one after another.  For one thread.

    number : of the present file
    writer : of the present file
    fault  : why the next file cannot be made or the last one not be closed; the present one goes on.  Else None.
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
        """Bring the empty file onto the medium, so that its number is not missing when that fails in its first second.

        A later file of this part becomes known when the one before it is closed.
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
        """Bytes in all files of this part."""
        return self._closed_bytes + sum(w.bytes_written for w in {*self._unclosed, self.writer})

    def free_mb(self) -> float:
        """Space left for us on the medium [MiB].  Raises StorageError."""
        return free_mb(self.folder.path)

    def stray(self) -> LostFile | None:
        """Does its path still lead to the present file?  Then None."""
        return self._path_watch.stray()

    def flush(self, *, may_split: bool = True) -> None:
        """Bring what is buffered into the file; go on to the next file when it is time.

        may_split : False while a file is being opened at another place, which a next file here would overtake
        Raises StorageError only when the file takes nothing; see ``fault`` for the rest, which the next flush tries
        again.
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
        """Bring what is in the files onto the medium.  When that fails they take nothing any more."""
        for writer in (*self._unclosed, self.writer):
            writer.sync()

    def close(self) -> None:
        """Finish all files.  When the medium refuses they are released as they are, and StorageError is raised."""
        refusal: StorageError | None = None
        for writer in dict.fromkeys((*self._unclosed, self.writer)):
            try:
                writer.close()
            except StorageError as error:  # the others may have better luck
                refusal = refusal or error
        self.abandon()
        if refusal:
            raise refusal

    def abandon(self) -> None:
        """Release all files as they are; a later repair closes them."""
        for writer in {*self._unclosed, self.writer}:
            writer.abandon()

    def discard(self) -> None:
        """Remove the only file, into which nothing was written."""
        self.writer.abandon()
        with contextlib.suppress(OSError):
            self.path.unlink()
        self._log_layout.numbering.release_number(self.number)

    def copy_deleted_file(self, folder: SessionFolder) -> Path:
        """Close the present file, which was deleted, and write it again in a folder; returns its path.

        Its content is there as long as it is open.  Raises StorageError.
        """
        rescued = folder.file_path(self._log_layout.kind, self.number)
        fd = os.dup(self.writer.fileno())
        try:
            self.close()
            with os.fdopen(create_file(rescued), "wb") as copy:
                at = 0
                while block := os.pread(fd, COPY_BLOCK_BYTES, at):
                    at += copy.write(block)
                copy.flush()
                os.fsync(copy.fileno())
        except OSError as error:
            raise StorageError(f"{rescued}: cannot be written again: {error.strerror}") from error
        finally:
            os.close(fd)
        return rescued

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
