"""Check of snapshot files: messages that a raw file holds too must be equal.

In a continuous recording a snapshot copies a part of it; in mode "snapshot" only the snapshots hold the frames.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from fti.logger.verify.file_check import FileCheck, Page
from fti.logger.verify.sequence_check import SequenceCheck, is_numbered

#: Cached pages of raw files, which the snapshot reads in order.
MAX_CACHED_PAGES = 4


class CopiedMessage(NamedTuple):
    """A message of a file."""

    topic: str
    t_ns: int
    data: bytes


@dataclass(frozen=True, slots=True)
class _PageLocation:
    """A page of a raw file: its offset, and its smallest and greatest number."""

    path: Path
    at: int
    first: int
    last: int


class SnapshotCheck:
    """Compares snapshots with the raw files.

    files, frames : number of snapshots and of their numbered messages; copies : messages in raw files too
    different     : number of copies that differ
    """

    def __init__(self, numbers: SequenceCheck) -> None:
        self.files = self.frames = self.copies = self.different = 0
        self._numbers = numbers
        self._page_locations: list[_PageLocation] = []
        self._loaded: deque[tuple[_PageLocation, dict[int, CopiedMessage]]] = deque(maxlen=MAX_CACHED_PAGES)

    def add_raw_page(self, path: Path, page: Page) -> None:
        """Add a page of a raw file, before its numbers are added."""
        seqs = [seq for topic, rows in page.rows if is_numbered(topic.name) for seq in self._numbers.full_numbers(rows)]
        if seqs:
            self._page_locations.append(_PageLocation(path, page.at, min(seqs), max(seqs)))

    def compare(self, page: Page) -> None:
        """Compare a page of a snapshot, before its numbers are added."""
        found = _copies(page, self._numbers)
        self.frames += len(found)
        copied: set[int] = set()
        for location in self._page_locations:
            if found and location.first <= max(found) and min(found) <= location.last:
                raw = self._load(location)
                copied |= found.keys() & raw.keys()
                self.different += sum(found[seq] != raw[seq] for seq in found.keys() & raw.keys())
        self.copies += len(copied)

    def _load(self, location: _PageLocation) -> dict[int, CopiedMessage]:
        for known, copies in self._loaded:
            if known == location:
                return copies
        copies = {}
        for page in FileCheck(location.path).pages(location.at):
            copies = _copies(page, self._numbers)
            break
        self._loaded.append((location, copies))
        return copies


def _copies(page: Page, numbers: SequenceCheck) -> dict[int, CopiedMessage]:
    found = {}
    for topic, rows in page.rows:
        if is_numbered(topic.name):
            for seq, row in zip(numbers.full_numbers(rows), rows, strict=True):
                found[seq] = CopiedMessage(topic.name, row[1], page.body(row))
    return found
