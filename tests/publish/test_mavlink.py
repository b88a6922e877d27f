"""MAVLink messages and their sink, read by mavutil and pymavlink's parser."""

from __future__ import annotations

import json
import math
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import asdict
from pymavlink import mavutil
from pymavlink.dialects.v20 import common

from fti.bus.message import encode_event
from fti.config.publish_tables import MavlinkTable
from fti.messages.outputs import ClearanceIntegrity, Event, HeightBelowAircraft, IntegrityState
from fti.messages.reasons import Reason
from fti.publish.mavlink_messages import status_text
from fti.publish.mean_sea_level import MeanSeaLevel
from fti.publish.message import PublishedMessage
from fti.publish.sinks.mavlink import MavlinkSink
from tests.helpers import until
from tests.publish.solutions import (
    ALT_M,
    CLIMB_MPS,
    HEADING_DEG,
    JSON_VALUES,
    LAT_DEG,
    LON_DEG,
    PITCH_DEG,
    ROLL_DEG,
    SPEED_MPS,
    T_NS,
    TRACK_DEG,
    arbitrary_messages,
    ignore,
    invalid_solution,
    json_field,
    message,
    solution,
)

ALT_MSL_M = ALT_M - MeanSeaLevel().undulation(math.radians(LAT_DEG), math.radians(LON_DEG))
HEIGHT_M, HEIGHT_SD_M = 123.45, 0.12
TABLE = MavlinkTable(udp=("127.0.0.1:9",))


def height(**changes: Any) -> HeightBelowAircraft:
    values = {"height_agl": HEIGHT_M, "sd": HEIGHT_SD_M, "valid": True, "reasons": ()}
    return HeightBelowAircraft(t_ns=T_NS, t_valid_ns=T_NS, sensor="altimeter", **{**values, **changes})


def integrity(state: IntegrityState, *, valid: bool = True, reasons: tuple[Reason, ...] = ()) -> ClearanceIntegrity:
    return ClearanceIntegrity(t_ns=T_NS, t_valid_ns=T_NS, state=state, reasons=reasons, valid=valid)


def event(level: str, text: str) -> PublishedMessage:
    payload = encode_event(asdict(Event(t_ns=T_NS, level=level, source="ins", text=text)))
    return PublishedMessage("/event", payload, 1, time.monotonic())


