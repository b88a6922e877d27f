"""Position and velocity: BESTPOS and BESTVEL.

    BESTPOS 42, 72 B   0 solution status u32 | 4 position type u32 | 8 latitude, longitude d [deg]
                       24 height above mean sea level d [m] | 32 undulation f [m] | 36 datum u32
                       40 sigma of latitude, longitude, height 3f [m] | 52 station 4s | 56 age of the differential
                       data, of the solution 2f [s] | 64 satellites tracked, used, used on L1, on more u8
                       68 reserved, extended status, signal masks u8
    BESTVEL 99, 44 B   0 solution status u32 | 4 velocity type u32 | 8 latency, age of the differential data 2f [s]
                       16 horizontal speed d [m/s] | 24 track d [deg] | 32 vertical speed, up d [m/s] | 40 reserved f

alt = height + undulation.  The velocity is valid ``latency`` before the time of the header.
"""

from __future__ import annotations

import math
import struct

from fti.drivers.novatel_oem6.clock import finite_or_none, subtract_latency
from fti.drivers.novatel_oem6.framing import NovatelHeader
from fti.formats.unit_factors import DEGREE
from fti.geodesy.formulas import wrap_heading
from fti.messages.measurements import Measurement, Position, Stamp, Velocity

BESTPOS = struct.Struct("<IIdddfI3f4s2f8B")
BESTVEL = struct.Struct("<II2f3df")
COMPUTED, INSUFFICIENT_OBSERVATIONS = 0, 1
TYPE_NONE, TYPE_FIXED, TYPE_DOPPLER, TYPE_SINGLE, TYPE_PROPAGATED, TYPE_OUT_OF_BOUNDS = 0, 1, 8, 16, 19, 72
#: Types without a present measurement: none, entered position, propagated without satellites, outside the limits of
#: the user.
NO_SOLUTION = frozenset({TYPE_NONE, TYPE_FIXED, TYPE_PROPAGATED, TYPE_OUT_OF_BOUNDS})
WGS84 = 61


def _is_valid(status: int, kind: int) -> bool:
    return status == COMPUTED and kind not in NO_SOLUTION


def decode_bestpos(body: bytes, header: NovatelHeader, stamp: Stamp) -> list[Measurement]:
    """BESTPOS in radians; in another datum than WGS84, or out of range, it is not valid."""
    v = BESTPOS.unpack_from(body)
    lat, lon, height, undulation = (finite_or_none(x) for x in v[2:6])
    is_complete = None not in (lat, lon, height, undulation) and abs(v[2]) <= 90.0 and abs(v[3]) <= 180.0
    lat_sd, lon_sd, height_sd = v[7:10]
    return [
        Position(
            stamp=stamp,
            lat=None if lat is None else lat * DEGREE,
            lon=None if lon is None else lon * DEGREE,
            alt=None if height is None or undulation is None else height + undulation,
            alt_msl=height,
            undulation=undulation,
            horizontal_sd=finite_or_none(math.sqrt((lat_sd**2 + lon_sd**2) / 2)),
            vertical_sd=finite_or_none(height_sd),
            valid=is_complete and v[6] == WGS84 and _is_valid(v[0], v[1]),
        )
    ]


def decode_bestvel(body: bytes, header: NovatelHeader, stamp: Stamp) -> list[Measurement]:
    """BESTVEL, down positive, at its time of validity."""
    status, kind, latency, _, speed, track_deg, up, _ = BESTVEL.unpack_from(body)
    is_complete = all(map(math.isfinite, (speed, track_deg, up)))
    track = wrap_heading(track_deg * DEGREE) if math.isfinite(track_deg) else None
    level = is_complete and track is not None
    return [
        Velocity(
            stamp=subtract_latency(stamp, latency),
            north=speed * math.cos(track) if level and track is not None else None,
            east=speed * math.sin(track) if level and track is not None else None,
            down=-up if math.isfinite(up) else None,
            ground_speed=finite_or_none(speed),
            track=track,
            valid=is_complete and _is_valid(status, kind),
        )
    ]


def encode_bestpos(position: Position, used: int) -> bytes:
    """Body of BESTPOS: a single-point solution in WGS84.  used : satellites"""
    undulation = position.undulation or 0.0
    height = position.alt_msl
    if height is None:
        height = (position.alt or 0.0) - undulation
    status, kind = (COMPUTED, TYPE_SINGLE) if position.valid else (INSUFFICIENT_OBSERVATIONS, TYPE_NONE)
    lat, lon = ((x or 0.0) / DEGREE for x in (position.lat, position.lon))
    horizontal, vertical = position.horizontal_sd or 0.0, position.vertical_sd or 0.0
    return BESTPOS.pack(
        status, kind, lat, lon, height, undulation, WGS84, horizontal, horizontal, vertical, b"\0" * 4, 0.0, 0.0,
        used, used, used, 0, 0, 0, 0, 0,
    )  # fmt: skip


def encode_bestvel(velocity: Velocity) -> bytes:
    """Body of BESTVEL: from the Doppler, without latency."""
    speed, track = velocity.ground_speed, velocity.track
    if (speed is None or track is None) and velocity.north is not None and velocity.east is not None:
        speed, track = math.hypot(velocity.north, velocity.east), math.atan2(velocity.east, velocity.north)
    status, kind = (COMPUTED, TYPE_DOPPLER) if velocity.valid else (INSUFFICIENT_OBSERVATIONS, TYPE_NONE)
    track_deg = wrap_heading(track or 0.0) / DEGREE
    return BESTVEL.pack(status, kind, 0.0, 0.0, speed or 0.0, track_deg, -(velocity.down or 0.0), 0.0)
