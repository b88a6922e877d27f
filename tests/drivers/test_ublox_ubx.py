"""u-blox UBX: captures of real receivers against gpsd, counts and bytes against pyubx2, units by hand, commands.

pyubx2 is not used by the driver.  gpsd writes degrees with 9 decimals, lengths with 3 or 4, times with 3.
"""

from __future__ import annotations

import io
import json
import math
import random
import struct
from collections import Counter
from datetime import UTC, datetime
from typing import Any, TypeVar

import numpy as np
import pytest
from pyubx2 import GET, POLL, SET, UBX_CONFIG_DATABASE, UBX_MSGIDS, UBXMessage, UBXReader

from fti.config import bind
from fti.drivers import nmea0183
from fti.drivers import ublox_ubx as ubx
from fti.drivers.ublox_ubx.frames import MAX_HELD_BYTES, crc24q, frame
from fti.drivers.ublox_ubx.table import NAMES, OUTPUTS, PORTS
from fti.errors import ConfigError
from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.messages.measurements import (
    Ack,
    Attitude,
    DeviceStatus,
    DeviceTime,
    Measurement,
    Position,
    Pseudorange,
    Pseudoranges,
    ReceiverClock,
    Satellites,
    Stamp,
    TimeScale,
    Velocity,
)
from tests.helpers import ROOT

CAPTURES = ("ublox-8-time", "ublox-neo-m8n", "ublox-neo-m8t")
each_capture = pytest.mark.parametrize("name", CAPTURES)
GPS_EPOCH_NS, LEAP_NS = 315_964_800 * 10**9, 18 * 10**9
SYSTEMS = {0: "gps", 1: "sbas", 2: "galileo", 3: "beidou", 5: "qzss", 6: "glonass"}
M = TypeVar("M")


def read(name: str) -> bytes:
    return (ROOT / f"tests/captures/{name}.log").read_bytes()


def reports(name: str, kind: str) -> list[dict[str, Any]]:
    """What gpsd 3.22 said to the same bytes."""
    lines = (ROOT / f"tests/captures/{name}.log.chk").read_text(errors="replace").splitlines()
    contents = [json.loads(line) for line in lines if line.startswith("{")]
    return [report for report in contents if report["class"] == kind]


def decode(data: bytes) -> list[Measurement]:
    return ubx.make_decoder(ubx.Options()).feed(data, 1)


def of(measurements: list[Measurement], kind: type[M]) -> list[M]:
    return [m for m in measurements if isinstance(m, kind)]


def one(message: bytes, kind: type[M]) -> M:
    (found,) = of(decode(message), kind)
    return found


def unix_ms(stamp: Stamp) -> int | None:
    if stamp.t_dev_ns is None:
        return None
    gps = stamp.time_scale is TimeScale.GPS
    return round((stamp.t_dev_ns + (GPS_EPOCH_NS - LEAP_NS if gps else 0)) / 1e6)


def report_ms(text: str) -> int:
    return round(datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp() * 1000)


def by_time(found: list[M]) -> dict[int | None, M]:
    return {unix_ms(m.stamp): m for m in found}  # type: ignore[attr-defined]


# ------------------------------------------------------------------------------------------------- counts and bytes


@each_capture
def test_messages_are_those_that_a_second_reader_counts(name: str) -> None:
    data = read(name)
    decoder = ubx.make_decoder(ubx.Options())
    decoder.feed(data, 1)
    measurements = [(raw, parsed.identity) for raw, parsed in UBXReader(io.BytesIO(data), protfilter=2, quitonerror=0)]
    assert decoder.counters.messages == Counter(identity for _, identity in measurements)
    assert decoder.counters.framed == sum(len(raw) for raw, _ in measurements)
    assert data[-decoder.counters.held :].startswith(b"\xb5b")  # the captures end inside a message
    assert set(decoder.counters.skipped) <= {"comment", "no_sync"}


def test_names_are_those_of_a_second_table() -> None:
    theirs = {(key[0], key[1]): name for key, name in UBX_MSGIDS.items() if len(key) == 2}
    assert {ids: theirs[ids] for ids in NAMES if ids in theirs} == {i: n for i, n in NAMES.items() if i in theirs}
    assert len(NAMES.keys() - theirs.keys()) <= 1  # MGA-ACK has a key of three bytes there


def test_keys_of_the_configuration_are_those_of_a_second_table() -> None:
    for name, (_, _, key) in OUTPUTS.items():
        kind, _, rest = name.partition("-")
        theirs = f"CFG_MSGOUT_NMEA_ID_{rest}" if kind == "NMEA" else f"CFG_MSGOUT_UBX_{kind}_{rest}"
        for place, port in enumerate(PORTS):
            assert UBX_CONFIG_DATABASE[f"{theirs}_{port.upper()}"][0] == key + place


