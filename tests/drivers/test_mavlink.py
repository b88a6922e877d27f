"""MAVLink: rejected frames, signatures, version 1, several systems, distance limits."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from fti import config
from fti.devices import bind_devices
from fti.drivers import Counters, mavlink
from fti.drivers.mavlink import READERS, wire
from fti.drivers.mavlink.wire import BASE_LENGTH, dialect_map, layout, signature
from fti.messages.measurements import (
    Ack,
    Attitude,
    DeviceStatus,
    DeviceTime,
    ImpactPressure,
    ImuSample,
    Measurement,
    Position,
    RadioHeight,
    Range,
    Reading,
    Stamp,
    StaticPressure,
    TimeScale,
    Velocity,
)
from tests.drivers.vectorfiles import load

S = Stamp(5_000_000_000)
#: COMMAND_LONG 511 (ATTITUDE every 20000 us), 512 (STATUSTEXT, to system 7) and a heartbeat of a ground station, from
#: 255/190, as the generated C library mavlink/c_library_v2 (7e16bc08) packs them.
C_INTERVAL = "fd20000000ffbe4c00000000f04100409c460000000000000000000000000000000000000000ff010101c44a"
C_REQUEST = "fd20000000ffbe4c000000007d4300000000000000000000000000000000000000000000000000020701608c"
C_HEARTBEAT = "fd09000000ffbe0000000000000006080004033d48"
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
    assert wire.crc(data) == common.x25crc(data).crc


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


# -------------------------------------------------------------------------------------------------- signatures

KEY = bytes(range(1, 33))  # of the C library's vector
SIGNED = load("mavlink_c_library_signed").data


def test_a_signed_frame_is_taken_whole_and_reported_as_unverified() -> None:
    found, counters = decode(SIGNED)
    assert len(found) == 5
    assert counters.framed == len(SIGNED)
    assert counters.messages["signed, not verified"] == 3


def test_the_signatures_of_the_c_library_hold_with_its_key_only() -> None:
    found, counters = decode(SIGNED, key=KEY.hex())
    assert len(found) == 5
    assert counters.messages == {"ATTITUDE": 1, "SCALED_PRESSURE": 1, "SYSTEM_TIME": 1}
    found, counters = decode(SIGNED, key=bytes(32).hex())
    assert not found
    assert counters.skipped == {"bad_signature": len(SIGNED)}


def test_the_key_may_be_in_a_file(tmp_path: Path) -> None:
    (tmp_path / "signing.key").write_text(f"{KEY.hex()}\n")
    file = tmp_path / "craft.toml"
    file.write_text(
        'session = { name = "craft" }\nlink = [{ name = "line", kind = "udp", bind = "127.0.0.1:14550" }]\n'
        'device = [{ name = "autopilot", link = "line", driver = "mavlink", options = { key_file = "signing.key" } }]\n'
    )
    (autopilot,) = bind_devices(config.load(file))
    decoder = autopilot.make_decoder()
    assert decoder.feed(SIGNED, 1) and not decoder.counters.skipped


def test_with_a_key_nothing_else_is_accepted() -> None:
    """Neither what is not signed, nor version 1, nor what was recorded and is played again."""
    plain, old = pack(ATTITUDE), pack(ATTITUDE, force_mavlink1=True)
    found, counters = decode(plain + old + SIGNED + SIGNED, key=KEY.hex())
    assert len(found) == 5
    assert counters.skipped == {"unsigned": len(plain) + len(old), "replayed": len(SIGNED)}


def test_each_link_of_a_source_has_its_own_time() -> None:
    frame = bytearray(SIGNED[: len(pack(ATTITUDE)) + 13])
    frame[-13] = 4  # another link
    frame[-6:] = signature(KEY, frame)
    _, counters = decode(SIGNED + bytes(frame), key=KEY.hex())
    assert not counters.skipped


def test_an_old_record_of_a_link_that_was_not_received_yet_is_not_accepted() -> None:
    """As the specification says: a new source or link may be a minute behind the others, not more."""

    def signed(link: int, time: int) -> bytes:
        frame = bytearray(SIGNED[: len(pack(ATTITUDE)) + 13])
        frame[-13:-6] = bytes([link]) + time.to_bytes(6, "little")
        frame[-6:] = signature(KEY, frame)
        return bytes(frame)

    now, minute = 10**9, 6_000_000
    stream = signed(1, now) + signed(2, now - minute) + signed(3, now - minute + 1) + signed(2, now) + signed(4, 0)
    _, counters = decode(stream, key=KEY.hex())
    assert counters.messages == {"ATTITUDE": 3}
    assert counters.skipped == {"replayed": 2 * len(signed(1, 0))}


@pytest.mark.parametrize("key", ["", "00", "zz" * 32])
def test_a_key_has_64_hexadecimal_digits(key: str) -> None:
    with pytest.raises(ValueError, match="key"):
        mavlink.Options(key=key)


# ------------------------------------------------------------------------------------------------ length, version


def seal(frame: bytearray, number: int) -> bytes:
    """The frame with the right checksum at its end."""
    known = layout("common", number)
    assert known is not None
    return bytes(frame) + wire.crc(bytes(frame[1:]) + known.seed).to_bytes(2, "little")


def test_a_version_1_payload_of_another_length_is_refused() -> None:
    good = pack(ATTITUDE, force_mavlink1=True)
    for change in (-4, 4):
        body = bytearray(good[:-2]) + bytes(max(0, change))
        body = body[:change] if change < 0 else body
        body[1] += change
        found, counters = decode(seal(body, 30) + good)
        assert len(found) == 2
        assert counters.skipped["bad_length"] == 1


def test_a_version_2_payload_of_a_newer_definition_is_read_as_far_as_it_is_known() -> None:
    body = bytearray(pack(ATTITUDE)[:-2]) + b"new"
    body[1] += 3
    (_, attitude), _ = decode(seal(body, 30))
    assert isinstance(attitude, Attitude)
    assert attitude.heading == pytest.approx(0.3)


def test_zeros_at_the_end_are_filled_in() -> None:
    message = common.MAVLink_attitude_message(1000, 0.5, 0, 0, 0, 0, 0)
    assert len(pack(message)) == 10 + 8 + 2  # six fields are not sent
    (imu, attitude), _ = decode(pack(message))
    assert isinstance(imu, ImuSample)
    assert imu.gyro_b == (0.0, 0.0, 0.0)
    assert isinstance(attitude, Attitude)
    assert (attitude.roll, attitude.pitch, attitude.heading) == (0.5, 0.0, 0.0)


SIZES = {"char": 1, "int8_t": 1, "uint8_t": 1, "uint8_t_mavlink_version": 1, "int16_t": 2, "uint16_t": 2}
SIZES |= {"int32_t": 4, "uint32_t": 4, "float": 4, "int64_t": 8, "uint64_t": 8, "double": 8}


def base_length(message: ElementTree.Element) -> int:
    """Of the fields before the extensions."""
    size = 0
    for child in message:
        if child.tag == "extensions":
            break
        if child.tag == "field":
            kind, _, count = child.attrib["type"].partition("[")
            size += SIZES[kind] * int(count.rstrip("]") or 1)
    return size


def test_base_lengths_are_those_of_the_definitions() -> None:
    """The tables of pymavlink do not say where the extensions begin; the XML from which they were generated does."""
    folder = Path(common.__file__).parent
    defined = {
        int(message.attrib["id"]): base_length(message)
        for name in ("minimal", "standard", "common")
        for message in ElementTree.parse(folder / f"{name}.xml").iter("message")
    }
    assert set(READERS) <= set(BASE_LENGTH)
    assert {number: defined[number] for number in BASE_LENGTH} == BASE_LENGTH


def test_named_values_are_readings_where_the_configuration_names_them() -> None:
    messages = [
        common.MAVLink_named_value_float_message(1500, name, value) for name, value in ((b"dh", 2.5), (b"x", 1.0))
    ]
    data = b"".join(map(pack, messages))
    found, _ = decode(data, named_values=("dh", "other"))
    assert found == [Reading(stamp=Stamp(1, 1_500_000_000, TimeScale.BOOT), name="dh", value=2.5)]
    assert decode(data)[0] == []


def test_a_named_value_that_is_no_number_is_none() -> None:
    message = common.MAVLink_named_value_float_message(1500, b"longest_10", math.nan)
    assert decode(pack(message), named_values=("longest_10",))[0] == []


def test_noise_is_never_a_message(scale: int) -> None:
    """pymavlink's own parser makes UNKNOWN messages of it; here the frame of every kind of noise is refused."""
    import random

    source = random.Random(1)
    noise = source.randbytes(2 * 10**5 if scale == 1 else 10**7)
    _, counters = decode(noise)
    assert not counters.messages
    parser = common.MAVLink(None)
    parser.robust_parsing = True
    theirs = {m.get_type() for m in parser.parse_buffer(noise[: 10**5]) or ()}
    assert any(name.startswith("UNKNOWN") for name in theirs)


