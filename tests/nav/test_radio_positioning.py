"""Radio navigation with devices: lever arm of the antenna, and ground below an uncertain position."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec import structs

from fti.config import Device, Radio
from fti.messages.measurements import Position, Satellite, Satellites, Stamp
from fti.messages.outputs import Compensation, HeightAboveGround, PositionFix
from fti.nav.navigation import NavState
from fti.nav.radio_positioning import RadioPosition
from fti.nav.source_interpolation import PositionState
from fti.nav.terrain_reference import Ground
from fti.terrain.terrain import Terrain

T0, LAT = 10**12, 0.8
DEVICES = {"gnss": Device(name="gnss", link="l", driver="d", lever_arm_b=(1.0, 0.0, -1.5))}
FIX = Position(stamp=Stamp(T0), lat=LAT, lon=0.2, alt=701.5, horizontal_sd=3.0, vertical_sd=10.0)


def fed_radio() -> RadioPosition:
    radio = RadioPosition(Radio(receiver="gnss", altimeter="laser"), DEVICES)
    radio.feed("gnss", FIX, T0)
    return radio


def over_slope(place_sd: float, compensated: float | None = None) -> PositionFix:
    """A laser 200 m above a slope of 0.2, at a place that is known to so many metres."""
    radio = fed_radio()
    posts = 100.0 + 0.2 * np.arange(0.0, 4001.0, 20.0)[:, None] + np.zeros((1, 201))
    terrain = Terrain.from_array(posts, 20.0, lat0=LAT, lon0=0.2, east0=-2000.0, north0=-2000.0)
    radio.set_terrain(Ground(terrain, 1.0, "slope"))
    height = HeightAboveGround(
        t_ns=T0,
        t_valid_ns=T0,
        sensor="laser",
        raw=200.0,
        height_agl=200.0 if compensated is None else compensated,
        sd=0.5,
        valid=True,
        reasons=(),
        compensation=Compensation.ATTITUDE if compensated is None else Compensation.RANGE,
        nearest=200.0,
        nearest_sd=0.5,
    )
    radio.feed_height(
        height, NavState(T0, None, PositionState(LAT, 0.2, 700.0, place_sd, 1.0, None, None, None, T0), None, None)
    )
    return radio.solution(T0)


def test_the_altitude_is_that_of_p() -> None:
    assert fed_radio().solution(T0).alt == pytest.approx(700.0, abs=1e-6)


def test_over_a_slope_the_altimeter_gives_an_altitude_where_the_place_is_known() -> None:
    assert over_slope(1.0).altitude_source == "altimeter"
    assert over_slope(100.0).altitude_source == "ranges"  # 20 m, and the fix has 10


def test_what_the_ground_makes_straight_down_of_a_range_counts() -> None:
    compensated = over_slope(1.0, compensated=196.0)
    as_it_is = over_slope(1.0)
    assert compensated.alt is not None and as_it_is.alt is not None
    assert as_it_is.alt - compensated.alt == pytest.approx(4.0, abs=0.1)


SKY = tuple(
    Satellite(system="gps", number=n, azimuth=azimuth, elevation=elevation, used=True)
    for n, (azimuth, elevation) in enumerate(((0.2, 1.2), (1.4, 0.35), (2.6, 0.7), (3.8, 0.26), (5.2, 0.6)))
)


def with_sky(*after: Satellites) -> float:
    """Sigma of a height with a stated sigma of 0.1 m, after satellite directions and then this message."""
    radio = RadioPosition(Radio(receiver="gnss"), DEVICES)
    for m in (Satellites(stamp=Stamp(T0), satellites=SKY), *after):
        radio.feed("gnss", m, T0)
    radio.feed("gnss", structs.replace(FIX, horizontal_sd=0.1, vertical_sd=0.1), T0)
    metres = radio.solution(T0).vertical_sd
    assert metres is not None
    return metres


def test_a_message_without_directions_takes_no_sky_away() -> None:
    """NAV-PVT and GGA have the number, GSA and PSRDOP the names, SATVIS2 all directions: none has those used."""
    assert with_sky() > 2.0
    which = tuple(Satellite(system="gps", number=n, used=True) for n in range(5))
    where = tuple(structs.replace(s, used=None) for s in SKY)
    for satellites in ((), which, where):
        assert with_sky(Satellites(stamp=Stamp(T0), satellites=satellites, used=5)) == with_sky()
    none_used = tuple(structs.replace(s, used=False) for s in SKY)
    assert with_sky(Satellites(stamp=Stamp(T0), satellites=none_used)) == pytest.approx(0.1, rel=1e-6)


def test_a_receiver_that_the_filter_excludes_gives_no_fix_any_more() -> None:
    radio = fed_radio()
    radio.refuse(frozenset({"gnss"}))
    later = T0 + 2 * 10**9
    radio.feed("gnss", structs.replace(FIX, stamp=Stamp(later), alt=760.0), later)
    assert not radio.solution(later).valid
    radio.refuse(frozenset())
    radio.feed("gnss", structs.replace(FIX, stamp=Stamp(later), alt=760.0), later)
    assert radio.solution(later).alt == pytest.approx(758.5, abs=0.1)
