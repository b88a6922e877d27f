"""Any DBC: the compiled decoder against cantools, states, limits, multiplexers, CAN FD; wrong DBCs; a vessel's bus."""

from __future__ import annotations

import math
import re
import struct
from collections import Counter
from pathlib import Path
from typing import Any

import can
import cantools
import pytest
from cantools.database.errors import DecodeError
from hypothesis import given, settings
from hypothesis import strategies as st

from fti import config
from fti.canframe import EXTENDED, pack_can
from fti.cli.decode import candump_frames
from fti.config import bind
from fti.devices import bind_devices
from fti.drivers import dbc
from fti.drivers._dbc_frames import FrameBuilder
from fti.errors import ConfigError
from fti.formats.dbc_messages import read_layouts
from fti.formats.quantities import QUANTITIES
from fti.messages.measurements import (
    Airspeed,
    DeviceStatus,
    DmeRange,
    FlowAngles,
    ImpactPressure,
    Measurement,
    Position,
    PressureAltitude,
    Reading,
    Stamp,
    StaticPressure,
    Temperature,
    Velocity,
)
from tests.helpers import ROOT

S = Stamp(1)
AIR_DATA = (ROOT / "configs/dbc/air_data_unit.dbc").read_text()
VESSEL = (ROOT / "configs/dbc/nmea2000.dbc").read_text()
FEATURES = (ROOT / "tests/drivers/dbc/features.dbc").read_text()
CAPTURE = ROOT / "tests/captures/nmea2000_part1.candump.log"


def feed(text: str, *frames: bytes, **keys: Any) -> tuple[list[Measurement], dbc.Decoder]:
    decoder = dbc.make_decoder(dbc.Options(dbc=text, **keys))
    measurements = [m for i, frame in enumerate(frames) for m in decoder.feed(frame, 1 + i)]
    counters = decoder.counters
    assert counters.bytes_in == counters.framed + sum(counters.skipped.values())
    return measurements, decoder


def readings(measurements: list[Measurement]) -> dict[str, Reading]:
    return {m.name: m for m in measurements if isinstance(m, Reading)}


# ----------------------------------------------------------------------------------------- comparison with cantools


def signal_lines(layout: list[tuple[int, int, bool, bool]]) -> str:
    """Signals of 16 bytes that do not overlap: (start, length, big-endian, signed)."""
    lines = []
    for number, (start, length, big, signed) in enumerate(layout):
        first = start - start % 8 + 7 - start % 8 if big else start  # a Motorola signal is named by its first bit
        order, sign = "0" if big else "1", "-" if signed else "+"
        lines.append(f' SG_ s{number} : {first}|{length}@{order}{sign} (0.5,-3) [0|0] "V" Vector__XXX')
    return "\n".join(lines)


@st.composite
def layouts(draw: st.DrawFn) -> str:
    """A message of 16 bytes, of signals of one byte order, from bit 0 on, with gaps."""
    big, at, found = draw(st.booleans()), 0, []
    while at < 120:
        at += draw(st.integers(0, 5))
        length = draw(st.integers(1, min(40, 128 - at)))
        found.append((at, length, big, draw(st.booleans())))
        at += length
    return f'VERSION ""\n\nNS_ :\n\nBS_:\n\nBU_: a\n\nBO_ 291 m: 16 a\n{signal_lines(found)}\n'


