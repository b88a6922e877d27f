"""Metadata and remarks on a session, for tables, plots and time bases that are made from it."""

from __future__ import annotations

from collections.abc import Iterator

from fti.logger.reading.file_numbers import absent_numbers
from fti.logger.reading.recording import Recording
from fti.logger.regular_file import why_not_regular

SNAPSHOT = "snapshot"
SNAPSHOT_NOTE = "SNAPSHOT: not a continuous recording; frames of the links are there around triggers only"
#: Session metadata that are copied to everything made from a session.
KEYS = ("name", "origin", "mode", "software", "config_file", "config_sha256")


def is_snapshot(recording: Recording) -> bool:
    """Are only frames around triggers recorded: by the mode of the session, or because only snapshot files are open?"""
    return recording.is_snapshot_session or bool(recording.snapshot_files and not recording.raw_files)


def session_metadata(recording: Recording) -> dict[str, str]:
    """Session metadata for a file that is made from a recording; ``note`` only for snapshots."""
    fti_table = recording.metadata.get("fti", {})
    metadata = {"session": recording.session, **{key: fti_table[key] for key in KEYS if key in fti_table}}
    return {**metadata, "mode": SNAPSHOT, "note": SNAPSHOT_NOTE} if is_snapshot(recording) else metadata


def remarks(recording: Recording) -> Iterator[str]:
    """Remarks for the user: the recording is a snapshot, parts of it are in other folders, files are ignored."""
    if is_snapshot(recording):
        yield SNAPSHOT_NOTE
    if text := _missing_parts(recording):
        yield text
    for path in sorted(recording.path.glob("*.mcap")) if recording.path.is_dir() else ():
        if why_not := why_not_regular(path):
            yield f"{path} is ignored: {why_not}"


def _missing_parts(recording: Recording) -> str | None:
    """Folders that hold, or may hold, more of the session; None for a session that seems complete."""
    if not recording.path.is_dir() or not recording.other_folders:
        return None
    found = [folder for folder in recording.other_folders if any(folder.glob("*.mcap"))]
    if found:
        return f"more of this session is in {', '.join(map(str, found))}; name all its folders"
    missing = absent_numbers(recording, "raw").missing
    if not missing:
        return None
    listed = ", ".join(f"{first:03}" if first == last else f"{first:03} to {last:03}" for first, last in missing)
    folders = ", ".join(map(str, recording.other_folders))
    return f"raw files {listed} are missing; they may be in {folders}; name all folders"
