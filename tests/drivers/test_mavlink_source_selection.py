"""MAVLink: one source for each quantity that several messages or sensors of an autopilot carry."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from fti.drivers import mavlink
from fti.messages.measurements import Measurement, Position, RadioHeight, Range, Reading, Velocity

S = 1_000_000_000
LAT, LON = math.radians(48.0), math.radians(11.5)
NEAR = 1e-9  # [rad], the resolution of the wire is 1.7e-9


class Autopilot:
    """Packs messages and decodes them at a time [s]."""

    def __init__(self, **options: Any) -> None:
        self._decoder = mavlink.make_decoder(mavlink.Options(**options))
        self._sender = common.MAVLink(None, srcSystem=1, srcComponent=1)

    def says(self, s: float, message: Any) -> list[Measurement]:
        return self._decoder.feed(bytes(message.pack(self._sender)), round(s * S))


def estimate(lat: int = 480_000_000, lon: int = 115_000_000) -> Any:
    return common.MAVLink_global_position_int_message(1000, lat, lon, 500_000, 0, 100, 200, -300, 65535)


def receiver(fix: int = 3, **changes: Any) -> Any:
    usual = {"eph": 65535, "epv": 65535, "vel": 500, "cog": 9000, "satellites_visible": 9, "alt_ellipsoid": 548_000}
    usual |= {"h_acc": 900, "v_acc": 1500, "vel_acc": 200} | changes
    return common.MAVLink_gps_raw_int_message(1000, fix, 480_000_100, 115_000_100, 501_000, **usual)


def distance(number: int, centimetres: int = 1500, kind: int = 0) -> Any:
    return common.MAVLink_distance_sensor_message(1, 20, 5000, centimetres, kind, number, 25, 16, signal_quality=90)


def of(kind: type, found: list[Measurement]) -> list[Any]:
    return [m for m in found if isinstance(m, kind)]


def readings(found: list[Measurement]) -> dict[str, float]:
    return {m.name: m.value for m in found if isinstance(m, Reading) and isinstance(m.value, float)}


def test_a_receiver_without_a_fix_does_not_hide_the_estimate() -> None:
    """The flicker between an estimate that goes on and a receiver that has lost its satellites."""
    pilot = Autopilot()
    measurements = [
        m for k in range(100) for m in pilot.says(k / 5, estimate()) + pilot.says(k / 5 + 0.1, receiver(fix=1))
    ]
    assert len(of(Position, measurements)) == len(of(Velocity, measurements)) == 100
    assert all(m.valid for m in of(Position, measurements) + of(Velocity, measurements))


def test_the_receiver_beside_the_estimate_is_a_reading() -> None:
    pilot = Autopilot()
    pilot.says(0.0, estimate())
    measurements = pilot.says(0.1, receiver())
    assert not of(Position, measurements)
    assert not of(Velocity, measurements)
    reported = readings(measurements)
    assert reported["gps_raw_int_lat"] == pytest.approx(math.radians(48.00001), abs=NEAR)
    assert reported["gps_raw_int_ground_speed"] == 5.0


def test_the_estimate_has_sigmas_and_undulation_of_its_receiver_while_that_has_a_fix() -> None:
    pilot = Autopilot()
    pilot.says(0.0, receiver())
    velocity, position = pilot.says(4.0, estimate())
    assert isinstance(position, Position)
    assert isinstance(velocity, Velocity)
    assert position.lat == pytest.approx(LAT, abs=NEAR)
    assert (position.alt, position.alt_msl, position.undulation) == (None, 500.0, 47.0)
    assert (position.horizontal_sd, position.vertical_sd, velocity.sd) == (0.9, 1.5, 0.2)
    pilot.says(4.5, receiver(fix=1))
    velocity, position = pilot.says(5.1, estimate())
    assert isinstance(position, Position)
    assert isinstance(velocity, Velocity)
    assert position.valid
    assert (position.undulation, position.horizontal_sd, position.vertical_sd, velocity.sd) == (None,) * 4


def test_an_ellipsoidal_height_needs_no_undulation() -> None:
    pilot = Autopilot(height="ellipsoid")
    pilot.says(0.0, receiver())
    position = of(Position, pilot.says(0.1, estimate()))[0]
    assert (position.alt, position.alt_msl, position.undulation) == (500.0, None, None)


def test_the_receiver_counts_while_there_is_no_estimate() -> None:
    """None at all, one that has not found its place, and one that has fallen silent, after five seconds."""
    pilot = Autopilot()
    assert of(Position, pilot.says(0.0, receiver()))[0].valid
    assert not of(Position, pilot.says(0.1, estimate(0, 0)))
    assert of(Position, pilot.says(0.2, receiver()))[0].valid
    assert of(Position, pilot.says(0.3, estimate()))[0].valid
    assert not of(Position, pilot.says(5.3, receiver()))
    assert of(Position, pilot.says(5.4, receiver()))[0].valid


def test_two_lasers_that_look_down_are_not_mixed() -> None:
    """The lower id counts, whichever comes first; the other one is a reading."""
    pilot = Autopilot()
    assert of(Range, pilot.says(0.0, distance(1, 1700)))[0].slant_range == 17.0
    first = pilot.says(0.1, distance(0, 1500))
    assert of(Range, first)[0].slant_range == 15.0
    assert readings(first) == {"distance_sensor": 0.0}
    second = pilot.says(0.2, distance(1, 1700))
    assert not of(Range, second)
    assert readings(second)["distance_sensor_1_slant_range"] == 17.0


def test_a_laser_without_return_gives_way_to_the_radar_after_five_seconds_and_takes_over_again() -> None:
    """A radio height and a range are heights of one altimeter."""
    pilot = Autopilot()
    pilot.says(0.0, distance(0))
    for k in range(1, 6):
        assert not of(Range, pilot.says(k, distance(0, 0)))[0].valid
        assert not of(RadioHeight, pilot.says(k, distance(1, 1800, kind=3)))
    radar = pilot.says(5.1, distance(1, 1800, kind=3))
    assert of(RadioHeight, radar)[0].height_agl == 18.0
    assert readings(radar) == {"distance_sensor": 1.0}
    assert not of(Range, pilot.says(5.2, distance(0, 0)))
    assert of(Range, pilot.says(5.3, distance(0, 1500)))[0].valid


def test_one_sensor_of_distance_can_be_chosen() -> None:
    """So that each of two has its own device, on one line."""
    pilot = Autopilot(distance_id=1)
    assert pilot.says(0.0, distance(0)) == []
    assert of(Range, pilot.says(0.1, distance(1, 1700)))[0].slant_range == 17.0


def test_one_message_can_be_chosen() -> None:
    """So that the receiver has a device of its own beside the estimate's."""
    pilot = Autopilot(only=("GPS_RAW_INT",))
    assert pilot.says(0.0, estimate()) == []
    assert of(Position, pilot.says(0.1, receiver()))[0].horizontal_sd == 0.9
    with pytest.raises(ValueError, match="'GPS' is not a message"):
        mavlink.Options(only=("GPS",))
