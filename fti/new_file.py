"""Output files of commands: each is new, and no file is overwritten."""

from __future__ import annotations

from pathlib import Path

from fti.errors import StorageError


def write_new_file(file: Path, data: bytes) -> None:
    """Write a file that must not exist, and make its folder.  Raises StorageError."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("xb") as out:
            out.write(data)
    except OSError as error:
        raise StorageError(f"{error.filename or file}: cannot be written: {error.strerror}") from error
