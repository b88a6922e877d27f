"""Test ``heading_track``: in wings-level flight heading and track differ by the wind only.

    |heading - track| <= asin(wind / speed) + 5.5 sd + 3 deg

wind: the configured maximum; tested above 1.5 times that speed, and refused after 10 s beyond the limit.  At 60 m/s
with a wind of 40 m/s the limit is 42 deg and more: the test detects gross heading errors.
"""

from __future__ import annotations

import math

from fti.geodesy.formulas import wrap_half_turn
from fti.messages.measurements import Attitude
from fti.messages.reasons import Reason
from fti.nav.plausibility.attitude import HEADING_SD_UNKNOWN
from fti.nav.plausibility.budget import K_FALSE
from fti.nav.plausibility.finding import PlausibilityFinding
from fti.nav.time_series import SECOND_NS

LEVEL = math.radians(5.0)
SIDESLIP = math.radians(3.0)
SPEED_RATIO = 1.5
MIN_DURATION_NS = 10 * SECOND_NS
#: Maximum time between compared track and attitude [ns].
MAX_PAIRING_NS = SECOND_NS


class HeadingTest:
    """Headings of one source.  wind : the maximum [m/s]"""

    def __init__(self, wind: float) -> None:
        self._wind = wind
        self._track: tuple[int, float, float] | None = None
        self._roll: tuple[int, float] | None = None
        self._since_ns: int | None = None

    def feed_track(self, t_ns: int, north: float, east: float) -> None:
        """Add a velocity over ground of a valid source [m/s]."""
        self._track = t_ns, math.hypot(north, east), math.atan2(east, north)

    def feed(self, t_ns: int, m: Attitude) -> list[PlausibilityFinding] | None:
        """Add an attitude; None where it is not comparable."""
        if m.roll is not None:
            self._roll = t_ns, m.roll
        if m.heading is None or not math.isfinite(m.heading) or not self._is_comparable(t_ns):
            return None
        assert self._track is not None
        _, speed, track = self._track
        sd = m.heading_sd if m.heading_sd is not None and 0.0 < m.heading_sd < math.inf else HEADING_SD_UNKNOWN
        limit = math.asin(self._wind / speed) + K_FALSE * sd + SIDESLIP
        off = wrap_half_turn(m.heading - track)
        if abs(off) <= limit:
            self._since_ns = None
            return []
        self._since_ns = t_ns if self._since_ns is None else self._since_ns
        if t_ns - self._since_ns < MIN_DURATION_NS:
            return None
        text = f"{math.degrees(off):+.0f} deg from the track at {speed:.0f} m/s, limit {math.degrees(limit):.0f} deg"
        return [PlausibilityFinding(Reason.HEADING_TRACK, self._since_ns, text)]

    def _is_comparable(self, t_ns: int) -> bool:
        """Whether the flight is wings level with a current track; otherwise a contradiction restarts."""
        is_level = self._roll is not None and t_ns - self._roll[0] <= MAX_PAIRING_NS and abs(self._roll[1]) <= LEVEL
        is_moving = self._track is not None and abs(t_ns - self._track[0]) <= MAX_PAIRING_NS
        is_fast = is_moving and self._track is not None and self._track[1] >= SPEED_RATIO * self._wind
        if not (is_level and is_fast):
            self._since_ns = None
        return is_level and is_fast
