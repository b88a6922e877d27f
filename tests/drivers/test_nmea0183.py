"""NMEA 0183: real captures compared with two independent parsers, midnight, satellites, damaged sentences."""

from __future__ import annotations

import functools
import io
import json
import math
import operator
import shutil
import subprocess
from collections import Counter
from collections.abc import Iterator
from datetime import UTC, datetime

import pynmeagps
import pytest

from fti.drivers import nmea0183 as nmea
from fti.messages.measurements import (
    Attitude,
    DeviceStatus,
    DeviceTime,
    Measurement,
    Position,
    ReceiverClock,
    Satellite,
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
def test_counts_are_those_of_a_second_parser(name: str) -> None:
    data = read(name)
    decoder = nmea.make_decoder(nmea.Options())
    decoder.feed(data, 1)
    theirs = [parsed for _, parsed in pynmeagps.NMEAReader(io.BytesIO(data), quitonerror=0) if parsed is not None]
    assert decoder.counters.messages == Counter(parsed.msgID for parsed in theirs)


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
    done = subprocess.run(["gpsdecode"], input=data, capture_output=True, check=True, timeout=120)
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
    """Every report of gpsd is part of one of our lists: it forgets the other systems with every new cycle.

    Without numbers, because gpsd 3.22 takes the Galileo satellites 33 to 36 for SBAS; what is used is compared for GPS
    and GLONASS, because it does not find the others of GNGSA.
    """
    data = read(name)
    ours = [sky_of(m.satellites) for m in decode(data) if isinstance(m, Satellites) and m.used is None and not m.hdop]
    skies = [r["satellites"] for r in gpsdecode(data) if r["class"] == "SKY" and "satellites" in r]
    assert len(skies) > 70
    for sky in skies:
        theirs = Counter(
            (s["el"], s["az"], s["ss"] or None, s["used"] if s["gnssid"] in (0, 6) else None)
            for s in sky  # type: ignore[attr-defined]
        )
        assert any(theirs <= measurements for measurements in ours), theirs


def sky_of(satellites: tuple[Satellite, ...]) -> Counter[object]:
    def rounded(angle: float | None) -> int:
        return round(math.degrees(angle or 0.0))

    return Counter(
        (rounded(s.elevation), rounded(s.azimuth), s.cn0_dbhz, s.used if s.system in ("gps", "glonass") else None)
        for s in satellites
    )


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


def test_a_date_does_not_outlast_the_receiver_that_sent_it() -> None:
    """One that was switched off and on has some time of the day, but no date, until it has a fix."""
    started = sentence("GPRMC,000001.00,V,,,,,,,,,,N")
    no_date = sentence("GPRMC,000000.00,A,4800.0,N,01130.0,E,1.0,2.0,,,,A")  # ZDA says it
    assert times(DAY_1 + no_date + GGA_0)[1:] == [NEW_YEAR_NS, NEW_YEAR_NS]
    assert times(DAY_1 + started + GGA_0)[1:] == [None, None]


def test_date_and_time_alone() -> None:
    (found,) = decode(sentence("GPZDA,120000.25,29,02,2024,00,00"))
    assert found == DeviceTime(stamp=Stamp(1, unix_ns("2024-02-29T12:00:00.250"), TimeScale.UTC))


# ------------------------------------------------------------------------------------------------------ sentences


@pytest.mark.parametrize(
    ("quality", "valid", "flag"),
    [("0", False, "no_fix"), ("1", True, "gps"), ("4", True, "rtk_fixed"), ("6", False, "estimated"),
     ("8", False, "simulator"), ("9", True, "sbas"), ("10", False, "fix_10")],
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


def test_a_group_of_satellites_with_a_lost_sentence_is_not_reported() -> None:
    group = [sentence(f"GPGSV,3,{i},09,{i:02d},10,020,30") for i in (1, 2, 3)]
    whole = [m for m in decode(b"".join(group)) if isinstance(m, Satellites)]
    assert [s.number for s in whole[0].satellites] == [1, 2, 3]
    assert decode(group[0] + group[2]) == []
    assert decode(group[1] + group[2]) == []


def test_a_group_has_the_stamp_of_its_first_sentence() -> None:
    decoder = nmea.make_decoder(nmea.Options())
    measurements = [decoder.feed(sentence(f"GPGSV,2,{i},06,{i:02d},10,020,30"), i) for i in (1, 2)]
    assert [m.stamp.t_rx_ns for m in measurements[1]] == [1]


def test_satellites_used_come_from_the_sentence_before() -> None:
    measurements = decode(
        sentence("GPGSA,A,3,05,,,,,,,,,,,,1.5,1.0,1.1") + sentence("GPGSV,1,1,02,05,10,020,30,06,11,021,")
    )
    used, view = (m for m in measurements if isinstance(m, Satellites))
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
        "GPGGA,120000.00,4800.0,N,01130.0,E,1,08,1.0,1640.4,F,47.0,M,,",
        "GPGGA,120000.00,4800.0,N,01130.0,E,1,08,1.0,500.0,M,154.2,f,,",
        "GPVTG,88.0,M,90.0,T,10.0,N,18.5,K,A",
        "GPVTG,90.0,T,88.0,M,18.5,K,10.0,N,A",
        "GPVTG,90.0,T,88.0,M,,N,5.14,M,A",
        "GPHDT,88.0,M",
        "GPRMC,120000.00,A,4800.0,N,01130.0,E,-1.0,2.0,010125,,,A",
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
    measurements = decoder.feed(b"# a comment $GPHDT,1" + good + b"\xff#\xfe" + good + b"# at 5 $ a piece\n" + good, 1)
    assert len(measurements) == 3


def test_encapsulated_data_and_proprietary_sentences_are_framed_by_name() -> None:
    decoder = nmea.make_decoder(nmea.Options())
    decoder.feed(sentence("AIVDM,1,1,,A,13aG?P0P00PD,0").replace(b"$", b"!", 1) + sentence("PUBX,41,1"), 1)
    assert decoder.counters.messages == {"VDM": 1, "PUBX,41": 1}
    decoder.feed(sentence("GPG~A,1") + sentence("PUBX,~") + sentence("PGRME,1"), 1)
    assert decoder.counters.messages == {"VDM": 1, "PUBX,41": 1, "(strange)": 2, "PGRME": 1}
    decoder.feed(sentence("PMTK001,314,3") + sentence("PSTMCPU,42.5") + sentence("PSRFTXTWK:   1488"), 1)
    assert decoder.counters.messages["PMTK001"] == decoder.counters.messages["PSTMCPU"] == 1
    assert decoder.counters.messages["(strange)"] == 3


def test_names_that_never_end_are_counted_as_one_from_some_hundred_on() -> None:
    decoder = nmea.make_decoder(nmea.Options())
    decoder.feed(b"".join(sentence(f"GP{i:05d},1") for i in range(1000)) + sentence("GPHDT,1.0,T"), 1)
    assert len(decoder.counters.messages) == 102
    assert decoder.counters.messages["(strange)"] == 900
    assert decoder.counters.messages["HDT"] == 1


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


# ------------------------------------------------------------------------------- talkers, variants, missing fields


def satellites_of(data: bytes) -> list[Satellites]:
    return [m for m in decode(data) if isinstance(m, Satellites)]


@pytest.mark.parametrize(
    ("talker", "number", "expected"),
    [
        ("GP", 7, ("gps", 7)), ("GP", 33, ("sbas", 120)), ("GP", 193, ("qzss", 1)), ("GP", 131, ("sbas", 131)),
        ("GL", 65, ("glonass", 1)), ("GL", 3, ("glonass", 3)), ("GA", 36, ("galileo", 36)), ("GA", 301, ("galileo", 1)),
        ("GA", 103, ("galileo", 3)), ("GB", 63, ("beidou", 63)), ("BD", 201, ("beidou", 1)), ("GB", 401, ("beidou", 1)),
        ("GQ", 1, ("qzss", 1)), ("QZ", 195, ("qzss", 3)), ("GI", 5, ("navic", 5)), ("GN", 70, ("glonass", 6)),
        ("GN", 12, ("gps", 12)), ("II", 999, ("unknown", 999)),
    ],
)  # fmt: skip
def test_satellites_are_numbered_within_their_system(talker: str, number: int, expected: tuple[str, int]) -> None:
    (measurements,) = satellites_of(sentence(f"{talker}GSV,1,1,01,{number},10,020,30"))[0].satellites
    assert (measurements.system, measurements.number) == expected


def gsv(talker: str, *numbers: int, cn0: int = 30, signal: str = "") -> bytes:
    groups = "".join(f",{n:02d},10,020,{cn0}" for n in numbers)
    return sentence(f"{talker}GSV,1,1,{len(numbers):02d}{groups}{signal}")


def keys(found: Satellites) -> list[tuple[str, int]]:
    return [(s.system, s.number) for s in found.satellites]


def test_each_list_has_the_whole_sky_and_a_silent_system_leaves_it() -> None:
    gp, gl = gsv("GP", 1, 2), gsv("GL", 65)
    rows = [set(keys(m)) for m in satellites_of(gp + gl + gp + gl + gp + gp)]
    gps = {("gps", 1), ("gps", 2)}
    both = gps | {("glonass", 1)}
    assert rows == [gps, both, both, both, both, gps]


def test_a_satellite_on_two_signals_is_reported_once_with_the_stronger() -> None:
    weak, strong = gsv("GP", 5, cn0=31, signal=",8"), gsv("GP", 5, 6, cn0=44, signal=",1")
    for order in (weak + strong, strong + weak):
        last = satellites_of(order)[-1]
        assert {(s.number, s.cn0_dbhz) for s in last.satellites} == {(5, 44.0), (6, 44.0)}
    moved = [sentence(f"GPGSV,1,1,01,05,{el},020,30,{signal}") for el, signal in ((10, 1), (11, 8), (12, 1))]
    (last_measurement,) = satellites_of(b"".join(moved))[-1].satellites
    assert last_measurement.elevation == math.radians(12)
    without_direction = sentence("GPGSV,1,1,01,05,,,50,8")
    measurements = {s.number: s for s in satellites_of(strong + without_direction)[-1].satellites}
    assert (measurements[5].cn0_dbhz, measurements[5].elevation) == (50.0, math.radians(10))


def test_satellites_in_use_of_more_than_one_sentence_and_system() -> None:
    first = sentence("GNGSA,A,3,01,02,03,04,05,06,07,08,09,10,11,12,1.5,1.0,1.1,1")
    second = sentence("GNGSA,A,3,13,14,,,,,,,,,,,1.5,1.0,1.1,1")
    other = sentence("GNGSA,A,3,05,,,,,,,,,,,,1.5,1.0,1.1,3")
    view = gsv("GP", 1, 13, 15) + gsv("GA", 5, 13)
    last = satellites_of(first + second + other + view)[-1]
    assert {(s.system, s.number): s.used for s in last.satellites} == {
        ("gps", 1): True, ("gps", 13): True, ("gps", 15): False, ("galileo", 5): True, ("galileo", 13): False,
    }  # fmt: skip
    fewer = satellites_of(first + second + view + second + view)[-1]
    assert [s.used for s in fewer.satellites if s.system == "gps"] == [False, True, False]
    none = satellites_of(gsv("GP", 1) + sentence("GNGSA,A,1,,,,,,,,,,,,,,,") + gsv("GP", 1))
    assert [m.satellites[0].used for m in (none[0], none[2])] == [None, False]


def test_directions_out_of_range_and_no_signal_are_unknown() -> None:
    (high, none) = satellites_of(sentence("GPGSV,1,1,02,05,99,020,30,06,10,360,00"))[0].satellites
    assert (high.elevation, high.azimuth, high.cn0_dbhz) == (None, None, 30.0)
    assert (none.azimuth, none.cn0_dbhz) == (0.0, None)


def test_signal_and_system_at_the_end_as_quectel_has_them() -> None:
    (found,) = satellites_of(sentence("PQGSV,1,1,02,02,20,116,,03,,,,0,4"))
    assert keys(found) == [("beidou", 2), ("beidou", 3)]


@pytest.mark.parametrize("body", ["GPGSV,1,2,01,05,10,020,30", "GPGSV,1,1,02,05,10,020,30,06,11", "GPGSV,0,0,00"])
def test_groups_that_cannot_be_are_malformed(body: str) -> None:
    decoder = nmea.make_decoder(nmea.Options())
    assert decoder.feed(sentence(body), 1) == []
    assert decoder.counters.messages == {"GSV malformed": 1}


def position_of(body: str) -> Position:
    (found,) = [m for m in decode(sentence(body)) if isinstance(m, Position)]
    return found


def test_gll_and_its_older_form() -> None:
    position = position_of("IIGLL,3000.0,S,09000.0,W,120000,A,A")
    assert (position.lat, position.lon) == pytest.approx((-math.pi / 6, -math.pi / 2))
    assert position.valid
    assert not position_of("IIGLL,3000.0,S,09000.0,W,120000,V").valid
    assert not position_of("LCGLL,3000.0,S,09000.0,W").valid


def test_sigma_of_gst_belongs_to_the_positions_around_it() -> None:
    gst = sentence("GPGST,120000.00,1.2,5.0,3.0,45.0,3.0,4.0,6.5")
    gga = "GPGGA,{},4800.0,N,01130.0,E,1,08,1.0,500.0,M,47.0,M,,"
    data = gst + b"".join(sentence(gga.format(t)) for t in ("120001.00", "120011.00", "115959"))
    sigma = [(p.horizontal_sd, p.vertical_sd) for p in decode(data) if isinstance(p, Position)]
    assert sigma == [(pytest.approx(math.sqrt((3.0**2 + 4.0**2) / 2)), 6.5), (None, None), (None, None)]


def test_the_sigma_that_is_written_is_the_one_that_is_read() -> None:
    stated = Position(
        stamp=Stamp(5, unix_ns("2024-02-29T12:00:00.250"), TimeScale.UTC),
        lat=0.8,
        lon=0.2,
        alt=547.0,
        alt_msl=500.0,
        undulation=47.0,
        horizontal_sd=2.5,
        vertical_sd=4.0,
    )
    sent = b"".join(nmea.make_encoder(nmea.Options()).encode(stated))
    measurement = next(m for m in decode(sent) if isinstance(m, Position) and m.alt_msl is not None)
    assert (measurement.horizontal_sd, measurement.vertical_sd) == pytest.approx((2.5, 4.0))


@pytest.mark.parametrize(
    ("body", "speed", "track"),
    [
        ("GPVTG,90.0,T,88.0,M,10.0,N,18.5,K,A", 10 * KNOT, 90.0),
        ("GPVTG,90.0,T,,M,10.0,N,18.5,K", 10 * KNOT, 90.0),
        ("GPVTG,90.0,T,,M,,N,36.0,K,A", 10.0, 90.0),
        ("GPVTG,,T,,M,0.1,N,0.2,K,D", 0.1 * KNOT, None),
        ("GPVTG,90.0,88.0,10.0,18.5", 10 * KNOT, 90.0),
    ],
)
def test_forms_of_vtg(body: str, speed: float, track: float | None) -> None:
    (found,) = decode(sentence(body))
    assert isinstance(found, Velocity)
    assert found.valid
    assert found.ground_speed == pytest.approx(speed)
    assert found.track == (None if track is None else pytest.approx(math.radians(track)))


def test_a_velocity_that_was_not_measured_is_not_valid() -> None:
    (found,) = decode(sentence("GPVTG,90.0,T,88.0,M,10.0,N,18.5,K,E"))
    assert isinstance(found, Velocity)
    assert not found.valid
    assert decode(sentence("GPVTG,,T,,M,,N,,K")) == []


@pytest.mark.parametrize(
    ("lost", "found"),
    [("GPGGA,120000,,,,,0,00,,,M,,M,,", "GPGGA,120000,4800.0,N,01130.0,E,1,08,1.0,500.0,M,47.0,M,,"),
     ("GPRMC,120000,V,,,,,,,,,", "GPRMC,120000,A,4800.0,N,01130.0,E,,,010125,,"),
     ("GPGLL,,,,,120000,V", "GPGLL,4800.0,N,01130.0,E,120000,A"),
     ("GNGNS,120000,,,,,NN,00,,,,,", "GNGNS,120000,4800.0,N,01130.0,E,AN,05,1.0,500.0,47.0,,"),
     ("PUBX,00,120000,,,,,0,NF,,,0,0,0,,99.99,99.99,99.99,0,0,0",
      "PUBX,00,120000,4800.0,N,01130.0,E,1,G3,1,1,0,0,0,,1,1,1,9,0,0")],
)  # fmt: skip
def test_a_velocity_that_does_not_say_its_mode_is_as_good_as_the_fix(lost: str, found: str) -> None:
    """Receivers before 2.3 without a fix go on with zeros."""
    decoder = nmea.make_decoder(nmea.Options())
    good = []
    for body in (lost, found, lost):
        decoder.feed(sentence(body), 1)
        good += decoder.feed(sentence("GPVTG,000.0,T,,M,000.0,N,000.0,K") + sentence("GPVTG,0.0,0.0,0.0,0.0"), 1)
        decoder.feed(sentence("LCGLL,3000.0,S,09000.0,W"), 1)  # says nothing about a fix
        good += decoder.feed(sentence("GPVTG,90.0,T,,M,10.0,N,18.5,K,A"), 1)
    assert [m.valid for m in good if isinstance(m, Velocity)] == [False, False, True, *[True] * 3, False, False, True]


@pytest.mark.parametrize("nothing", ["0.0", "0", "99.0", "99.99", ""])
def test_a_dilution_that_stands_for_none_is_none(nothing: str) -> None:
    bodies = (
        f"GPGGA,120000,4800.0,N,01130.0,E,1,08,{nothing},500.0,M,47.0,M,,",
        f"GNGNS,120000,4800.0,N,01130.0,E,AN,05,{nothing},500.0,47.0,,",
        f"GPGSA,A,1,,,,,,,,,,,,,{nothing},{nothing},{nothing}",
        f"PUBX,00,120000,4800.0,N,01130.0,E,1,G3,1,1,0,0,0,,{nothing},{nothing},1,9,0,0",
    )
    for body in bodies:
        (found,) = satellites_of(sentence(body))
        assert (found.hdop, found.vdop, found.pdop) == (None, None, None)


def test_headings_and_attitude() -> None:
    assert decode(sentence("HETHS,90.0,A")) == [Attitude(stamp=Stamp(1), heading=math.pi / 2)]
    assert decode(sentence("HETHS,90.0,E")) == [Attitude(stamp=Stamp(1), heading=math.pi / 2, valid=False)]
    assert decode(sentence("HETHS,,V") + sentence("GPHDT,,T") + sentence("HCHDG,90.0,,,1.3,E")) == []
    (found,) = decode(sentence("PASHR,120000.00,180.0,T,-10.0,+5.0,+0.01,0.1,0.2,0.3,2,3"))
    assert isinstance(found, Attitude)
    assert (found.heading, found.roll, found.pitch) == pytest.approx((math.pi, math.radians(-10), math.radians(5)))
    assert (found.roll_sd, found.pitch_sd, found.heading_sd) == pytest.approx(tuple(map(math.radians, (0.1, 0.2, 0.3))))
    assert decode(sentence("PASHR,POS,0,03,183530.00,2037.76012,N,08704.07373,W,058.48,,359.4,0.0,0.0")) == []


def test_proprietary_sentences_of_ublox() -> None:
    """km/h, metres above the ellipsoid, ns."""
    body = "PUBX,00,081350.00,4717.113210,N,00833.915187,E,546.589,G3,2.1,2.0,36.0,77.52,-0.5,,0.92,1.19,0.77,9,0,0"
    velocity, used, status, position = decode(sentence(body))
    assert isinstance(velocity, Velocity)
    assert isinstance(position, Position)
    assert velocity.ground_speed == pytest.approx(10.0)
    assert (velocity.down, velocity.valid) == (-0.5, True)
    assert (position.alt, position.alt_msl, position.horizontal_sd, position.vertical_sd) == (546.589, None, 2.1, 2.0)
    assert math.degrees(position.lat or 0.0) == pytest.approx(47 + 17.113210 / 60)
    assert used == Satellites(stamp=Stamp(1), used=9, hdop=0.92, vdop=1.19)
    assert status == DeviceStatus(stamp=Stamp(1), ok=True, flags=("fix_3d",))
    assert not position_of(body.replace("G3", "TT")).valid
    time, clock = decode(sentence("PUBX,04,073731.00,091202,113851.00,1196,15D,1930035,-2660.664,43"))
    assert time.stamp.t_dev_ns == unix_ns("2002-12-09T07:37:31")
    assert isinstance(clock, ReceiverClock)
    assert (clock.offset, clock.drift) == pytest.approx((1930035e-9, -2660.664e-9))


def test_the_end_of_a_day_may_be_called_24_o_clock() -> None:
    assert times(sentence("GPRMC,240000.00,A,4800.0,N,01130.0,E,1.0,2.0,311224,,,A") + GGA_0) == [NEW_YEAR_NS] * 2
    decoder = nmea.make_decoder(nmea.Options())
    decoder.feed(sentence("GPRMC,240001.00,A,4800.0,N,01130.0,E,1.0,2.0,311224,,,A"), 1)
    assert decoder.counters.messages == {"RMC malformed": 1}


@pytest.mark.parametrize(
    ("date", "expected"), [("311299", "1999-12-31"), ("010180", "1980-01-01"), ("010179", "2079-01-01")]
)
def test_years_of_two_digits(date: str, expected: str) -> None:
    (found,) = times(sentence(f"GPRMC,120000,A,4800.0,N,01130.0,E,1.0,2.0,{date},,,A"))
    assert found == unix_ns(f"{expected}T12:00:00")


def test_a_receiver_without_a_fix_may_say_impossible_places() -> None:
    measurements = decode(sentence("GPRMC,000452.981,V,36000.0000,N,72000.0000,E,0.000000,,190120,,"))
    assert isinstance(measurements[0], Position)
    assert (measurements[0].valid, measurements[0].lat, measurements[0].lon) == (False, None, None)
    assert measurements[0].stamp.t_dev_ns == unix_ns("2020-01-19T00:04:52.981")
    assert times(sentence("GPRMC,120000,V,,,,,,,000000,,")) == [None]


def test_line_ends_of_careless_receivers() -> None:
    body = sentence("GPHDT,2.0,T")[:-2]
    decoder = nmea.make_decoder(nmea.Options())
    for end in (b"\n", b"\r\n", b"\r\r\n"):
        assert len(decoder.feed(body + end, 1)) == 1
    assert not decoder.counters.skipped


def test_a_checksum_may_be_missing_when_the_option_says_so_but_not_be_wrong() -> None:
    decoder = nmea.make_decoder(nmea.Options(checksum="optional"))
    assert len(decoder.feed(b"$GPHDT,2.0,T\r\n" + sentence("GPHDT,2.0,T"), 1)) == 2
    assert decoder.feed(b"$GPHDT,2.0,T*00\r\n$GP\r\n", 1) == []
    assert decoder.counters.skipped == {"bad_checksum": 15, "no_checksum": 3, "no_sync": 4}
