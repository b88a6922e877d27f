"""NMEA sentences, judged by gpsd, pynmeagps and the fields of the standard."""

from __future__ import annotations

import math
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from datetime import datetime
from functools import partial
from typing import Any

import pynmeagps
import pytest
from hypothesis import given, settings

from fti.config.publish_tables import NmeaTable
from fti.errors import MissingError
from fti.geodesy import coarse_geoid
from fti.geodesy.geoid import Geoid, load_geoid
from fti.publish import mean_sea_level
from fti.publish.mean_sea_level import MeanSeaLevel
from fti.publish.message import PublishedMessage
from fti.publish.navigation_values import NO_NAVIGATION, read_navigation
from fti.publish.nmea_sentences import ENCODERS, encode
from fti.publish.sinks.nmea import NmeaSink
from tests.e2e.harness import free_udp_port
from tests.helpers import until
from tests.publish.gpsd import served_by_gpsd
from tests.publish.solutions import (
    ALT_M,
    HEADING_DEG,
    LAT_DEG,
    LON_DEG,
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

ALL = tuple(ENCODERS)
SEA = MeanSeaLevel()


def encoded(published: PublishedMessage) -> bytes:
    return encode(read_navigation(published, time.monotonic()), ALL, "IN", SEA)


def parsed(data: bytes) -> dict[str, Any]:
    """The sentences by their names, read by pynmeagps with checksums validated."""
    lines = data.splitlines(keepends=True)
    messages = [pynmeagps.NMEAReader.parse(line, validate=pynmeagps.VALCKSUM) for line in lines]
    return {message.msgID: message for message in messages}


# ------------------------------------------------------------------------------------------------------- sentences


def test_sentences_of_a_valid_solution() -> None:
    sentences = parsed(encoded(message(solution())))
    gga, rmc, vtg, gst = (sentences[name] for name in ("GGA", "RMC", "VTG", "GST"))
    for found in (gga, rmc):
        assert (found.lat, found.lon) == pytest.approx((LAT_DEG, LON_DEG), abs=1e-8)
        assert str(found.time) == "18:14:08.040000"
    assert (rmc.status, rmc.posMode, gga.quality, vtg.posMode) == ("A", "A", 1, "A")
    assert str(rmc.date) == "2026-11-29"
    assert gga.alt + gga.sep == pytest.approx(ALT_M, abs=1e-3)
    assert gga.sep == pytest.approx(coarse_geoid.undulation(math.radians(LAT_DEG), math.radians(LON_DEG)), abs=1.0)
    assert rmc.spd * 1852 / 3600 == pytest.approx(SPEED_MPS, abs=0.003)
    assert vtg.sogk / 3.6 == pytest.approx(SPEED_MPS, abs=0.002)
    assert rmc.cog == vtg.cogt == pytest.approx(TRACK_DEG, abs=0.006)
    assert (gst.stdLat, gst.stdLong, gst.stdAlt) == (1.5, 1.5, 2.5)
    assert sentences["HDT"].headingT == pytest.approx(HEADING_DEG, abs=0.006)


def test_the_longest_sentence_has_82_characters() -> None:
    far = solution(lat=-math.pi / 2, lon=-math.pi, alt=99_999.0, vel_north=-3000.0, horizontal_sd=1e5, vertical_sd=1e5)
    lines = encoded(message(far)).splitlines(keepends=True)
    assert max(len(line) for line in lines) <= 82


def test_without_the_grid_of_the_system_the_undulation_is_a_coarse_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """At 1 degree, where the coarse grid has a post: rounded to 0.1 m."""

    def no_grid(model: str) -> Geoid:
        raise MissingError(model)

    lat, lon = math.radians(49.0), math.radians(11.0)
    fine = load_geoid("egm96").undulation(lat, lon)
    monkeypatch.setattr(mean_sea_level, "load_geoid", no_grid)
    assert MeanSeaLevel().undulation(lat, lon) == pytest.approx(float(fine), abs=0.06)


@pytest.mark.parametrize("degrees", [359.999, -0.001, 0.0, 360.0])
def test_an_angle_of_a_full_turn_is_0(degrees: float) -> None:
    assert parsed(encoded(message(solution(heading=math.radians(degrees)))))["HDT"].headingT == 0.0


@pytest.mark.parametrize(
    "published",
    [
        message(invalid_solution()),
        late(message(solution())),
        message(solution(), age_ms=600.0),  # late on the bus
        message(solution(), received_s=time.monotonic() - 600.0),  # waited in the queue
        message(solution(lat=None)),
        message(solution(lat=2.0)),
        message(solution(lon=math.nan)),
        message(solution())._replace(payload=b"{}"),
        message(solution())._replace(payload=b"not JSON"),
    ],
    ids=[
        "invalid",
        "stated-late",
        "late",
        "waited",
        "without-latitude",
        "latitude-114",
        "longitude-nan",
        "empty",
        "not-json",
    ],
)
def test_a_position_that_is_not_valid_is_never_sent(published: PublishedMessage) -> None:
    assert_no_position(encoded(published))


def assert_no_position(data: bytes) -> None:
    fields = {line[3:6]: line.split("*")[0].split(",") for line in data.decode("ascii").splitlines()}
    assert fields["RMC"][2:9] == ["V", "", "", "", "", "", ""]
    assert fields["RMC"][12] == "N"
    assert fields["GGA"][2:7] == ["", "", "", "", "0"]
    assert (fields["GGA"][9], fields["GGA"][11]) == ("", "")
    assert [fields["VTG"][n] for n in (1, 5, 7, 9)] == ["", "", "", "N"]
    assert fields["GST"][6:9] == ["", "", ""]


def test_an_invalid_attitude_gives_no_heading_but_a_position() -> None:
    data = encoded(message(solution(attitude_valid=False)))
    assert b"$INHDT,,T*" in data
    assert b",A," in data


@given(arbitrary_messages(solution()))
@settings(max_examples=500, deadline=None)
def test_any_message_gives_sentences_with_right_checksums(published: PublishedMessage) -> None:
    data = encoded(published)
    lines = data.decode("ascii").splitlines(keepends=True)
    assert [line[3:6] for line in lines] == list(ALL)
    assert all(line.endswith("\r\n") and len(line) <= 82 for line in lines)
    parsed(data)


@given(arbitrary_messages(invalid_solution()))
@settings(max_examples=500, deadline=None)
def test_no_message_that_is_not_valid_gives_a_position(published: PublishedMessage) -> None:
    if json_field(published, "valid") is not True:
        assert_no_position(encoded(published))


# ------------------------------------------------------------------------------------------------------------ gpsd


def feed(sink: NmeaSink, make: Callable[[], list[PublishedMessage]], stop: Callable[[], bool]) -> None:
    """Send five times a second in the caller's thread until stop."""
    while not stop():
        sink.send(make())
        time.sleep(0.2)


@contextmanager
def fed(table: NmeaTable, make: Callable[[], list[PublishedMessage]]) -> Iterator[NmeaSink]:
    """A sink in a thread that gets messages five times a second."""
    sink, is_over = NmeaSink(table, ignore), threading.Event()
    sink.open()
    thread = threading.Thread(target=feed, args=(sink, make, is_over.is_set))
    thread.start()
    try:
        yield sink
    finally:
        is_over.set()
        thread.join()
        sink.close()


def test_gpsd_sees_position_speed_track_and_errors() -> None:
    port = free_udp_port()
    begin_ns = time.time_ns()

    def now() -> list[PublishedMessage]:
        t_ns = time.time_ns()
        return [message(solution(t_ns=t_ns, t_valid_ns=t_ns))]

    with fed(NmeaTable(tcp_port=port), now) as sink, served_by_gpsd(port) as report:
        reports = [report() for _ in range(60)]
        assert sink.count_peers() == 1
    fixes = [found for found in reports if found["class"] == "TPV" and found.get("mode") == 3 and "track" in found]
    assert len(fixes) > 5
    for fix in fixes:
        assert (fix["lat"], fix["lon"]) == pytest.approx((LAT_DEG, LON_DEG), abs=2e-8)
        assert fix["altHAE"] == pytest.approx(ALT_M, abs=0.01)
        assert fix["altMSL"] == pytest.approx(
            ALT_M - SEA.undulation(math.radians(LAT_DEG), math.radians(LON_DEG)), abs=0.01
        )
        assert fix["speed"] == pytest.approx(SPEED_MPS, abs=0.01)
        assert fix["track"] == pytest.approx(TRACK_DEG, abs=0.01)
        assert 0 <= seconds(fix["time"]) - begin_ns / 1e9 + 0.01 < 60
    errors = [found for found in reports if found["class"] == "GST"]
    assert errors
    assert all((found["lat"], found["lon"], found["alt"]) == (1.5, 1.5, 2.5) for found in errors)


def seconds(text: str) -> float:
    return datetime.fromisoformat(text).timestamp()


def test_gpsd_loses_the_fix_with_the_validity_and_with_the_messages() -> None:
    """Modes of gpsd: 1 no fix, 3 three-dimensional."""
    port = free_udp_port()
    phase = ["valid"]

    def make() -> list[PublishedMessage]:
        t_ns = time.time_ns()
        kinds = {"valid": solution, "invalid": invalid_solution}
        return [message(kinds[phase[0]](t_ns=t_ns, t_valid_ns=t_ns))] if phase[0] in kinds else []

    with fed(NmeaTable(tcp_port=port), make), served_by_gpsd(port) as report:

        def has_mode(expected: int) -> bool:
            found = report()
            return found["class"] == "TPV" and found.get("mode") == expected

        for phase[0], mode in (("valid", 3), ("invalid", 1), ("valid", 3), ("silent", 1), ("valid", 3)):
            until(partial(has_mode, mode), what=f"mode {mode} while {phase[0]}")


# ------------------------------------------------------------------------------------------------------------ sink


def test_datagrams_have_the_sentences_of_each_solution() -> None:
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5.0)
        sink = NmeaSink(
            NmeaTable(udp=(f"127.0.0.1:{receiver.getsockname()[1]}",), talker="GP", sentences=("RMC",)), ignore
        )
        sink.open()
        with closing(sink):
            sink.send([message(solution())])
            sink.send([])
            data = receiver.recv(2048)
            assert data.startswith(b"$GPRMC,181408.040,A,")
            receiver.settimeout(0.1)
            with pytest.raises(TimeoutError):  # the solution is still current
                receiver.recv(2048)
            assert sink.count_peers() == 1


def test_without_a_solution_it_sends_once_a_second_that_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [1000.0]
    monkeypatch.setattr(time, "monotonic", lambda: now_s[0])
    sent: list[bytes] = []
    sink = NmeaSink(NmeaTable(udp=("127.0.0.1:9",)), ignore)
    monkeypatch.setattr(sink._datagrams, "send", sent.append)
    sink.send([])
    sink.send([message(solution())])
    for _ in range(8):
        now_s[0] += 0.5
        sink.send([])
    assert [b",A," in data for data in sent] == [False, True, *[False] * 4]
    assert sent[0] == encode(NO_NAVIGATION, ("GGA", "RMC", "VTG", "GST"), "IN", SEA)