# --------------------------------------------------------------------------------------------- fields, against gpsd


def test_solutions_of_nav_pvt_are_those_of_gpsd() -> None:
    measurements = decode(read("ublox-neo-m8n"))
    positions, velocities = by_time(of(measurements, Position)), by_time(of(measurements, Velocity))
    reference = reports("ublox-neo-m8n", "TPV")
    assert {report_ms(r["time"]) for r in reference} == set(positions)
    for report in reference:
        position, velocity = positions[report_ms(report["time"])], velocities[report_ms(report["time"])]
        assert position.valid
        assert velocity.valid
        assert math.degrees(position.lat or 0.0) == pytest.approx(report["lat"], abs=6e-10)
        assert math.degrees(position.lon or 0.0) == pytest.approx(report["lon"], abs=6e-10)
        assert position.alt == pytest.approx(report["altHAE"], abs=6e-5)
        assert position.alt_msl == pytest.approx(report["altMSL"], abs=6e-5)
        assert position.horizontal_sd == pytest.approx(report["eph"], abs=6e-4)
        assert position.vertical_sd == pytest.approx(report["epv"], abs=6e-4)
        assert velocity.ground_speed == pytest.approx(report["speed"], abs=6e-4)
        assert math.degrees(velocity.track or 0.0) == pytest.approx(report["track"], abs=6e-5)


def test_solutions_of_nav_sol_are_those_of_gpsd() -> None:
    """Every epoch earth-centred; gpsd works out latitude and longitude for the first one only."""
    measurements = decode(read("ublox-neo-m8t"))
    positions, velocities = by_time(of(measurements, Position)), by_time(of(measurements, Velocity))
    reference = [r for r in reports("ublox-neo-m8t", "TPV") if "ecefx" in r]
    assert {report_ms(r["time"]) for r in reference} == set(positions)
    for report in reference:
        position, velocity = positions[report_ms(report["time"])], velocities[report_ms(report["time"])]
        assert position.valid
        here = ecef_from_geodetic(position.lat or 0.0, position.lon or 0.0, position.alt or 0.0)
        np.testing.assert_allclose(here, [report[f"ecef{axis}"] for axis in "xyz"], rtol=0, atol=0.0051)
        vel_n = np.array([velocity.north, velocity.east, velocity.down])
        vel_e = mat_en(position.lat or 0.0, position.lon or 0.0) @ vel_n
        np.testing.assert_allclose(vel_e, [report[f"ecefv{axis}"] for axis in "xyz"], rtol=0, atol=0.0051)
        assert velocity.sd == pytest.approx(report["ecefvAcc"], abs=0.0051)
        assert position.horizontal_sd == pytest.approx(report["ecefpAcc"], abs=0.0051)
    first, ours = reference[0], positions[report_ms(reference[0]["time"])]
    assert math.degrees(ours.lat or 0.0) == pytest.approx(first["lat"], abs=1e-9)
    assert math.degrees(ours.lon or 0.0) == pytest.approx(first["lon"], abs=1e-9)
    assert ours.alt == pytest.approx(first["altHAE"], abs=1e-4)


def test_times_and_the_first_fix_of_a_timing_receiver_are_those_of_gpsd() -> None:
    positions = by_time(of(decode(read("ublox-8-time")), Position))
    reference = reports("ublox-8-time", "TPV")
    assert {report_ms(r["time"]) for r in reference} == set(positions)
    first = reference[0]
    ours = positions[report_ms(first["time"])]
    assert math.degrees(ours.lat or 0.0) == pytest.approx(first["lat"], abs=1e-9)
    assert math.degrees(ours.lon or 0.0) == pytest.approx(first["lon"], abs=1e-9)
    assert ours.alt == pytest.approx(first["altHAE"], abs=1e-4)


@each_capture
def test_satellites_are_those_of_gpsd(name: str) -> None:
    ours = [m for m in of(decode(read(name)), Satellites) if m.satellites]
    reference = reports(name, "SKY")
    assert len(ours) == len(reference) > 3
    for found, report in zip(ours, reference, strict=True):
        measurements = {(s.system, s.number): s for s in found.satellites}
        assert len(measurements) == len(found.satellites) == report["nSat"]
        for theirs in report["satellites"]:
            mine = measurements[SYSTEMS[theirs["gnssid"]], theirs["svid"]]
            assert mine.used is theirs["used"]
            assert (mine.cn0_dbhz or 0.0) == theirs["ss"]
            assert mine.elevation == (pytest.approx(math.radians(theirs["el"])) if "el" in theirs else None)
            assert mine.azimuth == (pytest.approx(math.radians(theirs["az"])) if "el" in theirs else None)


