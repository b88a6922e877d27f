"""Check of the path of a session, with suggestions for a wrong one."""

from __future__ import annotations

import difflib
from pathlib import Path

from fti.errors import MissingError
from fti.logger.records import MAGIC
from fti.logger.regular_file import mcap_files, open_regular, why_not_regular

MAX_LISTED = 5


def check_session_path(place: Path) -> None:
    """Check for a folder with MCAP files, or a file with such a begin or suffix.  Raises MissingError."""
    if place.is_dir():
        if not any(mcap_files(place)):
            raise MissingError(f"{place}: holds no MCAP files{_sessions_in(place)}")
    elif place.exists() and (why_not := why_not_regular(place)):
        raise MissingError(f"{place}: {why_not}")
    elif not place.is_file():
        raise MissingError(f"{place}: there is no such session folder or file{_similar_names(place)}")
    elif place.suffix != ".mcap" and not _begins_as_mcap(place):
        raise MissingError(f"{place}: is not an MCAP file")


def holds_recording(place: Path) -> bool:
    """Is the path a folder with MCAP files, or such a file?"""
    try:
        check_session_path(place)
    except MissingError:
        return False
    return True


def _sessions_in(folder: Path) -> str:
    """The sessions in a folder of sessions, the newest first."""
    try:
        found = {path.parent for path in folder.glob("*/*.mcap")}
    except OSError:
        return ""
    newest = sorted(found, key=lambda path: path.stat().st_mtime, reverse=True)
    return f", but sessions: {_join_names([str(path) for path in newest])}" if newest else ""


def _similar_names(place: Path) -> str:
    """Paths in the same folder with a similar name."""
    try:
        names = [path.name for path in place.parent.iterdir()]
    except OSError:
        return ""
    near = difflib.get_close_matches(place.name, names, n=MAX_LISTED, cutoff=0.7)
    return f"; there is {_join_names([str(place.with_name(name)) for name in near])}" if near else ""


def _join_names(names: list[str]) -> str:
    more = f" and {len(names) - MAX_LISTED} more" if len(names) > MAX_LISTED else ""
    return f"{', '.join(names[:MAX_LISTED])}{more}"


def _begins_as_mcap(path: Path) -> bool:
    try:
        with open_regular(path) as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError as error:
        raise MissingError(f"{path}: cannot be read: {error.strerror}") from None
