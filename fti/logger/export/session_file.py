"""``session.json``: of which session the tables in a folder are, for kinds of tables that cannot say it themselves."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from fti.errors import StorageError

NAME = "session.json"


def check(folder: Path, session_metadata: Mapping[str, str]) -> None:
    """Raises StorageError when the folder has tables of another session, or of another part of it."""
    path = folder / NAME
    try:
        if path.read_text(encoding="utf-8") != _text(session_metadata):
            raise StorageError(f"{path}: the tables in this folder are of another session; choose another --out")
    except FileNotFoundError:
        pass
    except (OSError, UnicodeDecodeError) as error:
        raise StorageError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None


def write(folder: Path, session_metadata: Mapping[str, str]) -> None:
    """Write it, or write the same again.  Raises OSError."""
    draft = folder / f"{NAME}.part"
    try:
        draft.write_text(_text(session_metadata), encoding="utf-8")
        draft.rename(folder / NAME)
    finally:
        draft.unlink(missing_ok=True)


def _text(session_metadata: Mapping[str, str]) -> str:
    return f"{json.dumps(session_metadata, indent=1)}\n"
