"""Detects signs of spoofing in the signals of a receiver, which then is suspected but not refused.

    cn0     C/N0 changes by more than CN0_DB in SPAN_NS, as the mean of MIN_SATELLITES or more tracked both times
    clock   the receiver's clock departs from its rate by more than CLOCK_S and K sigma between two messages

A suspicion lasts for HOLD_NS: filter copies without the receiver are kept for that time.  A receiver may step its clock
by whole milliseconds; these steps do not count.  A bank of 60 deg and a bridge cause a suspicion, too, but no refusal.

Source: Akos 2012 (C/N0 and gain as signs of spoofing); limits: several times the effect of a turn, and 30 m of light
path.  Checked against: tests/nav/plausibility/test_signals.py.
"""

from __future__ import annotations

import math
from collections import deque

from fti.constants import SECOND_NS
from fti.messages.measurements import ReceiverClock, Satellites

CN0_DB, MIN_SATELLITES = 6.0, 4
SPAN_NS, HOLD_NS = 10 * SECOND_NS, 30 * SECOND_NS
CLOCK_S, K_CLOCK = 1e-7, 5.5
#: Maximum time between consecutive messages [ns].
MAX_GAP_NS = 5 * SECOND_NS
#: A step within this tolerance of whole milliseconds is the receiver's own [s].
MILLISECOND_S, STEP_SD_S = 1e-3, 1e-6


class SignalTest:
    """Signals of one receiver."""

    def __init__(self) -> None:
        self._levels: deque[tuple[int, dict[tuple[str, int], float]]] = deque()
        self._clock: tuple[int, ReceiverClock] | None = None
        self._until_ns: int | None = None

    def is_suspected(self, t_ns: int) -> bool:
        """Whether a sign is younger than HOLD_NS."""
        return self._until_ns is not None and t_ns < self._until_ns

    def feed_satellites(self, t_ns: int, m: Satellites) -> str | None:
        """Add C/N0 values; returns the text of the sign that begins a suspicion."""
        known = [s for s in m.satellites if s.cn0_dbhz is not None and s.cn0_dbhz > 0.0]
        levels = {(s.system, s.number): s.cn0_dbhz for s in known if s.cn0_dbhz is not None}
        while self._levels and not 0 < t_ns - self._levels[0][0] <= SPAN_NS:
            self._levels.popleft()
        changes = [change for _, before in self._levels if (change := _mean_change(before, levels)) is not None]
        self._levels.append((t_ns, levels))
        largest = max(changes, key=abs, default=0.0)
        if abs(largest) <= CN0_DB:
            return None
        return self._suspect(t_ns, f"C/N0 of its satellites changed by {largest:+.0f} dB within 10 s")

    def feed_clock(self, t_ns: int, m: ReceiverClock) -> str | None:
        """Add a clock; returns the text of the sign that begins a suspicion."""
        if not m.valid or m.offset is None or not math.isfinite(m.offset):
            return None
        last, self._clock = self._clock, (t_ns, m)
        if last is None or last[1].offset is None or not 0 < t_ns - last[0] <= MAX_GAP_NS:
            return None
        dt = (t_ns - last[0]) / SECOND_NS
        step = m.offset - last[1].offset - 0.5 * ((m.drift or 0.0) + (last[1].drift or 0.0)) * dt
        sd = math.hypot(m.offset_sd or 0.0, last[1].offset_sd or 0.0)
        if m.drift is None or not math.isfinite(step + sd) or abs(step) <= CLOCK_S + K_CLOCK * sd:
            return None
        if abs(step) > STEP_SD_S and abs(math.remainder(step, MILLISECOND_S)) <= STEP_SD_S:
            return None
        return self._suspect(t_ns, f"its clock stepped by {step * 1e6:+.2f} us")

    def _suspect(self, t_ns: int, sign: str) -> str | None:
        was_suspected = self.is_suspected(t_ns)
        self._until_ns = t_ns + HOLD_NS
        return None if was_suspected else sign


def _mean_change(before: dict[tuple[str, int], float], now: dict[tuple[str, int], float]) -> float | None:
    """Mean change of satellites that are tracked at both times [dB]; None of too few."""
    common = before.keys() & now.keys()
    if len(common) < MIN_SATELLITES:
        return None
    return sum(now[key] - before[key] for key in common) / len(common)
