"""Wrong positions, heights, attitudes, biases and ages as other people's parsers find them on the wire.

pynmeagps, pyubx2 and pymavlink decode what they know; frames of NovAtel (OM-20000129, BESTPOS) and iMAR (iXCOM, INSSOL)
are read by the offsets of their manuals.  Two flights differ by the fault alone.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import pynmeagps
import pytest
import pyubx2
from pydantic import TypeAdapter
from pymavlink.dialects.v20 import common

from fti.errors import ConfigError
from fti.hil.sensors.fault_effect_check import check_fault_effects
from fti.hil.tables.fault_types import Fault
from tests.hil.faults.device_flights import DEVICES, DURATION_S, TIMING, Flight, fly, make_sensor
from tests.hil.worlds import world

MAKE: TypeAdapter[Fault] = TypeAdapter(Fault)
FROM_S, TO_S = 2.0, 4.0
LATENCY_S = 0.1  # from a sample to its message, at most
EARTH_M, UNDULATION_M = 6.371e6, 47.0
DEG = math.degrees(1.0)


class Fix(NamedTuple):
    """A position [deg, m] and a velocity [m/s] as a parser has them; None where the message has no such field."""

    t: float
    lat: float
    lon: float
    alt: float | None
    alt_msl: float | None
    undulation: float | None
    north: float | None = None
    east: float | None = None


# ------------------------------------------------------------------------------------------------------- parsers


def of_nmea(t: float, message: bytes) -> Iterator[Fix]:
    parsed = pynmeagps.NMEAReader.parse(message)
    if parsed.msgID == "GGA":
        yield Fix(t, parsed.lat, parsed.lon, None, parsed.alt, parsed.sep)


def of_ublox(t: float, message: bytes) -> Iterator[Fix]:
    parsed = pyubx2.UBXReader.parse(message)
    if parsed.identity == "NAV-PVT":
        heights = parsed.height * 1e-3, parsed.hMSL * 1e-3
        yield Fix(t, parsed.lat, parsed.lon, *heights, None, parsed.velN * 1e-3, parsed.velE * 1e-3)


def of_novatel(t: float, message: bytes) -> Iterator[Fix]:
    if struct.unpack_from("<H", message, 4)[0] == 42:  # BESTPOS
        lat, lon, height, undulation = struct.unpack_from("<dddf", message, 28 + 8)
        yield Fix(t, lat, lon, None, height, undulation)


def of_mavlink(t: float, message: bytes) -> Iterator[Fix]:
    for m in common.MAVLink(None).parse_buffer(bytearray(message)) or []:
        if m.get_type() == "GPS_RAW_INT":
            yield Fix(t, m.lat * 1e-7, m.lon * 1e-7, m.alt_ellipsoid * 1e-3, m.alt * 1e-3, None)


def of_ixcom(t: float, message: bytes) -> Iterator[Fix]:
    if message[1] == 0x03:  # INSSOL
        lon, lat, alt, undulation_cm = struct.unpack_from("<ddfh", message, 16 + 48)
        yield Fix(t, lat * DEG, lon * DEG, alt, None, undulation_cm / 100.0)


PARSERS: dict[str, Callable[[float, bytes], Iterator[Fix]]] = {
    "nmea0183": of_nmea,
    "ublox_ubx": of_ublox,
    "novatel_oem6": of_novatel,
    "mavlink": of_mavlink,
    "imar_ixcom": of_ixcom,
}


def fault_of(kind: str, **keys: Any) -> Fault:
    return MAKE.validate_python({"kind": kind, "from_s": FROM_S, "to_s": TO_S, **keys})


def flights(name: str, fault: Fault, **keys: Any) -> tuple[Flight, Flight]:
    """Without and with the fault; keys : of the scenario."""
    without, wrong = (
        fly(name, *faults, sensor=make_sensor(name, world(DURATION_S, fault=faults, sensor=TIMING, **keys)))
        for faults in ((), (fault,))
    )
    return without, wrong


def messages(flight: Flight) -> list[tuple[float, bytes]]:
    return [(t, message) for t, several in flight for message in several]


def is_during(t: float) -> bool:
    """Was the sample of a message that left at t [s] taken during the fault, beyond doubt?"""
    return FROM_S + LATENCY_S < t < TO_S


def pairs(name: str, fault: Fault) -> list[tuple[Fix, Fix]]:
    """Every fix during the fault, without and with it."""
    found = [[fix for t, m in messages(flight) for fix in PARSERS[name](t, m)] for flight in flights(name, fault)]
    both = list(zip(*found, strict=True))
    assert [one for one, other in both if one.t < FROM_S] == [other for one, other in both if one.t < FROM_S]
    during = [(one, other) for one, other in both if is_during(one.t)]
    assert len(during) >= 3
    return during


def moved_m(one: Fix, other: Fix) -> tuple[float, float]:
    """North and east [m] on a sphere, which is right within 0.5 %."""
    north = (other.lat - one.lat) / DEG * EARTH_M
    return north, (other.lon - one.lon) / DEG * EARTH_M * math.cos(one.lat / DEG)


# ------------------------------------------------------------------------------------------------------- positions


@pytest.mark.parametrize("name", PARSERS)
def test_swapped_coordinates_stand_in_each_others_fields(name: str) -> None:
    for sound, wrong in pairs(name, fault_of("swapped_coordinates")):
        assert (wrong.lat, wrong.lon) == pytest.approx((sound.lon, sound.lat), abs=1e-6)
        assert wrong[3:] == sound[3:]


@pytest.mark.parametrize("name", PARSERS)
def test_an_undulation_of_zero_makes_both_heights_that_above_the_sea(name: str) -> None:
    for sound, wrong in pairs(name, fault_of("undulation")):
        assert moved_m(sound, wrong) == pytest.approx((0.0, 0.0), abs=1e-3)
        if wrong.undulation is not None:
            assert sound.undulation == pytest.approx(UNDULATION_M, abs=0.01)
            assert wrong.undulation == 0.0
        if sound.alt_msl is not None:
            assert wrong.alt_msl == pytest.approx(sound.alt_msl, abs=1e-3)
        if sound.alt is not None and wrong.alt is not None:
            assert sound.alt - wrong.alt == pytest.approx(UNDULATION_M, abs=0.01)


@pytest.mark.parametrize("name", ["ublox_ubx", "mavlink", "imar_ixcom"])
def test_the_height_above_the_sea_stands_in_the_field_of_the_other(name: str) -> None:
    for sound, wrong in pairs(name, fault_of("undulation", stated="msl_as_ellipsoid")):
        assert sound.alt is not None
        assert wrong.alt is not None
        assert sound.alt - wrong.alt == pytest.approx(UNDULATION_M, abs=0.01)
        assert (wrong.alt_msl, wrong.undulation) == (sound.alt_msl, sound.undulation)


@pytest.mark.parametrize("name", PARSERS)
@pytest.mark.parametrize("with_velocity", [True, False])
def test_a_sharp_ramp_is_rate_times_time(name: str, with_velocity: bool) -> None:
    """30 m/s to the south-east; the velocity, where the message has it, contains it or does not."""
    ramp = fault_of("gnss_ramp", north_mps=-18.0, east_mps=24.0, with_velocity=with_velocity)
    for sound, wrong in pairs(name, ramp):
        north, east = moved_m(sound, wrong)
        since = math.hypot(north, east) / 30.0
        assert wrong.t - LATENCY_S - FROM_S - 0.01 <= since <= wrong.t - FROM_S + 0.01
        assert north == pytest.approx(-18.0 * since, abs=0.3)
        assert east == pytest.approx(24.0 * since, abs=0.3)
        if sound.north is not None and wrong.north is not None and sound.east is not None and wrong.east is not None:
            change = wrong.north - sound.north, wrong.east - sound.east
            assert change == pytest.approx((-18.0, 24.0) if with_velocity else (0.0, 0.0), abs=2e-3)


def test_a_ramp_with_an_onset_accelerates_from_rest() -> None:
    """20 m/s^2 up to 10 m/s: a t^2 / 2 for half a second, then 2.5 m and 10 m/s."""
    for sound, wrong in pairs("ublox_ubx", fault_of("gnss_ramp", north_mps=10.0, onset_mps2=20.0)):
        assert sound.north is not None
        assert wrong.north is not None
        (north, _), speed = moved_m(sound, wrong), wrong.north - sound.north
        if speed < 9.999:
            assert north == pytest.approx(speed**2 / 40.0, abs=0.02)
        else:
            since = 0.5 + (north - 2.5) / 10.0
            assert wrong.t - LATENCY_S - FROM_S - 0.01 <= since <= wrong.t - FROM_S + 0.01


def test_a_ramp_upwards_raises_both_heights() -> None:
    first, *_, last = pairs("ublox_ubx", fault_of("gnss_ramp", up_mps=5.0))
    for height in ("alt", "alt_msl"):
        raised = [getattr(wrong, height) - getattr(sound, height) for sound, wrong in (first, last)]
        assert (raised[1] - raised[0]) / (last[0].t - first[0].t) == pytest.approx(5.0, abs=0.02)


@pytest.mark.parametrize("name", PARSERS)
def test_a_device_that_is_mounted_elsewhere_is_at_another_place(name: str) -> None:
    """40 m ahead is 40 m along the heading of 250 degrees, nearly: the aircraft wanders and pitches."""
    for sound, wrong in pairs(name, fault_of("lever_arm", forward_m=40.0)):
        north, east = moved_m(sound, wrong)
        assert math.hypot(north, east) == pytest.approx(40.0, abs=0.5)
        assert math.degrees(math.atan2(east, north)) % 360.0 == pytest.approx(250.0, abs=2.0)


def test_a_device_that_is_mounted_below_is_below() -> None:
    for sound, wrong in pairs("ublox_ubx", fault_of("lever_arm", down_m=30.0)):
        assert sound.alt is not None
        assert wrong.alt is not None
        assert sound.alt - wrong.alt == pytest.approx(30.0, abs=0.3)


def test_an_altimeter_that_is_mounted_below_is_nearer_to_the_ground() -> None:
    """A flat country: a laser of 247 m that is 30 m below its place reads 30 m less, within what the pitch makes."""
    without, wrong = flights("lightware_ascii", fault_of("lever_arm", down_m=30.0))
    values = [[float(m) for t, m in messages(flight) if is_during(t)] for flight in (without, wrong)]
    np.testing.assert_allclose(np.array(values[0]) - values[1], 30.0, atol=0.1)


# --------------------------------------------------------------------------------------------- attitude and inertial


def mavlink(flight: Flight, kind: str) -> list[Any]:
    parsed = [
        m for t, one in messages(flight) if is_during(t) for m in common.MAVLink(None).parse_buffer(bytearray(one))
    ]
    return [m for m in parsed if m.get_type() == kind]


def test_an_attitude_is_wrong_by_constants() -> None:
    """MAVLink: three angles, modulo a turn; the fields beside them are the same."""
    offset = fault_of("attitude_offset", roll_deg=-170.0, pitch_deg=4.0, heading_deg=175.0)
    sound, wrong = (mavlink(flight, "ATTITUDE") for flight in flights("mavlink", offset))
    assert len(sound) == len(wrong) >= 3
    for one, other in zip(sound, wrong, strict=True):
        for angle, added in (("roll", -170.0), ("pitch", 4.0), ("yaw", 175.0)):
            difference = math.degrees(getattr(other, angle) - getattr(one, angle))
            assert (difference - added + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-4)
        assert abs(other.roll) <= math.pi
        assert other.rollspeed == one.rollspeed


def test_an_attitude_on_arinc_429_is_wrong_by_constants() -> None:
    """Labels 325 and 314, BNR of 180 degrees over bits 29 (sign) to 16 (ARINC 429 part 1, 2.3): 14 bits, 0.022 deg."""
    offset = fault_of("attitude_offset", roll_deg=10.0, heading_deg=-30.0)
    for label, added in ((0o325, 10.0), (0o314, -30.0)):
        sound, wrong = (bnr_angles(flight, label) for flight in flights("arinc429_little", offset))
        assert len(sound) == len(wrong) >= 3
        turned = (np.subtract(wrong, sound) - added + 180.0) % 360.0 - 180.0
        assert np.abs(turned).max() <= 0.05


def bnr_angles(flight: Flight, label: int) -> list[float]:
    """Angles [deg] of the words of a label; the label is in the lowest octet, its first bit in the lowest place."""
    octet = int(f"{label:08b}"[::-1], 2)
    words = [int.from_bytes(m, "little") for t, m in messages(flight) if is_during(t)]
    counts = [word >> 15 & 0x3FFF for word in words if word & 0xFF == octet]
    return [(count - (1 << 14 if count >> 13 else 0)) * 180.0 / (1 << 13) for count in counts]


def test_a_bias_step_is_in_every_sample() -> None:
    """360 deg/h are 0.1 deg/s; 10 mg are 0.0980665 m/s^2; axes of the device."""
    step = fault_of("inertial_bias", gyro_degph=(0.0, 3600.0, 0.0), accel_mg=(10.0, 0.0, -20.0))
    sound, wrong = (mavlink(flight, "HIGHRES_IMU") for flight in flights("mavlink", step))
    assert len(sound) == len(wrong) >= 3
    for one, other in zip(sound, wrong, strict=True):
        assert math.degrees(other.ygyro - one.ygyro) == pytest.approx(1.0, abs=1e-4)
        assert (other.xgyro, other.zgyro, other.yacc) == (one.xgyro, one.zgyro, one.yacc)
        assert other.xacc - one.xacc == pytest.approx(0.0980665, abs=1e-5)
        assert other.zacc - one.zacc == pytest.approx(-0.196133, abs=1e-5)


def test_an_inertial_system_that_is_aided_sends_the_biases_and_keeps_its_solution() -> None:
    """iXCOM INSSOL: forces and rates are the first six floats."""
    sound, wrong = (
        np.array([struct.unpack_from("<6f3f3fddf", m, 16) for t, m in messages(flight) if is_during(t) and m[1] == 3])
        for flight in flights("imar_ixcom", fault_of("inertial_bias", accel_mg=(0.0, 50.0, 0.0)))
    )
    np.testing.assert_allclose((wrong - sound)[:, :6], [[0.0, 0.490333, 0.0, 0.0, 0.0, 0.0]] * len(sound), atol=1e-5)
    np.testing.assert_array_equal(sound[:, 6:], wrong[:, 6:])


def test_an_inertial_system_on_its_own_drifts_with_the_bias() -> None:
    """50 mg to the right for 2 s are 1 m/s and a metre to the right of the heading, free of satellites all the time."""
    free = {"device": {**TIMING["device"], "mode": "free"}}
    bias = fault_of("inertial_bias", accel_mg=(0.0, 50.0, 0.0))
    last = [
        [of for t, m in messages(fly("imar_ixcom", *faults, sensor=make_sensor(
            "imar_ixcom", world(DURATION_S, fault=faults, sensor=free)))) for of in of_ixcom(t, m) if t < TO_S][-1]
        for faults in ((), (bias,))
    ]  # fmt: skip
    north, east = moved_m(last[0], last[1])
    since = last[1].t - FROM_S
    assert math.hypot(north, east) == pytest.approx(0.490333 * since**2 / 2.0, abs=0.15)
    assert math.degrees(math.atan2(east, north)) % 360.0 == pytest.approx(340.0, abs=6.0)


# -------------------------------------------------------------------------------------------------- scale and age


def test_a_scaled_range_is_too_long_by_its_share() -> None:
    scale = fault_of("scale", quantity="range.slant_range", percent=-4.0)
    values = [[float(m) for t, m in messages(flight) if is_during(t)] for flight in flights("lightware_ascii", scale)]
    np.testing.assert_allclose(values[1], 0.96 * np.array(values[0]), atol=0.01)


def test_late_values_are_those_of_an_earlier_message_with_new_times() -> None:
    """At 10 Hz 0.75 s are eight messages; before the fault everything is as it was."""
    without, wrong = flights("nmea0183", fault_of("latency", by_s=0.75))
    sound, late = ([pynmeagps.NMEAReader.parse(m) for _, m in messages(flight)] for flight in (without, wrong))
    at = [t for t, m in messages(without) if b"GGA" in m]
    sound, late = ([p for p in parsed if p.msgID == "GGA"] for parsed in (sound, late))
    assert [p.time for p in late] == [p.time for p in sound]
    changed = [k for k, t in enumerate(at) if is_during(t)]
    assert len(changed) >= 15
    for k in changed:
        assert (late[k].lat, late[k].lon, late[k].alt) == (sound[k - 8].lat, sound[k - 8].lon, sound[k - 8].alt)
        assert (late[k].lat, late[k].lon) != (sound[k].lat, sound[k].lon)


def test_what_was_never_measured_so_long_ago_is_the_first_that_was() -> None:
    late = fault_of("latency", by_s=30.0)
    ranges = [[float(m) for _, m in messages(flight)] for flight in flights("lightware_ascii", late)]
    assert len({round(r, 2) for r in ranges[1][25:35]}) == 1
    assert ranges[1][30] == ranges[0][0]


# ------------------------------------------------------------------------------------------------------- refusals


def refused(name: str, fault: Fault) -> str:
    environment = world(DURATION_S, fault=(fault,), sensor=TIMING)
    with pytest.raises(ConfigError) as error:
        check_fault_effects([make_sensor(name, environment)], environment)
    return str(error.value)


@pytest.mark.parametrize(
    ("name", "kind", "keys", "message"),
    [
        ("lightware_ascii", "swapped_coordinates", {}, "does not send a latitude"),
        ("freeflight_ra4500", "gnss_ramp", {"up_mps": 1.0}, "does not send a position"),
        ("canaerospace", "undulation", {}, "does not send an undulation or a height above the ellipsoid"),
        ("nmea0183", "undulation", {"stated": "msl_as_ellipsoid"}, "does not send a height above the ellipsoid"),
        ("novatel_oem6", "undulation", {"stated": "msl_as_ellipsoid"}, "does not send a height above the ellipsoid"),
        ("honeywell_hmr2300", "lever_arm", {"down_m": 1.0}, "does not send a position, a velocity or a range"),
        ("ublox_ubx", "mounting", {"yaw_deg": 1.0}, "does not send a range along a direction"),
        ("ublox_ubx", "attitude_offset", {"pitch_deg": 1.0}, "does not send a pitch"),
        ("nmea0183", "inertial_bias", {"gyro_degph": (0.0, 1.0, 0.0)}, "does not send an angular rate of axis y"),
        ("ublox_ubx", "inertial_bias", {"accel_mg": (0.0, 0.0, 1.0)}, "does not send a specific force of axis z"),
    ],
)
def test_what_a_device_does_not_send_is_refused(name: str, kind: str, keys: dict[str, Any], message: str) -> None:
    assert refused(name, fault_of(kind, devices=("device",), **keys)).endswith(f"fault[0].devices: 'device' {message}")
    assert message in refused(name, fault_of(kind, **keys))


@pytest.mark.parametrize("name", PARSERS)
def test_a_device_that_has_no_fix_in_the_beginning_is_not_refused(name: str) -> None:
    outage = MAKE.validate_python({"kind": "gnss_outage", "from_s": 0.0, "to_s": 5.0})
    faults = (fault_of("swapped_coordinates", devices=("device",)), fault_of("undulation"), outage)
    environment = world(DURATION_S, fault=faults, sensor=TIMING)
    check_fault_effects([make_sensor(name, environment)], environment)


@pytest.mark.parametrize("name", ["arinc429", "freeflight_ra4500", "lightware_binary", "imar_ixcom"])
def test_an_altimeter_or_a_navigation_system_can_be_mounted_elsewhere(name: str) -> None:
    environment = world(DURATION_S, fault=(fault_of("lever_arm", devices=("device",), right_m=2.0),), sensor=TIMING)
    check_fault_effects([make_sensor(name, environment)], environment)


def test_every_device_flies_with_every_one_of_them() -> None:
    """A fault without names is of every device that sends what it changes; the others fly as if it were not there."""
    ever = {"from_s": 0.0, "to_s": DURATION_S}
    tables: tuple[dict[str, Any], ...] = (
        {"kind": "gnss_ramp", "up_mps": 1.0}, {"kind": "swapped_coordinates"}, {"kind": "undulation"},
        {"kind": "lever_arm", "down_m": 1.0}, {"kind": "attitude_offset", "roll_deg": 1.0},
        {"kind": "mounting", "pitch_deg": 1.0},
        {"kind": "inertial_bias", "accel_mg": (1.0, 1.0, 1.0)}, {"kind": "latency", "by_s": 0.5},
    )  # fmt: skip
    faults = tuple(MAKE.validate_python({**table, **ever}) for table in tables)
    environment = world(DURATION_S, fault=faults, sensor=TIMING)
    for name in DEVICES:
        ends = [
            flight[-1][0] if flight else 0.0
            for flight in (fly(name, *faults, sensor=make_sensor(name, environment)), fly(name))
        ]
        assert ends[0] == pytest.approx(ends[1], abs=0.2), name
