"""Delay of messages on the link from an aircraft, beyond its shortest one."""

from __future__ import annotations

import math

#: The clocks of aircraft and ground may run apart by this: the shortest delay is raised by it between messages.
MAX_DRIFT = 100e-6


class LinkDelay:
    """Compares times of publication, by the clock of the aircraft, with times of arrival, by a clock of the ground.

    Offset of the clocks and shortest delay cannot be distinguished, and are not part of the result.  A message that was
    delayed more than the quickest one so far is older by the difference.

    delay_ns : of the last message [ns]
    """

    def __init__(self) -> None:
        self._offset_ns = math.inf
        self._last_ns = 0
        self.delay_ns = 0

    def update(self, published_ns: int, arrived_ns: int) -> int:
        """Delay of a message beyond the shortest one [ns], at least 0.

        published_ns : clock of the aircraft;  arrived_ns : clock of the ground, never decreasing [ns]
        """
        raised_ns = self._offset_ns + MAX_DRIFT * (arrived_ns - self._last_ns)
        self._last_ns = arrived_ns
        self._offset_ns = min(raised_ns, arrived_ns - published_ns)
        self.delay_ns = round(arrived_ns - published_ns - self._offset_ns)
        return self.delay_ns
