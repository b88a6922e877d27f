"""GDL 90 messages, against the examples of the ICD and a receiver written from its tables."""

from __future__ import annotations

import math
import socket
import time
from contextlib import closing
from itertools import chain

import pytest
from hypothesis import given, settings

from fti.config.publish_tables import Gdl90Table
from fti.publish import gdl90_messages as gdl90
from fti.publish.message import PublishedMessage, SessionIdentity
from fti.publish.navigation_values import NavigationValues, read_navigation
from fti.publish.sinks.gdl90 import Gdl90Sink
from tests.publish.gdl90_receiver import (
    Ahrs,
    GeometricAltitude,
    Heartbeat,
    Identity,
    Message,
    Ownship,
    decode,
    unframe,
)
from tests.publish.solutions import (
    ALT_M,
    CLIMB_MPS,
    HEADING_DEG,
    LAT_DEG,
    LON_DEG,
    PITCH_DEG,
    ROLL_DEG,
    SPEED_MPS,
    TRACK_DEG,
    arbitrary_messages,
    ignore,
    invalid_solution,
    json_field,
    late,
    message,
    solution,
)

KNOT, FOOT, MILE = 1852 / 3600, 0.3048, 1852.0
#: Table 12 of the ICD, with the message identity of the ownship report.
REPORT = bytes.fromhex("0A 00 AB4549 1FEF15 A88978 0F 09 A9 07B001 20 01 4E38323556202020 00")


def values(published: PublishedMessage) -> NavigationValues:
    return read_navigation(published, time.monotonic())


def messages(found: NavigationValues) -> tuple[Heartbeat, Ownship, GeometricAltitude | None, Ahrs]:
    """What the receiver reads from the messages of one solution."""
    altitude = gdl90.geometric_altitude(found)
    contents = (gdl90.heartbeat(found), gdl90.ownship_report(found, "DEFTI"), gdl90.foreflight_ahrs(found))
    beat, report, attitude = (decode(gdl90.frame(content)) for content in contents)
    height = decode(gdl90.frame(altitude)) if altitude else None
    assert isinstance(beat, Heartbeat)
    assert isinstance(report, Ownship)
    assert isinstance(attitude, Ahrs)
    assert height is None or isinstance(height, GeometricAltitude)
    return beat, report, height, attitude


# ------------------------------------------------------------------------------------------- examples of the ICD


def test_the_frame_is_that_of_the_example_of_a_heartbeat() -> None:
    assert gdl90.frame(bytes.fromhex("00 81 41 DB D0 08 02")).hex(" ") == "7e 00 81 41 db d0 08 02 b3 8b 7e"


def test_flags_and_escapes_are_stuffed() -> None:
    content = bytes([0x7D, 0x7E, 0x5E, 0x7E, 0x7D])
    assert gdl90.frame(content).startswith(bytes.fromhex("7E 7D5D 7D5E 5E 7D5E 7D5D"))
    assert unframe(gdl90.frame(content)) == content


def test_the_report_of_the_example_is_encoded() -> None:
    """The address, pressure altitude and emitter category of the example are not among our outputs."""
    example = NavigationValues(
        lat=math.radians(0x1FEF15 * 180 / 2**23),
        lon=math.radians((0xA88978 - 2**24) * 180 / 2**23),
        vel_north=123 * KNOT * math.cos(math.radians(45)),
        vel_east=123 * KNOT * math.sin(math.radians(45)),
        vel_down=-64 * FOOT / 60,
        hpl=20.0,
        vpl=20.0,
        horizontal_sd=25.0 / 2.448,
        vertical_sd=20.0,
    )
    changed = bytearray(REPORT)
    changed[2:5] = bytes(3)
    changed[11:13] = bytes([0xFF, 0xF9])
    changed[18] = 0
    assert gdl90.ownship_report(example, "N825V").hex() == changed.hex()


@pytest.mark.parametrize(
    ("degrees", "code"),
    [(0.0, "000000"), (45.0, "200000"), (-45.0, "e00000"), (90.0, "400000"), (-180 / 2**23, "ffffff")],
)
def test_latitudes_of_the_examples(degrees: float, code: str) -> None:
    report = gdl90.ownship_report(NavigationValues(lat=math.radians(degrees), lon=math.radians(-180.0)), "")
    assert report[5:11].hex() == code + "800000"


