"""The clock of one device relative to FTI time: live offset and drift, from messages with device time.

    arrival - device time = offset + slope x (device time) + delay,   delay >= minimum delay

The line is the lower envelope (``fti.nav.device_time.delay_envelope``) of the fastest message of each second, over the
last hour.  The distance above it is lateness: t_valid = arrival - lateness - latency of the device.  The minimum delay
is not observable; the configured latency replaces it.

A counter that wraps at a known period continues (``WRAPS``).  Any other lasting change - a restart, a leap second, a
receiver that finds its date, a changed delay - starts a new segment after 10 s of messages with none near the line.
After 2 s (and five messages) the clock is not trusted: until it is known again, the arrival is used.  Late messages
keep their order, so five messages in a row that are older than the newest are sufficient, too.  Until then a message
that is later than its age limit keeps its time and is stale: with its arrival time it would look fresh.  A drift change
(temperature) moves the line with its window: 0.1 ppm in an hour is 0.05 ms.
"""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np

from fti.arrays import Array, Ints
from fti.constants import SECOND_NS
from fti.messages.measurements import TimeScale
from fti.nav.device_time.delay_envelope import MIN_SAMPLES, EnvelopeLine, fit_line

#: The fastest message of each second is stored for so many seconds.
WINDOW_S = 3600
#: Largest drift of an oscillator: zero drift is assumed until it is known this well.
UNKNOWN_DRIFT = 1e-4
#: One sigma of a validity time from the arrival alone [ns] (source 003, fig. 6.10: logs up to 25 ms late).
ARRIVAL_SD_NS = 25e6
#: The line is known when its sigma is below this [ns].
GOOD_SD_NS = 1e6
#: The drift is reported when it is known this well.
MAX_REPORTED_SLOPE_95 = 2e-6
#: A message is near the line within this plus four times the usual spread plus four sigma of the line [ns].
NEAR_NS = 10e6
NEAR_FACTOR = 4.0
#: Messages and time without one near the line until the clock is not trusted; until a new segment starts.
MIN_OUTLIERS = 5
TIMEOUT_TRUST_NS = 2 * SECOND_NS
TIMEOUT_SEGMENT_NS = 10 * SECOND_NS
#: Largest lateness of messages; a larger one means that the clock was set.
MAX_LATENESS_NS = 60 * SECOND_NS
#: Periods of counters that wrap [ns]: 32 bits of milliseconds; week, ten bits of weeks, day.
DAY_NS = 86_400 * SECOND_NS
WRAPS = {
    TimeScale.BOOT: (2**32 * 1_000_000,),
    TimeScale.GPS: (7 * DAY_NS, 1024 * 7 * DAY_NS),
    TimeScale.UTC: (DAY_NS, 1024 * 7 * DAY_NS),
}


class ClockState(StrEnum):
    """State of the estimate of a device's clock."""

    LEARNING = "learning"  # too short a time, or too much scatter: the arrival is used
    GOOD = "good"
    AWAY = "away"  # messages contradict the estimate: the arrival is used


