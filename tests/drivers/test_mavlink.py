"""MAVLink: what is refused, signatures, version 1, several systems, distance limits."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from fti.drivers import Counters, mavlink
from fti.types import (
    Attitude,
    DeviceStatus,
    DeviceTime,
    ImuSample,
    Measurement,
    Position,
    RadioHeight,
    Range,
    Stamp,
    TimeScale,
    Velocity,
)

S = Stamp(5_000_000_000)
ATTITUDE = common.MAVLink_attitude_message(1000, 0.1, 0.2, 0.3, 0.01, 0.02, 0.03)


def pack(message: Any, system: int = 1, **how: Any) -> bytes:
    return bytes(message.pack(common.MAVLink(None, srcSystem=system, srcComponent=1), **how))


def decode(data: bytes, **options: Any) -> tuple[list[Measurement], Counters]:
    decoder = mavlink.make_decoder(mavlink.Options(**options))
    return decoder.feed(data, 1), decoder.counters


def distance(**changes: Any) -> Any:
    usual = {"time_boot_ms": 1, "min_distance": 20, "max_distance": 5000, "current_distance": 1500, "type": 0}
    usual |= {"id": 0, "orientation": 25, "covariance": 16, "signal_quality": 90}
    return common.MAVLink_distance_sensor_message(**(usual | changes))


@given(st.binary(max_size=300))
def test_crc_is_that_of_pymavlink(data: bytes) -> None:
    assert mavlink.crc(data) == common.x25crc(data).crc


def test_a_message_that_the_dialect_does_not_know_is_refused() -> None:
    """Its CRC has no known seed, so it could be anything; pymavlink calls it UNKNOWN and believes it."""
    bogus = bytearray(pack(ATTITUDE))
    bogus[7:10] = (99_999).to_bytes(3, "little")
    found, counters = decode(bytes(bogus) + pack(ATTITUDE))
    assert [type(m) for m in found] == [ImuSample, Attitude]
    assert counters.messages == {"ATTITUDE": 1}
    assert counters.skipped["unknown_message"] == 1


def test_a_frame_with_unknown_flags_is_refused() -> None:
    bad = bytearray(pack(ATTITUDE))
    bad[2] = 0x02
    found, counters = decode(bytes(bad) + pack(ATTITUDE))
    assert len(found) == 2
    assert counters.skipped["bad_flags"] == 1


def test_a_signed_frame_is_taken_whole() -> None:
    mav = common.MAVLink(None, srcSystem=1, srcComponent=1)
    mav.signing.secret_key, mav.signing.sign_outgoing, mav.signing.timestamp = bytes(32), True, 1
    signed = bytes(ATTITUDE.pack(mav))
    assert len(signed) == len(pack(ATTITUDE)) + 13
    found, counters = decode(signed * 2)
    assert len(found) == 4
    assert counters.framed == 2 * len(signed)


def test_version_1_is_spoken_too() -> None:
    found, counters = decode(pack(ATTITUDE, force_mavlink1=True) * 2)
    assert counters.messages == {"ATTITUDE": 2}
    assert isinstance(found[1], Attitude)
    assert found[1].roll == pytest.approx(0.1, abs=1e-7)


def test_one_system_can_be_chosen() -> None:
    stream = pack(ATTITUDE, system=1) + pack(ATTITUDE, system=7) + pack(ATTITUDE, system=1, force_mavlink1=True)
    found, counters = decode(stream, system=7)
    assert len(found) == 2
    assert counters.messages == {"ATTITUDE": 1, "other source": 2}


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, (15.0, 0.04, True)),
        ({"covariance": 255}, (15.0, None, True)),
        ({"covariance": 0}, (15.0, None, True)),
        ({"signal_quality": 0}, (15.0, 0.04, True)),  # 0 is unknown
        ({"signal_quality": 1}, (15.0, 0.04, False)),  # 1 is an invalid signal
        ({"current_distance": 5001}, (None, 0.04, False)),
        ({"current_distance": 19}, (None, 0.04, False)),
    ],
)
def test_distance_limits_and_quality_decide_what_is_valid(changes: dict[str, int], expected: tuple[Any, ...]) -> None:
    (laser,), _ = decode(pack(distance(**changes)))
    assert isinstance(laser, Range)
    assert (laser.slant_range, laser.sd, laser.valid) == expected
    (radar,), _ = decode(pack(distance(type=3, **changes)))
    assert isinstance(radar, RadioHeight)
    assert (radar.height_agl, radar.sd, radar.valid) == expected


def test_only_a_sensor_that_looks_down_is_taken() -> None:
    assert decode(pack(distance(orientation=0)))[0] == []


def test_the_height_is_what_the_option_says() -> None:
    message = common.MAVLink_global_position_int_message(1, 480_000_000, 110_000_000, 500_000, 0, 0, 0, 0, 65535)
    positions = [decode(pack(message), height=h)[0][1] for h in ("msl", "ellipsoid")]
    assert all(isinstance(p, Position) for p in positions)
    assert [(p.alt, p.alt_msl) for p in positions if isinstance(p, Position)] == [(None, 500.0), (500.0, None)]


def test_a_receiver_with_accuracies_but_without_an_undulation_has_no_ellipsoid() -> None:
    """An autopilot that knows no undulation fills in the accuracies and leaves alt_ellipsoid at 0."""
    message = common.MAVLink_gps_raw_int_message(
        1000, 3, 480_000_000, 115_000_000, 453_000, 65535, 65535, 65535, 65535, 255, alt_ellipsoid=0, h_acc=900
    )
    position = next(m for m in decode(pack(message))[0] if isinstance(m, Position))
    assert (position.alt, position.alt_msl, position.undulation) == (None, 453.0, None)
    assert position.horizontal_sd == pytest.approx(0.9)


def test_an_autopilot_that_has_not_found_its_place_is_not_valid() -> None:
    """GLOBAL_POSITION_INT has no flag; before the first fix latitude and longitude are 0."""
    message = common.MAVLink_global_position_int_message(1000, 0, 0, 17_000, 0, 0, 0, 0, 65535)
    found = decode(pack(message))[0]
    assert [type(m) for m in found] == [Velocity, Position]
    assert not any(m.valid for m in found if isinstance(m, Velocity | Position))


def test_a_receiver_without_a_fix_is_not_valid_and_without_extension_has_no_ellipsoid() -> None:
    message = common.MAVLink_gps_raw_int_message(1000, 1, 0, 0, 0, 65535, 65535, 65535, 65535, 255)
    (velocity, position, satellites, status), _ = decode(pack(message))
    assert velocity == Velocity(stamp=Stamp(1, 1_000_000, TimeScale.BOOT), valid=False)
    assert isinstance(position, Position)
    assert (position.alt, position.undulation, position.horizontal_sd, position.valid) == (None, None, None, False)
    assert getattr(satellites, "hdop", 1.0) is None
    assert isinstance(status, DeviceStatus)
    assert status.flags == ("no_fix",)


def test_numbers_that_are_none_do_not_pass() -> None:
    nan = math.nan
    assert decode(pack(common.MAVLink_attitude_message(1, nan, 0, 0, nan, 0, 0)))[0] == []
    assert decode(pack(common.MAVLink_scaled_pressure_message(1, nan, math.inf, 0)))[0] == []
    imu = common.MAVLink_highres_imu_message(1, *(nan,) * 13, 0xFFFF)
    assert decode(pack(imu))[0] == []


def test_the_time_is_utc_where_the_autopilot_knows_it() -> None:
    known, unknown = (common.MAVLink_system_time_message(t, 5000) for t in (1_700_000_000_000_000, 0))
    assert decode(pack(known))[0] == [DeviceTime(stamp=Stamp(1, 1_700_000_000_000_000_000, TimeScale.UTC))]
    assert decode(pack(unknown))[0] == [DeviceTime(stamp=Stamp(1, 5_000_000_000, TimeScale.BOOT))]


def names(frames: list[bytes]) -> list[str]:
    return [str(common.mavlink_map[mavlink.message_id(frame)].msgname) for frame in frames]


def test_the_emulated_autopilot_sends_what_it_can_say() -> None:
    encoder = mavlink.make_encoder(mavlink.Options(system=42))
    both = Position(stamp=S, lat=0.8, lon=0.2, alt=547.0, alt_msl=500.0)
    assert names(encoder.encode(both)) == ["GPS_RAW_INT"]  # no velocity: 33 could not say that it is unknown
    encoder.encode(Velocity(stamp=S, north=1.0, east=2.0, down=3.0))
    frames = encoder.encode(both)
    assert names(frames) == ["GLOBAL_POSITION_INT", "GPS_RAW_INT"]
    assert [(frame[4], frame[5]) for frame in frames] == [(1, 42), (2, 42)]  # sequence, system
    assert names(encoder.encode(Position(stamp=S, lat=0.8, lon=0.2, alt_msl=500.0))) == ["GLOBAL_POSITION_INT"]
    assert names(encoder.encode(Position(stamp=Stamp(1), lat=0.8, lon=0.2, alt_msl=500.0))) == []


def test_the_emulated_altimeter_beyond_its_range_is_not_valid() -> None:
    encoder = mavlink.make_encoder(mavlink.Options())
    (frame,) = encoder.encode(RadioHeight(stamp=S, height_agl=900.0))
    (found,), _ = decode(frame)
    assert isinstance(found, RadioHeight)
    assert (found.height_agl, found.valid) == (None, False)
