"""Ranges of the sequence numbers that were found in a session, and the holes between them."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from operator import attrgetter

_FIRST = attrgetter("first")


@dataclass(slots=True)
class SequenceRange:
    """Numbers from ``first`` to ``last`` and their times; for a hole the times of its neighbours [ns]."""

    first: int
    last: int
    first_ns: int
    last_ns: int

    @property
    def count(self) -> int:
        """Number of numbers."""
        return self.last - self.first + 1


class Coverage:
    """Numbers found so far: ordered, disjoint ranges."""

    def __init__(self) -> None:
        self.ranges: list[SequenceRange] = []

    def add(self, numbers: list[tuple[int, int]]) -> set[int]:
        """Add sorted numbers with their times; returns those added before, or duplicate among these."""
        doubles: set[int] = set()
        for span in _spans(numbers, doubles):
            self._insert(span, doubles)
        return doubles

    def _insert(self, span: SequenceRange, doubles: set[int]) -> None:
        """Insert a range and merge it with adjacent ones."""
        ranges = self.ranges
        begin = bisect_right(ranges, span.first, key=_FIRST)
        if begin and ranges[begin - 1].last >= span.first - 1:
            begin -= 1
        end = begin
        while end < len(ranges) and ranges[end].first <= span.last + 1:
            other = ranges[end]
            doubles.update(range(max(span.first, other.first), min(span.last, other.last) + 1))
            if other.first < span.first:
                span.first, span.first_ns = other.first, other.first_ns
            if other.last > span.last:
                span.last, span.last_ns = other.last, other.last_ns
            end += 1
        ranges[begin:end] = [span]

    def holes(self, begin: int, end: int) -> list[SequenceRange]:
        """The missing numbers in begin <= number < end."""
        holes, expected, before_ns = [], begin, 0
        for span in self.ranges[max(bisect_right(self.ranges, begin, key=_FIRST) - 1, 0) :]:
            if expected >= end:
                break
            if span.first > expected:
                holes.append(
                    SequenceRange(expected, min(span.first, end) - 1, before_ns or span.first_ns, span.first_ns)
                )
            expected, before_ns = max(expected, span.last + 1), span.last_ns
        if expected < end:
            holes.append(SequenceRange(expected, end - 1, before_ns, before_ns))
        return holes


def _spans(numbers: list[tuple[int, int]], doubles: set[int]) -> Iterator[SequenceRange]:
    """The ranges of sorted numbers."""
    begin = before = numbers[0]
    if numbers[-1][0] - begin[0] + 1 == len(numbers) and all(b[0] - a[0] == 1 for a, b in pairwise(numbers)):
        yield SequenceRange(begin[0], numbers[-1][0], begin[1], numbers[-1][1])
        return
    for number in numbers[1:]:
        if number[0] == before[0]:
            doubles.add(number[0])
        elif number[0] != before[0] + 1:
            yield SequenceRange(begin[0], before[0], begin[1], before[1])
            begin = number
        before = number
    yield SequenceRange(begin[0], before[0], begin[1], before[1])
