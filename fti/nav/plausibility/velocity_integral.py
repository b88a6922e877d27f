"""Integral of one component of the stated velocity over time, by trapezoids."""

from __future__ import annotations

from collections import deque

from msgspec import Struct

from fti.constants import SECOND_NS
from fti.nav.plausibility.resolution import ResolutionEstimator

#: Maximum gap between velocities of a segment [ns].
MAX_GAP_NS = 3 * SECOND_NS
#: Minimum time between stored velocities [ns].
MIN_STEP_NS = 35_000_000
#: Stored entries: 4 s at the maximum rate.
HISTORY_SIZE = 128


class Integral(Struct, frozen=True, gc=False):
    """Integral at one time.

    path : [m] since the segment began;  speed : [m/s];  segment : paths of different segments cannot be compared
    age_s : extrapolation beyond the newest velocity [s]
    """

    path: float
    speed: float
    segment: int
    age_s: float


class VelocityIntegral:
    """One axis.  Values in m/s, positive along the axis.  interval_s : between the newest velocities [s]"""

    def __init__(self) -> None:
        self._entries: deque[tuple[int, float, float]] = deque(maxlen=HISTORY_SIZE)  # time, path, speed
        self._segment = 0
        self._resolution = ResolutionEstimator()
        self.interval_s = 1.0

    @property
    def newest_ns(self) -> int | None:
        """Time of the newest velocity."""
        return self._entries[-1][0] if self._entries else None

    @property
    def step(self) -> float:
        """Resolution of the velocity [m/s]; 0 while it is unknown."""
        return self._resolution.step or 0.0

    def feed(self, t_ns: int, speed: float) -> None:
        """Add a velocity; one that is older than the newest is ignored."""
        if not self._entries:
            self._begin(t_ns, speed)
            return
        last_ns, path, before = self._entries[-1]
        if t_ns - last_ns < MIN_STEP_NS:
            return
        self._resolution.update(speed)
        if t_ns - last_ns > MAX_GAP_NS:
            self._begin(t_ns, speed)
            return
        self.interval_s = (t_ns - last_ns) / SECOND_NS
        path += 0.5 * (speed + before) * (t_ns - last_ns) / SECOND_NS
        self._entries.append((t_ns, path, speed))

    def _begin(self, t_ns: int, speed: float) -> None:
        self._entries.clear()
        self._entries.append((t_ns, 0.0, speed))
        self._segment += 1

    def at(self, t_ns: int) -> Integral | None:
        """Integral at a time; None where no velocity is within MAX_GAP_NS."""
        after: tuple[int, float, float] | None = None
        for entry in reversed(self._entries):
            if entry[0] <= t_ns:
                return self._between(t_ns, entry, after)
            after = entry
        return None

    def _between(
        self, t_ns: int, entry: tuple[int, float, float], after: tuple[int, float, float] | None
    ) -> Integral | None:
        since, (begin_ns, path, speed) = (t_ns - entry[0]) / SECOND_NS, entry
        if after is None:
            if t_ns - begin_ns > MAX_GAP_NS:
                return None
            return Integral(path + speed * since, speed, self._segment, since)
        now = speed + (after[2] - speed) * (t_ns - begin_ns) / (after[0] - begin_ns)
        return Integral(path + 0.5 * (speed + now) * since, now, self._segment, 0.0)
