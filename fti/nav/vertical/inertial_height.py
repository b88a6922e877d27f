"""A vertical channel of its own: specific force and attitude become climb and height, and errors grow freely."""

from __future__ import annotations

import math
from bisect import bisect_right

from msgspec import Struct

from fti.constants import SECOND_NS
from fti.geodesy.formulas import EARTH_RATE, SEMI_MAJOR, Vector, dot, down_row, normal_gravity

#: Number of stored heights: 2 s at 400 Hz.
MAX_ENTRIES = 800


class HorizontalMotion(Struct, frozen=True, gc=False):
    """Horizontal motion, as the vertical channel needs it: lat [rad], velocity north and east [m/s]."""

    lat: float
    north: float
    east: float


def vertical_acceleration(accel_b: Vector, roll: float, pitch: float, motion: HorizontalMotion, alt: float) -> float:
    """Rate of change of the climb [m/s^2], positive up.

        d(climb)/dt = -(0 0 1) mat_nb accel_b - g(lat, alt) + 2 omega_ie cos(lat) v_E + (v_N^2 + v_E^2) / (a + alt)

    accel_b : specific force [m/s^2];  roll, pitch [rad];  alt above the ellipsoid [m]
    The semi-major axis a replaces both radii of curvature: an error of 4e-6 m/s^2 at 60 m/s.  The last two terms are
    9e-3 m/s^2 at 60 m/s to the east; without them the height error is 45 m after 100 s.
    Source: Titterton and Weston 2004, section 3.7 (vertical component of the local geographic mechanisation).
    """
    up = -dot(down_row(roll, pitch), accel_b)
    gravity = normal_gravity(math.sin(motion.lat), alt)
    curvature = (motion.north**2 + motion.east**2) / (SEMI_MAJOR + alt)
    return up - gravity + 2.0 * EARTH_RATE * math.cos(motion.lat) * motion.east + curvature


class InertialHeight:
    """Height and climb, integrated by the trapezoidal rule, with the heights of the last two seconds."""

    def __init__(self, t_ns: int, alt: float, climb: float) -> None:
        self.t_ns, self.alt, self.climb = t_ns, alt, climb
        self.accel: float | None = None
        self._times = [t_ns]
        self._past = [(alt, climb)]

    def advance(self, t_ns: int, accel: float) -> None:
        """Integrate to t_ns, later than the last time.  accel : vertical acceleration at t_ns [m/s^2]"""
        dt = (t_ns - self.t_ns) / SECOND_NS
        previous = accel if self.accel is None else self.accel
        self.alt += dt * (self.climb + dt * (2.0 * previous + accel) / 6.0)
        self.climb += 0.5 * dt * (previous + accel)
        self.t_ns, self.accel = t_ns, accel
        self._times.append(t_ns)
        self._past.append((self.alt, self.climb))
        if len(self._times) > 2 * MAX_ENTRIES:
            del self._times[:-MAX_ENTRIES], self._past[:-MAX_ENTRIES]

    def at(self, t_ns: int) -> tuple[float, float]:
        """Height [m] and climb [m/s] at t_ns, extrapolated from the sample before it, or the first one."""
        i = max(0, bisect_right(self._times, t_ns) - 1)
        alt, climb = self._past[i]
        return alt + climb * (t_ns - self._times[i]) / SECOND_NS, climb

    def shift(self, alt: float, climb: float) -> None:
        """Subtract an error of height [m] and climb [m/s] from present and past values."""
        self.alt, self.climb = self.alt - alt, self.climb - climb
        end_ns = self.t_ns
        self._past = [
            (h - alt - climb * (t - end_ns) / SECOND_NS, c - climb)
            for t, (h, c) in zip(self._times, self._past, strict=True)
        ]
