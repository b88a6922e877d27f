"""NMEA 0183: real captures against two parsers that are not ours, midnight, satellites, damaged sentences."""

from __future__ import annotations

import functools
import json
import math
import operator
import shutil
import subprocess
from collections.abc import Iterator
from datetime import UTC, datetime

import pynmeagps
import pytest

from fti.drivers import nmea0183 as nmea
from fti.types import (
    Attitude,
    DeviceStatus,
    DeviceTime,
    Measurement,
    Position,
    Satellites,
    Stamp,
    TimeScale,
    Velocity,
)
from tests.helpers import ROOT

#: ublox-8.log begins with a line at the wrong baud rate and ends inside its 1009th sentence.
CAPTURES = ("nmea-rtk.log", "nmea-fuzzy-cases.log", "ublox-8.log", "ublox-neo-m9n-nmea.log")
SENTENCES = {"nmea-rtk.log": 244, "nmea-fuzzy-cases.log": 28, "ublox-8.log": 1008, "ublox-neo-m9n-nmea.log": 1403}
each_capture = pytest.mark.parametrize("name", CAPTURES)
KNOT = 1852 / 3600
#: Sentences with a position, and the field of its latitude.
PLACES = {"GGA": 2, "RMC": 3, "GLL": 1}


def read(name: str) -> bytes:
    return (ROOT / "tests/captures" / name).read_bytes()


def decode(data: bytes) -> list[Measurement]:
    return nmea.make_decoder(nmea.Options()).feed(data, 1)


def sentence(body: str) -> bytes:
    return f"${body}*{functools.reduce(operator.xor, body.encode(), 0):02X}\r\n".encode()


def sentences(data: bytes) -> Iterator[list[str]]:
    """The reference: what stands between a dollar and the end of its line, split by comma, checksum verified."""
    for part in data.split(b"$")[1:]:
        body, star, given = part.splitlines()[0].partition(b"*")
        if star and int(given, 16) == functools.reduce(operator.xor, body, 0):
            yield body.decode("ascii").split(",")


def degrees(text: str, side: str) -> float:
    value = int(float(text) / 100) + (float(text) % 100) / 60
    return -value if side in "SW" else value


# ------------------------------------------------------------------------------------------------------ captures


@each_capture
def test_every_sentence_of_a_capture_is_framed_and_no_other_byte(name: str) -> None:
    data = read(name)
    decoder = nmea.make_decoder(nmea.Options())
    decoder.feed(data, 1)
    good = list(sentences(data))
    assert sum(decoder.counters.messages.values()) == len(good) == SENTENCES[name]
    assert not [text for text in decoder.counters.messages if "malformed" in text]
    comments = sum(len(line) + 1 for line in data.split(b"\n") if line.startswith(b"#"))
    assert decoder.counters.skipped["comment"] == comments
    assert decoder.counters.held == 0


@each_capture
def test_fields_are_those_of_a_split_by_comma(name: str) -> None:
    data = read(name)
    found = iter([m for m in decode(data) if isinstance(m, Position)])
    for f in sentences(data):
        if f[0][2:] not in PLACES:
            continue
        position, at = next(found), PLACES[f[0][2:]]
        assert math.degrees(position.lat or 0.0) == pytest.approx(degrees(f[at], f[at + 1]), abs=1e-10)
        assert math.degrees(position.lon or 0.0) == pytest.approx(degrees(f[at + 2], f[at + 3]), abs=1e-10)
        if f[0][2:] == "GGA":
            assert position.alt_msl == float(f[9])
            assert position.alt == pytest.approx(float(f[9]) + float(f[11]), abs=1e-9)
            assert position.valid is (f[6] != "0")
    assert next(found, None) is None


@each_capture
def test_speed_and_track_are_those_of_a_split_by_comma(name: str) -> None:
    data = read(name)
    found = iter([m for m in decode(data) if isinstance(m, Velocity)])
    for f in sentences(data):
        if f[0][2:] not in ("RMC", "VTG"):
            continue
        velocity = next(found)
        speed, course = (f[7], f[8]) if f[0][2:] == "RMC" else (f[5], f[1])
        assert velocity.ground_speed == pytest.approx(float(speed) * KNOT, abs=1e-9)
        assert velocity.track == (pytest.approx(math.radians(float(course)), abs=1e-12) if course else None)
    assert next(found, None) is None


