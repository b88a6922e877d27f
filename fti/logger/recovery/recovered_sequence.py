"""Sequence numbers of the recovered frames, and the missing ones between them."""

from __future__ import annotations

from collections.abc import Mapping

from fti.errors import RecordingError
from fti.logger.raw_log import RAW_ENCODING
from fti.logger.reading.chunk_content import Content
from fti.logger.reading.limits import MAX_HOLES
from fti.logger.reading.number_ranges import Coverage, SequenceRange
from fti.logger.reading.record_cursor import channel_fields
from fti.logger.reading.recording import unwrap


class RecoveredSequence:
    """Collects the numbers of frames, ticks and sent frames."""

    def __init__(self) -> None:
        self._coverage = Coverage()
        self._last: int | None = None

    def add(self, content: Content, channels: Mapping[int, bytes]) -> None:
        """Add the numbered messages of a chunk; channels : all known ones.  Raises RecordingError beyond a limit."""
        found: list[tuple[int, int]] = []
        for channel_id, numbers in content.numbers.items():
            record = channels.get(channel_id)
            if record and channel_fields(record).encoding == RAW_ENCODING:
                found += zip(numbers[::2], numbers[1::2], strict=True)
        if found:
            base = unwrap(found[0][0], self._last)
            full = sorted((unwrap(number, base), t_ns) for number, t_ns in found)
            self._last = full[-1][0]
            self._coverage.add(full)
            if len(self._coverage.ranges) > 2 * MAX_HOLES:
                raise RecordingError(f"its numbers have more than {2 * MAX_HOLES} holes")

    def gaps(self) -> list[SequenceRange]:
        """The missing numbers between the first and the last one."""
        ranges = self._coverage.ranges
        return self._coverage.holes(ranges[0].first, ranges[-1].last) if ranges else []
