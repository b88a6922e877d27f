"""Lines of text: where each ends, and whether its beginning was seen.

Any of the end characters ends a line, so CR, LF, CR LF and a doubled CR are all the same; an empty line is framed and
means nothing.

A line whose beginning was not seen is not taken: the end of "130.00" is "30.00", and no checksum tells.  The first
bytes after a connect, or after a gap, are such an end unless it is known that they begin a line.

A port that is lost and opened again goes on with the same decoder, and only the pause shows it.  A line with a pause
of ``LINE_TIMEOUT_NS`` in it is not taken, for its two halves may be of two lines; nor is the first one after a pause that is
``MAX_PAUSE_RATIO`` times as long as those between the lines before it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Literal

from fti.drivers import Counters
from fti.drivers._framing import Framer, Skip

FirstLine = Literal["skip", "take"]
#: A port is opened again after 0.1 s at the earliest; the bytes of a line come closer to each other.
LINE_TIMEOUT_NS = 100_000_000
MAX_PAUSE_RATIO = 3
#: The longest pause between lines is forgotten by this factor with each; so many are needed to know what is usual.
PAUSE_DECAY, MIN_PAUSES = 0.98, 10


class LineFramer(Framer):
    """Cuts a stream into lines, each with its end character.

    refuse  : why a line (without its end) is no message, "" when it is one
    ends    : characters that end a line; longest : most bytes of a line with its end
    begun   : the first byte fed is the first of a line
    """

    def __init__(
        self, refuse: Callable[[bytes], str], counters: Counters, *, longest: int, begun: bool, ends: bytes = b"\r\n"
    ) -> None:
        super().__init__(self._measure_line, counters, limit=longest + 1)
        self._refuse = refuse
        self._longest = longest
        self._begun = begun
        self._each_begins = begun
        self._last_ns: int | None = None
        self._usual_ns, self._pauses = 0.0, 0
        self._end = re.compile(b"[" + re.escape(ends) + b"]")

    def feed(self, data: bytes, t_rx_ns: int) -> Iterator[tuple[int, bytes]]:
        if data:
            pause_ns = t_rx_ns - self._last_ns if self._last_ns is not None else 0
            self._last_ns = t_rx_ns
            if self._is_torn(pause_ns):
                self._begun = False
        return super().feed(data, t_rx_ns)

    def _is_torn(self, pause_ns: int) -> bool:
        """May something be missing between the last read and this one?"""
        if self._counters.held:
            return pause_ns >= LINE_TIMEOUT_NS
        known, usual_ns = self._pauses >= MIN_PAUSES and not self._each_begins, self._usual_ns
        self._pauses += 1
        self._usual_ns = max(pause_ns, PAUSE_DECAY * usual_ns)
        return known and pause_ns >= max(LINE_TIMEOUT_NS, MAX_PAUSE_RATIO * usual_ns)

    def _measure_line(self, buffer: bytearray) -> int | Skip:
        found = self._end.search(buffer, 0, self._longest)
        if found is None:
            return self._measure_open(buffer)
        size = found.end()
        begun, self._begun = self._begun, True
        if size == 1:
            return size
        if not begun:
            return Skip(size, "no_beginning")
        reason = self._refuse(bytes(buffer[: size - 1]))
        return Skip(size, reason) if reason else size

    def _measure_open(self, buffer: bytearray) -> int | Skip:
        """No end yet."""
        if len(buffer) < self._longest:
            return 0
        self._begun = False
        return Skip(self._longest, "too_long")