def test_a_dialect_is_an_option() -> None:
    number = next(n for n in dialect_map("ardupilotmega") if n not in dialect_map("common"))
    name = dialect_map("ardupilotmega")[number].msgname
    known = layout("ardupilotmega", number)
    assert known is not None
    frame = bytearray([0xFD, 1, 0, 0, 0, 1, 1, *number.to_bytes(3, "little"), 7])
    data = bytes(frame) + wire.crc(bytes(frame[1:]) + known.seed).to_bytes(2, "little")
    assert decode(data, dialect="ardupilotmega")[1].messages == {name: 1}
    assert not decode(data)[1].messages


# ------------------------------------------------------------------------------------------------------- sources


def numbered(sequence: int, system: int = 1, component: int = 1) -> bytes:
    sender = common.MAVLink(None, srcSystem=system, srcComponent=component)
    sender.seq = sequence
    return bytes(ATTITUDE.pack(sender))


def test_what_is_missing_is_counted_for_each_source() -> None:
    """Two systems and a second component, interleaved; sequence numbers roll over and may come twice."""
    stream = [
        (254, 1, 1),
        (7, 2, 1),
        (255, 1, 1),
        (100, 1, 154),
        (0, 1, 1),
        (8, 2, 1),
        (3, 1, 1),
        (3, 1, 1),
        (11, 2, 1),
    ]
    found, counters = decode(b"".join(numbered(*frame) for frame in stream))
    assert counters.lost == {"1/1": 2, "2/1": 2}
    reported = [(m.name, m.value) for m in found if isinstance(m, Reading)]
    assert reported == [("lost_from_1_1", 2.0), ("lost_from_2_1", 2.0)]


