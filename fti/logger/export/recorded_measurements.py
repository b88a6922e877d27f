"""Measurements in derived files of times for which there are no frames: a raw file is lost, or damaged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from fti.logger.reading.mcap_file import McapMessage
from fti.logger.reading.recording import Recording

#: Frames are missing where the links have none for so long [ns].  In the same time a message is complete.
MISSING_NS = 1_000_000_000


class RecordedMeasurements:
    """Messages on some topics of the derived files, between the frames.

    end_of_topics : time of the last message of each topic [ns]
    """

    def __init__(self, recording: Recording, end_of_topics: Mapping[str, int]) -> None:
        self._items = (item for item in recording.items("derived") if item.topic.name in end_of_topics)
        self._end_ns = max(end_of_topics.values(), default=0)
        self._waiting: McapMessage | None = None
        self._covered_ns = 0  # frames are there up to this time

    def before_frame(self, t_rx_ns: int) -> Iterator[McapMessage]:
        """The messages of the time without frames before this one, which is the next."""
        begin_ns, self._covered_ns = self._covered_ns, max(self._covered_ns, t_rx_ns)
        if t_rx_ns - begin_ns > MISSING_NS:
            yield from self._between(begin_ns, t_rx_ns)

    def rest(self) -> Iterator[McapMessage]:
        """The messages after the last frame."""
        yield from self._between(self._covered_ns + MISSING_NS, self._end_ns + 1)

    def _between(self, begin_ns: int, end_ns: int) -> Iterator[McapMessage]:
        while begin_ns < self._end_ns:
            self._waiting = self._waiting or next(self._items, None)
            if self._waiting is None or self._waiting.log_time >= end_ns:
                return
            item, self._waiting = self._waiting, None
            if item.log_time > begin_ns:
                yield item
