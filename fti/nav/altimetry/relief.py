"""How uneven unknown ground may be: the relief that is assumed in the sigma of a height above it.

An altimeter sees the ground beside the point straight below: a laser by its tilt, a radar anywhere within its beam.
Where no terrain says how high it is there, the difference is an error of the height below the aircraft.  Its sigma is
configured (``relief_m``), or taken from the profile that this altimeter has seen in the last 20 s:

    z_k = alt_k - nearest_k         D(L) = sqrt(mean (z(s + L) - z(s))^2),        L: how far beside it may look

D is the structure function of the profile along the track, and the ground across it is taken to be alike.  Without an
altitude the profile is -nearest_k less its straight line: a steady climb is no relief.  A value that is stuck then
looks like level ground, so repeated values are left out.  Without a speed D is sqrt(2) times the standard deviation of
the profile, what it is for a large L.  Until the profile is 5 s long 10 m are assumed.
Stated, not measured: span, step and the first value.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from fti.nav.navigation import NavState
from fti.nav.series import SECOND_NS

Array = NDArray[np.float64]

STEP_NS = SECOND_NS // 5
SPAN = 100
MIN_COUNT = 25
#: A longer silence begins a new profile [ns].
MAX_GAP_NS = 2 * SECOND_NS
#: Assumed before there is a profile [m].
RELIEF_UNKNOWN_M = 10.0
#: An aircraft that is slower hovers: its profile says nothing of what lies beside [m/s].
MIN_SPEED = 5.0


class ReliefEstimator:
    """The relief below one altimeter.  assumed : one sigma [m] from the configuration; None : from the profile"""

    def __init__(self, assumed: float | None) -> None:
        self._assumed = assumed
        self._profile: deque[float] = deque(maxlen=SPAN)
        self._newest_ns = 0
        self._has_altitude = False
        self._value: float | None = None
        self._speed: float | None = None

    def take(self, t_ns: int, value: float, nearest: float, nav: NavState) -> None:
        """Range as the altimeter stated it [m], height of P above what the beam sees [m], and the navigation state."""
        position = nav.position
        alt = position.alt if position else None
        since = t_ns - self._newest_ns
        if 0 <= since < STEP_NS:
            return
        if not 0 <= since <= MAX_GAP_NS or (alt is None) == self._has_altitude:
            self._profile.clear()
        if alt is None and value == self._value:
            return
        self._value = value
        self._newest_ns, self._has_altitude = t_ns, alt is not None
        self._profile.append((alt or 0.0) - nearest)
        known = position is not None and position.north is not None and position.east is not None
        self._speed = math.hypot(position.north or 0.0, position.east or 0.0) if known and position else None

    def sd(self, beside: float) -> float:
        """One sigma [m] of the ground straight below against that which is seen.  beside : how far beside [m]"""
        if self._assumed is not None:
            return self._assumed
        if len(self._profile) < MIN_COUNT:
            return RELIEF_UNKNOWN_M
        profile = np.array(self._profile)
        if not self._has_altitude:
            profile = _without_trend(profile)
        if self._speed is None or self._speed < MIN_SPEED:
            return math.sqrt(2.0) * float(np.std(profile))
        steps = min(beside / self._speed * SECOND_NS / STEP_NS, SPAN)  # of any height: before it is rounded
        lag = min(max(round(steps), 1), len(profile) // 2)
        return float(np.sqrt(np.mean(np.square(profile[lag:] - profile[:-lag]))))


def _without_trend(profile: Array) -> Array:
    at = np.arange(len(profile)) - 0.5 * (len(profile) - 1)
    return np.asarray(profile - at * (at @ profile) / (at @ at))