@pytest.mark.parametrize(
    ("fpm", "code"),
    [(0, 0), (64, 0x001), (-64, 0xFFF), (32_576, 0x1FD), (99_999, 0x1FE), (-32_576, 0xE03), (-99_999, 0xE02)],
)
def test_climbs_of_the_examples(fpm: float, code: int) -> None:
    report = gdl90.ownship_report(NavigationValues(lat=1.0, lon=1.0, vel_down=-fpm * FOOT / 60), "")
    assert int.from_bytes(report[15:17], "big") & 0xFFF == code


@pytest.mark.parametrize(
    ("altitude_ft", "vpl", "sd", "code"),
    [
        (-1000, None, None, "ff38 ffff"),
        (0, 1.0, 40_000 / 1.96, "0000 7ffe"),
        (1000, 1.0, 10 / 1.96, "00c8 000a"),
        (1000, None, 50 / 1.96, "00c8 8032"),
    ],
)
def test_geometric_altitudes_of_the_examples(
    altitude_ft: float, vpl: float | None, sd: float | None, code: str
) -> None:
    found = gdl90.geometric_altitude(
        NavigationValues(lat=1.0, lon=1.0, alt=altitude_ft * FOOT, vpl=vpl, vertical_sd=sd)
    )
    assert found is not None
    assert found.hex() == "0b" + code.replace(" ", "")


@pytest.mark.parametrize(
    ("hpl", "vpl", "category"),
    [
        (None, 1.0, 0), (21 * MILE, None, 0), (19.9 * MILE, None, 1), (0.99 * MILE, None, 5), (0.59 * MILE, None, 6),
        (0.09 * MILE, None, 8), (74.0, None, 8), (74.0, 112.5, 8), (74.0, 111.0, 9), (24.0, 37.0, 10), (7.0, 10.0, 11),
        (7.0, 12.0, 10),
    ],
)  # fmt: skip
def test_integrity_categories_of_table_10(hpl: float | None, vpl: float | None, category: int) -> None:
    assert gdl90.nic(NavigationValues(hpl=hpl, vpl=vpl)) == category


# ------------------------------------------------------------------------------------------------------- receiver


def test_the_receiver_reads_the_example() -> None:
    """It is the judge of the other tests."""
    report = decode(gdl90.frame(REPORT))
    assert isinstance(report, Ownship)
    assert (report.lat, report.lon) == pytest.approx((44.90708, -122.99488), abs=180 / 2**23)
    assert (report.pressure_altitude_ft, report.speed_kt, report.climb_fpm, report.track_deg) == (5000, 123, 64, 45.0)
    assert (report.address, report.nic, report.nacp, report.callsign) == (0o52642511, 10, 9, "N825V")


def test_a_valid_solution() -> None:
    beat, report, height, attitude = messages(values(message(solution())))
    assert beat == Heartbeat(position_valid=True, utc_ok=False, seconds=(18 * 60 + 14) * 60 + 8)
    assert (report.lat, report.lon) == pytest.approx((LAT_DEG, LON_DEG), abs=90 / 2**23)
    assert report.speed_kt == round(SPEED_MPS / KNOT)
    assert report.track_deg == pytest.approx(TRACK_DEG, abs=0.71)
    assert report.climb_fpm == pytest.approx(CLIMB_MPS / FOOT * 60, abs=32)
    assert (report.nic, report.nacp) == (10, 10)  # hpl 20 m, vpl 30 m; 95 %: 3.7 m, 4.9 m
    assert (report.pressure_altitude_ft, report.address, report.callsign) == (None, 0, "DEFTI")
    assert height is not None
    assert height.altitude_ft == pytest.approx(ALT_M / FOOT, abs=2.5)
    assert (height.has_warning, height.figure_of_merit_m) == (False, 5)
    angles = (attitude.roll_deg, attitude.pitch_deg, attitude.heading_deg)
    assert angles == pytest.approx((ROLL_DEG, PITCH_DEG, HEADING_DEG), abs=0.051)
    assert attitude.is_magnetic is False
    assert attitude.airspeeds_kt == (None, None)


