"""Guidance along a route: position of the aircraft on the route, and commands for the autopilot."""

from __future__ import annotations

import math

from numpy import float64
from numpy.typing import NDArray

from fti.hil.flight.jsbsim.autopilot import GuidanceCommand
from fti.hil.flight.jsbsim.fdm import AircraftState
from fti.hil.flight.jsbsim.routes import Route
from fti.hil.flight.jsbsim.track import STEP_M
from fti.nav.integrity.approach import ApproachPath

#: Look-ahead time of the target point on the track [s].
LOOKAHEAD_S = 6.0


class RouteGuidance:
    """Guidance of one flight.  path : approach in whose local plane the track lies."""

    def __init__(self, route: Route, path: ApproachPath) -> None:
        self._route = route
        self._mat = [[float(x) for x in row] for row in path.frame.mat_le[:2]]
        self._origin = [float(x) for x in path.frame.origin_e]
        #: Distance along the track [m].
        self.along = 0.0

    def command(self, now: AircraftState) -> GuidanceCommand:
        """Commands for the autopilot; advances along the route.

        The side acceleration gives a circle to the target point:  2 V^2 / L sin(eta),  L = V LOOKAHEAD_S.
        """
        from_origin = [x - x0 for x, x0 in zip(now.position_e, self._origin, strict=True)]
        east, north = (sum(m * x for m, x in zip(row, from_origin, strict=True)) for row in self._mat)
        self.along = self._route.track.along_at(east, north, self.along)
        v_north, v_east, _ = now.vel_n
        speed = max(math.hypot(v_north, v_east), 1.0)
        at_east, at_north = self._route.track.point(self.along + LOOKAHEAD_S * speed)
        to_east, to_north = at_east - east, at_north - north
        eta = math.atan2(v_north * to_east - v_east * to_north, v_east * to_east + v_north * to_north)
        alt, slope = self._height()
        return GuidanceCommand(
            2.0 * speed / LOOKAHEAD_S * math.sin(eta), now.alt - alt, slope * speed, self.at(self._route.cas)
        )

    def at(self, values: NDArray[float64]) -> float:
        """Value of one of the route's arrays at the current station."""
        return values.item(self._station())

    def _station(self) -> int:
        return min(max(int(self.along / STEP_M), 0), len(self._route.alt) - 2)

    def _height(self) -> tuple[float, float]:
        k = self._station()
        low, high = self._route.alt.item(k), self._route.alt.item(k + 1)
        slope = (high - low) / STEP_M
        return low + slope * (self.along - k * STEP_M), slope
