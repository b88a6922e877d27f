"""Parser of the tables of metadata records."""

from __future__ import annotations

from fti.logger.records import HEAD, read_text


def metadata_table(record: bytes) -> tuple[str, dict[str, str]]:
    """Name and table of a metadata record.  Raises struct.error or UnicodeDecodeError when it is invalid."""
    name, at = read_text(record, HEAD.size)
    return name, text_table(record, at)


def text_table(data: bytes, at: int) -> dict[str, str]:
    """A table of texts at an offset."""
    end = at + 4 + int.from_bytes(data[at : at + 4], "little")
    at += 4
    found = {}
    while at < end:
        key, at = read_text(data, at)
        found[key], at = read_text(data, at)
    return found