@settings(max_examples=settings().max_examples // 3)  # two readings of a DBC each
@given(layouts(), st.binary(min_size=16, max_size=16))
def test_any_signal_is_cut_out_as_cantools_does(text: str, data: bytes) -> None:
    database: Any = cantools.database.load_string(text)
    expected = database.decode_message(291, data)
    found, _ = feed(text, pack_can(291, data, fd=True))
    assert {name: m.value for name, m in readings(found).items()} == {f"m.{k}": v for k, v in expected.items()}


@given(st.sampled_from([512, 512 | EXTENDED, 514]), st.binary(min_size=64, max_size=64))
def test_every_feature_is_decoded_as_cantools_does(word: int, noise: bytes) -> None:
    """Multiplexers, ranges of selectors, floats, FD; what cantools refuses has a selector that selects nothing."""
    database: Any = cantools.database.load_string(FEATURES)
    message = next(m for m in database.messages if (m.frame_id | EXTENDED * m.is_extended_frame) == word)
    data = noise[: message.length]
    found, decoder = feed(
        FEATURES, pack_can(message.frame_id, data, extended=message.is_extended_frame, fd=word == 514)
    )
    assert decoder.counters.messages == {message.name: 1}
    measurements = {name.partition(".")[2]: m for name, m in readings(found).items()}
    try:
        expected = message.decode(data, decode_choices=False)
    except DecodeError:
        assert {"page"} <= set(measurements) <= {"page", "part"}
        return
    assert set(measurements) == set(expected)
    for name, value in expected.items():
        stated = message.get_signal_by_name(name).choices or {}
        if math.isnan(value) or (name == "oil_temperature" and value + 40 in stated):
            assert (measurements[name].value, measurements[name].valid) == (None, False)
        else:
            assert measurements[name].value == value or not measurements[name].valid


@settings(max_examples=settings().max_examples // 3)
@given(layouts() | st.just(FEATURES), st.data())
def test_frames_are_built_as_cantools_does(text: str, data: st.DataObject) -> None:
    layout = data.draw(st.sampled_from(read_layouts(text)))
    chosen = {
        s.name: data.draw(
            st.sampled_from(sorted({c for other in layout.signals if other.selector == s.name for c in other.choices}))
        )
        for s in layout.selectors
    }
    raw: dict[str, float] = {}
    for s in layout.signals_for(chosen):
        numbers = st.integers(int(s.min_raw), int(s.max_raw)) if not s.is_float else st.floats(-1e4, 1e4, width=16)
        raw[s.name] = chosen[s.name] if s.name in chosen else data.draw(numbers)
    builder = FrameBuilder(layout)
    for name in [*raw][1:]:
        builder.set_raw(name, raw[name])
    first = next(iter(raw))
    assert builder.build({}) is None
    expected = layout.message.encode(raw, scaling=False, strict=False)
    fd = layout.length > 8
    assert builder.build({first: raw[first]}) == pack_can(layout.can_id, expected, extended=layout.extended, fd=fd)


@given(st.data())
def test_what_is_encoded_comes_back_to_half_a_bit(data: st.DataObject) -> None:
    database: Any = cantools.database.load_string(FEATURES)
    engine = database.messages[0]
    values = {"state": 2.0}
    for signal in engine.signals:
        if signal.name in ("speed", "torque"):
            values[signal.name] = data.draw(st.floats(float(signal.minimum), float(signal.maximum)))
    values["oil_temperature"] = data.draw(st.floats(-40.0, 214.0))
    encoder = dbc.make_encoder(dbc.Options(dbc=FEATURES))
    sent = [Reading(stamp=S, name=f"engine.{name}", value=value) for name, value in values.items()]
    (frame,) = [frame for reading in sent for frame in encoder.encode(reading)]
    measurements = readings(feed(FEATURES, frame)[0])
    for name, half in (("speed", 0.125), ("torque", 0.25), ("oil_temperature", 0.5)):
        assert measurements[f"engine.{name}"].value == pytest.approx(values[name], abs=half * (1 + 1e-9))


# --------------------------------------------------------------------------------------------------- a real bus


def test_a_vessels_bus_through_a_dbc() -> None:
    """4000 frames: how many of each python-can's reader and cantools find, and every value that they find."""
    database: Any = cantools.database.load_string(VESSEL)
    by_id = {m.frame_id: m for m in database.messages}
    counted: Counter[str] = Counter()
    expected: list[float] = []
    with can.CanutilsLogReader(CAPTURE) as log:
        for message in log:
            if message.is_extended_id and message.arbitration_id in by_id:
                known = by_id[message.arbitration_id]
                counted[known.name] += 1
                decoded = known.decode(bytes(message.data), decode_choices=False)
                expected += [float(value) for value in decoded.values()]
    found, decoder = feed(VESSEL, *(data for _, data in candump_frames(CAPTURE.read_text().splitlines(), CAPTURE)))
    assert decoder.counters.messages == counted == {
        "position": 787, "course_and_speed": 315, "water_depth": 74, "battery": 53,
    }  # fmt: skip
    assert decoder.counters.skipped == {"other_id": 16 * (4000 - sum(counted.values()))}
    assert len([m for m in found if not isinstance(m, DeviceStatus)]) == len(expected)
    valid = [m.value for m in found if isinstance(m, Reading) and m.valid]
    assert not Counter(valid) - Counter(expected)
    latitudes = [math.degrees(m.lat) for m in found if isinstance(m, Position) and m.lat is not None]
    assert (min(latitudes), max(latitudes)) == pytest.approx((37.92, 37.93), abs=0.01)


def test_not_available_is_no_number() -> None:
    found, _ = feed(VESSEL, pack_can(0x0DF50B11, bytes.fromhex("01FFFFFFFFFF7FFF"), extended=True))
    depth = readings(found)["water_depth.depth"]
    assert (depth.value, depth.valid, depth.text) == (None, False, "not_available")


# ----------------------------------------------------------------------------------------- states, limits, frames


def engine(**values: float | str) -> bytes:
    full = {"message_code": 0, "state": "running", "speed": 2400, "torque": 0, "oil_temperature": 85, **values}
    database: Any = cantools.database.load_string(FEATURES)
    return pack_can(512, database.encode_message("engine", full, strict=False))


def test_a_state_has_a_number_and_a_name() -> None:
    found, _ = feed(FEATURES, engine(state="failed"))
    assert readings(found)["engine.state"] == Reading(stamp=S, name="engine.state", value=15.0, text="failed")


def test_outside_its_limits_a_quantity_is_not_valid_either() -> None:
    """Angles of attack of 90 and 90.01 degrees; the DBC allows 90."""
    frames = (pack_can(0x18FEF100, struct.pack("<HHhh", 0, 0, angle, 0), extended=True) for angle in (9000, 9001))
    found, _ = feed(AIR_DATA, *frames)
    assert [m.valid for m in found if isinstance(m, FlowAngles) and m.aoa is not None] == [True, False]


def test_outside_its_limits_a_value_is_not_valid() -> None:
    found, _ = feed(FEATURES, engine(speed=8000.0), engine(message_code=1, speed=8000.25))
    speeds = [m for m in found if isinstance(m, Reading) and m.name == "engine.speed"]
    assert [(m.value, m.valid) for m in speeds] == [(8000.0, True), (8000.25, False)]


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (pack_can(513, bytes(8)), "other_id"),
        (pack_can(514, bytes(8), extended=True), "other_id"),
        (pack_can(512, bytes(8), remote=True), "remote_frame"),
        (pack_can(4, bytes(8), error=True), "error_frame"),
        (pack_can(512, bytes(7)), "bad_data"),
        (pack_can(512, bytes(8))[:15], "no_frame"),
        (pack_can(512, bytes(8))[:4] + b"\x09" + bytes(11), "no_frame"),
    ],
)
def test_frames_that_say_nothing_are_counted_by_reason(frame: bytes, reason: str) -> None:
    found, decoder = feed(FEATURES, frame)
    assert (found, dict(decoder.counters.skipped)) == ([], {reason: len(frame)})