class ClockSegment:
    """One continuous run of a device's clock, started by its first message.  Device times are unwrapped [ns].

    first_ns, last_ns : arrival of its first and its last message
    messages, late : number of its messages, and of those not near the line
    largest_ns     : largest lateness
    newest_ns      : newest device time in a message near the line
    """

    def __init__(self, t_rx_ns: int, t_dev_ns: int, window_s: int | None) -> None:
        self.first_ns = self.last_ns = t_rx_ns
        self.messages = self.late = 0
        self.largest_ns = 0.0
        self.newest_ns = t_dev_ns
        self._x0, self._y0 = t_dev_ns, t_rx_ns - t_dev_ns
        self._window = window_s
        self._x: list[float] = []
        self._y: list[float] = []
        self._slot = 0
        self._quickest: tuple[float, float] | None = None
        self._unfitted = 0
        self._last_dev_ns = t_dev_ns
        self._grid_ns = 0
        self._shortest_ns = TIMEOUT_SEGMENT_NS
        self.line = EnvelopeLine(0.0, UNKNOWN_DRIFT, 0.0, ARRIVAL_SD_NS, 0.0, 0.0, "none")

    def lateness(self, t_rx_ns: int, t_dev_ns: int) -> float:
        """Distance of a message above the line [ns]."""
        return t_rx_ns - t_dev_ns - self._y0 - self.line.at(t_dev_ns - self._x0)

    def lateness_of(self, t_rx_ns: Ints, t_dev_ns: Ints) -> Ints:
        """``lateness`` of many messages, shape (n,)."""
        line = self.line.at((t_dev_ns - self._x0).astype(np.float64))
        return np.asarray(t_rx_ns - t_dev_ns - self._y0 - np.rint(line).astype(np.int64))

    def near_ns(self, t_dev_ns: int) -> float:
        """Largest distance from the line of a message that is near it [ns]."""
        line = self.line
        return NEAR_NS + NEAR_FACTOR * (line.spread + min(self.sd_ns(t_dev_ns), ARRIVAL_SD_NS))

    def sd_ns(self, t_dev_ns: int, line: EnvelopeLine | None = None) -> float:
        """One sigma of the line [ns]; line : another one of this segment's ``points``."""
        return (line or self.line).sd(t_dev_ns - self._x0)

    def add(self, t_rx_ns: int, t_dev_ns: int) -> None:
        """Add a message; the fastest of each second is used, late ones of an earlier second are not."""
        self.messages += 1
        self.last_ns = t_rx_ns
        self._measure_resolution(t_dev_ns)
        x, y = float(t_dev_ns - self._x0), float(t_rx_ns - t_dev_ns - self._y0)
        slot = int(x // SECOND_NS)
        if self._quickest is None or slot > self._slot:
            self._close_slot()
            self._slot, self._quickest = slot, (x, y)
        elif slot == self._slot and y < self._quickest[1]:
            self._quickest = (x, y)

    def finish(self) -> None:
        """Fit all messages."""
        self._close_slot()
        self._quickest = None
        self._fit()

    def _measure_resolution(self, t_dev_ns: int) -> None:
        """Update the greatest common divisor of device time steps, and the shortest step."""
        step = abs(t_dev_ns - self._last_dev_ns)
        if step:
            self._last_dev_ns = t_dev_ns
            self._grid_ns = math.gcd(self._grid_ns, step)
            self._shortest_ns = min(self._shortest_ns, step)

    @property
    def resolution_ns(self) -> int:
        """Resolution of the device time; 0 if all steps are whole multiples of the shortest."""
        return self._grid_ns if self._grid_ns < self._shortest_ns else 0

    def _close_slot(self) -> None:
        if self._quickest is None:
            return
        self._x.append(self._quickest[0])
        self._y.append(self._quickest[1])
        self._unfitted += 1
        if self._unfitted > len(self._x) // 10:
            self._fit()

    def _fit(self) -> None:
        if self._window is not None:
            del self._x[: -self._window], self._y[: -self._window]
        self._unfitted = 0
        line = fit_line(*self.points, float(self.resolution_ns))
        if line and line.slope_95 < UNKNOWN_DRIFT:
            self.line = line
        elif self._x:
            lowest = int(np.argmin(self._y))
            self.line = EnvelopeLine(0.0, UNKNOWN_DRIFT, self._y[lowest], ARRIVAL_SD_NS, self._x[lowest], 0.0, "none")

    @property
    def points(self) -> tuple[Array, Array]:
        """The fastest message of each second: device time and arrival - device time [ns], relative."""
        return np.array(self._x), np.array(self._y)

    @property
    def is_known(self) -> bool:
        """Whether a line was fitted."""
        return self.line.method != "none" and len(self._x) >= MIN_SAMPLES

    @property
    def drift_ppm(self) -> float:
        """Drift of the device's clock relative to FTI time; positive: it is faster."""
        return 1e6 * (1.0 / (1.0 + self.line.slope) - 1.0)

    def device_ns(self, t_ns: int, line: EnvelopeLine | None = None) -> int:
        """Device time [ns] of a message that arrives at t_ns with minimum delay.

        line : another one of this segment's ``points``
        """
        line = line or self.line
        since = float(t_ns - self._x0 - self._y0)
        return self._x0 + round(since - line.at(since - line.at(since)))


class ClockEstimator:
    """The clock of a device, in one time scale.

    latency_ns : minimum delay from device time to arrival
    max_age_ns : messages with an older device time are refused
    window_s   : see ``WINDOW_S``; None: unlimited (offline)
    segments   : finished ones and the present one; refused : messages that did not fit
    unwrap_ns  : sum of the periods of wrapped counters
    """

    def __init__(
        self, scale: TimeScale, latency_ns: int, max_age_ns: int, window_s: int | None = WINDOW_S, name: str = ""
    ) -> None:
        self.scale = scale
        self.segments: list[ClockSegment] = []
        self.refused = 0
        self._name = name
        self._latency_ns, self._max_age_ns, self._window = latency_ns, max_age_ns, window_s
        self.unwrap_ns = 0
        self._outliers_since_ns: int | None = None
        self._outliers = self._backward_count = 0
        self._is_distrusted = False
        self._is_drift_reported = False
        self._event_texts: list[str] = []

    @property
    def segment(self) -> ClockSegment | None:
        """The present segment."""
        return self.segments[-1] if self.segments else None

    @property
    def state(self) -> ClockState:
        """State of the present segment."""
        segment = self.segment
        if self._is_distrusted:
            return ClockState.AWAY
        certain = segment is not None and segment.is_known and segment.line.level_sd <= GOOD_SD_NS
        return ClockState.GOOD if certain else ClockState.LEARNING

    def drain_event_texts(self) -> list[str]:
        """Texts of events since the last call."""
        news, self._event_texts = self._event_texts, []
        return news

    def feed(self, t_rx_ns: int, t_dev_ns: int) -> int | None:
        """Take a message; returns its time of validity in FTI time [ns], or None if the clock is not trusted.

        It may be older than its age limit, and is never later than its arrival minus the latency.
        """
        segment = self.segments[-1] if self.segments else self._begin(t_rx_ns, t_dev_ns)
        t_dev_ns, late = self._unwrap(segment, t_rx_ns, t_dev_ns)
        near = segment.near_ns(t_dev_ns)
        if late < -near and not segment.is_known:  # the first messages were late
            self.segments.pop()
            segment, late = self._begin(t_rx_ns, t_dev_ns), 0.0
        self._watch(segment, t_rx_ns, t_dev_ns, near=abs(late) <= near)
        if self._outliers >= MIN_OUTLIERS and self._outlier_duration_ns(t_rx_ns) >= TIMEOUT_SEGMENT_NS:
            self._renew(t_rx_ns, t_dev_ns)
            return None
        if not -near <= late <= self._max_age_ns - self._latency_ns:
            self.refused += 1
            return self._valid_ns(segment, t_rx_ns, t_dev_ns, late) if near < late <= MAX_LATENESS_NS else None
        segment.add(t_rx_ns, t_dev_ns)
        segment.late += late > near
        segment.largest_ns = max(segment.largest_ns, late)
        return self._valid_ns(segment, t_rx_ns, t_dev_ns, late)

    def _valid_ns(self, segment: ClockSegment, t_rx_ns: int, t_dev_ns: int, late: float) -> int | None:
        """Time of validity of a message; None while the clock is not known well enough."""
        if self._is_distrusted or not segment.is_known or not segment.sd_ns(t_dev_ns) <= GOOD_SD_NS:
            return None
        self._report_drift(segment)
        return t_rx_ns - round(max(late, 0.0)) - self._latency_ns

    def device_ns(self, t_ns: int) -> int:
        """Device time at the FTI time t_ns [ns]; there must be a segment."""
        segment = self.segments[-1]
        return segment.device_ns(t_ns + self._latency_ns) - self.unwrap_ns

    def sd_ns(self, t_ns: int) -> float:
        """One sigma of ``device_ns`` [ns]."""
        segment = self.segments[-1]
        return segment.sd_ns(segment.device_ns(t_ns + self._latency_ns))

    def finish(self) -> None:
        """Finish all segments after the last message."""
        for segment in self.segments:
            segment.finish()

    def _begin(self, t_rx_ns: int, t_dev_ns: int) -> ClockSegment:
        self.segments.append(ClockSegment(t_rx_ns, t_dev_ns, self._window))
        return self.segments[-1]

    def _watch(self, segment: ClockSegment, t_rx_ns: int, t_dev_ns: int, *, near: bool) -> None:
        """Count messages that are not near the line, and those that are older than the newest."""
        if near:
            segment.newest_ns = max(segment.newest_ns, t_dev_ns)
            if self._outliers:
                self._clear_outliers()
            return
        self._outliers_since_ns = t_rx_ns if self._outliers_since_ns is None else self._outliers_since_ns
        self._outliers += 1
        self._backward_count = self._backward_count + 1 if t_dev_ns < segment.newest_ns else 0
        lasting = self._outliers >= MIN_OUTLIERS and self._outlier_duration_ns(t_rx_ns) > TIMEOUT_TRUST_NS
        self._is_distrusted |= lasting or self._backward_count >= MIN_OUTLIERS

    def _clear_outliers(self) -> None:
        self._outliers_since_ns, self._outliers, self._backward_count, self._is_distrusted = None, 0, 0, False

    def _outlier_duration_ns(self, t_rx_ns: int) -> int:
        return 0 if self._outliers_since_ns is None else t_rx_ns - self._outliers_since_ns

    def _renew(self, t_rx_ns: int, t_dev_ns: int) -> None:
        """Start a new segment: the clock was set, or the delay has changed."""
        start_ns = self._outliers_since_ns or t_rx_ns
        self._clear_outliers()
        self._is_drift_reported = False
        previous = self.segments[-1]
        segment = self._begin(t_rx_ns, t_dev_ns)
        segment.first_ns = start_ns
        segment.add(t_rx_ns, t_dev_ns)
        if previous.is_known:
            step = (t_dev_ns - previous.device_ns(t_rx_ns)) / SECOND_NS
            self._event_texts.append(
                f"the clock of {self._name} ({self.scale}) stepped by {step:+.3f} s; it is estimated again"
            )

    def _unwrap(self, segment: ClockSegment, t_rx_ns: int, t_dev_ns: int) -> tuple[int, float]:
        """Device time without the wraps of a counter, and its distance above the line."""
        unwrapped = t_dev_ns + self.unwrap_ns
        late = segment.lateness(t_rx_ns, unwrapped)
        if abs(late) < 1000 * SECOND_NS:
            return unwrapped, late
        for jump in (sign * period for period in WRAPS[self.scale] for sign in (1, -1)):
            jumped = segment.lateness(t_rx_ns, unwrapped + jump)
            if abs(jumped) <= self._max_age_ns:
                self.unwrap_ns += jump
                self._event_texts.append(
                    f"the counter of {self._name} ({self.scale}) stepped by {-jump / SECOND_NS:+.0f} s"
                )
                return unwrapped + jump, jumped
        return unwrapped, late

    def _report_drift(self, segment: ClockSegment) -> None:
        if not self._is_drift_reported and segment.line.slope_95 < MAX_REPORTED_SLOPE_95:
            drift = f"{segment.drift_ppm:+.2f} +- {1e6 * segment.line.slope_95:.2f} ppm against FTI time"
            self._event_texts.append(f"the clock of {self._name} ({self.scale}) is known: {drift}")
            self._is_drift_reported = True