@pytest.mark.parametrize("name", ["ublox-8-time", "ublox-neo-m8t"])
def test_dilutions_are_those_of_gpsd(name: str) -> None:
    ours = [m for m in of(decode(read(name)), Satellites) if m.hdop is not None]
    stated = {(m.hdop, m.vdop, m.pdop) for m in ours}
    for report in reports(name, "SKY"):
        assert (report["hdop"], report["vdop"], report["pdop"]) in stated


def rinex_number(observation: dict[str, Any]) -> int:
    """In its raw reports gpsd counts augmentation satellites from 20, as RINEX does."""
    number: int = observation["svid"]
    return number + 100 if SYSTEMS[observation["gnssid"]] == "sbas" else number


def test_raw_observations_are_those_of_gpsd() -> None:
    ours, reference = of(decode(read("ublox-neo-m8t")), Pseudoranges), reports("ublox-neo-m8t", "RAW")
    assert len(ours) == len(reference) == 39
    for found, report in zip(ours, reference, strict=True):
        assert unix_ms(found.stamp) == pytest.approx(report["time"] * 1000 + report["nsec"] / 1e6, abs=0.51)
        assert len(found.observations) == len(report["rawdata"])
        for mine, theirs in zip(found.observations, report["rawdata"], strict=True):
            assert (mine.system, mine.number) == (SYSTEMS[theirs["gnssid"]], rinex_number(theirs))
            assert (mine.signal, mine.cn0_dbhz) == (theirs["obs"], theirs["snr"])
            assert mine.pseudorange == pytest.approx(theirs["pseudorange"], abs=6e-7)
            assert mine.doppler == pytest.approx(theirs["doppler"], abs=6e-7)
            assert mine.lock_time == pytest.approx(theirs["locktime"] / 1000)
            if mine.carrier_phase is not None:
                assert mine.carrier_phase == pytest.approx(theirs["carrierphase"], abs=6e-7)


# ---------------------------------------------------------------------------------------------- units, by hand


def message(name: str, **fields: Any) -> bytes:
    """A message of a second generator."""
    data: bytes = UBXMessage(name[:3], name, GET, **fields).serialize()
    return data


GOOD = {"fixType": 3, "gnssFixOk": 1, "numSV": 9, "pDOP": 1.5}
NOON = {"year": 2024, "month": 2, "day": 29, "hour": 12, "min": 0, "second": 0, "validDate": 1, "validTime": 1}
NOON_NS = int(datetime(2024, 2, 29, 12, tzinfo=UTC).timestamp()) * 10**9


def pvt(**fields: Any) -> bytes:
    return message("NAV-PVT", **{**GOOD, **NOON, "iTOW": 388_818_000, "hAcc": 1000, "vAcc": 2000, **fields})


def test_pvt_in_metres_per_second() -> None:
    """mm/s, 1e-5 degrees: 10 m/s to the south and sinking with 2 m/s."""
    velocity = one(pvt(velN=-10_000, velE=0, velD=2000, gSpeed=10_000, headMot=180.0, sAcc=250), Velocity)
    assert (velocity.north, velocity.east, velocity.down, velocity.ground_speed, velocity.sd) == (
        -10.0,
        0.0,
        2.0,
        10.0,
        0.25,
    )
    assert velocity.track == pytest.approx(math.pi)


def test_posllh_in_metres_and_radians() -> None:
    """1e-7 degrees, mm: 30 degrees north are pi/6."""
    position = one(
        frame(0x01, 0x02, struct.pack("<I4i2I", 0, -900_000_000, 300_000_000, 123_456, 76_456, 2500, 3500)), Position
    )
    assert position.lat == pytest.approx(math.pi / 6)
    assert position.lon == pytest.approx(-math.pi / 2)
    assert (position.alt, position.alt_msl, position.undulation) == (123.456, 76.456, 47.0)
    assert (position.horizontal_sd, position.vertical_sd) == (2.5, 3.5)


def test_hpposllh_has_two_more_digits() -> None:
    data = struct.pack("<BHBI4i4b2I", 0, 0, 0, 0, 115_678_901, 481_234_567, 545_678, 498_765, 99, -99, 9, -9, 141, 212)
    position = one(frame(0x01, 0x14, data), Position)
    assert math.degrees(position.lat or 0.0) == pytest.approx(48.123456601, abs=1e-12)
    assert math.degrees(position.lon or 0.0) == pytest.approx(11.567890199, abs=1e-12)
    assert position.alt == pytest.approx(545.6789, abs=1e-9)
    assert position.alt_msl == pytest.approx(498.7641, abs=1e-9)
    assert (position.horizontal_sd, position.vertical_sd) == (0.0141, 0.0212)


