"""``[flight]`` of a scenario, one table per kind; the default is ``kind = "approach"``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from fti.config import Name, Positive, StrictModel
from fti.config.keys import NO_UNIT, key
from fti.hil.tables.fault_base import NotNegative
from fti.hil.tables.jsbsim_options import JsbsimFlight

#: Subsonic flow only [m/s]; a flight is computed in advance and held in memory [s].
Speed = Annotated[float, Field(ge=1, le=300)]
MAX_DURATION_S = 14_400.0


class ApproachFlight(StrictModel):
    """A flight down the published approach of the airfield; the default."""

    kind: Literal["approach"] = "approach"
    start_m: Annotated[
        float, Field(gt=0, le=1e6), key("distance before the runway threshold at the start of the flight", "m")
    ] = 4500.0
    duration_s: Annotated[float, Field(gt=0, le=MAX_DURATION_S), key("duration of the flight", "s")] = 82.0
    speed_mps: Annotated[Speed, key("mean speed over the ground", "m/s")] = 60.0
    wander_m: Annotated[float, Field(ge=0, le=1000), key("standard deviation of the offset from the track", "m")] = 3.0
    wander_height_m: Annotated[
        float, Field(ge=0, le=100), key("standard deviation of the height from the glide path", "m")
    ] = 1.5
    gust_mps: Annotated[float, Field(ge=0, le=20), key("standard deviation of the speed over the ground", "m/s")] = 0.7


class WaypointTable(StrictModel):
    """``[[flight.waypoint]]``: a waypoint of the flight."""

    lat_deg: Annotated[float, Field(ge=-89, le=89), key("latitude, positive north", "deg", 36.63)]
    lon_deg: Annotated[float, Field(ge=-180, le=180), key("longitude, positive east", "deg", -84.16)]
    alt_m: Annotated[float, Field(ge=-500, le=20000), key("altitude above the WGS84 ellipsoid", "m", 600.0)]
    speed_mps: Annotated[
        Speed, key("speed over the ground at the waypoint; it changes linearly to that of the next one", "m/s", 55.0)
    ]


class WaypointFlight(StrictModel):
    """A flight along waypoints, from the first to the last, with turns that begin before each waypoint."""

    kind: Literal["waypoints"]
    waypoint: Annotated[
        tuple[WaypointTable, ...],
        Field(min_length=2),
        key(
            "[[flight.waypoint]]: the waypoints, two or more",
            NO_UNIT,
            [
                {"lat_deg": 36.63, "lon_deg": -84.10, "alt_m": 600.0, "speed_mps": 55.0},
                {"lat_deg": 36.63, "lon_deg": -84.16, "alt_m": 400.0, "speed_mps": 55.0},
            ],
        ),
    ]
    bank_deg: Annotated[float, Field(ge=5, le=75), key("bank limit in turns, in still air", "deg")] = 25.0


class RecordedFlight(StrictModel):
    """A flight from a recording."""

    kind: Literal["recorded"]
    file: Annotated[  # absolute after reading
        str,
        key(
            "folder of a session, or a table (CSV) with the columns t_s, lat_deg, lon_deg, alt_m, roll_deg, pitch_deg, "
            "heading_deg; a relative path begins at the scenario",
            NO_UNIT,
            "flight.csv",
        ),
    ]
    device: Annotated[
        Name | None, key("of a session: device of position and attitude; none: the only one", NO_UNIT, "ins")
    ] = None
    from_s: Annotated[NotNegative, key("time of the recording at which the flight starts", "s")] = 0.0
    duration_s: Annotated[
        Positive | None, key("duration of the flight; none: to the end of the recording", "s", 300.0)
    ] = None
    smooth_s: Annotated[
        Positive | None, key("smoothing time of the samples; none: they are not smoothed", "s", 2.0)
    ] = None


AnyFlight = ApproachFlight | WaypointFlight | RecordedFlight | JsbsimFlight
FlightTable = Annotated[AnyFlight, Field(discriminator="kind")]
