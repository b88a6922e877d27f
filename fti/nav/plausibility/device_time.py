"""Test ``device_time``: the time that a device states against the arrival of its messages.

late = arrival - device time - smallest of the last minute.  A time that goes ahead by more than FORWARD_S cannot be
lateness: the message would arrive before it was sent.  One that falls behind by more than BEHIND_S for LASTING_S,
without a message that is on time, is a step and not a delay.  A time that stands still while messages arrive, and one
that goes back message after message, are findings too.  Five messages in a row are needed for each.  After a finding,
and after a gap of arrivals (a device that restarts), the relation is learned anew; counters that start again at a known
period go on.
"""

from __future__ import annotations

from collections import deque

from fti.nav.plausibility.finding import Finding
from fti.nav.series import SECOND_NS
from fti.nav.times.device_clock import WRAPS
from fti.types import Reason, Stamp, TimeScale

MESSAGES = 5
FORWARD_S = 0.1
BEHIND_S = 0.5
LASTING_S = 2.0
GAP_NS = 3 * SECOND_NS
WINDOW_S = 60


class DeviceTimeTest:
    """One time scale of one device."""

    def __init__(self, scale: TimeScale) -> None:
        self._scale = scale
        self._smallest: deque[tuple[int, int]] = deque(maxlen=WINDOW_S)  # second of arrival, arrival - device time [ns]
        self._least: int | None = None  # of them all
        self._last: tuple[int, int] | None = None
        self._heard = 0
        self._still_since: int | None = None
        self._away = self._back = 0
        self._away_since_ns = 0

    def update(self, stamp: Stamp) -> list[Finding]:
        """Take the stamp of a message; its device time must be there."""
        assert stamp.t_dev_ns is not None
        rx, dev = stamp.t_rx_ns, stamp.t_dev_ns
        last, self._last = self._last, (rx, dev)
        if last and (rx, dev) == last:
            return []
        if last is None or rx - last[0] > GAP_NS:
            self._learn_anew()
        found = self._find(rx, dev, last)
        if found:
            self._learn_anew()
        return found

    def _learn_anew(self) -> None:
        self._smallest.clear()
        self._least = None
        self._heard, self._away, self._back, self._still_since = 0, 0, 0, None

    def _find(self, rx: int, dev: int, last: tuple[int, int] | None) -> list[Finding]:
        self._heard += 1
        if last is None or self._heard <= MESSAGES:
            self._note(rx, rx - dev)
            return []
        if standing := self._find_standing(rx, dev, last):
            return standing
        self._back = self._back + 1 if dev < last[1] else 0
        if self._back >= MESSAGES:
            return [Finding(Reason.DEVICE_TIME, rx, f"its time goes back in {MESSAGES} messages in a row")]
        return self._find_step(rx, dev)

    def _find_standing(self, rx: int, dev: int, last: tuple[int, int]) -> list[Finding]:
        if dev != last[1]:
            self._still_since = None
            return []
        self._still_since = last[0] if self._still_since is None else self._still_since
        if rx - self._still_since < LASTING_S * SECOND_NS:
            return []
        text = f"its time stands still for {(rx - self._still_since) / SECOND_NS:.1f} s"
        return [Finding(Reason.DEVICE_TIME, self._still_since, text)]

    def _find_step(self, rx: int, dev: int) -> list[Finding]:
        late = self._late_s(rx, dev)
        if -FORWARD_S <= late <= BEHIND_S:
            self._away = 0
            self._note(rx, rx - dev)
            return []
        if self._away == 0:
            self._away_since_ns = rx
        self._away += 1
        lasted = (rx - self._away_since_ns) / SECOND_NS
        if self._away < MESSAGES or (late > 0.0 and lasted < LASTING_S):
            return []
        if self._has_wrapped(late):
            self._learn_anew()
            return []
        return [Finding(Reason.DEVICE_TIME, self._away_since_ns, f"its time steps by {-late:+.3f} s against arrival")]

    def _late_s(self, rx: int, dev: int) -> float:
        if self._least is None:
            self._least = min(offset for _, offset in self._smallest)
        return (rx - dev - self._least) / SECOND_NS

    def _has_wrapped(self, late_s: float) -> bool:
        return any(abs(abs(late_s) - period / SECOND_NS) <= BEHIND_S for period in WRAPS[self._scale])

    def _note(self, rx: int, offset: int) -> None:
        second = rx // SECOND_NS
        if not self._smallest or self._smallest[-1][0] != second:
            self._least = None  # the oldest may leave
            self._smallest.append((second, offset))
        elif offset < self._smallest[-1][1]:
            self._smallest[-1] = second, offset
            self._least = offset if self._least is None else min(self._least, offset)