def test_what_another_source_loses_is_counted_and_not_reported() -> None:
    stream = numbered(0, 2) + numbered(0, 1) + numbered(5, 2) + numbered(1, 1)
    found, counters = decode(stream, system=1)
    assert counters.lost == {"2/1": 4}
    assert not [m for m in found if isinstance(m, Reading)]


def test_one_component_can_be_chosen() -> None:
    _, counters = decode(numbered(0) + numbered(0, 1, 154), component=154)
    assert counters.messages == {"other source": 1, "ATTITUDE": 1}


# ------------------------------------------------------------------------------------------------------ messages


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
        ({"current_distance": 65535, "max_distance": 65535}, (None, 0.04, False)),
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
    measurements = decode(pack(message))[0]
    assert [type(m) for m in measurements] == [Velocity, Position]
    assert not any(m.valid for m in measurements if isinstance(m, Velocity | Position))


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


def test_a_time_of_zero_is_none() -> None:
    assert decode(pack(common.MAVLink_system_time_message(0, 0)))[0] == []
    attitude = common.MAVLink_attitude_message(0, 0.1, 0.2, 0.3, 0.01, 0.02, 0.03)
    gps = common.MAVLink_gps_raw_int_message(0, 3, 1, 1, 1, 65535, 65535, 65535, 65535, 255)
    measurements = decode(pack(attitude) + pack(gps))[0]
    assert {m.stamp for m in measurements if not isinstance(m, Reading)} == {Stamp(1)}


def test_a_second_inertial_sensor_is_not_mixed_with_the_first() -> None:
    first, second = (common.MAVLink_highres_imu_message(1, *(0.5,) * 13, 0xFFFF, id=which) for which in (0, 1))
    assert sum(isinstance(m, ImuSample) for m in decode(pack(first) + pack(second))[0]) == 1
    found, counters = decode(pack(common.MAVLink_raw_imu_message(1, *(7,) * 9, id=1)), raw_imu="scaled")
    assert (found, counters.messages) == ([], {"RAW_IMU": 1})


def test_pressures_of_zero_are_those_of_no_sensor() -> None:
    """ArduPilot leaves press_diff at 0 where it has no airspeed sensor."""
    (impact, static), _ = decode(pack(common.MAVLink_scaled_pressure_message(1, 950.0, 0.0, 0)))
    assert isinstance(impact, ImpactPressure)
    assert (impact.q_c, impact.valid) == (0.0, False)
    assert isinstance(static, StaticPressure)
    found, _ = decode(pack(common.MAVLink_scaled_pressure_message(1, 0.0, 5.0, 0)))
    assert found == [ImpactPressure(stamp=Stamp(1, 1_000_000, TimeScale.BOOT), q_c=500.0)]