def test_a_longer_frame_than_the_dbc_says_is_read_as_far_as_it_says() -> None:
    found, _ = feed(FEATURES, pack_can(514, bytes.fromhex("0102") + bytes(62), fd=True))
    assert readings(found)["frame_of_64.first"].value == 258.0
    found, _ = feed(FEATURES, pack_can(512, engine()[8:] + bytes(8), fd=True))
    assert readings(found)["engine.speed"].value == 2400.0


# ------------------------------------------------------------------------------------- lost, repeated, silent


def reported(measurements: list[Measurement]) -> list[str]:
    return [flag for m in measurements if isinstance(m, DeviceStatus) for flag in m.flags]


ALIVE = """VERSION ""

NS_ :

BS_:

BU_: a

BO_ 291 m: 2 a
 SG_ alive : 0|4@1+ (1,0) [0|14] "" a
 SG_ current : 8|8@1+ (0.1,0) [0|0.3] "A" a
"""


def test_a_counter_rolls_over_where_its_maximum_says() -> None:
    """0 to 14 in four bits is usual on road vehicles: 14 to 0 is no loss."""
    found, decoder = feed(ALIVE, *(pack_can(291, bytes([n % 15, 0])) for n in range(31)), counter="alive")
    assert not decoder.counters.lost
    assert not [m for m in found if isinstance(m, DeviceStatus)]


