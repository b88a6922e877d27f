"""Test ``heading_track``: in wings-level flight heading and track differ by the wind only.

    |heading - track| <= asin(wind / speed) + 5.5 sd + 3 deg

wind: the configured maximum; tested above 1.5 times that speed, and refused after 10 s beyond the limit.  At 60 m/s
with a wind of 40 m/s the limit is 42 deg and more: the test detects gross heading errors.
"""

from __future__ import annotations

import math

from fti.constants import SECOND_NS
from fti.geodesy.formulas import wrap_half_turn
from fti.messages.measurements import Attitude
from fti.messages.reasons import Reason
from fti.nav.plausibility.attitude import HEADING_SD_UNKNOWN
from fti.nav.plausibility.budget import K_FALSE
from fti.nav.plausibility.finding import PlausibilityFinding

LEVEL = math.radians(5.0)
SIDESLIP = math.radians(3.0)
SPEED_RATIO = 1.5
MIN_DURATION_NS = 10 * SECOND_NS
#: Maximum time between compared velocity and attitude [ns].
MAX_PAIRING_NS = SECOND_NS
#: Time [ns], north and east [m/s].
TimedVelocity = tuple[int, float, float]


class HeadingTest:
    """Headings of one source.  wind : the maximum [m/s]"""

    def __init__(self, wind: float) -> None:
        self._wind = wind
        self._roll: tuple[int, float] | None = None
        self._since_ns: int | None = None

    def feed(self, t_ns: int, m: Attitude, velocity: TimedVelocity) -> list[PlausibilityFinding] | None:
        """Add an attitude; None where it is not comparable.  velocity : newest of any valid source; 0 without one"""
        if m.roll is not None:
            self._roll = t_ns, m.roll
        if m.heading is None or not math.isfinite(m.heading):
            return None
        velocity_ns, north, east = velocity
        is_level = self._roll is not None and t_ns - self._roll[0] <= MAX_PAIRING_NS and abs(self._roll[1]) <= LEVEL
        speed = math.hypot(north, east)
        if not is_level or abs(t_ns - velocity_ns) > MAX_PAIRING_NS or speed < SPEED_RATIO * self._wind:
            self._since_ns = None
            return None
        track = math.atan2(east, north)
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