def test_velned_in_metres_per_second() -> None:
    """cm/s, 1e-5 degrees: 36 km/h to the west is 10 m/s, 270 degrees."""
    data = struct.pack("<I3iIIiII", 0, 0, -1000, 50, 1001, 1000, 27_000_000, 20, 0)
    velocity = one(frame(0x01, 0x12, data), Velocity)
    assert (velocity.north, velocity.east, velocity.down, velocity.ground_speed, velocity.sd) == (
        0.0,
        -10.0,
        0.5,
        10.0,
        0.2,
    )
    assert velocity.track == pytest.approx(1.5 * math.pi)


def test_attitude_in_radians() -> None:
    data = struct.pack("<IB3x3i3I", 0, 0, -9_000_000, 4_500_000, 18_000_000, 100_000, 200_000, 300_000)
    attitude = one(frame(0x01, 0x05, data), Attitude)
    assert (attitude.roll, attitude.pitch, attitude.heading) == pytest.approx((-math.pi / 2, math.pi / 4, math.pi))
    assert (attitude.roll_sd, attitude.heading_sd) == pytest.approx((math.radians(1), math.radians(3)))


def test_clock_in_seconds() -> None:
    """ns, ns/s, ns, ps/s; receiver time is ahead of GPS time when it is positive."""
    receiver_clock = one(message("NAV-CLOCK", clkB=1_000_000, clkD=760, tAcc=20, fAcc=5000), ReceiverClock)
    assert (receiver_clock.offset, receiver_clock.drift) == pytest.approx((1e-3, 7.6e-7))
    assert (receiver_clock.offset_sd, receiver_clock.drift_sd) == pytest.approx((20e-9, 5e-9))
    unknown = one(message("NAV-CLOCK", tAcc=0xFFFFFFFF), ReceiverClock)
    assert not unknown.valid
    assert unknown.offset_sd is None


def test_times_in_gps_and_utc() -> None:
    """Week 2300 began on 2024-02-04; 500 ns before its first second."""
    gps = one(message("NAV-TIMEGPS", iTOW=1000, fTOW=-500, week=2300, towValid=1, weekValid=1), DeviceTime)
    assert gps.stamp.t_dev_ns == (2300 * 7 * 86_400 + 1) * 10**9 - 500
    utc = one(message("NAV-TIMEUTC", nano=-7, validUTC=1, **{k: NOON[k] for k in list(NOON)[:5]}, sec=0), DeviceTime)
    assert (utc.stamp.t_dev_ns, utc.stamp.time_scale) == (NOON_NS - 7, TimeScale.UTC)
    assert decode(message("NAV-TIMEGPS", week=2300, towValid=1)) == []
    assert decode(message("NAV-TIMEUTC", year=2024, month=1, day=1)) == []


def test_observations_in_metres_cycles_and_seconds() -> None:
    signal = struct.pack("<ddfBBBBHBBBBBx", 2e7, 1e8, -1000.0, 2, 11, 6, 0, 1500, 44, 3, 5, 1, 3)
    data = struct.pack("<dHbBBBxx", 345_600.25, 2300, 18, 1, 1, 1) + signal
    pseudoranges = one(frame(0x02, 0x15, data), Pseudoranges)
    assert pseudoranges.stamp.t_dev_ns == (2300 * 604_800 + 345_600) * 10**9 + 250_000_000
    assert pseudoranges.observations == (
        Pseudorange(
            system="galileo", number=11, signal="L7Q", pseudorange=2e7, pseudorange_sd=0.08, carrier_phase=1e8,
            carrier_phase_sd=0.02, doppler=-1000.0, cn0_dbhz=44.0, lock_time=1.5, carrier_hz=1207.14e6,
        ),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("gnss_id", "signal_id", "channel", "expected"),
    [(0, 0, 0, ("L1C", 1575.42e6)), (0, 3, 0, ("L2L", 1227.6e6)), (6, 0, 0, ("L1C", 1598.0625e6)),
     (6, 2, 13, ("L2C", 1248.625e6)), (3, 0, 0, ("L2I", 1561.098e6)), (2, 8, 0, ("L6B", 1278.75e6)),
     (0, 15, 0, ("signal_15", None))],
)  # fmt: skip
def test_signals_and_their_carriers(gnss_id: int, signal_id: int, channel: int, expected: tuple[str, float]) -> None:
    """GLONASS has channels from -7 to 6, 562.5 and 437.5 kHz apart."""
    signal = struct.pack("<ddfBBBBHBBBBBx", 2e7, 1e8, 0.0, gnss_id, 1, signal_id, channel, 0, 44, 0, 0, 0, 3)
    data = frame(0x02, 0x15, struct.pack("<dHbBBBxx", 0.25, 2300, 18, 1, 1, 1) + signal)
    (found,) = one(data, Pseudoranges).observations
    assert (found.signal, found.carrier_hz) == expected
    if found.carrier_hz:
        again = ubx.make_encoder(ubx.Options()).encode(one(data, Pseudoranges))
        assert one(b"".join(again), Pseudoranges).observations == (found,)


