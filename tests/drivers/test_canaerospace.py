"""CANaerospace: data types, node services, emergency events, message codes, silent nodes, user-defined identifiers."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.canframe import pack_can
from fti.cli.decode import candump_frames
from fti.drivers import canaerospace as can
from fti.drivers.canaerospace.data_types import TYPES, decode_values
from fti.messages.measurements import (
    Ack,
    Airspeed,
    Attitude,
    DeviceStatus,
    DmeRange,
    Measurement,
    RadioHeight,
    Reading,
    Stamp,
    StaticPressure,
    Temperature,
)
from tests.helpers import ROOT

S = Stamp(1)
MS = 1_000_000
AIR_DATA = (ROOT / "configs/dbc/air_data_unit.dbc").read_text()
OWN_TABLE = """VERSION ""

NS_ :

BS_:

BU_: unit

BO_ 1600 airspeed: 8 unit
 SG_ node_id : 7|8@0+ (1,0) [0|255] "" Vector__XXX
 SG_ data_type : 15|8@0+ (1,0) [0|255] "" Vector__XXX
 SG_ service_code : 23|8@0+ (1,0) [0|255] "" Vector__XXX
 SG_ message_code : 31|8@0+ (1,0) [0|255] "" Vector__XXX
 SG_ calibrated_airspeed : 39|32@0- (-1,0) [-300|300] "kt" Vector__XXX
