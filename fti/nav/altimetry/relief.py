"""Estimates the relief of unknown ground, which enters the sigma of a height above it.

An altimeter measures the ground at an offset from the nadir: a laser by its tilt, a radar anywhere within its beam.
Without terrain the difference of ground height is an error of the height below the aircraft.  Its sigma is configured
(``relief_m``), or taken from the profile that this altimeter has measured in the last 20 s:

    z_k = alt_k - nearest_k         D(L) = sqrt(mean (z(s + L) - z(s))^2),        L: maximum offset

D is the structure function of the profile along the track; the ground across it is assumed to be similar.  Without an
altitude the profile is -nearest_k without its linear trend: a steady climb is not relief.

Far from the measured ground D is sqrt(2) times the standard deviation of the profile.  This value, at least 10 m, is
assumed
- below 5 m/s and without a speed: a hover does not show the ground around;
- while a value repeats exactly for 2 s or more and for five samples: it may be stuck, and would look like level ground
  in level flight.  An altimeter with coarse steps over level ground repeats, too; its sigma is enlarged as well;
- after both, until a new profile is 5 s long.
Before the first profile 10 m are assumed.
Chosen, not measured: span, step and the initial value.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from fti.arrays import Array
from fti.constants import SECOND_NS
from fti.nav.altimetry.stuck_value import MIN_RUN_NS, MIN_RUN_SAMPLES
from fti.nav.navigation import NavState

STEP_NS = SECOND_NS // 5
SPAN = 100
MIN_COUNT = 25
#: A longer gap begins a new profile [ns].
MAX_GAP_NS = 2 * SECOND_NS
#: Assumed before there is a profile [m].
RELIEF_UNKNOWN_M = 10.0
#: Below this speed the aircraft hovers: its profile does not show the ground around [m/s].
MIN_SPEED = 5.0


class ReliefEstimator:
    """The relief below one altimeter.  assumed : one sigma [m] from the configuration; None : from the profile"""

    def __init__(self, assumed: float | None) -> None:
        self._assumed = assumed
        self._profile: deque[tuple[int, float]] = deque(maxlen=SPAN)  # time [ns], height [m]
        self._newest_ns = 0
        self._has_altitude = False
        self._far = RELIEF_UNKNOWN_M  # assumed without a profile
        self._value: float | None = None
        self._value_ns, self._samples = 0, 0  # begin and samples of its repetition
        self._speed: float | None = None

    def feed(self, t_ns: int, value: float, nearest: float, nav: NavState) -> None:
        """Add a stated range [m], the height of P over level ground [m], and the navigation state."""
        position = nav.position
        alt = position.alt if position else None
        is_new = value != self._value
        if is_new:
            self._value, self._value_ns, self._samples = value, t_ns, 0
        self._samples += 1
        since = t_ns - self._newest_ns
        if since < STEP_NS:
            return
        if since > MAX_GAP_NS or (alt is None) == self._has_altitude:
            self._start_profile(t_ns)
        self._newest_ns, self._has_altitude = t_ns, alt is not None
        self._follow_speed(nav)
        if self._samples >= MIN_RUN_SAMPLES and t_ns - self._value_ns >= MIN_RUN_NS:
            self._start_profile(self._value_ns)
        elif alt is not None or is_new:
            self._profile.append((t_ns, (alt or 0.0) - nearest))

    def sd(self, offset: float) -> float:
        """One sigma [m] of the ground height at the nadir minus at the measured point.  offset : of both [m]"""
        if self._assumed is not None:
            return self._assumed
        if len(self._profile) < MIN_COUNT:
            return self._far
        if self._speed is None or self._speed < MIN_SPEED:
            return self._far_sd()
        profile = self._heights()
        steps = min(offset / self._speed * SECOND_NS / STEP_NS, SPAN)  # may be huge: limited before rounding
        lag = min(max(round(steps), 1), len(profile) // 2)
        return float(np.sqrt(np.mean(np.square(profile[lag:] - profile[:-lag]))))

    def _follow_speed(self, nav: NavState) -> None:
        """After a hover a new profile begins."""
        position, before = nav.position, self._speed
        known = position is not None and position.north is not None and position.east is not None
        self._speed = math.hypot(position.north or 0.0, position.east or 0.0) if known and position else None
        if before is not None and before < MIN_SPEED and (self._speed is None or self._speed >= MIN_SPEED):
            self._start_profile(self._newest_ns)

    def _start_profile(self, end_ns: int) -> None:
        """Begin a new profile; until it is long enough, the earlier ones up to end_ns count.

        A profile that is too short may raise the assumed value, but does not lower it.
        """
        while self._profile and self._profile[-1][0] > end_ns:
            self._profile.pop()
        if len(self._profile) >= MIN_COUNT:
            self._far = self._far_sd()
        elif len(self._profile) > 1:
            self._far = max(self._far, self._far_sd())
        self._profile.clear()

    def _far_sd(self) -> float:
        return max(RELIEF_UNKNOWN_M, math.sqrt(2.0) * float(np.std(self._heights())))

    def _heights(self) -> Array:
        heights = np.array([height for _, height in self._profile])
        return heights if self._has_altitude else _without_trend(heights)


def _without_trend(profile: Array) -> Array:
    at = np.arange(len(profile)) - 0.5 * (len(profile) - 1)
    return np.asarray(profile - at * (at @ profile) / (at @ at))
