"""A square of ground, and when the next one has to be loaded."""

from __future__ import annotations

import math
from dataclasses import dataclass

from fti.geodesy.formulas import metres_per_radian, wrap_half_turn

#: Distance from the middle at which the next square is needed, and of its middle ahead on the track [half sides].
LEAVE_SHARE, AHEAD_SHARE = 0.5, 1.0 / 3.0
#: The middle of the next square is at most so much flight ahead [s].
AHEAD_S = 60.0


@dataclass(frozen=True, slots=True)
class TerrainArea:
    """A square in the east, north plane of the frame in its middle.

    lat, lon : of the middle [rad];  radius_m : half its side [m];  files : paths of the files that touch it
    """

    lat: float
    lon: float
    radius_m: float
    files: tuple[str, ...]

    def is_left_by(self, lat: float, lon: float) -> bool:
        """Whether a position is so far from the middle that the next square is needed."""
        return math.hypot(*_offset(self.lat, self.lon, lat, lon)) > LEAVE_SHARE * self.radius_m

    def next_middle(self, lat: float, lon: float, vel_north: float, vel_east: float) -> tuple[float, float]:
        """The middle of the next square, ahead of a position: latitude and longitude [rad]."""
        speed = math.hypot(vel_north, vel_east)
        ahead_s = min(AHEAD_S, AHEAD_SHARE * self.radius_m / max(speed, 1e-3))
        per_lat, per_lon = metres_per_radian(lat, 0.0)
        return lat + ahead_s * vel_north / per_lat, wrap_half_turn(lon + ahead_s * vel_east / per_lon)


def _offset(lat0: float, lon0: float, lat: float, lon: float) -> tuple[float, float]:
    """North and east of a point from another one [m]."""
    per_lat, per_lon = metres_per_radian(lat0, 0.0)
    return (lat - lat0) * per_lat, wrap_half_turn(lon - lon0) * per_lon