def test_a_value_at_its_limit_is_within_it() -> None:
    """3 * 0.1 is a little more than 0.3."""
    found, _ = feed(ALIVE, *(pack_can(291, bytes([0, raw])) for raw in (3, 4)))
    assert [m.valid for m in found if isinstance(m, Reading) and m.name == "m.current"] == [True, False]


def test_a_counter_shows_what_was_lost_and_what_came_twice() -> None:
    codes = (13, 14, 14, 1, 2)  # four bits: 15 and 0 never came
    found, decoder = feed(FEATURES, *(engine(message_code=code) for code in codes))
    assert reported(found) == ["engine_repeated", "engine_lost_2"]
    assert decoder.counters.lost == {"engine": 2}
    assert decoder.counters.messages == {"engine": 5}


def test_a_node_that_falls_silent_is_reported_at_a_frame_of_another() -> None:
    """The DBC says 100 ms; silent is five periods."""
    decoder = dbc.make_decoder(dbc.Options(dbc=FEATURES))
    other = pack_can(0x123, b"")
    ms = 1_000_000
    rows: list[tuple[int, str]] = []
    for t in range(0, 3000, 20):
        received = [] if 1000 < t <= 2000 else [engine(message_code=t // 100 % 16)] if t % 100 == 0 else []
        for frame in (*received, other):
            rows += [(t, flag) for flag in reported(decoder.feed(frame, 1 + t * ms))]
    assert rows[0] == (1520, "node_engine_silent")
    assert [flag for _, flag in rows[1:]] == ["engine_lost_10", "node_engine_back"]
    assert rows[1][0] == 2100


# ------------------------------------------------------------------------------------------------ another layout


def test_a_makers_air_data_unit() -> None:
    """configs/dbc/air_data_unit.dbc: 29 bits, little-endian, several signals in a frame, units of its own."""
    slow = struct.pack("<H", 11664) + (16404).to_bytes(3, "little") + struct.pack("<hB", 685, 1)
    found, _ = feed(AIR_DATA, pack_can(0x18FEF200, slow, extended=True))
    speed, altitude, temperature, heater = found
    assert isinstance(speed, Airspeed)
    assert isinstance(altitude, PressureAltitude)
    assert isinstance(temperature, Temperature)
    assert speed.cas == pytest.approx(116.64 * 1852 / 3600)
    assert altitude.alt_press == pytest.approx(1640.4 * 0.3048)
    assert temperature.static == pytest.approx(6.85 + 273.15)
    assert heater == Reading(stamp=S, name="air_data_slow.heater_state", value=1.0)


def test_a_frame_of_several_signals_waits_until_all_are_set() -> None:
    encoder = dbc.make_encoder(dbc.Options(dbc=AIR_DATA))
    before = (StaticPressure(stamp=S, p_static=95_000.0), ImpactPressure(stamp=S, q_c=1000.0))
    last = FlowAngles(stamp=S, aoa=0.1, aos=-0.05)
    assert [encoder.encode(m) for m in before] == [[], []]
    (frame,) = encoder.encode(last)
    assert feed(AIR_DATA, frame)[0][:2] == list(before)
    assert encoder.encode(last) == []  # the pressures must be told anew


def test_the_encoder_keeps_to_the_limits_of_the_dbc() -> None:
    encoder = dbc.make_encoder(dbc.Options(dbc=AIR_DATA))
    assert encoder.encode(StaticPressure(stamp=S, p_static=1e9)) == []
    encoder.encode(ImpactPressure(stamp=S, q_c=-1e9))
    (frame,) = encoder.encode(FlowAngles(stamp=S, aoa=9.0, aos=-9.0))
    pressure = feed(AIR_DATA, frame)[0][0]
    assert isinstance(pressure, StaticPressure)
    assert pressure.p_static == pytest.approx(131_070.0)


def test_a_quantity_in_a_unit_that_does_not_measure_it_is_a_reading() -> None:
    text = AIR_DATA.replace('"kt"', '"knots"')
    slow = struct.pack("<H", 11664) + bytes(6)
    found, _ = feed(text, pack_can(0x18FEF200, slow, extended=True))
    assert not any(isinstance(m, Airspeed) for m in found)
    assert readings(found)["air_data_slow.calibrated_airspeed"].unit == "knots"


def test_signals_may_overlap_and_those_of_no_message_are_left_alone() -> None:
    """Both are usual in DBCs that editors write."""
    independent = 'BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX\n SG_ spare : 0|8@1+ (1,0) [0|0] "" X\n\n'
    overlapping = ' SG_ both : 0|32@1+ (1,0) [0|0] "" Vector__XXX\n\nCM_ BO_'
    text = AIR_DATA.replace("BO_ 2566844672", independent + "BO_ 2566844672", 1).replace("\nCM_ BO_", overlapping, 1)
    data = bytes(range(1, 9))
    found, _ = feed(text, pack_can(0x18FEF200, data, extended=True))
    assert readings(found)["air_data_slow.both"].value == int.from_bytes(data[:4], "little")
    assert readings(found)["air_data_slow.heater_state"].value == 8.0


# ---------------------------------------------------------------------------------------------------- wrong DBCs


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("garbage", "dbc: Invalid syntax at line 1, column 1"),
        (AIR_DATA.replace(": 0|16@1+", "0|16@1+", 1), r"dbc: Invalid syntax at line 10, column 22"),
        (
            AIR_DATA.replace(": 48|16@1-", ": 60|16@1-"),
            "dbc: signal 'sideslip' does not fit into the 8 bytes of its message",
        ),
        (re.sub(r"BO_ .*", "", AIR_DATA, flags=re.DOTALL), "dbc: contains no message"),
        (
            ALIVE + ALIVE.partition("BU_: a\n")[2].replace(" m:", " n:"),
            "dbc: messages 'm' and 'n' have the same identifier 291",
        ),
    ],
)
def test_a_wrong_dbc_is_refused_in_a_sentence(text: str, sentence: str) -> None:
    for make in (dbc.make_decoder, dbc.make_encoder):
        with pytest.raises(ValueError, match=sentence):
            make(dbc.Options(dbc=text))