def unix_ns(text: str) -> int:
    return round(datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp() * 1000) * 1_000_000


def gpsdecode(data: bytes) -> list[dict[str, object]]:
    if not shutil.which("gpsdecode"):
        pytest.skip("gpsdecode (Debian: gpsd-clients) is not installed; it is the independent decoder")
    done = subprocess.run(["gpsdecode"], input=data, capture_output=True, check=True, timeout=60)
    return [json.loads(line) for line in done.stdout.splitlines()]


@each_capture
def test_positions_are_those_of_gpsd(name: str) -> None:
    data = read(name)
    ours = {m.stamp.t_dev_ns: m for m in decode(data) if isinstance(m, Position) and m.alt is not None}
    reports = [r for r in gpsdecode(data) if r["class"] == "TPV" and "lat" in r and "altMSL" in r]
    assert len(reports) > 0.4 * len(ours)
    for report in reports:
        mine = ours[unix_ns(str(report["time"]))]
        assert math.degrees(mine.lat or 0.0) == pytest.approx(report["lat"], abs=6e-10)
        assert math.degrees(mine.lon or 0.0) == pytest.approx(report["lon"], abs=6e-10)
        assert mine.alt_msl == pytest.approx(report["altMSL"], abs=6e-5)
        assert mine.alt == pytest.approx(report["altHAE"], abs=6e-5)
        assert mine.undulation == pytest.approx(report["geoidSep"], abs=6e-4)


@each_capture
def test_speeds_are_those_of_gpsd(name: str) -> None:
    data = read(name)
    ours = {m.stamp.t_dev_ns: m for m in decode(data) if isinstance(m, Velocity) and m.stamp.t_dev_ns}
    reports = [r for r in gpsdecode(data) if r["class"] == "TPV" and "speed" in r]
    assert reports
    for report in reports:
        mine = ours[unix_ns(str(report["time"]))]
        assert mine.ground_speed == pytest.approx(report["speed"], abs=6e-4)
        if "track" in report:
            assert math.degrees(mine.track or 0.0) == pytest.approx(report["track"], abs=6e-5)


@pytest.mark.parametrize("name", CAPTURES[2:])
def test_satellites_are_those_of_gpsd(name: str) -> None:
    """gpsd repeats its list after each talker; the longest of its lists of the first epoch is the whole sky."""
    data = read(name)
    first_epoch = data[: data.index(b"ZDA")]
    seen = {
        (s.elevation and round(math.degrees(s.elevation)), s.azimuth and round(math.degrees(s.azimuth)), s.cn0_dbhz)
        for m in decode(first_epoch)
        if isinstance(m, Satellites) and m.used is None and m.hdop is None
        for s in m.satellites
    }
    skies = [r["satellites"] for r in gpsdecode(first_epoch) if r["class"] == "SKY" and "satellites" in r]
    sky = max(skies, key=len)  # type: ignore[arg-type]
    theirs = {(s["el"], s["az"], s["ss"] or None) for s in sky}  # type: ignore[attr-defined]
    assert {(el or 0, az or 0, ss) for el, az, ss in seen} == theirs


@each_capture
def test_a_second_parser_sees_the_same_positions(name: str) -> None:
    data = read(name)
    found = iter([m for m in decode(data) if isinstance(m, Position)])
    for f in sentences(data):
        if f[0][2:] in PLACES:
            parsed = pynmeagps.NMEAReader.parse(sentence(",".join(f)))
            position = next(found)
            assert math.degrees(position.lat or 0.0) == pytest.approx(parsed.lat, abs=1e-8)
            assert math.degrees(position.lon or 0.0) == pytest.approx(parsed.lon, abs=1e-8)


# -------------------------------------------------------------------------------------------------- time and date

DAY_1 = sentence("GPRMC,235959.00,A,4800.0,N,01130.0,E,1.0,2.0,311224,,,A")
GGA_0 = sentence("GPGGA,000000.00,4800.0,N,01130.0,E,1,08,1.0,500.0,M,47.0,M,,")
NEW_YEAR_NS = unix_ns("2025-01-01T00:00:00")


