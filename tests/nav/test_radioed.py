"""Radio navigation fed by devices: of the antenna's place and of the ground below a doubtful one."""

from __future__ import annotations

import numpy as np
import pytest

from fti.config import Device, Radio
from fti.nav.ground import Ground
from fti.nav.navigation import NavState
from fti.nav.radioed import RadioPosition
from fti.nav.sources import PositionState
from fti.terrain.terrain import Terrain
from fti.types import HeightAboveGround, Position, PositionFix, Stamp

T0, LAT = 10**12, 0.8
DEVICES = {"gnss": Device(name="gnss", link="l", driver="d", lever_arm_b=(1.0, 0.0, -1.5))}
FIX = Position(stamp=Stamp(T0), lat=LAT, lon=0.2, alt=701.5, horizontal_sd=3.0, vertical_sd=10.0)


def flown() -> RadioPosition:
    radio = RadioPosition(Radio(receiver="gnss", altimeter="laser"), DEVICES)
    radio.feed("gnss", FIX, T0)
    return radio


def over_slope(place_sd: float, compensated: float | None = None) -> PositionFix:
    """A laser 200 m above a slope of 0.2, at a place that is known to so many metres."""
    radio = flown()
    posts = 100.0 + 0.2 * np.arange(0.0, 4001.0, 20.0)[:, None] + np.zeros((1, 201))
    terrain = Terrain.from_array(posts, 20.0, lat0=LAT, lon0=0.2, east0=-2000.0, north0=-2000.0)
    radio.give_ground(Ground(terrain, 1.0, "slope"))
    height = HeightAboveGround(
        t_ns=T0,
        t_valid_ns=T0,
        sensor="laser",
        raw=200.0,
        height_agl=200.0,
        sd=0.5,
        valid=True,
        reasons=(),
        compensated=compensated,
        compensated_sd=None if compensated is None else 0.5,
    )
    radio.take_height(
        height, NavState(T0, None, PositionState(LAT, 0.2, 700.0, place_sd, 1.0, None, None, None, T0), None, None)
    )
    return radio.solution(T0)


def test_the_altitude_is_that_of_p() -> None:
    assert flown().solution(T0).alt == pytest.approx(700.0, abs=1e-6)


def test_over_a_slope_the_altimeter_gives_an_altitude_where_the_place_is_known() -> None:
    assert over_slope(1.0).altitude_source == "altimeter"
    assert over_slope(100.0).altitude_source == "ranges"  # 20 m, and the fix has 10


def test_what_the_ground_makes_straight_down_of_a_range_counts() -> None:
    compensated = over_slope(1.0, compensated=196.0)
    as_it_is = over_slope(1.0)
    assert compensated.alt is not None and as_it_is.alt is not None
    assert as_it_is.alt - compensated.alt == pytest.approx(4.0, abs=0.1)
