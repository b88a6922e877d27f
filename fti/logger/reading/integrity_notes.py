"""Integrity notes from the metadata of a file that was closed after its writer ended, or made by a recovery."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from fti.logger.log_layout import CLOSED_METADATA, RECOVERED_METADATA
from fti.logger.reading.text_format import clock_text


def list_warnings(name: str, table: Mapping[str, str]) -> Iterator[str]:
    """Sentences about messages without a checksum, from one metadata table."""
    if name == RECOVERED_METADATA:  # the recovery made the checksums: they do not prove the original data
        if (unverified := table.get("unproved", "?")) != "0":
            yield f"was recovered; {unverified} messages had no valid checksum"
        if table.get("complete") != "true":
            yield "was recovered from a damaged file"
    elif name == CLOSED_METADATA:
        yield from _unverified_warnings(table)


def list_end_warnings(name: str, table: Mapping[str, str]) -> Iterator[str]:
    """Sentences about missing bytes at the end of a file; other files may hold their content."""
    if name == CLOSED_METADATA:
        yield from _end_warnings(table)


def list_notes(name: str, table: Mapping[str, str]) -> Iterator[str]:
    """Sentences that do not mean a loss."""
    if name == CLOSED_METADATA and not (any(_unverified_warnings(table)) or any(_end_warnings(table))):
        yield "was closed later: its writer ended before it closed the file"


def has_unverified_end(tables: Mapping[str, Mapping[str, str]]) -> bool:
    """Was the last chunk of a file closed with unverified or missing data?"""
    table = tables.get(CLOSED_METADATA)
    return table is not None and (any(_unverified_warnings(table)) or any(_end_warnings(table)))


def _unverified_warnings(table: Mapping[str, str]) -> Iterator[str]:
    """The checksum of the last chunk was made when the file was closed."""
    unverified = table.get("unproved_messages", "?")
    if unverified != "0":
        yield f"was closed later: {unverified} messages{_start_text(table)} are unverified, no checksum covered them"


def _end_warnings(table: Mapping[str, str]) -> Iterator[str]:
    missing = table.get("missing_bytes", "?")
    if missing != "0":
        yield f"was closed later: {missing} bytes at its end were missing or damaged"
    if "kept_file" in table:
        yield f"was closed later: bytes behind its last record, perhaps more records, are in {table['kept_file']}"


def _start_text(table: Mapping[str, str]) -> str:
    try:
        return f" from {clock_text(int(table['unproved_from_ns']))} on"
    except (KeyError, ValueError, OverflowError, OSError):
        return ""