def times(data: bytes) -> list[int | None]:
    return [m.stamp.t_dev_ns for m in decode(data) if isinstance(m, Position)]


def test_without_a_date_there_is_no_device_time() -> None:
    assert times(GGA_0) == [None]


def test_a_sentence_after_midnight_is_of_the_new_day_before_the_date_says_so() -> None:
    assert times(DAY_1 + GGA_0) == [NEW_YEAR_NS - 1_000_000_000, NEW_YEAR_NS]


def test_a_late_sentence_is_of_the_old_day() -> None:
    late = sentence("GPGGA,235959.50,4800.0,N,01130.0,E,1,08,1.0,500.0,M,47.0,M,,")
    day_2 = sentence("GPRMC,000000.00,A,4800.0,N,01130.0,E,1.0,2.0,010125,,,A")
    assert times(DAY_1 + day_2 + late + GGA_0)[1:] == [NEW_YEAR_NS, NEW_YEAR_NS - 500_000_000, NEW_YEAR_NS]


def test_date_and_time_alone() -> None:
    (found,) = decode(sentence("GPZDA,120000.25,29,02,2024,00,00"))
    assert found == DeviceTime(stamp=Stamp(1, unix_ns("2024-02-29T12:00:00.250"), TimeScale.UTC))


# ------------------------------------------------------------------------------------------------------ sentences


@pytest.mark.parametrize(
    ("quality", "valid", "flag"),
    [("0", False, "no_fix"), ("1", True, "gps"), ("4", True, "rtk_fixed"), ("6", False, "estimated"),
     ("8", False, "simulator"), ("9", False, "fix_9")],
)  # fmt: skip
def test_kind_of_fix_decides_what_is_valid(quality: str, valid: bool, flag: str) -> None:
    position, _, status = decode(sentence(f"GPGGA,1200,,,,,{quality},,,,,,,,".replace("1200", "120000")))
    assert isinstance(position, Position)
    assert status == DeviceStatus(stamp=Stamp(1), ok=valid, flags=(flag,))
    assert position.valid is False  # there are no coordinates
    assert position.lat is None


def test_gns_and_heading() -> None:
    position, used = decode(sentence("GNGNS,120000.00,4800.0,N,01130.0,W,AAN,14,0.7,500.0,47.0,,,V"))
    assert isinstance(position, Position)
    assert isinstance(used, Satellites)
    assert (position.alt, position.valid, used.used, used.hdop) == (547.0, True, 14, 0.7)
    assert math.degrees(position.lon or 0.0) == pytest.approx(-11.5)
    assert decode(sentence("HEHDT,274.5,T")) == [Attitude(stamp=Stamp(1), heading=math.radians(274.5))]


def test_a_group_of_satellites_with_a_lost_sentence_is_not_told() -> None:
    group = [sentence(f"GPGSV,3,{i},09,{i:02d},10,020,30") for i in (1, 2, 3)]
    whole = [m for m in decode(b"".join(group)) if isinstance(m, Satellites)]
    assert [s.number for s in whole[0].satellites] == [1, 2, 3]
    assert decode(group[0] + group[2]) == []
    assert decode(group[1] + group[2]) == []


def test_a_group_has_the_stamp_of_its_first_sentence() -> None:
    decoder = nmea.make_decoder(nmea.Options())
    found = [decoder.feed(sentence(f"GPGSV,2,{i},06,{i:02d},10,020,30"), i) for i in (1, 2)]
    assert [m.stamp.t_rx_ns for m in found[1]] == [1]


def test_satellites_used_come_from_the_sentence_before() -> None:
    found = decode(sentence("GPGSA,A,3,05,,,,,,,,,,,,1.5,1.0,1.1") + sentence("GPGSV,1,1,02,05,10,020,30,06,11,021,"))
    used, view = (m for m in found if isinstance(m, Satellites))
    assert (used.pdop, used.hdop, used.vdop) == (1.5, 1.0, 1.1)
    assert [(s.number, s.used, s.cn0_dbhz) for s in view.satellites] == [(5, True, 30.0), (6, False, None)]


