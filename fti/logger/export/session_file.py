"""``session.json``: metadata of the session of the tables in a folder."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from fti.errors import StorageError

NAME = "session.json"


def check(folder: Path, session_metadata: Mapping[str, str]) -> None:
    """Check that the folder has no tables of another session or another part of it.  Raises StorageError."""
    path = folder / NAME
    try:
        if path.read_text(encoding="utf-8") != _text(session_metadata):
            raise StorageError(f"{path}: the tables in this folder belong to another session; choose another --out")
    except FileNotFoundError:
        pass
    except (OSError, UnicodeDecodeError) as error:
        raise StorageError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None


def write(folder: Path, session_metadata: Mapping[str, str]) -> None:
    """Write ``session.json``, which may exist with the same content.  Raises OSError."""
    draft = folder / f"{NAME}.part"
    try:
        draft.write_text(_text(session_metadata), encoding="utf-8")
        draft.rename(folder / NAME)
    finally:
        draft.unlink(missing_ok=True)


def _text(session_metadata: Mapping[str, str]) -> str:
    return f"{json.dumps(session_metadata, indent=1)}\n"
