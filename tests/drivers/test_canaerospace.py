"""CAN through a DBC: other frames, other nodes, another maker's layout, wrong DBCs."""

from __future__ import annotations

import math
import re
import struct

import pytest

from fti.canframe import pack_can
from fti.cli.decode import candump_frames
from fti.config import bind
from fti.drivers import canaerospace as can
from fti.types import (
    Airspeed,
    Attitude,
    FlowAngles,
    ImpactPressure,
    Measurement,
    PressureAltitude,
    RadioHeight,
    Stamp,
    StaticPressure,
    Temperature,
)
from tests.helpers import ROOT

S = Stamp(1)
MAKERS_DBC = (ROOT / "configs/dbc/air_data_unit.dbc").read_text()


def static_pressure(hpa: float, *, node: int = 1, kind: int = 2) -> bytes:
    return pack_can(326, bytes([node, kind, 0, 0]) + struct.pack(">f", hpa))


def feed(*frames: bytes, options: can.Options | None = None) -> tuple[list[Measurement], dict[str, int]]:
    decoder = can.make_decoder(options or can.Options())
    found = [m for frame in frames for m in decoder.feed(frame, 1)]
    assert decoder.counters.bytes_in == decoder.counters.framed + sum(decoder.counters.skipped.values())
    return found, dict(decoder.counters.skipped)


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (pack_can(327, bytes(8)), "other_id"),
        (pack_can(326, bytes(8), extended=True), "other_id"),
        (pack_can(326, bytes(8), remote=True), "remote_frame"),
        (pack_can(4, bytes(8), error=True), "error_frame"),
        (static_pressure(1000.0, kind=12), "bad_data"),  # SHORT2: two numbers that need each other
        (pack_can(326, bytes(4)), "bad_data"),
        (b"\x46\x01", "no_frame"),
        (bytes(17), "no_frame"),
    ],
)
def test_frames_that_say_nothing_are_counted_by_reason(frame: bytes, reason: str) -> None:
    assert feed(frame) == ([], {reason: len(frame)})


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_number_that_is_none_does_not_pass(value: float) -> None:
    assert feed(static_pressure(value)) == ([], {})


def test_one_node_can_be_chosen() -> None:
    found, skipped = feed(static_pressure(1000.0, node=1), static_pressure(900.0, node=2), options=can.Options(node=2))
    assert found == [StaticPressure(stamp=S, p_static=90_000.0)]
    assert skipped == {"other_node": 16}


def test_a_vessel_speaks_of_other_things() -> None:
    """A real capture (NMEA 2000): every frame is taken, none is understood."""
    file = ROOT / "tests/captures/nmea2000_part1.candump.log"
    frames = [data for _, data in candump_frames(file.read_text(), file)]
    assert len(frames) == 4000
    assert feed(*frames) == ([], {"other_id": 4000 * 16})


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


# ---------------------------------------------------------------------------------------------- another layout


def test_a_makers_own_layout_is_a_dbc() -> None:
    """configs/dbc/air_data_unit.dbc: 29 bits, little-endian, several signals in a frame, units of its own."""
    options = can.Options(dbc=MAKERS_DBC)
    slow = struct.pack("<H", 11664) + (16404).to_bytes(3, "little") + struct.pack("<hB", 685, 1)
    found, skipped = feed(pack_can(0x18FEF200, slow, extended=True), static_pressure(1000.0), options=options)
    assert [type(m) for m in found] == [Airspeed, PressureAltitude, Temperature]
    speed, altitude, temperature = found
    assert isinstance(speed, Airspeed)
    assert isinstance(altitude, PressureAltitude)
    assert isinstance(temperature, Temperature)
    assert speed.cas == pytest.approx(116.64 * 1852 / 3600)
    assert altitude.alt_press == pytest.approx(1640.4 * 0.3048)
    assert temperature.static == pytest.approx(6.85 + 273.15)
    assert skipped == {"other_id": 16}


def test_a_frame_of_several_signals_waits_until_all_are_told() -> None:
    encoder = can.make_encoder(can.Options(dbc=MAKERS_DBC))
    told = (StaticPressure(stamp=S, p_static=95_000.0), ImpactPressure(stamp=S, q_c=1000.0))
    last = FlowAngles(stamp=S, aoa=0.1, aos=-0.05)
    assert [encoder.encode(m) for m in told] == [[], []]
    (frame,) = encoder.encode(last)
    found, _ = feed(frame, options=can.Options(dbc=MAKERS_DBC))
    assert found[:2] == list(told)
    assert encoder.encode(last) == []  # the pressures must be told anew


def test_the_encoder_keeps_to_the_limits_of_the_dbc() -> None:
    encoder = can.make_encoder(can.Options(dbc=MAKERS_DBC))
    assert encoder.encode(StaticPressure(stamp=S, p_static=1e9)) == []
    encoder.encode(ImpactPressure(stamp=S, q_c=-1e9))
    (frame,) = encoder.encode(FlowAngles(stamp=S, aoa=9.0, aos=-9.0))
    found, _ = feed(frame, options=can.Options(dbc=MAKERS_DBC))
    assert isinstance(found[0], StaticPressure)
    assert found[0].p_static == pytest.approx(131_070.0)


# --------------------------------------------------------------------------------------------------- wrong DBCs


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("garbage", "dbc: Invalid syntax at line 1, column 1"),
        (MAKERS_DBC.replace(": 0|16@1+", "0|16@1+", 1), r"dbc: Invalid syntax at line 10, column 22"),
        (MAKERS_DBC.replace(": 48|16@1-", ": 60|16@1-"), "dbc: The signal sideslip does not fit"),
        (MAKERS_DBC.replace('"kt"', '"knots"'), "calibrated_airspeed: unit 'knots'; allowed here: m/s, kt"),
        (re.sub(r"SG_ \w+ :", "SG_ x :", MAKERS_DBC, count=1).split("BO_ 2566844928")[0].split("SG_ impact")[0],
         "dbc: no signal has a name that is understood; those are radio_height"),
    ],
)  # fmt: skip
def test_a_wrong_dbc_is_refused_in_a_sentence(text: str, sentence: str) -> None:
    for make in (can.make_decoder, can.make_encoder):
        with pytest.raises(ValueError, match=sentence):
            make(can.Options(dbc=text))


def test_the_option_names_a_file_and_carries_its_text() -> None:
    options = bind(can.Options, {"dbc_file": "air_data_unit.dbc", "dbc": MAKERS_DBC}, "x.toml")
    assert can.make_decoder(options).counters.bytes_in == 0
