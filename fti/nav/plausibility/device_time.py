"""Test ``device_time``: device time against the arrival of messages.

late = arrival - device time - minimum of both over the last minute.  A device time early by more than MAX_EARLY_S is a
step: the message would arrive before it was sent.  One late by more than MAX_LATE_S for MIN_DURATION_S, without a
message on time, is a step and not a delay.  A time that stands still while messages arrive, and one that decreases in
consecutive messages, are findings too.  Each needs five consecutive messages.  After a finding, and after a gap of
arrivals (a device restart), the relation is learned again; counters that wrap at a known period are accepted.
"""

from __future__ import annotations

from collections import deque

from fti.constants import SECOND_NS
from fti.messages.measurements import Stamp, TimeScale
from fti.messages.reasons import Reason
from fti.nav.device_time.clock_estimator import WRAPS
from fti.nav.plausibility.finding import PlausibilityFinding

MIN_MESSAGES = 5
MAX_EARLY_S = 0.1
MAX_LATE_S = 0.5
MIN_DURATION_S = 2.0
MAX_GAP_NS = 3 * SECOND_NS
WINDOW_S = 60


class DeviceTimeTest:
    """One time scale of one device."""

    def __init__(self, scale: TimeScale) -> None:
        self._scale = scale
        self._min_offsets: deque[tuple[int, int]] = deque(
            maxlen=WINDOW_S
        )  # second of arrival, arrival - device time [ns]
        self._min_offset: int | None = None  # of them all
        self._last: tuple[int, int] | None = None
        self._received = 0
        self._frozen_since: int | None = None
        self._off_count = self._backward_count = 0
        self._off_since_ns = 0

    def update(self, stamp: Stamp) -> list[PlausibilityFinding]:
        """Test the stamp of a message, which must have a device time."""
        assert stamp.t_dev_ns is not None
        rx, dev = stamp.t_rx_ns, stamp.t_dev_ns
        last, self._last = self._last, (rx, dev)
        if last and (rx, dev) == last:
            return []
        if last is None or rx - last[0] > MAX_GAP_NS:
            self._reset()
        findings = self._find(rx, dev, last)
        if findings:
            self._reset()
        return findings

    def _reset(self) -> None:
        self._min_offsets.clear()
        self._min_offset = None
        self._received, self._off_count, self._backward_count, self._frozen_since = 0, 0, 0, None

    def _find(self, rx: int, dev: int, last: tuple[int, int] | None) -> list[PlausibilityFinding]:
        self._received += 1
        if last is None or self._received <= MIN_MESSAGES:
            self._note(rx, rx - dev)
            return []
        if standing := self._find_frozen(rx, dev, last):
            return standing
        self._backward_count = self._backward_count + 1 if dev < last[1] else 0
        if self._backward_count >= MIN_MESSAGES:
            return [
                PlausibilityFinding(Reason.DEVICE_TIME, rx, f"its time goes back in {MIN_MESSAGES} messages in a row")
            ]
        return self._find_step(rx, dev)

    def _find_frozen(self, rx: int, dev: int, last: tuple[int, int]) -> list[PlausibilityFinding]:
        if dev != last[1]:
            self._frozen_since = None
            return []
        self._frozen_since = last[0] if self._frozen_since is None else self._frozen_since
        if rx - self._frozen_since < MIN_DURATION_S * SECOND_NS:
            return []
        text = f"its time stands still for {(rx - self._frozen_since) / SECOND_NS:.1f} s"
        return [PlausibilityFinding(Reason.DEVICE_TIME, self._frozen_since, text)]

    def _find_step(self, rx: int, dev: int) -> list[PlausibilityFinding]:
        late = self._late_s(rx, dev)
        if -MAX_EARLY_S <= late <= MAX_LATE_S:
            self._off_count = 0
            self._note(rx, rx - dev)
            return []
        if self._off_count == 0:
            self._off_since_ns = rx
        self._off_count += 1
        lasted = (rx - self._off_since_ns) / SECOND_NS
        if self._off_count < MIN_MESSAGES or (late > 0.0 and lasted < MIN_DURATION_S):
            return []
        if self._has_wrapped(late):
            self._reset()
            return []
        return [
            PlausibilityFinding(
                Reason.DEVICE_TIME, self._off_since_ns, f"its time steps by {-late:+.3f} s against arrival"
            )
        ]

    def _late_s(self, rx: int, dev: int) -> float:
        if self._min_offset is None:
            self._min_offset = min(offset for _, offset in self._min_offsets)
        return (rx - dev - self._min_offset) / SECOND_NS

    def _has_wrapped(self, late_s: float) -> bool:
        return any(abs(abs(late_s) - period / SECOND_NS) <= MAX_LATE_S for period in WRAPS[self._scale])

    def _note(self, rx: int, offset: int) -> None:
        second = rx // SECOND_NS
        if not self._min_offsets or self._min_offsets[-1][0] != second:
            self._min_offset = None  # the oldest may leave
            self._min_offsets.append((second, offset))
        elif offset < self._min_offsets[-1][1]:
            self._min_offsets[-1] = second, offset
            self._min_offset = offset if self._min_offset is None else min(self._min_offset, offset)