def test_older_observations() -> None:
    rows = [(1e8, 2e7, 500.0, 5, 6, 40, 0), (1e8, 2e7, 500.0, 122, 4, 35, 0), (1e8, 2e7, 500.0, 7, 1, 20, 0)]
    body = b"".join(struct.pack("<ddfBbbB", *row) for row in rows)
    pseudoranges = one(frame(0x02, 0x10, struct.pack("<ihBx", 250, 1500, 3) + body), Pseudoranges)
    assert pseudoranges.stamp.t_dev_ns == 1500 * 604_800 * 10**9 + 250_000_000
    assert [(o.system, o.number) for o in pseudoranges.observations] == [("gps", 5), ("sbas", 122), ("gps", 7)]
    assert [o.pseudorange for o in pseudoranges.observations] == [2e7, 2e7, None]
    assert [o.carrier_phase for o in pseudoranges.observations] == [1e8, None, None]


# ------------------------------------------------------------------------------------------------ validity and time


@pytest.mark.parametrize(
    ("fields", "valid", "flags"),
    [
        ({}, True, ("fix_3d",)),
        ({"fixType": 2}, True, ("fix_2d",)),
        ({"fixType": 4, "diffSoln": 1}, True, ("gnss_dead_reckoning", "dgps")),
        ({"carrSoln": 2, "diffSoln": 1}, True, ("fix_3d", "dgps", "rtk_fixed")),
        ({"gnssFixOk": 0}, False, ("fix_3d", "beyond_limits")),
        ({"fixType": 0}, False, ("no_fix",)),
        ({"fixType": 1}, False, ("dead_reckoning",)),
        ({"fixType": 5}, False, ("time_only",)),
        ({"fixType": 9}, False, ("fix_9",)),
    ],
)
def test_kind_of_fix_decides_what_is_valid(fields: dict[str, int], valid: bool, flags: tuple[str, ...]) -> None:
    measurements = decode(pvt(**fields))
    assert of(measurements, Position)[0].valid is valid
    assert of(measurements, Velocity)[0].valid is valid
    (status,) = of(measurements, DeviceStatus)
    assert (status.ok, status.flags) == (valid, flags)


def test_an_invalid_place_is_none() -> None:
    position = one(pvt(invalidLlh=1, lat=48.0, lon=11.0, height=1000), Position)
    assert (position.valid, position.lat, position.lon, position.alt) == (False, None, None, None)


def test_accuracies_that_are_unknown_are_none() -> None:
    position = one(pvt(hAcc=0xFFFFFFFF, vAcc=0xFFFFFFFF), Position)
    assert (position.horizontal_sd, position.vertical_sd) == (None, None)


@pytest.mark.parametrize(("nano", "fields"), [(-3_000_000, {}), (994_999_999, {}), (-1, {"hour": 0, "day": 1})])
def test_nanoseconds_have_a_sign(nano: int, fields: dict[str, int]) -> None:
    stamp = one(pvt(nano=nano, **fields), Position).stamp
    expected = datetime(2024, 2, fields.get("day", 29), fields.get("hour", 12), tzinfo=UTC).timestamp()
    assert (stamp.t_dev_ns, stamp.time_scale) == (int(expected) * 10**9 + nano, TimeScale.UTC)


@pytest.mark.parametrize("missing", ["validDate", "validTime"])
def test_a_time_that_is_not_valid_is_none(missing: str) -> None:
    assert one(pvt(**{missing: 0}), Position).stamp.t_dev_ns is None


@pytest.mark.parametrize(
    "unknown",
    [
        pvt(validDate=0, validTime=0),
        pvt(validDate=1, validTime=0),
        message("NAV-SOL", iTOW=1000, week=2300, towSet=1, wknSet=0),
        message("NAV-TIMEGPS", iTOW=1000, week=2300, towValid=1, weekValid=0),
    ],
    ids=["pvt", "pvt_date", "sol", "timegps"],
)
def test_a_week_does_not_outlast_the_receiver_that_sent_it(unknown: bytes) -> None:
    """A receiver that was switched off and on counts iTOW from anywhere until it knows the time."""
    clock = message("NAV-CLOCK", iTOW=5000, tAcc=1)
    before, after, again = of(decode(pvt() + clock + unknown + clock + pvt() + clock), ReceiverClock)
    assert before.stamp.t_dev_ns is not None
    assert after.stamp == Stamp(1)
    assert again.stamp == before.stamp


