"""The published approach: airfield file, glide path intercept (GPI), path along the track.

    s    path length along the ground track to GPI [m], >= 0 before it       y    offset right of the track [m]
    GPI  x_g beyond the threshold:  x_g = TCH / (tan g + r),  alt_g = alt_thr + r x_g
    alt_path(s) = alt_g + s tan g + s^2 / (2 R_e)

with glide angle g, runway slope r (> 0 uphill in the direction of landing), threshold crossing height TCH.  The last
term is the curvature of the Earth below a straight line: 0.7 m at 3 km, 7.9 m at 10 km.  The track is straight, or has
arcs (``fti.nav.integrity.ground_track``): s is then not the distance to the intercept point.
Source: Spiegel 2018, 7.2.2, made exact; ICAO Doc 8168 for the geometry of GPI.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from fti.arrays import Array
from fti.config import Positive, StrictModel, bind, parse_toml
from fti.config.keys import NO_UNIT, ONE, key
from fti.geodesy.formulas import SEMI_MAJOR, SEMI_MINOR
from fti.geodesy.local import LocalFrame
from fti.nav.integrity.ground_track import GroundTrack, TrackLeg

#: Mean radius of the Earth, (2 a + b) / 3 [m].
EARTH_RADIUS = (2 * SEMI_MAJOR + SEMI_MINOR) / 3


class Airfield(StrictModel):
    """The airfield file: the runway, its glide path and its ground track."""

    name: Annotated[str, key("name of the approach", NO_UNIT, "EXAMPLE 27")]
    threshold_lat_deg: Annotated[
        float, Field(ge=-89, le=89), key("latitude of the runway threshold, positive north", "deg", 36.63)
    ]
    threshold_lon_deg: Annotated[
        float, Field(ge=-180, le=180), key("longitude of the runway threshold, positive east", "deg", -84.1675)
    ]
    threshold_alt_m: Annotated[float, key("altitude of the runway threshold above the WGS84 ellipsoid", "m", 360.0)]
    course_deg: Annotated[
        float, Field(ge=0, lt=360), key("true course of the runway in the direction of landing", "deg", 275.0)
    ]
    runway_slope: Annotated[
        float, Field(ge=-0.05, le=0.05), key("slope of the runway, rise over run, positive uphill when landing", ONE)
    ] = 0.0
    glide_deg: Annotated[float, Field(ge=1, le=10), key("angle of the glide path", "deg")] = 3.0
    tch_m: Annotated[Positive, key("height of the glide path above the threshold (threshold crossing height)", "m")] = (
        15.24
    )
    runway_length_m: Annotated[Positive, key("length of the runway from the threshold", "m", 1200.0)]
    survey_date: Annotated[
        str,
        Field(pattern=r"^\d{4}-\d{2}-\d{2}$"),
        key("date of the survey of the approach; default of --date of fti reference make", NO_UNIT, "2018-06-01"),
    ]
    leg: Annotated[
        tuple[TrackLeg, ...] | None,
        key(
            "[[leg]]: legs of the ground track, from the intercept point outwards; none: the track is straight", NO_UNIT
        ),
    ] = None


def load_airfield(text: str, file: str) -> Airfield:
    """The airfield in a TOML text; file : its name, for messages.  Raises ConfigError."""
    return bind(Airfield, parse_toml(text, file), file)


class ApproachPath:
    """The approach to an airfield."""

    def __init__(self, airfield: Airfield) -> None:
        self.airfield = airfield
        self.glide = math.radians(airfield.glide_deg)
        #: Distance of GPI beyond the threshold [m].
        self.x_gpi = airfield.tch_m / (math.tan(self.glide) + airfield.runway_slope)
        #: Altitude of GPI above the ellipsoid [m].
        self.alt_gpi = airfield.threshold_alt_m + airfield.runway_slope * self.x_gpi
        self._track = GroundTrack(airfield.leg) if airfield.leg else None
        self._course = course = math.radians(airfield.course_deg)
        self._sin, self._cos = math.sin(course), math.cos(course)
        threshold = LocalFrame(
            math.radians(airfield.threshold_lat_deg),
            math.radians(airfield.threshold_lon_deg),
            airfield.threshold_alt_m,
        )
        lat, lon, _ = threshold.to_geodetic((self.x_gpi * self._sin, self.x_gpi * self._cos, 0.0))
        self.frame = LocalFrame(float(lat), float(lon), self.alt_gpi)

    def to_path(self, lat: ArrayLike, lon: ArrayLike) -> tuple[Array, Array]:
        """Path length s to GPI and offset y right of the track [m] of positions lat, lon [rad], any shape."""
        enu = self.frame.to_local(lat, lon, self.alt_gpi)
        back, right = self._back_right(enu[..., 0], enu[..., 1])
        return self._track.to_path(back, right) if self._track else (back, right)

    def to_path_one(self, lat: float, lon: float) -> tuple[float, float]:
        """``to_path`` of one position."""
        if self._track:
            s, y = self.to_path(lat, lon)
            return float(s), float(y)
        east, north, _ = self.frame.point_to_local(lat, lon, self.alt_gpi)
        return self._back_right(east, north)

    def _back_right(self, east: Any, north: Any) -> tuple[Any, Any]:
        """Coordinates along and across the course, of numbers or arrays [m]."""
        return -(east * self._sin + north * self._cos), east * self._cos - north * self._sin

    def to_geodetic(self, s: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """lat, lon [rad] of path lengths s and offsets y [m]: the inverse of ``to_path``."""
        s, y = np.broadcast_arrays(np.asarray(s, dtype=np.float64), np.asarray(y, dtype=np.float64))
        back, right = self._track.to_plane(s, y) if self._track else (s, y)
        east, north = -back * self._sin + right * self._cos, -back * self._cos - right * self._sin
        down = (back**2 + right**2) / (2 * EARTH_RADIUS)
        lat, lon, _ = self.frame.to_geodetic(np.stack((east, north, -down), axis=-1))
        return lat, lon

    def course(self, s: ArrayLike) -> Array:
        """Course of the track [rad], in the direction of flight, at path lengths s [m]."""
        s = np.asarray(s, dtype=np.float64)
        return np.asarray(self._course - (self._track.theta(s) if self._track else np.zeros_like(s)))

    def bank(self, s: ArrayLike) -> Array:
        """Nominal roll on the track [rad] at path lengths s [m]; zero where it is straight."""
        s = np.asarray(s, dtype=np.float64)
        return self._track.bank(s) if self._track else np.zeros_like(s)

    def bank_one(self, s: float) -> float:
        """``bank`` at one point."""
        return float(self.bank(s)) if self._track else 0.0

    def alt_path(self, s: ArrayLike) -> Array:
        """Altitude of the glide path above the ellipsoid [m] at path lengths s [m]."""
        s = np.asarray(s, dtype=np.float64)
        return np.asarray(self.alt_gpi + s * math.tan(self.glide) + s**2 / (2 * EARTH_RADIUS))
