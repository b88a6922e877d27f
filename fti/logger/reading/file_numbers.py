"""File numbers of a session, and the missing ones among them."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import NamedTuple

from fti.logger.log_layout import FILE_METADATA, SKIPPED_NUMBERS_KEY
from fti.logger.reading.mcap_file import McapFile
from fti.logger.reading.recording import Recording
from fti.logger.session import Kind, name_parts

#: File numbers of this program are not longer.
MAX_NUMBER_DIGITS = 10


class AbsentNumbers(NamedTuple):
    """Numbers below the greatest one that no file has.

    skipped_numbers : allocated and not used according to later files, for example after a late open
    missing         : ranges of all others, first and last number
    """

    skipped_numbers: list[int]
    missing: list[tuple[int, int]]


def absent_numbers(recording: Recording, kind: Kind) -> AbsentNumbers:
    """The numbers without a file of this kind.  Raises MissingError when a file cannot be opened."""
    numbers = sorted({-1, *(name_parts(path)[1] for path in recording.paths(kind))})
    gaps = [(before + 1, after - 1) for before, after in pairwise(numbers) if after - before > 1]
    stated = _stated_numbers(recording, kind) if gaps else set()
    skipped_numbers = sorted(n for n in stated if any(first <= n <= last for first, last in gaps))
    return AbsentNumbers(skipped_numbers, [part for gap in gaps for part in _split_range(gap, skipped_numbers)])


def _split_range(gap: tuple[int, int], skipped_numbers: list[int]) -> Iterable[tuple[int, int]]:
    """The parts of a range without the skipped numbers."""
    first, last = gap
    edges = [first - 1, *(n for n in skipped_numbers if first <= n <= last), last + 1]
    return [(before + 1, after - 1) for before, after in pairwise(edges) if after - before > 1]


def _stated_numbers(recording: Recording, kind: Kind) -> set[int]:
    """The numbers that the files list as skipped."""
    tables = (McapFile(path).head().metadata.get(FILE_METADATA, {}) for path in recording.paths(kind))
    words = (word for table in tables for word in table.get(SKIPPED_NUMBERS_KEY, "").split())
    return {int(word) for word in words if word.isascii() and word.isdigit() and len(word) <= MAX_NUMBER_DIGITS}
