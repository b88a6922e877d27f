"""Test ``heading_track``: in wings-level flight the heading is that of the track but for the wind.

    |heading - track| <= asin(wind / speed) + 5.5 sd + 3 deg

wind: the strongest of the configuration; tested from 1.5 times that speed on, and refused after 10 s beyond.  At 60 m/s
with a wind of 40 m/s that is 42 deg and more: the test sees a heading that is grossly wrong.
"""

from __future__ import annotations

import math

from fti.nav.plausibility.attitude import HEADING_SD_UNKNOWN
from fti.nav.plausibility.budget import K_FALSE
from fti.nav.plausibility.finding import PlausibilityFinding
from fti.nav.time_series import SECOND_NS, wrap
from fti.types import Attitude, Reason

LEVEL = math.radians(5.0)
SIDESLIP = math.radians(3.0)
SPEED_RATIO = 1.5
MIN_DURATION_NS = 10 * SECOND_NS
#: A track is compared with attitudes that are no farther away [ns].
MAX_PAIRING_NS = SECOND_NS


class HeadingTest:
    """Headings of one source.  wind : the strongest one [m/s]"""

    def __init__(self, wind: float) -> None:
        self._wind = wind
        self._track: tuple[int, float, float] | None = None
        self._roll: tuple[int, float] | None = None
        self._since_ns: int | None = None

    def feed_track(self, t_ns: int, north: float, east: float) -> None:
        """Take a velocity over ground of a source that is valid [m/s]."""
        self._track = t_ns, math.hypot(north, east), math.atan2(east, north)

    def take(self, t_ns: int, m: Attitude) -> list[PlausibilityFinding] | None:
        """Take an attitude; None where it cannot be compared."""
        if m.roll is not None:
            self._roll = t_ns, m.roll
        if m.heading is None or not math.isfinite(m.heading) or not self._is_comparable(t_ns):
            return None
        assert self._track is not None
        _, speed, track = self._track
        sd = m.heading_sd if m.heading_sd is not None and 0.0 < m.heading_sd < math.inf else HEADING_SD_UNKNOWN
        limit = math.asin(self._wind / speed) + K_FALSE * sd + SIDESLIP
        off = wrap(m.heading - track)
        if abs(off) <= limit:
            self._since_ns = None
            return []
        self._since_ns = t_ns if self._since_ns is None else self._since_ns
        if t_ns - self._since_ns < MIN_DURATION_NS:
            return None
        text = f"{math.degrees(off):+.0f} deg from the track at {speed:.0f} m/s, limit {math.degrees(limit):.0f} deg"
        return [PlausibilityFinding(Reason.HEADING_TRACK, self._since_ns, text)]

    def _is_comparable(self, t_ns: int) -> bool:
        """In flight, wings level, with a track of now; else a contradiction must begin anew."""
        is_level = self._roll is not None and t_ns - self._roll[0] <= MAX_PAIRING_NS and abs(self._roll[1]) <= LEVEL
        is_moving = self._track is not None and abs(t_ns - self._track[0]) <= MAX_PAIRING_NS
        is_fast = is_moving and self._track is not None and self._track[1] >= SPEED_RATIO * self._wind
        if not (is_level and is_fast):
            self._since_ns = None
        return is_level and is_fast
