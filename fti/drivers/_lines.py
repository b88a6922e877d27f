"""Lines of text: where each ends, and whether its beginning was seen.

Any of the end characters ends a line, so CR, LF, CR LF and a doubled CR are all the same; an empty line is framed and
means nothing.

A line whose beginning was not seen is not taken: the end of "130.00" is "30.00", and no checksum tells.  The first
bytes after a connect, or after a gap, are such an end unless it is known that they begin a line.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Literal

from fti.drivers import Counters
from fti.drivers._framing import Framer, Skip

FirstLine = Literal["skip", "take"]


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
        self._end = re.compile(b"[" + re.escape(ends) + b"]")

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
