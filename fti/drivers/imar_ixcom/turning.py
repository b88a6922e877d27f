"""Velocity to north, east, down from the frame that the data selection names."""

from __future__ import annotations

import math
from collections.abc import Callable

from fti.drivers.imar_ixcom.selection import VEL_BODY, VEL_ECEF, VEL_ENU, VEL_NED

Triple = tuple[float, float, float]


def from_ned(vel: Triple, rpy: Triple, lat: float, lon: float) -> Triple:
    """As it is."""
    return vel


def from_enu(vel: Triple, rpy: Triple, lat: float, lon: float) -> Triple:
    """East, north, up."""
    east, north, up = vel
    return north, east, -up


def from_ecef(vel: Triple, rpy: Triple, lat: float, lon: float) -> Triple:
    """Earth-fixed; at lat, lon [rad]."""
    x, y, z = vel
    outward = math.cos(lon) * x + math.sin(lon) * y  # away from the axis of the Earth
    north = -math.sin(lat) * outward + math.cos(lat) * z
    down = -math.cos(lat) * outward - math.sin(lat) * z
    return north, -math.sin(lon) * x + math.cos(lon) * y, down


def from_body(vel: Triple, rpy: Triple, lat: float, lon: float) -> Triple:
    """mat_nb of roll, pitch, heading times vel_b."""
    (forward, right, below), (roll, pitch, heading) = vel, rpy
    side = math.cos(roll) * right - math.sin(roll) * below
    under = math.sin(roll) * right + math.cos(roll) * below
    ahead = math.cos(pitch) * forward + math.sin(pitch) * under
    down = -math.sin(pitch) * forward + math.cos(pitch) * under
    north = math.cos(heading) * ahead - math.sin(heading) * side
    return north, math.sin(heading) * ahead + math.cos(heading) * side, down


VELOCITY_FRAMES: tuple[tuple[int, Callable[[Triple, Triple, float, float], Triple]], ...] = (
    (VEL_NED, from_ned),
    (VEL_ENU, from_enu),
    (VEL_ECEF, from_ecef),
    (VEL_BODY, from_body),
)
