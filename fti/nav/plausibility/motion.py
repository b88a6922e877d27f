"""Test ``impossible`` of stated velocities: speed, climb and acceleration against the limits of the aircraft."""

from __future__ import annotations

import math

from fti.config import SourceLimits
from fti.constants import SECOND_NS
from fti.messages.reasons import Reason
from fti.nav.plausibility.budget import K_FALSE
from fti.nav.plausibility.finding import PlausibilityFinding
from fti.nav.plausibility.sigmas import ARRIVAL_SD_S

#: Minimum and maximum time between velocities that are compared for their acceleration [ns].
MIN_SEPARATION_NS, MAX_SEPARATION_NS = 450_000_000, 3 * SECOND_NS


class MotionTest:
    """Velocities of one source."""

    def __init__(self, limits: SourceLimits) -> None:
        self._limits = limits
        self._level: tuple[int, float, float] | None = None
        self._vertical: tuple[int, float] | None = None

    def update_level(self, t_ns: int, north: float, east: float, sd: float) -> list[PlausibilityFinding]:
        """Test a horizontal velocity with its sigma [m/s]."""
        speed, limit = math.hypot(north, east), self._limits.speed_mps + K_FALSE * sd
        if speed > limit:
            return [PlausibilityFinding(Reason.IMPOSSIBLE, t_ns, f"{speed:.0f} m/s over ground, limit {limit:.0f} m/s")]
        before = self._level
        if before is None or not 0 <= t_ns - before[0] <= MAX_SEPARATION_NS:
            self._level = t_ns, north, east
            return []
        if t_ns - before[0] < MIN_SEPARATION_NS:
            return []
        self._level = t_ns, north, east
        return self._accelerates(t_ns, before[0], math.hypot(north - before[1], east - before[2]), sd)

    def update_vertical(self, t_ns: int, down: float, sd: float) -> list[PlausibilityFinding]:
        """Test a vertical velocity with its sigma [m/s]."""
        limit = self._limits.climb_mps + K_FALSE * sd
        if abs(down) > limit:
            return [
                PlausibilityFinding(
                    Reason.IMPOSSIBLE, t_ns, f"vertical speed {abs(down):.0f} m/s, limit {limit:.0f} m/s"
                )
            ]
        before = self._vertical
        if before is None or not 0 <= t_ns - before[0] <= MAX_SEPARATION_NS:
            self._vertical = t_ns, down
            return []
        if t_ns - before[0] < MIN_SEPARATION_NS:
            return []
        self._vertical = t_ns, down
        return self._accelerates(t_ns, before[0], abs(down - before[1]), sd)

    def _accelerates(self, t_ns: int, since_ns: int, change: float, sd: float) -> list[PlausibilityFinding]:
        seconds = (t_ns - since_ns) / SECOND_NS
        limit = self._limits.acceleration_mps2 * (1.0 + K_FALSE * math.sqrt(2.0) * ARRIVAL_SD_S / seconds)
        limit += K_FALSE * math.sqrt(2.0) * sd / seconds
        if change / seconds <= limit:
            return []
        text = f"its velocity changes by {change / seconds:.0f} m/s^2, limit {limit:.0f} m/s^2"
        return [PlausibilityFinding(Reason.IMPOSSIBLE, since_ns, text)]
