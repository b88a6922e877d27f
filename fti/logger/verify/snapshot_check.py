"""Snapshot files under proof: what stands in a raw file too must be the same there.

Beside the continuous recording, a snapshot is a copy of a part of it; in mode "snapshot" its frames stand nowhere else.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from fti.logger.verify.file_check import FileCheck, Page
from fti.logger.verify.sequence_check import SequenceCheck, is_numbered

#: Pages of raw files that are kept: the snapshot goes through them in order.
MAX_CACHED_PAGES = 4


class CopiedMessage(NamedTuple):
    """A message as it stands in a file."""

    topic: str
    t_ns: int
    data: bytes


@dataclass(frozen=True, slots=True)
class _PageLocation:
    """A page of a raw file: where it begins, and its smallest and greatest number."""

    path: Path
    at: int
    first: int
    last: int


class SnapshotCheck:
    """Compares snapshots with the raw files.

    files, frames : snapshots, and the numbered messages in them; copies : those that stand in raw files too
    different     : copies that are not the same
    """

    def __init__(self, numbers: SequenceCheck) -> None:
        self.files = self.frames = self.copies = self.different = 0
        self._numbers = numbers
        self._places: list[_PageLocation] = []
        self._loaded: deque[tuple[_PageLocation, dict[int, CopiedMessage]]] = deque(maxlen=MAX_CACHED_PAGES)

    def note_raw(self, path: Path, page: Page) -> None:
        """A page of a raw file, before its numbers are taken."""
        seqs = [seq for topic, rows in page.rows if is_numbered(topic.name) for seq in self._numbers.full(rows)]
        if seqs:
            self._places.append(_PageLocation(path, page.at, min(seqs), max(seqs)))

    def compare(self, page: Page) -> None:
        """A page of a snapshot, before its numbers are taken."""
        found = _copies(page, self._numbers)
        self.frames += len(found)
        seen: set[int] = set()
        for place in self._places:
            if found and place.first <= max(found) and min(found) <= place.last:
                raw = self._load(place)
                seen |= found.keys() & raw.keys()
                self.different += sum(found[seq] != raw[seq] for seq in found.keys() & raw.keys())
        self.copies += len(seen)

    def _load(self, place: _PageLocation) -> dict[int, CopiedMessage]:
        for known, copies in self._loaded:
            if known == place:
                return copies
        copies = {}
        for page in FileCheck(place.path).pages(place.at):
            copies = _copies(page, self._numbers)
            break
        self._loaded.append((place, copies))
        return copies


def _copies(page: Page, numbers: SequenceCheck) -> dict[int, CopiedMessage]:
    found = {}
    for topic, rows in page.rows:
        if is_numbered(topic.name):
            for seq, row in zip(numbers.full(rows), rows, strict=True):
                found[seq] = CopiedMessage(topic.name, row[1], page.body(row))
    return found
