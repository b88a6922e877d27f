"""The statistics in the summaries of the files, without reading their messages."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Statistics


def file_statistics(files: Iterable[Path]) -> list[Statistics]:
    """The statistics of each file; empty when a file has no summary."""
    found = []
    for path in files:
        with path.open("rb") as file:
            try:
                summary = make_reader(file).get_summary()
            except (McapError, ValueError, LookupError, struct.error, OverflowError, MemoryError):
                return []
        if summary is None or summary.statistics is None:
            return []
        found.append(summary.statistics)
    return found
