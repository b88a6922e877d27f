"""Sequence numbers of the recovered frames, and the missing ones between them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fti.errors import RecordingError
from fti.logger.raw_log import RAW_ENCODING
from fti.logger.reading.chunk_content import Content, channel_name
from fti.logger.reading.limits import MAX_HOLES
from fti.logger.reading.recording import unwrap


@dataclass(slots=True)
class RecoveredRange:
    """Numbers without a gap, and their first and last time [ns]."""

    first: int
    last: int
    first_ns: int
    last_ns: int


@dataclass(frozen=True, slots=True)
class SequenceGap:
    """Missing numbers first to last, and the times [ns] of the frames before and after them."""

    first: int
    last: int
    after_ns: int
    before_ns: int


class RecoveredSequence:
    """Collects the numbers of frames, ticks and sent frames."""

    def __init__(self) -> None:
        self._runs: list[RecoveredRange] = []
        self._last: int | None = None
        self._next_joined = 2 * MAX_HOLES

    def add(self, content: Content, channels: Mapping[int, bytes]) -> None:
        """Add the numbered messages of a chunk; channels : all known ones."""
        found: list[tuple[int, int]] = []
        for channel_id, numbers in content.numbers.items():
            record = channels.get(channel_id)
            if record and channel_name(record)[1] == RAW_ENCODING:
                found += zip(numbers[::2], numbers[1::2], strict=True)
        if found:
            base = unwrap(found[0][0], self._last)
            full = sorted((unwrap(number, base), t_ns) for number, t_ns in found)
            self._last = full[-1][0]
            self._runs += _runs_of(full)
            if len(self._runs) > self._next_joined:
                self._runs = _join_ranges(self._runs)
                self._next_joined = 2 * max(len(self._runs), MAX_HOLES)
                if len(self._runs) > 2 * MAX_HOLES:
                    raise RecordingError(f"its numbers have more than {2 * MAX_HOLES} holes")

    def gaps(self) -> list[SequenceGap]:
        """The missing numbers between the first and the last one."""
        gaps: list[SequenceGap] = []
        reached: RecoveredRange | None = None
        for run in sorted(self._runs, key=lambda run: run.first):
            if reached and run.first > reached.last + 1:
                gaps.append(SequenceGap(reached.last + 1, run.first - 1, reached.last_ns, run.first_ns))
            if reached is None or run.last > reached.last:
                reached = run
        return gaps


def _join_ranges(runs: list[RecoveredRange]) -> list[RecoveredRange]:
    """Merge adjacent ranges."""
    joined: list[RecoveredRange] = []
    for run in sorted(runs, key=lambda run: run.first):
        if joined and run.first <= joined[-1].last + 1:
            if run.last > joined[-1].last:
                joined[-1].last, joined[-1].last_ns = run.last, run.last_ns
        else:
            joined.append(run)
    return joined


def _runs_of(numbered: list[tuple[int, int]]) -> list[RecoveredRange]:
    first, last = numbered[0], numbered[-1]
    if last[0] - first[0] == len(numbered) - 1:
        return [RecoveredRange(first[0], last[0], first[1], last[1])]
    runs = [RecoveredRange(first[0], first[0], first[1], first[1])]
    for number, t_ns in numbered:
        if number > runs[-1].last + 1:
            runs.append(RecoveredRange(number, number, t_ns, t_ns))
        else:
            runs[-1].last, runs[-1].last_ns = number, t_ns
    return runs