def test_time_of_the_week_is_completed_with_the_week_that_was_received() -> None:
    clock = message("NAV-CLOCK", iTOW=5, tAcc=1)
    assert one(clock, ReceiverClock).stamp.t_dev_ns is None
    end = message("NAV-TIMEGPS", iTOW=604_799_000, week=2300, towValid=1, weekValid=1)
    new_week, late = of(decode(end + clock + message("NAV-CLOCK", iTOW=604_799_500, tAcc=1)), ReceiverClock)
    assert new_week.stamp == Stamp(1, 2301 * 604_800 * 10**9 + 5_000_000, TimeScale.GPS)
    assert late.stamp.t_dev_ns == 2301 * 604_800 * 10**9 - 500_000_000
    assert of(decode(end + message("NAV-CLOCK", iTOW=604_800_000)), ReceiverClock)[0].stamp.t_dev_ns is None
    for leap_s in (17, 18, 19):
        itow = 388_800_000 + 1000 * leap_s
        after_pvt = of(decode(pvt(iTOW=itow) + message("NAV-CLOCK", iTOW=itow)), ReceiverClock)[0].stamp.t_dev_ns
        assert after_pvt == NOON_NS - GPS_EPOCH_NS + leap_s * 10**9


def test_a_place_without_a_flag_is_as_good_as_the_fix_before_it() -> None:
    def place(accuracy_mm: int) -> bytes:
        return frame(0x01, 0x02, struct.pack("<I4i2I", 0, 0, 0, 0, 0, accuracy_mm, 0))

    assert one(place(5000), Position).valid
    assert not one(place(100_001), Position).valid
    assert not one(place(0xFFFFFFFF), Position).valid
    lost = message("NAV-STATUS", gpsFix=0) + place(5000)
    assert not one(lost, Position).valid
    again = of(decode(lost + message("NAV-STATUS", gpsFix=3, gpsFixOk=1) + place(5000)), Position)
    assert [p.valid for p in again] == [False, True]


def test_directions_and_signals_that_are_unknown_are_none() -> None:
    row = struct.pack("<BBBbhhI", 0, 7, 0, -91, 0, 0, 0)
    (measurements,) = one(frame(0x01, 0x35, struct.pack("<IBBxx", 0, 1, 1) + row), Satellites).satellites
    assert (measurements.elevation, measurements.azimuth, measurements.cn0_dbhz, measurements.used) == (
        None,
        None,
        None,
        False,
    )


@pytest.mark.parametrize(
    ("number", "expected"),
    [(32, ("gps", 32)), (33, ("beidou", 6)), (65, ("glonass", 1)), (131, ("sbas", 131)), (159, ("beidou", 1)),
     (193, ("qzss", 1)), (211, ("galileo", 1)), (255, ("unknown", 255))],
)  # fmt: skip
def test_numbers_of_svinfo(number: int, expected: tuple[str, int]) -> None:
    row = struct.pack("<BBBBBbhi", 1, number, 1, 4, 40, 45, 90, 0)
    (measurements,) = one(frame(0x01, 0x30, struct.pack("<IBBxx", 0, 1, 0) + row), Satellites).satellites
    assert ((measurements.system, measurements.number), measurements.used, measurements.cn0_dbhz) == (
        expected,
        True,
        40.0,
    )
    assert (measurements.elevation, measurements.azimuth) == pytest.approx((math.pi / 4, math.pi / 2))


# -------------------------------------------------------------------------------------------------------- framing


def test_checksums_of_the_documents() -> None:
    assert frame(0x0A, 0x04, b"") == bytes.fromhex("b562 0a04 0000 0e34")  # the poll that u-center sends
    assert crc24q(b"123456789") == 0xCDE703  # the catalogue's check value of CRC-24/LTE-A


def feed(data: bytes) -> tuple[list[Measurement], Any]:
    decoder = ubx.make_decoder(ubx.Options())
    return decoder.feed(data, 1), decoder.counters


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (pvt()[:-1] + b"\x00", "bad_checksum"),
        (b"\xb5\x62\x01\x99\xf9\x0f", "bad_length"),
        (b"\xb5\x62\x01\x07\x00\x01", "bad_length"),
        (b"\xb5\x62\x01\x35\x15\x00" + bytes(40), "bad_length"),
        (b"\xb5\x61", "no_sync"),
        (b"\xd3\xff\x00", "no_sync"),
        (b"\xd3\x00\x02\x3e\xd0\x00\x00\x00", "bad_checksum"),
    ],
)
def test_what_is_no_message_is_counted_and_the_next_one_is_found_at_once(data: bytes, reason: str) -> None:
    found, counters = feed(data + pvt())
    assert of(found, Position)
    assert counters.skipped[reason] > 0
    assert counters.framed == len(pvt())


