"""Values of ``/nav/nav_solution`` for the protocols of other programs: unknown unless they are valid."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fti.constants import SECOND_NS
from fti.publish.current_output import current_fields, number
from fti.publish.message import PublishedMessage

NAVIGATION_TOPIC = "/nav/nav_solution"
#: Limits of plausible values: altitude [m], speed of each axis [m/s], sigma and protection level [m].
ALTITUDES_M = (-20_000.0, 100_000.0)
MAX_SPEED_MPS = 10_000.0
MAX_ERROR_M = 1e9
#: End of the times that the protocols have.
END_NS = 2**32 * SECOND_NS


@dataclass(frozen=True, slots=True)
class NavigationValues:
    """Values of the solution; None if they are unknown or not valid.

    t_ns     : time of validity, FTI time [ns]; None if it is no time from 1970 until 2106
    lat, lon : [rad], both or none; the other values of the position and the velocity only with them
    alt      : above the WGS84 ellipsoid [m]; vel_* [m/s]
    horizontal_sd, vertical_sd, hpl, vpl : one sigma, protection levels [m]
    roll, pitch, heading : [rad], all or none; heading in [-2 pi, 2 pi]
    reasons  : why the solution is not valid
    """

    t_ns: int | None = None
    lat: float | None = None
    lon: float | None = None
    alt: float | None = None
    vel_north: float | None = None
    vel_east: float | None = None
    vel_down: float | None = None
    horizontal_sd: float | None = None
    vertical_sd: float | None = None
    hpl: float | None = None
    vpl: float | None = None
    roll: float | None = None
    pitch: float | None = None
    heading: float | None = None
    reasons: tuple[str, ...] = ()

    @property
    def ground_speed(self) -> float | None:
        """[m/s]."""
        if self.vel_north is None or self.vel_east is None:
            return None
        return math.hypot(self.vel_north, self.vel_east)

    @property
    def track(self) -> float | None:
        """Direction of the velocity over ground, clockwise from true north, in [0, 2 pi] [rad]; None at rest."""
        if self.vel_north is None or self.vel_east is None or not (self.vel_north or self.vel_east):
            return None
        return math.atan2(self.vel_east, self.vel_north) % math.tau


#: Without a current solution.
NO_NAVIGATION = NavigationValues(reasons=("no output",))


def read_navigation(message: PublishedMessage, now_s: float) -> NavigationValues:
    """The values of a message of ``NAVIGATION_TOPIC`` that are valid at now_s (``time.monotonic``) [s]."""
    fields = current_fields(message, now_s)
    if fields is None:
        return NO_NAVIGATION
    return NavigationValues(
        t_ns=_time(fields), reasons=tuple(fields["reasons"]), **_position(fields), **_attitude(fields)
    )


def _time(fields: Mapping[str, Any]) -> int | None:
    t_ns = fields["t_ns"] if fields["t_valid_ns"] is None else fields["t_valid_ns"]
    return int(t_ns) if 0 <= t_ns < END_NS else None


def _position(fields: Mapping[str, Any]) -> dict[str, float | None]:
    lat, lon = number(fields, "lat", -math.pi / 2, math.pi / 2), number(fields, "lon", -math.pi, math.pi)
    if fields["valid"] is not True or lat is None or lon is None:
        return {}
    speeds = ("vel_north", "vel_east", "vel_down")
    errors = ("horizontal_sd", "vertical_sd", "hpl", "vpl")
    return {
        "lat": lat,
        "lon": lon,
        "alt": number(fields, "alt", *ALTITUDES_M),
        **{name: number(fields, name, -MAX_SPEED_MPS, MAX_SPEED_MPS) for name in speeds},
        **{name: number(fields, name, 0.0, MAX_ERROR_M) for name in errors},
    }


def _attitude(fields: Mapping[str, Any]) -> dict[str, float | None]:
    roll, pitch = number(fields, "roll", -math.pi, math.pi), number(fields, "pitch", -math.pi / 2, math.pi / 2)
    heading = number(fields, "heading", -math.tau, math.tau)
    if fields["attitude_valid"] is not True or None in (roll, pitch, heading):
        return {}
    return {"roll": roll, "pitch": pitch, "heading": heading}
