"""Packing of finished files: zstd chunks, and back to the same bytes.

The new file is written beside the old one under another name, read back, and takes its place only when it is proved
to give the original byte for byte.  An interruption at any moment leaves one of the two, whole.
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
from fti.logger.lock import locked
from fti.logger.packing.layout import original
from fti.logger.packing.writer import LAYOUT, METADATA, Packer
from fti.logger.reading.mcap_file import has_footer
from fti.logger.reading.source import Source
from fti.logger.reading.structure import chunk_head, record_end
from fti.logger.reading.tables import metadata_table
from fti.logger.reading.told import Told, read_told
from fti.logger.records import HEAD, MAGIC, read_text

Progress = Callable[[int], None]


@dataclass(frozen=True, slots=True)
class Packed:
    """What became of a file: its size before and after [B]."""

    path: Path
    before: int
    after: int


@dataclass(frozen=True, slots=True)
class _About:
    """What a packed file tells of its original; layout_at : where its records end."""

    sha256: str
    layout_at: int
    layout: bytes


def pack(path: Path, progress: Progress) -> Packed | None:
    """Pack one file; None when it is packed already.

    progress : called now and then with the bytes of the original that are done, twice: written, and read back.
    Raises RecordingError when the file is not finished, damaged or cannot be packed reversibly; StorageError when it
    is being written or the medium refuses.  It is then as it was.
    """
    return _replaced(path, lambda source, part: _pack(source, part, progress))


def unpack(path: Path, progress: Progress) -> Packed | None:
    """Make a packed file the original again; None when it is not packed.  Raises as ``pack``."""
    return _replaced(path, lambda source, part: _unpack(source, part, progress))


# -------------------------------------------------------------------------------------------------------- replacing


def _replaced(path: Path, write: Callable[[Source, Path], bool]) -> Packed | None:
    """Let ``write`` make a new file beside the old one, and put it in its place; False from it: there is no need."""
    place = path.resolve()
    part = place.with_name(f".{place.name}.part")
    if not has_footer(place):
        raise RecordingError(f"{path}: is not finished; when nothing records into it: fti recover {path} --in-place")
    with locked(place) as fd, Source(place) as source:
        if not os.path.samestat(os.fstat(fd), place.stat()):
            raise StorageError(f"{path}: has just been replaced by another process")
        try:
            part.unlink(missing_ok=True)  # of a run that was killed
            written = write(source, part)
            if source.unreadable:
                raise RecordingError(f"{path}: cannot be read everywhere; it is as it was; see fti recover")
            return _put_in_place(source, part) if written else None
        except OSError as error:
            raise StorageError(f"{path}: cannot be rewritten: {error.strerror}; it is as it was") from error
        finally:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)


def _put_in_place(source: Source, part: Path) -> Packed:
    path, before, after = source.path, source.size, part.stat().st_size
    shutil.copystat(path, part)
    with contextlib.suppress(PermissionError):
        os.chown(part, path.stat().st_uid, path.stat().st_gid)
    part.replace(path)
    with contextlib.suppress(OSError):  # some file systems have nothing to sync there; the old or the new name stands
        sync_folder(path.parent)
    return Packed(path, before, after)


def _onto_medium(stream: BinaryIO) -> None:
    stream.flush()
    os.fsync(stream.fileno())


# ---------------------------------------------------------------------------------------------------------- packing


def _pack(source: Source, part: Path, progress: Progress) -> bool:
    told = _told(source)
    if METADATA in told.named:
        return False
    with part.open("xb") as stream:
        sha256 = Packer(source, told.data_end, stream, progress).run()
        _onto_medium(stream)
    with Source(part) as packed:
        _prove(source, packed, sha256, lambda done: progress(source.size + done))
    return True


# ---------------------------------------------------------------------------------------------------------- proving


def _told(source: Source) -> Told:
    """The summary.  Raises RecordingError."""
    told = read_told(source)
    if told is None or told.shift:
        raise RecordingError(f"{source.path}: its summary is damaged; see fti recover")
    return told


def _about(source: Source) -> _About | None:
    """What a packed file tells of its original; None when it is not packed."""
    told = _told(source)
    if METADATA not in told.named:
        return None
    try:
        _, about = metadata_table(_record(source, told.named[METADATA]))
        layout_at = told.named[LAYOUT]
        return _About(about["sha256"], layout_at, _attached(_record(source, layout_at)))
    except (ValueError, KeyError, struct.error):
        raise RecordingError(f"{source.path}: what it tells of its original is damaged; see fti recover") from None


def _record(source: Source, at: int) -> bytes:
    end = record_end(source, at, source.size)
    if end is None:
        raise ValueError(f"the record at byte {at} is damaged")
    return source.read(at, end - at)


def _attached(attachment: bytes) -> bytes:
    """The content of an attachment record."""
    _, at = read_text(attachment, HEAD.size + 16)
    _, at = read_text(attachment, at)
    return attachment[at + 8 : -4]


def _unpacked(source: Source, about: _About, progress: Progress) -> Iterator[bytes]:
    done = 0
    for data in original(source, len(MAGIC), about.layout_at, about.layout):
        yield data
        done += len(data)
        progress(done)


def _prove(source: Source, packed: Source, sha256: str, progress: Progress) -> None:
    """Does the packed file, as it lies there, give the original, and is it sound?  Raises RecordingError."""
    about = _about(packed)
    found = hashlib.sha256()
    for data in _unpacked(packed, about, progress) if about else ():
        found.update(data)
    if not (about and about.sha256 == sha256 == found.hexdigest() and _leads_to_the_end(packed, _told(packed))):
        raise RecordingError(f"{source.path}: cannot be packed so that it can be unpacked again; it is as it was")


def _leads_to_the_end(packed: Source, told: Told) -> bool:
    """Do sound records fill the file, and is there a chunk wherever the summary tells of one?"""
    at: int | None = len(MAGIC)
    chunks = set()
    while at is not None and at < told.data_end:
        if chunk_head(packed, at):
            chunks.add(at)
        at = record_end(packed, at, told.data_end)
    return at == told.data_end and {chunk.offset for chunk in told.chunks} <= chunks


# -------------------------------------------------------------------------------------------------------- unpacking


def _unpack(source: Source, part: Path, progress: Progress) -> bool:
    about = _about(source)
    if about is None:
        return False
    found = hashlib.sha256()
    with part.open("xb") as stream:
        for data in _unpacked(source, about, progress):
            stream.write(data)
            found.update(data)
        _onto_medium(stream)
    if found.hexdigest() != about.sha256:
        raise RecordingError(f"{source.path}: does not give the original's checksum; it is as it was; see fti recover")
    return True