"""


def static_pressure(hpa: float, *, node: int = 1, code: int = 0) -> bytes:
    return pack_can(326, bytes([node, 2, 0, code]) + struct.pack(">f", hpa))


def typed(can_id: int, kind: int, data: bytes, *, node: int = 1, code: int = 0) -> bytes:
    return pack_can(can_id, bytes([node, kind, 0, code]) + data)


def feed(*frames: bytes, **keys: Any) -> tuple[list[Measurement], dict[str, int]]:
    decoder = can.make_decoder(can.Options(**keys))
    measurements = [m for frame in frames for m in decoder.feed(frame, 1)]
    assert decoder.counters.bytes_in == decoder.counters.framed + sum(decoder.counters.skipped.values())
    return measurements, dict(decoder.counters.skipped)


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (pack_can(250, bytes(8)), "other_id"),  # the users' own
        (pack_can(1950, bytes(8)), "other_id"),  # debugging
        (pack_can(326, bytes(8), extended=True), "other_id"),
        (pack_can(326, bytes(8), remote=True), "remote_frame"),
        (pack_can(4, bytes(8), error=True), "error_frame"),
        (typed(326, 2, bytes(3)), "bad_data"),  # a FLOAT has four bytes
        (typed(326, 6, bytes(4)), "bad_data"),  # a SHORT has two
        (typed(326, 32, bytes(4)), "bad_data"),  # reserved
        (typed(326, 100, bytes(4)), "bad_data"),  # the users' own type
        (pack_can(326, bytes(3)), "bad_data"),
        (pack_can(50, bytes(8)), "bad_data"),  # an emergency event has type 1
        (typed(129, 0, b""), "bad_data"),  # an identification has type 16
        (b"\x46\x01", "no_frame"),
        (bytes(17), "no_frame"),
    ],
)
def test_frames_that_say_nothing_are_counted_by_reason(frame: bytes, reason: str) -> None:
    assert feed(frame) == ([], {reason: len(frame)})


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_number_that_is_none_does_not_pass(value: float) -> None:
    assert feed(static_pressure(value)) == ([], {})
    found, _ = feed(typed(318, 2, struct.pack(">f", value)))
    assert found == [Reading(stamp=S, name="mach_number", value=None, valid=False)]


def test_one_node_can_be_chosen() -> None:
    found, skipped = feed(static_pressure(1000.0, node=1), static_pressure(900.0, node=2), node=2)
    assert found == [StaticPressure(stamp=S, p_static=90_000.0)]
    assert skipped == {"other_node": 16}


def test_a_vessel_speaks_of_other_things() -> None:
    """A real capture (NMEA 2000): every frame is taken, none is understood."""
    file = ROOT / "tests/captures/nmea2000_part1.candump.log"
    frames = [data for _, data in candump_frames(file.read_text().splitlines(), file)]
    assert len(frames) == 4000
    assert feed(*frames) == ([], {"other_id": 4000 * 16})


# ---------------------------------------------------------------------------------------------------- data types


def test_the_example_of_the_document_is_750_kelvin() -> None:
    """Section 5: SHORT2 16384 of 1500 K, printed as 750 K: the factor is rounded to 21.84 there."""
    found, _ = feed(typed(324, 12, struct.pack(">hh", 16384, 1500)))
    assert isinstance(found[0], Temperature)
    assert found[0].static == pytest.approx(750.0, abs=0.2)


def test_a_quantity_may_come_as_an_integer() -> None:
    found, _ = feed(typed(1071, 4, struct.pack(">I", 18_520)), typed(1072, 3, struct.pack(">i", 100)))
    assert [m.slant_range for m in found if isinstance(m, DmeRange)] == [18_520.0, 100.0]


@given(st.sampled_from(sorted(TYPES)), st.binary(max_size=8))
def test_a_type_takes_its_own_length_and_no_other(kind: int, data: bytes) -> None:
    if len(data) != TYPES[kind].layout.size:
        with pytest.raises(ValueError, match=TYPES[kind].name):
            decode_values(kind, data)
    else:
        decode_values(kind, data)


def test_halves_of_a_double_that_are_not_of_one_node_make_none() -> None:
    high, low = struct.pack(">d", 48.137154)[:4], struct.pack(">d", 48.137154)[4:]
    found, skipped = feed(typed(1036, 30, high, node=1), typed(1036, 31, low, node=2), typed(1036, 31, low, node=1))
    assert [m.value for m in found if isinstance(m, Reading)] == [48.137154]
    assert not skipped


# -------------------------------------------------------------------------------- emergency events, node services


def test_an_emergency_event_is_a_status() -> None:
    found, _ = feed(pack_can(10, bytes([7, 1, 0, 0, 3, 4]) + struct.pack(">h", -2)))
    flags = ("emergency_event", "node_7", "location_3", "operation_4", "error_-2")
    assert found == [DeviceStatus(stamp=S, ok=False, flags=flags)]


def test_an_identification_is_asked_for_and_answered() -> None:
    for node in ("0", "7"):
        request = can.command("identify", {"node": node}, can.Options())
        (answer,) = can.make_encoder(can.Options(node=7)).respond(request)
        found, _ = feed(request, answer)
        assert [m.accepted for m in found if isinstance(m, Ack)] == [True]
        assert "node_7" in next(m.flags for m in found if isinstance(m, DeviceStatus))
    assert can.make_encoder(can.Options(node=7)).respond(can.command("identify", {"node": "8"})) == []
    assert can.make_encoder(can.Options(node=7)).respond(answer) == []


def test_what_identify_takes_is_reported() -> None:
    with pytest.raises(ValueError, match=r"identify: node = '256'; allowed is 0 to 255"):
        can.command("identify", {"node": "256"})
    with pytest.raises(ValueError, match=r"identify: no argument 'nod'; there is node"):
        can.command("identify", {"nod": "2"})


def test_other_node_services_are_counted_by_name() -> None:
    decoder = can.make_decoder(can.Options())
    for frame in (typed(130, 0, b""), pack_can(2001, bytes([1, 0, 5, 0])), pack_can(128, bytes([1, 0, 100, 0]))):
        assert decoder.feed(frame, 1) == []
    assert decoder.counters.messages == {"ids_request": 1, "tis_response": 1, "service_100_request": 1}


# ---------------------------------------------------------------------------------------- lost, repeated, silent


def reported(measurements: list[Measurement]) -> list[str]:
    return [flag for m in measurements if isinstance(m, DeviceStatus) for flag in m.flags]


def test_message_codes_tell_what_was_lost_and_what_came_twice() -> None:
    decoder = can.make_decoder(can.Options())
    measurements = [m for code in (253, 254, 254, 1, 2) for m in decoder.feed(static_pressure(1000.0, code=code), 1)]
    assert reported(measurements) == ["static_pressure_repeated", "static_pressure_lost_2"]
    assert len([m for m in measurements if isinstance(m, StaticPressure)]) == 5
    assert decoder.counters.lost == {"static_pressure": 2}


def test_two_nodes_that_send_the_same_have_counters_of_their_own() -> None:
    frames = [static_pressure(1000.0, node=node, code=code) for code in (5, 6, 7) for node in (1, 2)]
    assert not reported(feed(*frames)[0])


def silences(frames: dict[int, bytes]) -> list[tuple[int, str]]:
    """What is told, and when [ms]; frames : by time [ms]."""
    decoder = can.make_decoder(can.Options())
    return [(t, flag) for t, frame in sorted(frames.items()) for flag in reported(decoder.feed(frame, 1 + t * MS))]


def test_a_node_that_falls_silent_is_reported_by_the_stamps_of_others() -> None:
    """Both send every 100 ms; node 2 stops after 1000 ms and comes back at 3000."""
    first = {t: static_pressure(1000.0, node=1, code=t // 100 % 256) for t in range(0, 4000, 100)}
    second = {t + 50: static_pressure(900.0, node=2, code=t // 100 % 256) for t in range(0, 1000, 100)}
    again = {t + 50: static_pressure(900.0, node=2, code=(t // 100 - 20) % 256) for t in range(3000, 4000, 100)}
    assert silences(first | second | again) == [(1500, "node_2_silent"), (3050, "node_2_back")]


def test_a_bus_that_is_silent_as_a_whole_is_reported_when_it_speaks_again() -> None:
    early = {t: static_pressure(1000.0, code=t // 100) for t in range(0, 1000, 100)}
    late = {t: static_pressure(1000.0, code=t // 100 - 40) for t in range(5000, 6000, 100)}
    assert silences(early | late) == [(5000, "node_1_silent"), (5000, "node_1_back")]


def test_a_node_whose_period_is_not_known_yet_is_not_silent() -> None:
    first = {t: static_pressure(1000.0, node=1, code=t // 100 % 256) for t in range(0, 9000, 100)}
    once = {t + 5: static_pressure(1000.0, node=2, code=t // 100) for t in (0, 100, 200)}
    assert silences(first | once) == []


# ------------------------------------------------------------------------------------------------- the emulator


def test_the_message_code_counts_per_identifier() -> None:
    encoder = can.make_encoder(can.Options())
    static = [encoder.encode(StaticPressure(stamp=S, p_static=1e5))[0] for _ in range(257)]
    (height,) = encoder.encode(RadioHeight(stamp=S, height_agl=1.0))
    assert [frame[8 + 3] for frame in static] == [*range(256), 0]
    assert height[8 + 3] == 0


def test_what_the_sensor_knows_to_be_wrong_is_not_sent() -> None:
    encoder = can.make_encoder(can.Options())
    assert encoder.encode(RadioHeight(stamp=S, height_agl=100.0, valid=False)) == []
    assert encoder.encode(RadioHeight(stamp=S, height_agl=None)) == []


def test_an_attitude_is_two_messages_and_comes_back_in_parts() -> None:
    frames = can.make_encoder(can.Options()).encode(Attitude(stamp=S, roll=0.5, pitch=-0.25, heading=1.0))
    found, _ = feed(*frames)
    parts = [m for m in found if isinstance(m, Attitude)]
    assert [m.pitch for m in parts if m.pitch is not None] == pytest.approx([-0.25])
    assert [m.roll for m in parts if m.roll is not None] == pytest.approx([0.5])


# --------------------------------------------------------------------------------------- identifiers of one's own


def test_a_dbc_is_the_table_of_identifiers() -> None:
    """Another identifier, knots, and a factor that turns the sign."""
    found, _ = feed(typed(1600, 2, struct.pack(">f", -100.0)), typed(1600, 2, struct.pack(">f", -301.0)), dbc=OWN_TABLE)
    speeds = [m for m in found if isinstance(m, Airspeed)]
    assert [m.cas for m in speeds] == pytest.approx([100 * 1852 / 3600, 301 * 1852 / 3600])
    assert [m.valid for m in speeds] == [True, False]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("garbage", "dbc: Invalid syntax at line 1, column 1"),
        (AIR_DATA, "dbc: message 'air_data_fast': must have the header node_id, .* use the driver dbc"),
        (OWN_TABLE.replace('"kt"', '"knots"'), "calibrated_airspeed: unit 'knots'; allowed here: m/s, kt"),
        (OWN_TABLE.split("BO_ 1600", maxsplit=1)[0], "dbc: contains no message"),
    ],
)
def test_a_wrong_dbc_is_refused_in_a_sentence(text: str, sentence: str) -> None:
    for make in (can.make_decoder, can.make_encoder):
        with pytest.raises(ValueError, match=sentence):
            make(can.Options(dbc=text))