def test_a_course_of_a_whole_turn_is_north() -> None:
    message = common.MAVLink_gps_raw_int_message(1000, 3, 1, 1, 1, 65535, 65535, 1000, 36_000, 255)
    velocity = next(m for m in decode(pack(message))[0] if isinstance(m, Velocity))
    assert velocity.track == pytest.approx(0.0, abs=1e-9)


def test_a_heartbeat_of_what_is_no_autopilot_says_nothing_about_it() -> None:
    ground = common.MAVLink_heartbeat_message(common.MAV_TYPE_GCS, common.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)
    assert decode(pack(ground))[0] == []
    critical = common.MAVLink_heartbeat_message(common.MAV_TYPE_FIXED_WING, 3, 0, 0, common.MAV_STATE_CRITICAL, 3)
    assert decode(pack(critical))[0] == [DeviceStatus(stamp=Stamp(1), ok=False, flags=("critical",))]


def test_a_map_that_the_autopilot_has_not_is_not_valid() -> None:
    message = common.MAVLink_terrain_report_message(481_000_000, 115_000_000, 0, 0.0, 0.0, 0, 0)
    readings = [m for m in decode(pack(message))[0] if isinstance(m, Reading)]
    assert len(readings) == 4
    assert not any(m.valid for m in readings)


def test_raw_numbers_are_counts_unless_the_autopilot_scales_them() -> None:
    message = common.MAVLink_raw_imu_message(1000, 0, 0, -1000, 100, 0, 0, 450, 0, 0)
    assert all(isinstance(m, Reading) and m.unit == "" for m in decode(pack(message))[0])
    imu = decode(pack(message), raw_imu="scaled")[0][0]
    assert isinstance(imu, ImuSample)
    assert imu.accel_b == pytest.approx((0.0, 0.0, -9.80665))
    assert imu.gyro_b == pytest.approx((0.1, 0.0, 0.0))


@pytest.mark.parametrize(
    ("angles", "quaternion"),
    [
        ((0.4, 0.0, 0.0), (math.cos(0.2), math.sin(0.2), 0.0, 0.0)),
        ((0.0, -0.3, 0.0), (math.cos(0.15), 0.0, -math.sin(0.15), 0.0)),
        ((0.0, 0.0, 5.0), (math.cos(2.5), 0.0, 0.0, math.sin(2.5))),
        # roll -60, pitch 30, heading 90 degrees: the product of the three half angles
        (
            (-math.pi / 3, math.pi / 6, math.pi / 2),
            (
                math.cos(math.pi / 4) * math.cos(math.pi / 12) * math.cos(math.pi / 6)
                - math.sin(math.pi / 4) * math.sin(math.pi / 12) * math.sin(math.pi / 6),
                -math.cos(math.pi / 4) * math.cos(math.pi / 12) * math.sin(math.pi / 6)
                - math.sin(math.pi / 4) * math.sin(math.pi / 12) * math.cos(math.pi / 6),
                math.cos(math.pi / 4) * math.sin(math.pi / 12) * math.cos(math.pi / 6)
                - math.sin(math.pi / 4) * math.cos(math.pi / 12) * math.sin(math.pi / 6),
                math.sin(math.pi / 4) * math.cos(math.pi / 12) * math.cos(math.pi / 6)
                + math.cos(math.pi / 4) * math.sin(math.pi / 12) * math.sin(math.pi / 6),
            ),
        ),
    ],
)
def test_a_quaternion_is_an_attitude(angles: tuple[float, ...], quaternion: tuple[float, ...]) -> None:
    attitude = decode(pack(common.MAVLink_attitude_quaternion_message(1, *quaternion, 0, 0, 0)))[0][-1]
    assert isinstance(attitude, Attitude)
    assert (attitude.roll, attitude.pitch, attitude.heading) == pytest.approx(angles, abs=1e-6)


@pytest.mark.parametrize("length", [0.0, 0.5, math.nan])
def test_a_quaternion_that_is_none_is_no_attitude(length: float) -> None:
    found, _ = decode(pack(common.MAVLink_attitude_quaternion_message(1, length, 0, 0, 0, 0.1, 0, 0)))
    assert [type(m) for m in found] == [ImuSample]


# ------------------------------------------------------------------------------------------------------ commands


