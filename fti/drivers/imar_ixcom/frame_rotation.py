"""Rotation of a velocity from earth-fixed or body frame to north, east, down."""

from __future__ import annotations

import math

Triple = tuple[float, float, float]


def ned_from_ecef(vel: Triple, lat: float, lon: float) -> Triple:
    """Earth-fixed; at lat, lon [rad]."""
    x, y, z = vel
    outward = math.cos(lon) * x + math.sin(lon) * y  # away from the axis of the Earth
    north = -math.sin(lat) * outward + math.cos(lat) * z
    down = -math.cos(lat) * outward - math.sin(lat) * z
    return north, -math.sin(lon) * x + math.cos(lon) * y, down


def ned_from_body(vel: Triple, rpy: Triple) -> Triple:
    """mat_nb of roll, pitch, heading times vel_b."""
    (forward, right, below), (roll, pitch, heading) = vel, rpy
    side = math.cos(roll) * right - math.sin(roll) * below
    under = math.sin(roll) * right + math.cos(roll) * below
    horizontal = math.cos(pitch) * forward + math.sin(pitch) * under
    down = -math.sin(pitch) * forward + math.cos(pitch) * under
    north = math.cos(heading) * horizontal - math.sin(heading) * side
    return north, math.sin(heading) * horizontal + math.cos(heading) * side, down