def test_a_counter_that_no_message_has_is_refused_where_it_is_stated() -> None:
    with pytest.raises(ValueError, match="counter = 'alife': no message of the DBC has such a signal"):
        dbc.make_decoder(dbc.Options(dbc=ALIVE, counter="alife"))
    assert dbc.make_decoder(dbc.Options(dbc=ALIVE))
    assert dbc.make_decoder(dbc.Options(dbc=ALIVE, counter=""))


def test_an_empty_file_is_not_the_built_in_dbc(tmp_path: Path) -> None:
    text = """
        session = { name = "bus", directory = "out" }
        link = [{ name = "bus", kind = "can", interface = "socketcan", channel = "can0" }]
        device = [{ name = "unit", link = "bus", driver = "canaerospace", options = { dbc_file = "unit.dbc" } }]
    """
    (tmp_path / "bus.toml").write_text(text)
    (tmp_path / "unit.dbc").write_text("\n")
    with pytest.raises(ConfigError, match=r"device\[0\].options.dbc_file = 'unit.dbc': the file is empty"):
        bind_devices(config.load(tmp_path / "bus.toml"))


def test_the_option_names_a_file_and_carries_its_text() -> None:
    options = bind(dbc.Options, {"dbc_file": "air_data_unit.dbc", "dbc": AIR_DATA}, "x.toml")
    assert dbc.make_decoder(options).counters.bytes_in == 0


def test_a_maker_makes_the_measurement_of_its_quantity() -> None:
    station = QUANTITIES["dme_1_distance"].maker()(Stamp(1), 2.0, False)
    assert station == DmeRange(stamp=Stamp(1), station="dme_1", slant_range=2.0, valid=False)
    assert QUANTITIES["vertical_speed"].maker()(Stamp(1), 2.0, True) == Velocity(stamp=Stamp(1), down=-2.0)
