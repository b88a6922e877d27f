"""Of which session something was made, and what is not in it: for whoever uses tables, plots and time bases later."""

from __future__ import annotations

from collections.abc import Iterator

from fti.logger.reading.file_numbers import absent_numbers
from fti.logger.reading.recording import Recording
from fti.logger.regular_file import why_not_regular

SNAPSHOT = "snapshot"
SNAPSHOT_NOTE = "SNAPSHOT: not a continuous recording; frames of the links are there around triggers only"
#: What is told of a session wherever something is made from it.
KEYS = ("name", "origin", "mode", "software", "config_file", "config_sha256")


def is_snapshot(recording: Recording) -> bool:
    """Are frames there around triggers only: by the mode of the session, or because this is a snapshot file alone?"""
    return recording.is_snapshot_session or bool(recording.snapshot_files and not recording.raw_files)


def session_metadata(recording: Recording) -> dict[str, str]:
    """What a file that is made from a recording says of it; ``note`` only where something is to be known."""
    told = recording.metadata.get("fti", {})
    found = {"session": recording.session, **{key: told[key] for key in KEYS if key in told}}
    return {**found, "mode": SNAPSHOT, "note": SNAPSHOT_NOTE} if is_snapshot(recording) else found


def remarks(recording: Recording) -> Iterator[str]:
    """What a person should know who reads a recording: that it is a snapshot, that more of it lies elsewhere."""
    if is_snapshot(recording):
        yield SNAPSHOT_NOTE
    if text := _missing_parts(recording):
        yield text
    for path in sorted(recording.path.glob("*.mcap")) if recording.path.is_dir() else ():
        if why_not := why_not_regular(path):
            yield f"{path} is left out: {why_not}"


def _missing_parts(recording: Recording) -> str | None:
    """Where more of the session lies, or may lie when files are missing; None for a session that seems whole."""
    if not recording.path.is_dir() or not recording.other_folders:
        return None
    found = [folder for folder in recording.other_folders if any(folder.glob("*.mcap"))]
    if found:
        return f"more of this session lies in {', '.join(map(str, found))}; name all its folders"
    missing = absent_numbers(recording, "raw").missing
    if not missing:
        return None
    listed = ", ".join(f"{first:03}" if first == last else f"{first:03} to {last:03}" for first, last in missing)
    return f"raw files {listed} are not here; they may lie in {', '.join(map(str, recording.other_folders))}; name all folders"