@pytest.mark.parametrize(
    "body",
    [
        "GPGGA,250000.00,4800.0,N,01130.0,E,1,08,1.0,500.0,M,47.0,M,,",
        "GPGGA,120000.00,9800.0,N,01130.0,E,1,08,1.0,500.0,M,47.0,M,,",
        "GPGGA,120000.00,4860.0,N,01130.0,E,1,08,1.0,500.0,M,47.0,M,,",
        "GPGGA,120000.00,4800.0,X,01130.0,E,1,08,1.0,500.0,M,47.0,M,,",
        "GPGGA,120000.00,4800.0,N,01130.0,E,1,08,1.0,nan,M,47.0,M,,",
        "GPGGA,120000.00,4800.0,N",
        "GPRMC,120000.00,A,4800.0,N,01130.0,E,1.0,2.0,320124,,,A",
        "GPZDA,120000.00,31,02,2024,00,00",
        "GPGSV,x,1,1",
        "GPHDT,1e3,T",
    ],
)
def test_fields_without_sense_are_counted_as_malformed(body: str) -> None:
    decoder = nmea.make_decoder(nmea.Options())
    assert decoder.feed(sentence(body), 1) == []
    assert decoder.counters.messages == {f"{body[2:5]} malformed": 1}
    assert decoder.counters.framed == len(sentence(body))


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (sentence("GPHDT,1.0,T").replace(b"1.0", b"1.1"), "bad_checksum"),
        (b"$GPHDT,1.0,T\r\n", "no_checksum"),
        (b"$GPHDT,1\x00.0,T*00\r\n", "bad_character"),
        (b"$GPHDT,1.0,T*00\rX\n", "bad_character"),
        (b"$" + b"A" * 300 + b"\r\n", "too_long"),
    ],
)
def test_sentences_that_are_none_are_counted_by_reason(data: bytes, reason: str) -> None:
    good = sentence("GPHDT,2.0,T")
    decoder = nmea.make_decoder(nmea.Options())
    assert len(decoder.feed(data + good, 1)) == 1
    assert decoder.counters.skipped[reason] > 0
    assert decoder.counters.framed == len(good)


def test_a_sentence_inside_garbage_and_comments_is_found() -> None:
    good = sentence("GPHDT,2.0,T")
    decoder = nmea.make_decoder(nmea.Options())
    found = decoder.feed(b"# a comment $GPHDT,1" + good + b"\xff#\xfe" + good + b"# at 5 $ a piece\n" + good, 1)
    assert len(found) == 3


def test_encapsulated_data_and_proprietary_sentences_are_framed_by_name() -> None:
    decoder = nmea.make_decoder(nmea.Options())
    decoder.feed(sentence("AIVDM,1,1,,A,13aG?P0P00PD,0").replace(b"$", b"!", 1) + sentence("PUBX,41,1"), 1)
    assert decoder.counters.messages == {"VDM": 1, "PUBX,41": 1}


def test_the_emulated_receiver_speaks_as_other_parsers_expect() -> None:
    encoder = nmea.make_encoder(nmea.Options())
    stamp = Stamp(5, unix_ns("2024-02-29T12:00:00.250"), TimeScale.UTC)
    encoder.encode(Velocity(stamp=stamp, north=30.0, east=-40.0, down=0.0))
    rmc, gga = encoder.encode(Position(stamp=stamp, lat=-0.5, lon=2.0, alt=147.0, undulation=47.0))
    parsed_rmc, parsed_gga = pynmeagps.NMEAReader.parse(rmc), pynmeagps.NMEAReader.parse(gga)
    assert math.radians(parsed_rmc.lat) == pytest.approx(-0.5, abs=1e-9)
    assert math.radians(parsed_gga.lon) == pytest.approx(2.0, abs=1e-9)
    assert parsed_rmc.spd == pytest.approx(50.0 / KNOT, abs=0.0006)
    assert parsed_rmc.cog == pytest.approx(math.degrees(math.atan2(-40, 30)) + 360, abs=0.0006)
    assert (str(parsed_rmc.date), str(parsed_rmc.time)) == ("2024-02-29", "12:00:00.250000")
    assert (parsed_gga.alt, parsed_gga.sep, parsed_gga.quality) == (100.0, 47.0, 1)
    assert nmea.make_encoder(nmea.Options()).encode(Position(stamp=stamp, valid=False))[1].split(b",")[6] == b"0"
