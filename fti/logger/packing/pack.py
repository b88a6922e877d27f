"""Packing of finished files with zstd chunks, and restoration of the same bytes.

The new file is written to the same folder under another name and read back.  It replaces the old file only if it
restores the original byte for byte.  An interruption at any moment leaves one complete file.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from fti.errors import RecordingError, StorageError
from fti.logger.folder_sync import sync_folder
from fti.logger.lock import exclusive_lock
from fti.logger.packing.restore_layout import restore_original
from fti.logger.packing.writer import LAYOUT, METADATA, Packer
from fti.logger.reading.mcap_file import has_footer
from fti.logger.reading.record_cursor import attachment_content, metadata_table
from fti.logger.reading.record_validation import valid_record, valid_records
from fti.logger.reading.summary_index import SummaryIndex, read_summary_index
from fti.logger.reading.tolerant_file import TolerantFile
from fti.logger.records import MAGIC, Op

Progress = Callable[[int], None]


@dataclass(frozen=True, slots=True)
class PackResult:
    """Size of a file before and after [B]."""

    path: Path
    before: int
    after: int


@dataclass(frozen=True, slots=True)
class _OriginalInfo:
    """Data of a packed file on its original; layout_at : where its records end."""

    sha256: str
    layout_at: int
    layout: bytes


def pack(path: Path, progress: Progress) -> PackResult | None:
    """Pack one file; None when it is packed already.

    progress : called with the processed bytes of the original, which are written and then read back.
    Raises RecordingError when the file is not finished, damaged or cannot be packed reversibly; StorageError when it
    is being written or the medium refuses.  The file is then unchanged.
    """
    return _replace_file(path, lambda source, part: _pack(source, part, progress))


def unpack(path: Path, progress: Progress) -> PackResult | None:
    """Restore the original of a packed file; None when it is not packed.  Raises as ``pack``."""
    return _replace_file(path, lambda source, part: _unpack(source, part, progress))


# -------------------------------------------------------------------------------------------------------- replacing


def _replace_file(path: Path, write: Callable[[TolerantFile, Path], bool]) -> PackResult | None:
    """Let ``write`` create a new file and replace the old one; ``write`` returns False when nothing is to be done."""
    target = path.resolve()
    part = target.with_name(f".{target.name}.part")
    if not has_footer(target):
        hint = f"when no recorder writes it, close it with: fti recover {path} --in-place"
        raise RecordingError(f"{path}: is not finished; {hint}")
    with exclusive_lock(target) as fd, TolerantFile(target) as source:
        if not os.path.samestat(os.fstat(fd), target.stat()):
            raise StorageError(f"{path}: has just been replaced by another process")
        try:
            part.unlink(missing_ok=True)  # of a run that was killed
            written = write(source, part)
            if source.unreadable:
                raise RecordingError(f"{path}: has unreadable bytes; the file is unchanged; see fti recover")
            return _put_in_place(source, part) if written else None
        except OSError as error:
            raise StorageError(f"{path}: cannot be rewritten: {error.strerror}; the file is unchanged") from error
        finally:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)


def _put_in_place(source: TolerantFile, part: Path) -> PackResult:
    path, before, after = source.path, source.size, part.stat().st_size
    shutil.copystat(path, part)
    with contextlib.suppress(PermissionError):
        os.chown(part, path.stat().st_uid, path.stat().st_gid)
    part.replace(path)
    with contextlib.suppress(OSError):  # some file systems cannot sync a folder; the old or the new name remains
        sync_folder(path.parent)
    return PackResult(path, before, after)


def _sync_stream(stream: BinaryIO) -> None:
    stream.flush()
    os.fsync(stream.fileno())


# ---------------------------------------------------------------------------------------------------------- packing


def _pack(source: TolerantFile, part: Path, progress: Progress) -> bool:
    summary = _read_summary(source)
    if METADATA in summary.named:
        return False
    with part.open("xb") as stream:
        sha256 = Packer(source, summary.data_end, stream, progress).run()
        _sync_stream(stream)
    with TolerantFile(part) as packed:
        _verify_packed(source, packed, sha256, lambda done: progress(source.size + done))
    return True


# ---------------------------------------------------------------------------------------------------------- proving


def _read_summary(source: TolerantFile) -> SummaryIndex:
    """The summary.  Raises RecordingError."""
    summary = read_summary_index(source)
    if summary is None or summary.shift:
        raise RecordingError(f"{source.path}: its summary is damaged; see fti recover")
    return summary


def _read_original_info(source: TolerantFile) -> _OriginalInfo | None:
    """Data of a packed file on its original; None when it is not packed."""
    summary = _read_summary(source)
    if METADATA not in summary.named:
        return None
    try:
        _, original_info = metadata_table(_record(source, summary.named[METADATA]))
        layout_at = summary.named[LAYOUT]
        _, layout = attachment_content(_record(source, layout_at))
        return _OriginalInfo(original_info["sha256"], layout_at, layout)
    except (ValueError, KeyError, struct.error):
        raise RecordingError(f"{source.path}: its data on the original are damaged; see fti recover") from None


def _record(source: TolerantFile, at: int) -> bytes:
    record = valid_record(source, at, source.size)
    if record is None:
        raise ValueError(f"the record at byte {at} is damaged")
    return source.read(at, record.end - at)


def _iter_original(source: TolerantFile, original_info: _OriginalInfo, progress: Progress) -> Iterator[bytes]:
    done = 0
    for data in restore_original(source, len(MAGIC), original_info.layout_at, original_info.layout):
        yield data
        done += len(data)
        progress(done)


def _verify_packed(source: TolerantFile, packed: TolerantFile, sha256: str, progress: Progress) -> None:
    """Check that the packed file is valid and restores the original.  Raises RecordingError."""
    original_info = _read_original_info(packed)
    found = hashlib.sha256()
    for data in _iter_original(packed, original_info, progress) if original_info else ():
        found.update(data)
    if not (
        original_info
        and original_info.sha256 == sha256 == found.hexdigest()
        and _is_completely_readable(packed, _read_summary(packed))
    ):
        raise RecordingError(f"{source.path}: cannot be packed reversibly; the file is unchanged")


def _is_completely_readable(packed: TolerantFile, summary: SummaryIndex) -> bool:
    """Do valid records fill the file, and is there a chunk at every offset in the summary?"""
    found = list(valid_records(packed, len(MAGIC), summary.data_end))
    chunks = {record.at for record in found if record.op == Op.CHUNK}
    return found[-1].end == summary.data_end and {chunk.offset for chunk in summary.chunks} <= chunks


# -------------------------------------------------------------------------------------------------------- unpacking


def _unpack(source: TolerantFile, part: Path, progress: Progress) -> bool:
    original_info = _read_original_info(source)
    if original_info is None:
        return False
    found = hashlib.sha256()
    with part.open("xb") as stream:
        for data in _iter_original(source, original_info, progress):
            stream.write(data)
            found.update(data)
        _sync_stream(stream)
    if found.hexdigest() != original_info.sha256:
        text = "the unpacked content does not match the original's checksum; the file is unchanged"
        raise RecordingError(f"{source.path}: {text}; see fti recover")
    return True
