"""Framing of text lines: ends of lines, and rejection of lines with a missing beginning.

Any end character ends a line, so CR, LF, CR LF and a doubled CR are equivalent; an empty line is framed and ignored.

A line with a missing beginning is rejected: the end of "130.00" is "30.00", and there is no checksum.  The first bytes
after a connect, or after a gap, are such a line unless they are known to begin a line.

After a loss of the port the same decoder continues, and only a pause reveals the loss.  A line that contains a pause of
``LINE_TIMEOUT_NS`` is rejected, since its parts may be of two lines; so is the first line after a pause that is
``MAX_PAUSE_RATIO`` times as long as those between the lines before it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Literal

from fti.drivers import Counters
from fti.drivers._framing import Framer, Skip

FirstLine = Literal["skip", "take"]
#: A port is reopened after 0.1 s at the earliest; the bytes of a line arrive with shorter pauses.
LINE_TIMEOUT_NS = 100_000_000
MAX_PAUSE_RATIO = 3
#: Decay of the maximum pause per line; number of pauses until the usual pause is known.
PAUSE_DECAY, MIN_PAUSES = 0.98, 10


class LineFramer(Framer):
    """Divides a stream into lines, each with its end character.

    refuse : reason why a line (without its end) is not a message, otherwise ""; ends : characters that end a line
    max_length : of a line with its end [bytes]; starts_with_line : the first byte is the first of a line
    """

    def __init__(
        self,
        refuse: Callable[[bytes], str],
        counters: Counters,
        *,
        max_length: int,
        starts_with_line: bool,
        ends: bytes = b"\r\n",
    ) -> None:
        super().__init__(self._measure_line, counters, limit=max_length + 1)
        self._refuse = refuse
        self._max_length = max_length
        self._starts_line = starts_with_line
        self._each_begins = starts_with_line
        self._last_ns: int | None = None
        self._usual_ns, self._pauses = 0.0, 0
        self._end = re.compile(b"[" + re.escape(ends) + b"]")

    def feed(self, data: bytes, t_rx_ns: int) -> Iterator[tuple[int, bytes]]:
        if data:
            pause_ns = t_rx_ns - self._last_ns if self._last_ns is not None else 0
            self._last_ns = t_rx_ns
            if self._is_interrupted(pause_ns):
                self._starts_line = False
        return super().feed(data, t_rx_ns)

    def _is_interrupted(self, pause_ns: int) -> bool:
        """May bytes be missing between the last read and this one?"""
        if self._counters.held:
            return pause_ns >= LINE_TIMEOUT_NS
        is_known, usual_ns = self._pauses >= MIN_PAUSES and not self._each_begins, self._usual_ns
        self._pauses += 1
        self._usual_ns = max(pause_ns, PAUSE_DECAY * usual_ns)
        return is_known and pause_ns >= max(LINE_TIMEOUT_NS, MAX_PAUSE_RATIO * usual_ns)

    def _measure_line(self, buffer: bytearray) -> int | Skip:
        match = self._end.search(buffer, 0, self._max_length)
        if match is None:
            return self._measure_open(buffer)
        size = match.end()
        is_whole, self._starts_line = self._starts_line, True
        if size == 1:
            return size
        if not is_whole:
            return Skip(size, "no_beginning")
        reason = self._refuse(bytes(buffer[: size - 1]))
        return Skip(size, reason) if reason else size

    def _measure_open(self, buffer: bytearray) -> int | Skip:
        """An incomplete line."""
        if len(buffer) < self._max_length:
            return 0
        self._starts_line = False
        return Skip(self._max_length, "too_long")
