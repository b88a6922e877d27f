"""Squares of ground along a flight."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fti.terrain.area import TerrainArea

EARTH_M = 6.37e6


def fly(lat0: float, lon0: float, turn_rate: float, load_s: float) -> tuple[int, float, float]:
    """An hour at 60 m/s with squares of 5 km half a side that take ``load_s`` to load.

    Returns the number of squares, the least distance to the edge of the square in use, and the flown distance [m].
    """
    lat, lon, track, radius_m, speed = lat0, lon0, 1.0, 5000.0, 60.0
    area, coming, number, margin = TerrainArea(lat, lon, radius_m, ()), None, 1, math.inf
    for second in range(3600):
        north, east = speed * math.cos(track), speed * math.sin(track)
        lat, lon = lat + north / EARTH_M, lon + east / EARTH_M / math.cos(lat)
        lon = (lon + math.pi) % math.tau - math.pi
        track += turn_rate
        if coming is None and area.is_left_by(lat, lon):
            coming = (second + load_s, TerrainArea(*area.next_middle(lat, lon, north, east), radius_m, ()))
        if coming is not None and second >= coming[0]:
            area, coming, number = coming[1], None, number + 1
        turned = (lon - area.lon + math.pi) % math.tau - math.pi
        offsets = np.abs([(lat - area.lat) * EARTH_M, turned * EARTH_M * math.cos(lat)])
        margin = min(margin, radius_m - float(offsets.max()))
    return number, margin, 3600.0 * speed


@pytest.mark.parametrize("turn_rate", [0.0, 0.002, 0.05])
@pytest.mark.parametrize(("lat_deg", "lon_deg"), [(48.0, 11.0), (-17.0, 179.97)])
def test_the_aircraft_stays_within_its_square_and_squares_last(
    lat_deg: float, lon_deg: float, turn_rate: float
) -> None:
    """Also across the antimeridian; loading takes 20 s, 1.2 km of flight."""
    number, margin, distance = fly(math.radians(lat_deg), math.radians(lon_deg), turn_rate, 20.0)
    assert margin > 1000.0
    assert number <= 2 + distance / (0.7 * 5000.0)
    assert (number > 1) == (turn_rate < 0.01)  # circles of 1.2 km radius stay within the first one


def test_an_aircraft_at_rest_gets_a_square_around_it() -> None:
    area = TerrainArea(0.8, 0.2, 5000.0, ())
    assert area.next_middle(0.81, 0.21, 0.0, 0.0) == pytest.approx((0.81, 0.21))
    assert not area.is_left_by(0.8, 0.2)


def test_the_other_side_of_the_antimeridian_is_near() -> None:
    """1.3 km."""
    area = TerrainArea(0.0, math.pi - 1e-4, 5000.0, ())
    assert not area.is_left_by(0.0, 1e-4 - math.pi)
    assert area.next_middle(0.0, math.pi - 1e-5, 0.0, 600.0)[1] == pytest.approx(
        -math.pi + 1666.7 / 6.378e6 - 1e-5, abs=1e-6
    )
