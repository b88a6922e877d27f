"""What a device says that no flight has is no part of a position, velocity or attitude; and beyond a pole."""

import math
from typing import Any

import numpy as np
import pytest

from fti.config import Device
from fti.nav.sources import AttitudeState, PositionState, Source
from fti.types import Attitude, Position, Stamp, Velocity

MS = 1_000_000
NOW = 1_000_000_000_000


def source() -> Source:
    return Source(Device.model_validate({"name": "ins", "link": "l", "driver": "d", "max_age_ms": 1000.0}))


def attitude(**parts: float) -> AttitudeState | None:
    of, said = source(), dict[str, Any](roll=0.1, pitch=0.2, heading=1.0)
    of.push_attitude(Attitude(stamp=Stamp(NOW), **said | parts), NOW)
    return of.attitude(NOW)


def position(speed: dict[str, float] | None = None, ahead_ms: int = 0, **parts: float) -> PositionState | None:
    """Of a device that has said one place, and one velocity."""
    of, said, flown = (
        source(),
        dict[str, Any](lat=0.8, lon=0.2, alt=500.0),
        dict[str, Any](north=60.0, east=0.0, down=0.0),
    )
    of.push_position(Position(stamp=Stamp(NOW), **said | parts), NOW)
    of.push_velocity(Velocity(stamp=Stamp(NOW), **flown | (speed or {})), NOW)
    return of.position(NOW + ahead_ms * MS, None)


@pytest.mark.parametrize(("part", "value"), [("roll", 3.3), ("roll", 1e12), ("pitch", 1.6), ("pitch", -1e7)])
def test_an_angle_that_no_body_has_is_no_attitude(part: str, value: float) -> None:
    assert attitude(**{part: value}) is None


def test_upside_down_and_straight_up_are_attitudes_in_single_precision_too() -> None:
    ends = {"roll": float(np.float32(math.pi)), "pitch": float(np.float32(math.pi / 2))}
    assert max(ends["roll"] - math.pi, ends["pitch"] - math.pi / 2) > 0.0
    found = attitude(**ends)
    assert found is not None
    assert found.pitch == pytest.approx(math.pi / 2)


def test_a_roll_between_two_on_either_side_of_upside_down_is_an_angle() -> None:
    of = source()
    for t_ns, roll in ((NOW, 3.1), (NOW + 20 * MS, -3.0)):
        of.push_attitude(Attitude(stamp=Stamp(t_ns), roll=roll, pitch=0.0), t_ns)
    found = of.attitude(NOW + 15 * MS)
    assert found is not None
    assert found.roll == pytest.approx(-3.0 - 0.25 * (2 * math.pi - 6.1))


@pytest.mark.parametrize("value", [1e300, -1e7, 2001.0])
@pytest.mark.parametrize("part", ["north", "east", "down"])
def test_a_speed_that_nobody_flies_moves_no_position(part: str, value: float) -> None:
    """A latitude of -6e291 had been told as valid."""
    found = position({part: value}, ahead_ms=500)
    assert found is not None
    assert getattr(found, part) is None
    assert found.lat == pytest.approx(0.8, abs=1e-5)
    assert found.alt == pytest.approx(500.0, abs=1.0)


def test_a_height_that_nobody_flies_at_is_none() -> None:
    found = position(alt=1e12)
    assert found is not None
    assert found.alt is None


@pytest.mark.parametrize("sd", [0.0, -1.0, math.nan])
def test_a_sigma_that_is_not_positive_is_none(sd: float) -> None:
    found = position(horizontal_sd=sd, vertical_sd=sd)
    assert found is not None
    assert (found.horizontal_sd, found.vertical_sd) == (None, None)


def test_two_places_a_continent_apart_are_no_speed() -> None:
    of = source()
    for t_ns, lat, alt in ((NOW, 0.8, 500.0), (NOW + 300 * MS, 0.1, 90e3)):
        of.push_position(Position(stamp=Stamp(t_ns), lat=lat, lon=0.2, alt=alt), t_ns)
    found = of.position(NOW + 400 * MS, None)
    assert found is not None
    assert (found.north, found.east, found.down) == (None, None, None)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_who_moves_on_over_a_pole_comes_down_on_the_other_side(side: float) -> None:
    """5 m before the pole, half a second at 60 m/s: 25 m behind it, on the opposite meridian."""
    from_pole = 5.0 / 6.4e6
    found = position({"north": side * 60.0}, 500, lat=side * (math.pi / 2 - from_pole), lon=1.0)
    assert found is not None
    assert abs(found.lat) == pytest.approx(math.pi / 2 - 25.0 / 6.4e6, abs=1e-8)
    assert found.lon == pytest.approx(1.0 - math.pi)