class Sent:
    """A sink whose datagrams go to pymavlink's parser, which raises for every wrong frame."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = time.monotonic()
        self._parser = common.MAVLink(None)
        self._found: list[Any] = []
        self.sink = MavlinkSink(TABLE, ignore)
        monkeypatch.setattr(time, "monotonic", lambda: self.now_s)
        monkeypatch.setattr(self.sink._datagrams, "send", self._parse)

    def _parse(self, datagram: bytes) -> None:
        assert datagram[0] == 0xFD  # MAVLink 2
        (found,) = self._parser.parse_buffer(datagram)
        self._found.append(found)

    def __call__(self, *messages: PublishedMessage, after_s: float = 0.0) -> list[Any]:
        """The messages that follow from some of the bus."""
        self.now_s += after_s
        self._found.clear()
        self.sink.send([published._replace(received_s=self.now_s) for published in messages])
        return self._found.copy()


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> Sent:
    return Sent(monkeypatch)


def of(kind: str, found: list[Any]) -> list[Any]:
    return [one for one in found if one.get_type() == kind]


def texts(found: list[Any]) -> list[tuple[int, str]]:
    return [(one.severity, one.text) for one in of("STATUSTEXT", found)]


# -------------------------------------------------------------------------------------------------------- messages


def test_position_attitude_and_altitude_of_a_valid_solution(sent: Sent) -> None:
    sent(message(height()))
    found = sent(message(solution()))
    (position,) = of("GLOBAL_POSITION_INT", found)
    assert (position.lat / 1e7, position.lon / 1e7) == pytest.approx((LAT_DEG, LON_DEG), abs=6e-8)
    assert position.alt / 1000 == pytest.approx(ALT_MSL_M, abs=0.001)
    assert position.vx / 100 == pytest.approx(SPEED_MPS * math.cos(math.radians(TRACK_DEG)), abs=0.006)
    assert position.vy / 100 == pytest.approx(SPEED_MPS * math.sin(math.radians(TRACK_DEG)), abs=0.006)
    assert position.vz / 100 == pytest.approx(-CLIMB_MPS, abs=0.006)
    assert position.hdg / 100 == pytest.approx(HEADING_DEG, abs=0.006)
    (attitude,) = of("ATTITUDE", found)
    angles = [math.degrees(angle) for angle in (attitude.roll, attitude.pitch, attitude.yaw)]
    assert angles == pytest.approx([ROLL_DEG, PITCH_DEG, HEADING_DEG], abs=1e-5)
    (altitude,) = of("ALTITUDE", found)
    assert altitude.altitude_amsl == pytest.approx(ALT_MSL_M, abs=0.001)
    assert altitude.bottom_clearance == pytest.approx(HEIGHT_M, abs=1e-4)
    assert altitude.altitude_terrain == pytest.approx(ALT_MSL_M - HEIGHT_M, abs=0.001)
    assert (position.get_srcSystem(), position.get_srcComponent()) == (100, 1)


def test_a_height_is_a_distance_sensor_that_points_down(sent: Sent) -> None:
    (distance,) = of("DISTANCE_SENSOR", sent(message(height())))
    assert distance.current_distance == 12345
    assert distance.covariance == 144  # (12 cm)^2
    assert distance.orientation == common.MAV_SENSOR_ROTATION_PITCH_270


@pytest.mark.parametrize(
    "changes", [{"valid": False}, {"height_agl": None}, {"height_agl": 700.0}, {"height_agl": -1.0}]
)
def test_a_height_that_is_not_valid_or_out_of_range_is_not_sent(sent: Sent, changes: dict[str, Any]) -> None:
    assert not of("DISTANCE_SENSOR", sent(message(height(**changes))))


@pytest.mark.parametrize("make", [invalid_solution, lambda: solution(lat=None)], ids=["invalid", "without-latitude"])
def test_no_position_is_sent_while_it_is_not_valid(sent: Sent, make: Callable[[], Any]) -> None:
    sent(message(solution()))
    found = sent(message(make()), after_s=1.0)
    assert not of("GLOBAL_POSITION_INT", found)
    assert not of("ALTITUDE", found)
    (status,) = of("SYS_STATUS", found)
    assert status.onboard_control_sensors_present & common.MAV_SYS_STATUS_SENSOR_GPS
    assert not status.onboard_control_sensors_health & common.MAV_SYS_STATUS_SENSOR_GPS
    ((severity, text),) = texts(found)
    assert severity == common.MAV_SEVERITY_WARNING
    assert text.startswith("position not valid")


def test_the_validity_of_the_position_is_a_text_on_a_change_only(sent: Sent) -> None:
    warning, info = common.MAV_SEVERITY_WARNING, common.MAV_SEVERITY_INFO
    assert texts(sent()) == [(warning, "position not valid (no output)")]
    assert texts(sent(message(solution()))) == [(info, "position valid")]
    assert texts(sent(message(solution()), after_s=0.1)) == []
    assert texts(sent(message(invalid_solution()), after_s=0.1)) == [(warning, "position not valid (no_position)")]
    assert texts(sent(message(solution()), after_s=0.1)) == [(info, "position valid")]
    late = message(solution(), age_ms=600.0)
    assert texts(sent(late, after_s=0.1)) == [(warning, "position not valid (no output)")]
    sent(message(solution()), after_s=0.1)
    assert texts(sent(after_s=0.5)) == []
    assert texts(sent(after_s=0.5)) == [(warning, "position not valid (no output)")]


def test_the_integrity_is_a_text_on_a_change_with_its_severity(sent: Sent) -> None:
    sent()
    assert texts(sent(message(integrity(IntegrityState.OK)))) == [(common.MAV_SEVERITY_INFO, "clearance integrity: ok")]
    assert texts(sent(message(integrity(IntegrityState.OK)), after_s=0.5)) == []
    alert = message(integrity(IntegrityState.ALERT, valid=False, reasons=(Reason.NO_POSITION,)))
    expected = [(common.MAV_SEVERITY_CRITICAL, "clearance integrity: alert (no_position)")]
    assert texts(sent(alert, after_s=0.5)) == expected
    assert texts(sent(message(integrity(IntegrityState.CAUTION)), after_s=0.5)) == [
        (common.MAV_SEVERITY_WARNING, "clearance integrity: caution")
    ]
    silent = texts(sent(after_s=2.0))
    assert (common.MAV_SEVERITY_WARNING, "clearance integrity: unavailable (no output)") in silent


def test_the_status_has_a_bit_for_each_thing_that_is_valid(sent: Sent) -> None:
    bits = (
        common.MAV_SYS_STATUS_SENSOR_GPS,
        common.MAV_SYS_STATUS_AHRS,
        common.MAV_SYS_STATUS_SENSOR_LASER_POSITION,
        common.MAV_SYS_STATUS_TERRAIN,
    )

    def health(*messages: PublishedMessage) -> list[bool]:
        (status,) = of("SYS_STATUS", sent(*messages, after_s=1.0))
        return [bool(status.onboard_control_sensors_health & bit) for bit in bits]

    ok = message(integrity(IntegrityState.OK))
    assert health() == [False] * 4
    assert health(message(solution()), message(height()), ok) == [True] * 4
    assert health(message(invalid_solution()), message(height()), ok) == [False, False, True, True]
    assert health(message(solution(attitude_valid=False)), message(height(valid=False))) == [True, False, False, True]
    contradiction = message(integrity(IntegrityState.OK, valid=False))
    assert health(message(solution()), contradiction) == [True, True, False, False]
    assert health() == [False] * 4


def test_warnings_and_errors_are_texts_and_long_ones_are_joined(sent: Sent) -> None:
    sent()
    assert texts(sent(event("info", "connected"))) == []
    assert texts(sent(event("warning", "21 °C"))) == [(common.MAV_SEVERITY_WARNING, "ins: 21 ?C")]
    long = "".join(chr(ord("a") + n % 26) for n in range(395))
    chunks = of("STATUSTEXT", sent(event("error", long)))
    assert len({chunk.id for chunk in chunks}) == 1
    assert chunks[0].id > 0
    assert [chunk.chunk_seq for chunk in chunks] == list(range(len(chunks)))
    assert "".join(chunk.text for chunk in chunks) == f"ins: {long}"


@pytest.mark.parametrize("length", [0, 1, 49, 50, 51, 99, 100, 101, 400, 5000])
def test_the_last_chunk_of_a_text_ends_with_a_null(length: int) -> None:
    """common.xml: "Any null character in the text field is taken to mean this was the last chunk"."""
    chunks = [one.text.encode().ljust(50, b"\0") for one in status_text(common.MAV_SEVERITY_ERROR, "x" * length, 7)]
    assert b"".join(chunks).rstrip(b"\0") == b"x" * min(length, 400)
    if length > 50:
        assert [b"\0" in chunk for chunk in chunks] == [False] * (len(chunks) - 1) + [True]
    else:
        assert len(chunks) == 1


def test_the_heartbeat_comes_once_a_second_with_and_without_data(sent: Sent) -> None:
    found = [one for step in range(100) for one in sent(*[message(solution())] * (step % 2), after_s=0.1)]
    beats = of("HEARTBEAT", found)
    assert len(beats) == 10
    assert all((b.type, b.autopilot) == (common.MAV_TYPE_FIXED_WING, common.MAV_AUTOPILOT_GENERIC) for b in beats)


def test_the_sequence_has_no_gap(sent: Sent) -> None:
    found = [one for _ in range(200) for one in sent(message(solution()), message(height()), after_s=0.1)]
    numbers = [one.get_seq() for one in found]
    assert all((after - before) % 256 == 1 for before, after in pairwise(numbers))


def test_times_are_since_the_first_output(sent: Sent) -> None:
    found = sent(message(solution())) + sent(message(solution(t_ns=T_NS + 10**9, t_valid_ns=T_NS + 10**9)))
    assert [one.time_boot_ms for one in of("ATTITUDE", found)] == [0, 1000]


# ------------------------------------------------------------------------------------------------ arbitrary messages


@pytest.mark.parametrize("output", [solution(), height(), integrity(IntegrityState.OK)], ids=lambda o: type(o).__name__)
def test_any_message_gives_right_frames(output: Any) -> None:
    @given(arbitrary_messages(output))
    @settings(max_examples=300, deadline=None)
    def check(published: PublishedMessage) -> None:
        with pytest.MonkeyPatch.context() as patch:
            Sent(patch)(published)

    check()


@given(arbitrary_messages(invalid_solution()))
@settings(max_examples=300, deadline=None)
def test_no_message_that_is_not_valid_gives_a_position(published: PublishedMessage) -> None:
    if json_field(published, "valid") is True:
        return
    with pytest.MonkeyPatch.context() as patch:
        found = Sent(patch)(published)
    assert not of("GLOBAL_POSITION_INT", found)
    assert not of("ALTITUDE", found)
    (status,) = of("SYS_STATUS", found)
    assert not status.onboard_control_sensors_health & common.MAV_SYS_STATUS_SENSOR_GPS


@given(arbitrary_messages(height(valid=False)))
@settings(max_examples=300, deadline=None)
def test_no_message_that_is_not_valid_gives_a_height(published: PublishedMessage) -> None:
    if json_field(published, "valid") is not True:
        with pytest.MonkeyPatch.context() as patch:
            assert not of("DISTANCE_SENSOR", Sent(patch)(published))


@pytest.mark.parametrize(
    "payload", [b"", b"[]", b'{"t_ns":1,"level":["error"],"source":"a","text":"b"}', b'{"level":"error"}']
)
def test_an_event_that_is_none_is_ignored(sent: Sent, payload: bytes) -> None:
    sent()
    assert sent(PublishedMessage("/event", payload, 1)) == []


@given(JSON_VALUES | st.dictionaries(st.sampled_from(["t_ns", "level", "source", "text"]), JSON_VALUES))
@settings(max_examples=300, deadline=None)
def test_any_event_gives_right_frames(fields: object) -> None:
    payload = json.dumps(fields).encode()
    with pytest.MonkeyPatch.context() as patch:
        Sent(patch)(PublishedMessage("/event", payload, 1))


def test_states_are_sent_again_after_a_failure(sent: Sent) -> None:
    sent(message(solution()))
    sent.sink.open()
    assert (common.MAV_SEVERITY_INFO, "position valid") in texts(sent(message(solution()), after_s=0.1))
    sent.sink.close()


# --------------------------------------------------------------------------------------------------------- mavutil


@contextmanager
def ground_station() -> Iterator[tuple[Any, int]]:
    """mavutil at a free port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with closing(mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}")) as station:
        yield station, port