@pytest.mark.parametrize(
    ("name", "args", "options", "expected"),
    [
        ("message_interval", {"message": "ATTITUDE", "rate_hz": "50"}, {}, C_INTERVAL),
        ("message_interval", {"message": "30", "rate_hz": "50.0"}, {}, C_INTERVAL),
        ("request_message", {"message": "statustext"}, {"system": 7}, C_REQUEST),
    ],
)
def test_commands_are_the_bytes_of_the_c_library(
    name: str, args: dict[str, str], options: dict[str, Any], expected: str
) -> None:
    assert mavlink.command(name, args, mavlink.Options(**options)).hex() == expected


def test_a_heartbeat_goes_out_when_it_is_wanted() -> None:
    assert mavlink.poll(mavlink.Options()) is None
    assert mavlink.poll(mavlink.Options(heartbeat_s=1.0)) == (1.0, bytes.fromhex(C_HEARTBEAT))


@pytest.mark.parametrize(
    ("name", "args", "match"),
    [
        ("message_interval", {"message": "ATTITUDE"}, "rate_hz is missing"),
        ("message_interval", {"message": "ATTITUDE", "rate_hz": "1001"}, "0 to 1000, or off"),
        ("message_interval", {"message": "ATTITUDE", "rate_hz": "nan"}, "0 to 1000, or off"),
        ("request_message", {"message": "ATTITUTE"}, "'ATTITUTE': must be the name"),
        ("request_message", {"message": "30", "x": "1"}, "no argument 'x'"),
        ("arm", {}, "there are message_interval, request_message"),
    ],
)
def test_bad_commands_are_refused(name: str, args: dict[str, str], match: str) -> None:
    with pytest.raises(ValueError, match=match):
        mavlink.command(name, args)


def test_an_acknowledgement_is_ours_or_nobodys() -> None:
    def answer(**who: int) -> list[Measurement]:
        return decode(pack(common.MAVLink_command_ack_message(511, 4, **who)))[0]

    refused = [Ack(stamp=Stamp(1), command="message_interval", accepted=False, detail="failed")]
    assert answer(target_system=255, target_component=190) == refused
    assert answer() == refused
    assert answer(target_system=254, target_component=190) == []
    assert decode(pack(common.MAVLink_command_ack_message(400, 0)))[0] == []  # arming: somebody else's
    assert decode(pack(common.MAVLink_command_ack_message(511, 5)))[0] == []  # in progress


def test_the_emulated_autopilot_obeys_and_acknowledges() -> None:
    options = mavlink.Options()
    device, decoder = mavlink.make_encoder(options), mavlink.make_decoder(options)

    def tell(name: str, **args: str) -> list[Measurement]:
        answers = device.respond(mavlink.command(name, args, options))
        return [m for data in answers for m in decoder.feed(data, 1)]

    def fly(first: int) -> int:
        """Frames of ten samples, 20 ms apart."""
        times = range(first * 20_000_000, (first + 10) * 20_000_000, 20_000_000)
        level = [Attitude(stamp=Stamp(t), roll=0.1, pitch=0.2, heading=0.3) for t in times]
        return len([frame for m in level for frame in device.encode(m)])

    assert fly(1) == 10
    assert tell("message_interval", message="ATTITUDE", rate_hz="10") == [
        Ack(stamp=Stamp(1), command="message_interval", accepted=True, detail="accepted")
    ]
    assert fly(11) == 2
    tell("message_interval", message="ATTITUDE", rate_hz="off")
    assert fly(21) == 0
    ack, attitude = tell("request_message", message="ATTITUDE")
    assert isinstance(ack, Ack)
    assert ack.accepted
    assert isinstance(attitude, Attitude)
    (refused,) = tell("request_message", message="VFR_HUD")
    assert isinstance(refused, Ack)
    assert not refused.accepted


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("number", [400, 511, 512])
def test_the_emulated_autopilot_refuses_parameters_that_are_no_numbers(number: int, bad: float) -> None:
    """NaN in a COMMAND_LONG means "not given"; many ground stations send it."""
    order = common.MAVLink_command_long_message(1, 1, number, 0, bad, bad, 0, 0, 0, 0, 0)
    (answer,) = mavlink.make_encoder(mavlink.Options()).respond(pack(order, system=255))
    assert common.MAVLink(None).parse_char(answer).result == common.MAV_RESULT_UNSUPPORTED


# ------------------------------------------------------------------------------------------------------ emulator


def names(frames: list[bytes]) -> list[str]:
    return [str(common.mavlink_map[wire.message_id(frame)].msgname) for frame in frames]


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