def test_a_long_message_is_awaited_when_its_count_agrees() -> None:
    row = struct.pack("<ddfBBBBHBBBBBx", 2e7, 1e8, 0.0, 0, 1, 0, 0, 0, 40, 0, 0, 0, 3)
    whole = frame(0x02, 0x15, struct.pack("<dHbBBBxx", 0.0, 2300, 18, 184, 1, 1) + row * 184)
    found, counters = feed(whole + pvt())
    assert len(of(found, Pseudoranges)[0].observations) == 184
    assert counters.framed == len(whole) + len(pvt()) <= MAX_HELD_BYTES
    _, counters = feed(whole[:11] + b"\x00" + whole[12:100])
    assert counters.held == 100
    _, counters = feed(whole[:17] + b"\x01" + whole[18:100])  # the count of signals is damaged
    assert counters.skipped["bad_length"] == 2


def test_three_protocols_on_one_line() -> None:
    nmea = b"$GNGGA,000941.00,4404.13387,N,12118.85628,W,1,12,1.01,1144.8,M,-21.4,M,,*4D\r\n"
    rtcm = bytes.fromhex("d300133ed7d30202980edeef34b4bd62ac0941986f33360b98")
    found, counters = feed(pvt() + nmea + rtcm + pvt() + rtcm + nmea)
    assert counters.messages == {"NAV-PVT": 2, "GGA": 2, "RTCM 1005": 2}
    assert not counters.skipped
    assert len(of(found, Position)) == 4


def test_sentences_between_messages_say_what_they_say_alone(scale: int) -> None:
    """A capture of UBX and one of NMEA dealt into each other at any place between two messages."""
    messages = [raw for raw, _ in UBXReader(io.BytesIO(read("ublox-neo-m8n")), protfilter=2, quitonerror=0)]
    capture = (ROOT / "tests/captures/ublox-neo-m9n-nmea.log").read_bytes()
    sentences = [line + b"\n" for line in capture.split(b"\n") if line.startswith(b"$")][:60]
    alone = of_each(
        [nmea0183.make_decoder(nmea0183.Options()).feed(b"".join(sentences), 1), decode(b"".join(messages))]
    )
    for seed in range(5 * scale):
        rng, left, dealt = random.Random(seed), [messages, sentences], []
        while any(left):
            dealt.append(rng.choice([kind for kind in left if kind])[0])
            left = [kind[1:] if kind and kind[0] is dealt[-1] else kind for kind in left]
        found, counters = feed(b"".join(dealt))
        assert Counter(map(repr, found)) == alone
        assert (counters.held, counters.skipped) == (0, {})


def of_each(lists: list[list[Measurement]]) -> Counter[str]:
    return Counter(repr(m) for found in lists for m in found)


def test_unknown_and_short_messages_are_counted() -> None:
    short = frame(0x01, 0x07, b"\x00" * 20)
    odd = frame(0x01, 0x35, struct.pack("<IBBxx", 0, 1, 0)[:6])
    found, counters = feed(frame(0x01, 0x61, b"1234") + frame(0x77, 0x01, b"") + frame(0x01, 0xF0, b"") + short + odd)
    assert found == []
    assert counters.messages == {
        "NAV-EOE": 1, "0x77-0x01": 1, "NAV-0xF0": 1, "NAV-PVT malformed": 1, "NAV-SAT malformed": 1,
    }  # fmt: skip


# ------------------------------------------------------------------------------------------------------- commands


def parsed(data: bytes, mode: int = SET) -> Any:
    return UBXReader.parse(data, msgmode=mode)


def test_commands_are_what_a_second_parser_understands() -> None:
    requests = parsed(ubx.command("message", {"name": "NAV-SAT", "rate": "5"}))
    assert (requests.identity, requests.payload) == ("CFG-MSG", bytes((0x01, 0x35, 5)))
    rate = parsed(ubx.command("rate", {"period_ms": "100", "cycles": "2"}))
    assert (rate.identity, rate.measRate, rate.navRate) == ("CFG-RATE", 100, 2)
    reset = parsed(ubx.command("reset", {"kind": "cold"}))
    assert (reset.identity, reset.payload) == ("CFG-RST", bytes.fromhex("ffff0200"))
    assert ubx.command("reset", {"kind": "warm"})[6:10] == bytes.fromhex("01000200")
    assert ubx.command("version", {}) == UBXMessage("MON", "MON-VER", POLL).serialize()


def test_commands_for_later_receivers_are_what_a_second_parser_understands() -> None:
    options = ubx.Options(configure_with="cfg_valset", port="usb")
    requests = parsed(ubx.command("message", {"name": "NAV-PVT"}, options))
    assert (requests.identity, requests.ram, requests.bbr, requests.flash) == ("CFG-VALSET", 1, 0, 0)
    assert requests.CFG_MSGOUT_UBX_NAV_PVT_USB == 1
    rate = parsed(ubx.command("rate", {"period_ms": "200"}, options))
    assert (rate.CFG_RATE_MEAS, rate.CFG_RATE_NAV) == (200, 1)