def test_mavutil_sees_the_aircraft_and_its_commands_change_nothing() -> None:
    with ground_station() as (station, port):
        sink, is_over = MavlinkSink(MavlinkTable(udp=(f"127.0.0.1:{port}",), system=42), ignore), threading.Event()
        sink.open()

        def feed() -> None:
            while not is_over.wait(0.05):
                sink.send([message(solution()), message(height()), message(integrity(IntegrityState.CAUTION))])

        thread = threading.Thread(target=feed)
        thread.start()
        try:
            assert station.wait_heartbeat(timeout=10).get_srcSystem() == 42
            assert station.target_system == 42  # mavutil takes it for a vehicle
            position = station.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=10)
            assert (position.lat / 1e7, position.lon / 1e7) == pytest.approx((LAT_DEG, LON_DEG), abs=6e-8)
            distance = station.recv_match(type="DISTANCE_SENSOR", blocking=True, timeout=10)
            assert distance.current_distance == 12345
            for _ in range(5000):
                station.mav.command_long_send(42, 1, common.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, *[0] * 6)
            assert not station.recv_match(type="COMMAND_ACK", blocking=True, timeout=0.5)
            assert station.recv_match(type="ATTITUDE", blocking=True, timeout=10)
            assert sink.count_peers() == 1
        finally:
            is_over.set()
            thread.join()
            sink.close()


def test_mavutil_sees_states_as_texts() -> None:
    with (
        ground_station() as (station, port),
        closing(MavlinkSink(MavlinkTable(udp=(f"127.0.0.1:{port}",)), ignore)) as sink,
    ):
        sink.open()
        sink.send(
            [message(solution()), message(integrity(IntegrityState.ALERT, valid=False)), event("error", "y" * 120)]
        )
        found = []

        def received() -> list[str]:
            while one := station.recv_match(type="STATUSTEXT"):
                found.append(one.text)
            return found if len(found) == 5 else []

        assert sorted(until(received)) == sorted(
            ["position valid", "clearance integrity: alert", "ins: " + "y" * 45, "y" * 50, "y" * 25]
        )