@pytest.mark.parametrize(
    "published",
    [
        message(invalid_solution()),
        late(message(solution())),
        message(solution(), age_ms=600.0),
        message(solution(), received_s=time.monotonic() - 600.0),
        message(solution(attitude_valid=False, lon=None)),
        message(solution())._replace(payload=b"[]"),
    ],
    ids=["invalid", "stated-late", "late", "waited", "without-longitude", "not-a-table"],
)
def test_what_is_not_valid_is_coded_as_invalid(published: PublishedMessage) -> None:
    assert_invalid(values(published))


def assert_invalid(found: NavigationValues) -> None:
    beat, report, height, attitude = messages(found)
    assert not beat.position_valid
    assert (report.lat, report.lon, report.nic, report.nacp) == (None, None, 0, 0)
    assert (report.speed_kt, report.climb_fpm, report.track_deg) == (None, None, None)
    assert height is None
    assert (attitude.roll_deg, attitude.pitch_deg, attitude.heading_deg) == (None, None, None)


@given(arbitrary_messages(solution()))
@settings(max_examples=500, deadline=None)
def test_any_message_gives_messages_that_the_documents_allow(published: PublishedMessage) -> None:
    messages(values(published))


@given(arbitrary_messages(invalid_solution()))
@settings(max_examples=500, deadline=None)
def test_no_message_that_is_not_valid_gives_values(published: PublishedMessage) -> None:
    if json_field(published, "valid") is not True and json_field(published, "attitude_valid") is not True:
        assert_invalid(values(published))


@pytest.mark.parametrize(("name", "callsign"), [("D-EFTI", "DEFTI"), ("research_aircraft", "RESEARCH"), ("--", "")])
def test_a_callsign_has_capitals_and_digits_only(name: str, callsign: str) -> None:
    assert gdl90.callsign_of(name) == callsign


# ------------------------------------------------------------------------------------------------------------ sink


def test_the_tablet_gets_its_messages_at_their_rates(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten seconds: five with solutions, then none."""
    now_s = [1000.0]
    monkeypatch.setattr(time, "monotonic", lambda: now_s[0])
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as tablet:
        tablet.bind(("127.0.0.1", 0))
        tablet.setblocking(False)
        table = Gdl90Table(udp=(f"127.0.0.1:{tablet.getsockname()[1]}",))
        sink = Gdl90Sink(table, SessionIdentity("D-EFTI", "test"), ignore)
        with closing(sink):
            sink.open()
            received: list[list[Message]] = []
            for step in range(50):
                sink.send([message(solution())] if step < 25 else [])
                now_s[0] += 0.2
                received.append(read_all(tablet))
            assert sink.count_peers() == 1
    first, last, silent = (list(chain(*received[part])) for part in (slice(25), slice(25, 50), slice(30, 50)))
    assert count(first, Heartbeat) == count(first, Ownship) == count(first, GeometricAltitude) == 5
    assert count(first, Identity) == 5
    assert count(first, Ahrs) == 25
    assert isinstance(received[0][1], Heartbeat)  # the report follows it
    assert isinstance(received[0][2], Ownship)
    assert {found for found in first if isinstance(found, Identity)} == {Identity("FTI", "FTI D-EFTI", False)}
    assert count(last, Heartbeat) == count(last, Ownship) == 5
    assert count(silent, GeometricAltitude) == 0
    assert not any(found.position_valid for found in silent if isinstance(found, Heartbeat))
    assert all(found.lat is None for found in silent if isinstance(found, Ownship))
    assert all(found.roll_deg is None for found in silent if isinstance(found, Ahrs))
    assert count(silent, Ahrs) == 4


def read_all(tablet: socket.socket) -> list[Message]:
    found = []
    while True:
        try:
            found.append(decode(tablet.recv(2048)))
        except BlockingIOError:
            return found


def count(found: list[Message], kind: type) -> int:
    return sum(isinstance(message, kind) for message in found)