@pytest.mark.parametrize(
    ("name", "args", "stated"),
    [
        ("message", {}, "message: name is missing; allowed: NAV-POSLLH"),
        ("message", {"name": "NAV-XYZ"}, "'NAV-XYZ'"),
        ("message", {"name": "NAV-PVT", "rate": "256"}, r"rate = '256'; allowed: a whole number, 0\.\.255"),
        ("message", {"name": "NAV-PVT", "speed": "1"}, "no argument 'speed'; there are name, rate"),
        ("rate", {"period_ms": "24"}, r"25\.\.65535"),
        ("rate", {}, "period_ms is missing"),
        ("rate", {"period_ms": "1e2"}, "'1e2'"),
        ("reset", {"kind": "lukewarm"}, "allowed: hot, warm, cold"),
        ("version", {"a": "b"}, "there are none"),
    ],
)
def test_a_bad_command_teaches(name: str, args: dict[str, str], stated: str) -> None:
    with pytest.raises(ValueError, match=stated):
        ubx.command(name, args)


def test_what_is_asked_at_a_connect_is_asked_again_when_the_options_say_so() -> None:
    assert ubx.poll(ubx.Options(messages={"NAV-PVT": 1})) is None
    assert ubx.poll(ubx.Options(ask_again_s=5.0)) is None
    again = ubx.Options(messages={"NAV-PVT": 1}, ask_again_s=5.0)
    assert ubx.poll(again) == (5.0, b"".join(ubx.on_connect(again)))


def test_only_the_reset_is_not_answered() -> None:
    assert [name for name, command in ubx.COMMANDS.items() if not command.answered] == ["reset"]


@pytest.mark.parametrize(
    ("table", "stated"),
    [({"messages": {"NAV-XYZ": 1}}, "NAV-XYZ"), ({"messages": {"NAV-PVT": 300}}, "0..255"), ({"period_ms": 10}, "25")],
)
def test_bad_options_are_reported(table: dict[str, Any], stated: str) -> None:
    with pytest.raises(ConfigError, match=stated):
        bind(ubx.Options, table, "file.toml", "device[0].options")


# ------------------------------------------------------------------------------------------------------- emulator


@pytest.mark.parametrize("way", ["cfg_msg", "cfg_valset"])
def test_the_emulated_receiver_is_silent_until_it_is_asked(way: str) -> None:
    options = bind(ubx.Options, {"messages": {"NAV-PVT": 2}, "period_ms": 100, "configure_with": way}, "file.toml")
    device, decoder = ubx.make_encoder(options), ubx.make_decoder(options)
    here = Position(stamp=Stamp(1), lat=0.8, lon=0.2, alt=500.0)
    assert device.encode(here) == []
    stated = b"".join(ubx.on_connect(options))
    answers = [data for at in range(len(stated)) for data in device.respond(stated[at : at + 1])]
    version, *taken = of([m for data in answers for m in decoder.feed(data, 1)], Ack)
    assert (version.command, version.accepted) == ("version", True)
    assert [(a.accepted, a.detail) for a in taken] == (
        [(True, "CFG-RATE"), (True, "CFG-MSG")] if way == "cfg_msg" else [(True, "CFG-VALSET")] * 2
    )
    assert [len(device.encode(here)) for _ in range(4)] == [1, 0, 1, 0]
    clock = ReceiverClock(stamp=Stamp(1), offset=0.0)
    assert device.encode(clock) == []


def test_the_emulated_receiver_refuses_what_it_does_not_know_and_never_answers_a_reset() -> None:
    device = ubx.make_encoder(ubx.Options())
    refused = [device.respond(frame(0x06, 0x24, bytes(36))), device.respond(frame(0x06, 0x8A, bytes(9)))]
    refused += [
        device.respond(ubx.command("message", {"name": "NAV-VELNED"})),
        device.respond(frame(0x06, 0x01, b"\x77\x01\x00")),
    ]
    assert [one(b"".join(data), Ack).accepted for data in refused] == [False] * 4
    taken = device.respond(ubx.command("message", {"name": "NMEA-GGA", "rate": "0"}))
    assert one(b"".join(taken), Ack).accepted
    assert device.respond(ubx.command("reset", {"kind": "hot"})) == []
    assert device.respond(b"$PUBX,40*00\r\n" + frame(0x01, 0x07, b"")) == []


def test_the_emulated_receiver_says_when_it_has_no_fix() -> None:
    device = ubx.make_encoder(ubx.Options())
    stamp = Stamp(5, NOON_NS, TimeScale.UTC)
    lost = b"".join(device.encode(Position(stamp=stamp, lat=0.8, lon=0.2, alt=1.0, valid=False)))
    assert not one(lost, Position).valid
    device.encode(DeviceStatus(stamp=stamp, ok=False, flags=("fix_3d", "jammed")))
    lost = b"".join(device.encode(Position(stamp=stamp, lat=0.8, lon=0.2, alt=1.0, valid=False)))
    assert not one(lost, Position).valid
