"""The bytes of the emulated devices do not change: sha256 of the bytes of sixty cycles, for each driver.

The sums were taken before the encoders were made faster.  One that is to send something else needs a new sum, and a
reason.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Any

import pytest

from fti import config, drivers
from fti.messages.measurements import (
    Airspeed,
    Attitude,
    Deviation,
    DeviceStatus,
    DmeRange,
    FlowAngles,
    ImpactPressure,
    ImuSample,
    MagneticField,
    Measurement,
    Position,
    PressureAltitude,
    RadioHeight,
    Range,
    Reading,
    Satellites,
    Stamp,
    StaticPressure,
    SurfaceDeflection,
    Temperature,
    TimeScale,
    Velocity,
)

CYCLES = 60
BEGIN_NS = 1_767_225_600_000_000_000
SURFACES = ("elevator", "left_aileron", "right_aileron", "flaps", "left_flap", "right_flap", "rudder", "stabilizer")
LOGS = {name: every for every, name in enumerate(("INSSOL", "INSRPY", "INSVELNED", "INSVELENU", "INSPOSLLH"), 1)}
MORE_LOGS = {"INSGNDSPEED": 1, "IMURAW": 1, "IMUCORR": 1, "GNSSSOL": 1, "AIRDATA": 1, "MAGDATA": 1, "SYSSTAT": 1}
APMP = {"set": "air_data", "packets": "apmp"}

LIDAR = {
    "sync": "59 59",
    "length": 9,
    "byte_order": "little",
    "checksum": {"kind": "sum8"},
    "fields": [
        {"name": "slant_range", "at": 2, "type": "u16", "scale": 0.01, "lost": [0]},
        {"name": "first_strength", "at": 4, "type": "u16"},
    ],
}

#: Driver, options, sum.
SENT: list[tuple[str, dict[str, Any], str]] = [
    ("arinc429", {}, "60:73d535d95976beac"),
    ("ascii_line", {}, "60:72b0f2d006411581"),
    ("canaerospace", {}, "963:fdd4b6f041ed9aca"),
    ("deflection_pickups", {}, "562:525411ca46b03388"),
    ("freeflight_ra4500", {}, "60:30db7f0db7035f32"),
    ("imar_ixcom", {}, "20:dd19fb4f0fe9d255"),
    ("lightware_ascii", {}, "60:2e62a0192bcd3218"),
    ("lightware_binary", {}, "60:1a65856e520b6f43"),
    ("mavlink", {}, "463:31cadc31b6db992a"),
    ("nmea0183", {}, "231:2e8ee837d4d51b96"),
    ("novatel_oem6", {}, "132:196cffeb41685959"),
    ("power_unit", {}, "240:813442ded787e446"),
    ("ublox_ubx", {}, "60:253db0f22c5bdf77"),
    ("arinc429", {"set": "radio_altimeter_bcd"}, "60:688021b099d41a77"),
    ("arinc429", {"set": "freeflight_ra4500"}, "60:2f5abab3247c6cfe"),
    ("arinc429", {"set": "ils"}, "113:173436840324a561"),
    ("arinc429", {"set": "dme"}, "120:c05cc49554d2c64d"),
    ("arinc429", {"set": "air_data"}, "480:835d9573beffd1ba"),
    ("arinc429", {"set": "air_data_18"}, "480:ce9eb33d08eebabb"),
    ("arinc429", {"set": "ahrs"}, "540:776e11d9ddf50e06"),
    ("arinc429", {"set": "irs"}, "660:9c706c441feeb88e"),
    ("arinc429", {"set": "gps"}, "540:cbf5fec6e879d1f5"),
    ("arinc429", {"set": "gnss_743a"}, "660:7572adfe5fb4ce41"),
    ("arinc429", APMP, "420:09fbce664cac3e49"),
    ("imar_ixcom", {"logs": LOGS}, "90:879ed9612bde0af9"),
    ("imar_ixcom", {"logs": MORE_LOGS}, "360:70899b4e2620723c"),
    ("mavlink", {"emulate": "simulator"}, "120:61704eb20f431dde"),
    ("binary_struct", LIDAR, "60:a77651d3f53ad2af"),
]
CONTINUOUS = "60:286017e9a26310d0"


def number(k: int, at: int, low: float, high: float) -> float:
    """A number of cycle k, the same on every machine: no function but the four operations."""
    return low + (high - low) * ((k * 7919 + at * 104_729 + 13) % 65_537) / 65_537.0


def cycle(k: int) -> list[Measurement]:
    """What a device that measures everything measures; now and then something is missing."""
    t_ns = BEGIN_NS + k * 100_000_000
    stamp = Stamp(t_ns, t_ns, TimeScale.UTC) if k % 2 else Stamp(t_ns, k * 100_000_000, TimeScale.BOOT)
    return [*inertial(k, stamp), *air(k, stamp), *heights(k, stamp), *radio(k, stamp), *reported(k, stamp)]


def inertial(k: int, stamp: Stamp) -> Iterator[Measurement]:
    fixed = k % 7 != 3
    ax, ay, az, gx, gy, gz, mx, my, mz = (number(k, i, -9.0, 9.0) for i in range(9))
    yield MagneticField(stamp=stamp, field_b=(mx * 5e-6, my * 5e-6, mz * 5e-6))
    yield ImuSample(stamp=stamp, accel_b=(ax, ay, az), gyro_b=(gx * 0.1, gy * 0.1, gz * 0.1))
    yield Attitude(stamp=stamp, roll=number(k, 9, -3, 3), pitch=number(k, 10, -1, 1), heading=number(k, 11, 0, 6.28))
    if k % 3:  # without them the position is an inertial system's own
        yield Satellites(stamp=stamp, used=k % 13 if fixed else 0, hdop=0.5 + k, vdop=0.7 + k, pdop=0.9 + k)
    if not fixed:
        yield Velocity(stamp=stamp, valid=False)
        yield Position(stamp=stamp, valid=False)
        return
    north, east, down = (number(k, i, -99.0, 99.0) for i in range(12, 15))
    yield Velocity(
        stamp=stamp, north=north, east=east, down=down, ground_speed=abs(north), track=abs(east) / 17, sd=0.1
    )
    alt = number(k, 15, -100.0, 3000.0)
    yield Position(
        stamp=stamp, lat=number(k, 16, -1.5, 1.5), lon=number(k, 17, -3.1, 3.1), alt=alt, alt_msl=alt + 31.0,
        undulation=-31.0, horizontal_sd=1.25, vertical_sd=2.5,
    )  # fmt: skip


def air(k: int, stamp: Stamp) -> Iterator[Measurement]:
    yield StaticPressure(stamp=stamp, p_static=number(k, 18, 5e4, 1.05e5))
    yield ImpactPressure(stamp=stamp, q_c=number(k, 19, 0.0, 6e3))
    yield PressureAltitude(stamp=stamp, alt_press=number(k, 20, -300.0, 9e3), setting_pa=101_325.0)
    yield PressureAltitude(stamp=stamp, alt_press=number(k, 21, -300.0, 9e3), valid=k % 5 != 0)
    speed = number(k, 22, 0.0, 99.0)
    yield Temperature(stamp=stamp, static=number(k, 23, 220.0, 320.0))
    yield FlowAngles(stamp=stamp, aoa=number(k, 24, -0.3, 0.3), aos=number(k, 25, -0.3, 0.3))
    yield Airspeed(stamp=stamp, cas=speed, ias=speed + 1.0, tas=speed + 9.0)


def heights(k: int, stamp: Stamp) -> Iterator[Measurement]:
    height, measurements = number(k, 26, 0.0, 700.0), k % 11 != 5
    yield Reading(stamp=stamp, name="first_strength", value=number(k, 27, 0.0, 100.0), unit="%")
    yield Range(stamp=stamp, slant_range=height if measurements else None, sd=0.05, valid=measurements)
    yield RadioHeight(stamp=stamp, height_agl=height if measurements else None, valid=measurements)


def radio(k: int, stamp: Stamp) -> Iterator[Measurement]:
    for n in range(1, 5):
        received = (k + n) % 6 != 0
        yield DmeRange(
            stamp=stamp,
            station=f"dme_{n}",
            slant_range=9e4 * number(k, 28 + n, 0, 1) if received else None,
            valid=received,
        )
    yield Deviation(stamp=stamp, localizer_ddm=number(k, 33, -0.2, 0.2), glide_slope_ddm=None if k % 9 == 4 else 0.1)


def reported(k: int, stamp: Stamp) -> Iterator[Measurement]:
    for n, surface in enumerate(SURFACES):
        yield SurfaceDeflection(stamp=stamp, surface=surface, deflection=None, raw=(k * 577 + n * 991) % 4096)
    yield Reading(stamp=stamp, name="gnss_mode", value=12.0 if k % 7 != 3 else 8.0)
    yield Reading(stamp=stamp, name="magnetic_heading", value=None if k % 10 == 9 else 1.0 + k / 64, valid=k % 10 != 9)
    yield Reading(stamp=stamp, name="yaw_rate", value=number(k, 34, -1, 1), unit="rad/s")
    yield DeviceStatus(stamp=stamp, ok=True, flags=("in_air", "active", "auto") if k % 8 else ("unlocked",))


def sum_of(name: str, options: dict[str, Any], requests: tuple[str, ...] = ()) -> str:
    """Of all messages, each with its length; behind how many there are.  asked : commands before the first cycle"""
    driver = drivers.load(name)
    bound = config.bind(driver.Options, options, "test.toml", "options")
    encoder = driver.make_encoder(bound)
    digest, count = hashlib.sha256(), 0
    for data in [*driver.on_connect(bound), *(driver.command(text, {}, bound) for text in requests)]:
        encoder.respond(data)
    for k in range(CYCLES):
        for message in (message for m in cycle(k) for message in encoder.encode(m)):
            digest.update(len(message).to_bytes(2, "big") + message)
            count += 1
    return f"{count}:{digest.hexdigest()[:16]}"


@pytest.mark.parametrize(
    ("name", "options", "expected"), SENT, ids=lambda value: value if isinstance(value, str) else ""
)
def test_a_driver_sends_what_it_sent(name: str, options: dict[str, Any], expected: str) -> None:
    assert sum_of(name, options) == expected


def test_a_magnetometer_sends_what_it_sent_when_it_is_asked() -> None:
    assert sum_of("honeywell_hmr2300", {}, ("continuous",)) == CONTINUOUS
