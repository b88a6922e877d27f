"""``[flight]`` of a scenario, one table per kind; the default is ``kind = "approach"``.

[flight]
kind = "waypoints"                 # straight legs, turned into before each waypoint
bank_deg = 25

[[flight.waypoint]]
lat_deg = 36.63
lon_deg = -84.16
alt_m = 600                        # above the ellipsoid
speed_mps = 55                     # over the ground

[flight]
kind = "recorded"                  # a table t_s, lat_deg, lon_deg, alt_m, roll_deg, pitch_deg, heading_deg ...
file = "flight.csv"                # ... or the folder of a session
device = "ins"                     # of a session: source of position and attitude; default: the only one
from_s = 10
duration_s = 300
smooth_s = 2                       # smoothing time of the samples; default: no smoothing

[flight]
kind = "jsbsim"                    # a flight dynamic model with an autopilot: fti/hil/tables/jsbsim_options.py
route = "approach"                 # "pattern", "go_around", "low_level"
turbulence = "light"
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from fti.config import Name, Positive, StrictModel
from fti.hil.tables.fault_base import NotNegative
from fti.hil.tables.jsbsim_options import JsbsimFlight

#: Subsonic flow only [m/s]; a flight is computed in advance and held in memory [s].
Speed = Annotated[float, Field(ge=1, le=300)]
MAX_DURATION_S = 14_400.0


class ApproachFlight(StrictModel):
    """``[flight]`` down the published approach of the airfield."""

    kind: Literal["approach"] = "approach"
    start_m: Annotated[float, Field(gt=0, le=1e6)] = 4500.0
    duration_s: Annotated[float, Field(gt=0, le=MAX_DURATION_S)] = 82.0
    speed_mps: Speed = 60.0
    wander_m: Annotated[float, Field(ge=0, le=1000)] = 3.0
    wander_height_m: Annotated[float, Field(ge=0, le=100)] = 1.5
    gust_mps: Annotated[float, Field(ge=0, le=20)] = 0.7


class WaypointTable(StrictModel):
    """``[[flight.waypoint]]``: position, height above the ellipsoid, and ground speed."""

    lat_deg: Annotated[float, Field(ge=-89, le=89)]
    lon_deg: Annotated[float, Field(ge=-180, le=180)]
    alt_m: Annotated[float, Field(ge=-500, le=20000)]
    speed_mps: Speed


class WaypointFlight(StrictModel):
    """``[flight]`` along waypoints, from the first to the last."""

    kind: Literal["waypoints"]
    waypoint: Annotated[tuple[WaypointTable, ...], Field(min_length=2)]
    bank_deg: Annotated[float, Field(ge=5, le=75)] = 25.0


class RecordedFlight(StrictModel):
    """``[flight]`` from a recording.  ``file`` is absolute after reading."""

    kind: Literal["recorded"]
    file: str
    device: Name | None = None
    from_s: NotNegative = 0.0
    duration_s: Positive | None = None
    smooth_s: Positive | None = None


AnyFlight = ApproachFlight | WaypointFlight | RecordedFlight | JsbsimFlight
FlightTable = Annotated[AnyFlight, Field(discriminator="kind")]
