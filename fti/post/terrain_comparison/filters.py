"""The filter of the flight without satellites: alone, with the fixes of one method, or with the best possible ones.

Each filter gets satellites until the middle of the first profile, so that all begin with the same position, and again
where it has restarted.  The filter with a fix of the Cramer-Rao bound at the reference position has the bound of the
whole flight as its covariance, for the error model of the inertial unit.
Source: Bergman 1999, section 3 and 5 (bound of a sequence of measurements).
"""

from __future__ import annotations

from collections.abc import Mapping

from fti.config import Device, Filter
from fti.messages.measurements import Measurement, Position, Velocity
from fti.messages.outputs import HeightAboveGround
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.position_mark import MarkedPosition, PositionMark
from fti.nav.inertial_aiding import AidedNavigation
from fti.nav.navigation import NavState
from fti.nav.terrain_reference import Ground


class OutageFilter:
    """One filter.  settings, devices : of the flight;  map_sd : of the map [m]"""

    def __init__(self, settings: Filter, devices: Mapping[str, Device], map_sd: float) -> None:
        self._aided, self._gnss = AidedNavigation(settings, dict(devices), map_sd), settings.gnss
        self._has_outage = False

    def feed(self, device: str, m: Measurement, t_ns: int) -> None:
        """A measurement; those of satellites are dropped after the first mark."""
        is_of_satellites = device in self._gnss and isinstance(m, (Position, Velocity))
        if is_of_satellites and self._has_outage and self._aided.estimate(t_ns) is not None:
            return
        if self._aided.accepts(device, type(m)):
            self._aided.feed(device, m, t_ns)

    def feed_height(self, height: HeightAboveGround, nav: NavState) -> None:
        """A height; those of altimeters that the configuration names aid the altitude."""
        self._aided.feed_height(height, nav)

    def set_terrain(self, ground: Ground | None) -> None:
        """The ground below the altimeters."""
        self._aided.set_terrain(ground)

    def feed_mark(self, t_ns: int, mark: PositionMark) -> None:
        """The middle of a profile; from the first one on there are no satellites."""
        self._has_outage = True
        self._aided.feed_terrain_fix(t_ns, mark)

    def feed_fix(self, t_ns: int, fix: MarkedPosition) -> None:
        """A fix, at the end of its profile."""
        self._aided.feed_terrain_fix(t_ns, fix)

    def estimate(self, t_ns: int) -> Estimate | None:
        """State and covariance; None while it is not aligned."""
        return self._aided.estimate(t_ns)
