"""Implausible values of a device are not used; extrapolation over a pole."""

import math
from typing import Any

import numpy as np
import pytest

from fti.config import Device
from fti.messages.measurements import Attitude, Position, Stamp, Velocity
from fti.nav.source_interpolation import AttitudeState, NavSource, PositionState, level_velocity

MS = 1_000_000
NOW = 1_000_000_000_000


def source() -> NavSource:
    return NavSource(Device.model_validate({"name": "ins", "link": "l", "driver": "d", "max_age_ms": 1000.0}))


def attitude(**parts: float) -> AttitudeState | None:
    of, stated = source(), dict[str, Any](roll=0.1, pitch=0.2, heading=1.0)
    of.push_attitude(Attitude(stamp=Stamp(NOW), **stated | parts), NOW)
    return of.attitude(NOW)


def position(speed: dict[str, float] | None = None, after_ms: int = 0, **parts: float) -> PositionState | None:
    """Of a device that has sent one position and one velocity."""
    of, stated, velocity = (
        source(),
        dict[str, Any](lat=0.8, lon=0.2, alt=500.0),
        dict[str, Any](north=60.0, east=0.0, down=0.0),
    )
    of.push_position(Position(stamp=Stamp(NOW), **stated | parts), NOW)
    of.push_velocity(Velocity(stamp=Stamp(NOW), **velocity | (speed or {})), NOW)
    return of.position(NOW + after_ms * MS, None)


@pytest.mark.parametrize(("part", "value"), [("roll", 3.3), ("roll", 1e12), ("pitch", 1.6), ("pitch", -1e7)])
def test_an_angle_that_no_body_has_is_no_attitude(part: str, value: float) -> None:
    assert attitude(**{part: value}) is None


def test_upside_down_and_straight_up_are_attitudes_in_single_precision_too() -> None:
    ends = {"roll": float(np.float32(math.pi)), "pitch": float(np.float32(math.pi / 2))}
    assert max(ends["roll"] - math.pi, ends["pitch"] - math.pi / 2) > 0.0
    result = attitude(**ends)
    assert result is not None
    assert result.pitch == pytest.approx(math.pi / 2)


def test_a_roll_between_two_on_either_side_of_upside_down_is_an_angle() -> None:
    of = source()
    for t_ns, roll in ((NOW, 3.1), (NOW + 20 * MS, -3.0)):
        of.push_attitude(Attitude(stamp=Stamp(t_ns), roll=roll, pitch=0.0), t_ns)
    result = of.attitude(NOW + 15 * MS)
    assert result is not None
    assert result.roll == pytest.approx(-3.0 - 0.25 * (2 * math.pi - 6.1))


@pytest.mark.parametrize("value", [1e300, -1e7, 2001.0])
@pytest.mark.parametrize("part", ["north", "east", "down"])
def test_a_speed_that_nobody_flies_moves_no_position(part: str, value: float) -> None:
    """A latitude of -6e291 had been output as valid."""
    result = position({part: value}, after_ms=500)
    assert result is not None
    assert getattr(result, part) is None
    assert result.lat == pytest.approx(0.8, abs=1e-5)
    assert result.alt == pytest.approx(500.0, abs=1.0)


def test_a_height_that_nobody_flies_at_is_none() -> None:
    result = position(alt=1e12)
    assert result is not None
    assert result.alt is None


@pytest.mark.parametrize("sd", [0.0, -1.0, math.nan])
def test_a_sigma_that_is_not_positive_is_none(sd: float) -> None:
    result = position(horizontal_sd=sd, vertical_sd=sd)
    assert result is not None
    assert (result.horizontal_sd, result.vertical_sd) == (None, None)


def test_two_places_a_continent_apart_are_no_speed() -> None:
    of = source()
    for t_ns, lat, alt in ((NOW, 0.8, 500.0), (NOW + 300 * MS, 0.1, 90e3)):
        of.push_position(Position(stamp=Stamp(t_ns), lat=lat, lon=0.2, alt=alt), t_ns)
    result = of.position(NOW + 400 * MS, None)
    assert result is not None
    assert (result.north, result.east, result.down) == (None, None, None)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_who_moves_on_over_a_pole_comes_down_on_the_other_side(side: float) -> None:
    """5 m before the pole, half a second at 60 m/s: 25 m behind it, on the opposite meridian."""
    from_pole = 5.0 / 6.4e6
    result = position({"north": side * 60.0}, 500, lat=side * (math.pi / 2 - from_pole), lon=1.0)
    assert result is not None
    assert abs(result.lat) == pytest.approx(math.pi / 2 - 25.0 / 6.4e6, abs=1e-8)
    assert result.lon == pytest.approx(1.0 - math.pi)


def roll_sd_deg(times_ms: list[int], at_ms: int, sd: float | None = math.radians(0.2)) -> float | None:
    """Sigma of the roll of a device that states its attitude at some times."""
    of = source()
    for ms in times_ms:
        of.push_attitude(Attitude(stamp=Stamp(NOW), roll=0.1, pitch=0.0, roll_sd=sd), NOW + ms * MS)
    result = of.attitude(NOW + at_ms * MS)
    assert result is not None
    return None if result.roll_sd is None else math.degrees(result.roll_sd)


def test_an_attitude_that_is_held_is_less_certain_with_its_age() -> None:
    """The aircraft may roll at 30 deg/s, three sigma; an attitude of 50 Hz or between two of 10 Hz is as stated."""
    assert roll_sd_deg([0], 0) == pytest.approx(0.2)
    assert roll_sd_deg([0], 20) == pytest.approx(0.2)
    assert roll_sd_deg([0], 500) == pytest.approx(5.0, rel=0.01)
    assert roll_sd_deg([0], 500, sd=None) == pytest.approx(5.0, rel=0.01)
    assert roll_sd_deg([0, 100], 50) == pytest.approx(0.2)
    assert roll_sd_deg([0, 800], 400) == pytest.approx(4.0, rel=0.01)
    assert roll_sd_deg([0], 10, sd=None) is None


@pytest.mark.parametrize("track", [math.inf, -math.inf])
def test_a_track_that_is_no_angle_makes_no_velocity(track: float) -> None:
    """Its cosine raised a ValueError."""
    assert position(speed={"ground_speed": 60.0, "track": track}) is not None
    assert level_velocity(Velocity(stamp=Stamp(0), ground_speed=60.0, track=track)) == (None, None)
