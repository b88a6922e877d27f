"""Configured binary frames; two of them are compared with drivers that have their own code."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti import config, drivers
from fti.drivers import binary_struct as bs
from fti.errors import ConfigError
from fti.messages.measurements import Measurement, RadioHeight, Range, Reading, Stamp, Velocity

S = Stamp(1)
ONE = {"sync": "a5", "length": 3, "fields": [{"name": "x", "at": 1, "type": "u16"}]}
#: LightWare's packet 44 with one output.
LWNX = {
    "sync": "aa",
    "length_in": {"at": 1, "type": "u16", "bits": [6, 10], "plus": 5},
    "checksum": {"kind": "crc16_xmodem"},
    "where": [{"at": 3, "type": "u8", "value": 44}],
    "fields": [{"name": "slant_range", "at": 4, "type": "i16", "scale": 0.01, "lost": [13000]}],
}
#: The radar altimeter RA-4500.
RA4500 = {
    "sync": "10 df 03",
    "length": 9,
    "byte_order": "big",
    "trailer": "1003",
    "fields": [
        {"name": "radio_height", "at": 3, "type": "u16", "unit": "ft", "needs": ["_failed", "_unlocked"]},
        {"name": "_failed", "at": 5, "type": "u8", "bits": [1, 2], "good": [0]},
        {"name": "_unlocked", "at": 5, "type": "u8", "bits": [3, 1], "good": [0]},
    ],
}


def options(table: dict[str, Any], **more: Any) -> bs.Options:
    return config.bind(bs.Options, {**table, **more}, "a.toml", "options")


def decoded(data: bytes, table: dict[str, Any]) -> list[Measurement]:
    return bs.make_decoder(options(table)).feed(data, 1)


def values(data: bytes, table: dict[str, Any]) -> list[float | None]:
    return [m.value for m in decoded(data, table) if isinstance(m, Reading)]


@pytest.mark.parametrize(
    ("kind", "order", "data", "value"),
    [
        ("u8", "little", "ff", 255.0),
        ("i8", "little", "ff", -1.0),
        ("u16", "little", "0201", 258.0),
        ("u16", "big", "0102", 258.0),
        ("i16", "big", "fffe", -2.0),
        ("u32", "big", "00010000", 65536.0),
        ("i32", "little", "00000080", -2147483648.0),
        ("u64", "little", "0100000000000000", 1.0),
        ("i64", "big", "ffffffffffffffff", -1.0),
        ("f32", "big", "41480000", 12.5),
        ("f64", "little", "0000000000002940", 12.5),
    ],
)
def test_numbers_are_read_by_type_and_byte_order(kind: str, order: str, data: str, value: float) -> None:
    fields = [{"name": "x", "at": 1, "type": kind}]
    table = {"sync": "a5", "length": 1 + len(data) // 2, "byte_order": order, "fields": fields}
    frame = bytes.fromhex("a5" + data)
    assert values(frame, table) == [value]
    assert bs.make_encoder(options(table)).encode(Reading(stamp=S, name="x", value=value)) == [frame]


def test_bits_of_one_byte_are_fields_of_their_own() -> None:
    fields = [
        {"name": n, "at": 1, "type": "u8", "bits": bits} for n, bits in (("a", [0, 1]), ("b", [1, 3]), ("c", [4, 4]))
    ]
    table = {"sync": "a5", "length": 2, "fields": fields}
    assert values(b"\xa5\xb6", table) == [0.0, 3.0, 11.0]
    encoder = bs.make_encoder(options(table))
    sent = [
        f for n, v in (("a", 0.0), ("b", 3.0), ("c", 11.0)) for f in encoder.encode(Reading(stamp=S, name=n, value=v))
    ]
    assert sent == [b"\xa5\xb6"]


@pytest.mark.parametrize("cm", [1, 1234, 12999, 13000, 13001, 32767])
def test_a_described_packet_is_that_of_the_driver_with_code(cm: int) -> None:
    lightware = drivers.load("lightware_binary")
    coded = lightware.Options(outputs=("first_raw",), lost_m=(130.0,))  # type: ignore[call-arg]
    (packet,) = lightware.make_encoder(coded).encode(Range(stamp=S, slant_range=cm * 0.01))
    expected = lightware.make_decoder(coded).feed(packet, 1)
    (found,) = decoded(packet, LWNX)
    assert isinstance(found, Range)
    assert isinstance(expected[0], Range)
    assert found.valid is expected[0].valid is (cm != 13000)
    if found.valid:
        assert found.slant_range == pytest.approx(expected[0].slant_range)
        assert bs.make_encoder(options(LWNX)).encode(found) == [packet]


@pytest.mark.parametrize(
    ("height", "status", "valid"), [(500, 0x10, True), (0x1003, 0x11, True), (7, 2, False), (7, 8, False)]
)
def test_the_radar_altimeter_needs_no_code_either(height: int, status: int, valid: bool) -> None:
    frame = b"\x10\xdf\x03" + height.to_bytes(2, "big") + bytes([status, 0]) + b"\x10\x03"
    (found,) = decoded(frame * 2, RA4500)[:1]
    _, coded = drivers.load("freeflight_ra4500").make_decoder(_defaults()).feed(frame, 1)
    assert isinstance(found, RadioHeight)
    assert isinstance(coded, RadioHeight)
    assert found.valid is coded.valid is valid
    assert found.height_agl == (pytest.approx(height * 0.3048) if valid else None)


def _defaults() -> config.StrictModel:
    return drivers.load("freeflight_ra4500").Options()


def test_frames_of_others_are_framed_and_counted() -> None:
    decoder = bs.make_decoder(options(LWNX))
    other = drivers.load("lightware_binary").command("identify", {})
    assert decoder.feed(other, 1) == []
    assert decoder.counters.messages == {"(other)": 1}
    assert decoder.counters.framed == len(other)


def test_a_length_that_cannot_be_costs_one_byte() -> None:
    decoder = bs.make_decoder(options(LWNX, longest=64))
    (good,) = bs.make_encoder(options(LWNX)).encode(Range(stamp=S, slant_range=5.0))
    assert decoder.feed(b"\xaa\xff\xff" + b"\xaa\x00\x00" + good, 1) == [Range(stamp=S, slant_range=5.0)]
    assert decoder.counters.skipped == {"bad_length": 1, "bad_checksum": 1, "no_sync": 4}


def test_a_field_behind_the_end_of_a_short_frame_says_nothing() -> None:
    table = {**LWNX, "fields": [*LWNX["fields"], {"name": "x", "at": 6, "type": "u8"}]}
    short = bs.make_encoder(options(LWNX)).encode(Range(stamp=S, slant_range=5.0))[0]
    measurements = decoded(short, table)
    # the byte where x would be belongs to the checksum, and a checksum is no value of a field
    assert measurements == [Range(stamp=S, slant_range=5.0), Reading(stamp=S, name="x", value=None, valid=False)]


@pytest.mark.parametrize("kind", ["xor8", "sum8", "sum16", "crc16_arc", "crc16_modbus", "crc16_kermit", "crc32"])
@pytest.mark.parametrize("order", ["little", "big"])
def test_a_checksum_refuses_every_changed_bit(kind: str, order: str) -> None:
    size = {"xor8": 1, "sum8": 1, "crc32": 4}.get(kind, 2)
    table = {**ONE, "length": 3 + size, "byte_order": order, "checksum": {"kind": kind, "start": 1}}
    (frame,) = bs.make_encoder(options(table)).encode(Reading(stamp=S, name="x", value=4660.0))
    assert values(frame, table) == [4660.0]
    for bit in range(8, 8 * len(frame)):
        changed = bytearray(frame)
        changed[bit // 8] ^= 1 << bit % 8
        assert values(bytes(changed), table) == [], bit


def test_a_checksum_may_stand_before_a_trailer_or_at_a_place() -> None:
    for checksum in ({"kind": "sum8", "at": -2, "start": 1}, {"kind": "sum8", "at": 3, "start": 1}):
        table = {**ONE, "length": 5, "trailer": "0d", "checksum": checksum}
        assert values(b"\xa5\x01\x02\x03\x0d", table) == [513.0]
        assert values(b"\xa5\x01\x02\x04\x0d", table) == []
        assert values(b"\xa5\x01\x02\x03\x0a", table) == []


def test_values_that_do_not_fit_become_the_nearest() -> None:
    encoder = bs.make_encoder(options(ONE))
    for value, data in ((-5.0, "0000"), (70000.0, "ffff"), (1.4, "0100")):
        assert encoder.encode(Reading(stamp=S, name="x", value=value)) == [bytes.fromhex("a5" + data)]
    assert encoder.encode(Reading(stamp=S, name="x", value=float("nan"))) == []


def test_units_become_si() -> None:
    """250 tenths of a knot are 25 kt, and those are 12.8611 m/s."""
    fields = [{"name": "ground_speed", "at": 1, "type": "u16", "scale": 0.1, "unit": "kt"}]
    (found,) = decoded(b"\xa5\xfa\x00", {**ONE, "fields": fields})
    assert isinstance(found, Velocity)
    assert found.ground_speed == pytest.approx(12.8611, abs=1e-4)


def test_a_number_that_is_none_is_not_valid() -> None:
    fields = [{"name": "x", "at": 1, "type": "f32"}]
    measurements = decoded(b"\xa5" + struct.pack("<f", float("nan")), {"sync": "a5", "length": 5, "fields": fields})
    assert measurements == [Reading(stamp=S, name="x", value=None, valid=False)]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"sync": ""}, "sync: must be given"),
        ({"length": None}, "length: one of length and length_in must be given"),
        ({"length_in": {"at": 1, "type": "u8"}}, "length: one of length and length_in must be given"),
        ({"length": 2}, "x: ends at byte 3, the data at 2"),
        ({"trailer": "0d0a0d0a"}, "shorter than sync, checksum and trailer"),
        ({"where": [{"at": 9, "type": "u8", "value": 1}]}, "where: ends at byte 10, the data at 3"),
        ({"checksum": {"kind": "crc16_xmodem", "at": 2}}, "a frame encoded as described cannot be decoded"),
        (
            {"fields": [{"name": "x", "at": 1, "type": "i16", "bits": [0, 4]}]},
            "fields: x: bits = [0, 4]: must lie in a u8",
        ),
        (
            {"fields": [{"name": "x", "at": 1, "type": "u8", "bits": [5, 4]}]},
            "fields: x: bits = [5, 4]: must lie in a u8",
        ),
        ({"fields": []}, "fields: must be given where length, sync is"),
        (
            {"fields": [{"name": "x", "at": 1, "type": "u16", "lost": [-1]}]},
            "fields: x: lost: -1 does not fit; allowed are whole numbers from 0 to 65535",
        ),
        (
            {"fields": [{"name": "x", "at": 1, "type": "i16", "lost": [0x8000]}]},
            "fields: x: lost: 32768 does not fit; allowed are whole numbers from -32768 to 32767",
        ),
        (
            {"fields": [{"name": "x", "at": 1, "type": "u8", "bits": [0, 2], "good": [4]}]},
            "fields: x: good: 4 does not fit; allowed are whole numbers from 0 to 3",
        ),
        (
            {"fields": [{"name": "x", "at": 1, "type": "u16", "lost": ["FFFF"]}]},
            "fields: x: lost: 'FFFF' is text; a frame has only numbers",
        ),
        (
            {"length": 5, "fields": [{"name": "x", "at": 1, "type": "f32", "lost": [1e300]}]},
            "fields: x: lost: 1e+300 is too large for this type",
        ),
        (
            {"where": [{"at": 1, "type": "u8", "value": 300}]},
            "where[0]: value = 300 does not fit; allowed are whole numbers from 0 to 255",
        ),
    ],
)
def test_a_wrong_description_is_one_sentence(change: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError) as caught:
        bs.make_decoder(options({**ONE, **change}))
    assert sentence in str(caught.value)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"sync": "5"}, "a.toml: options.sync = '5': string should match pattern"),
        ({"fields": [{"name": "x", "at": 1, "type": "u24"}]}, "options.fields[0].type = 'u24': input should be 'u8'"),
        ({"fields": [{"name": "x", "type": "u8"}]}, "options.fields[0].at: missing; it must be given"),
        ({"on_connect": ["xy"]}, "options.on_connect[0] = 'xy': string should match pattern"),
    ],
)
def test_a_wrong_key_is_one_sentence_with_file_and_place(change: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ConfigError) as caught:
        options({**ONE, **change})
    assert sentence in str(caught.value)


def test_bytes_can_be_sent_and_asked() -> None:
    assert bs.command("send", {"hex": "5A 04 04 62"}) == bytes.fromhex("5a040462")
    for args in ({}, {"hex": ""}, {"hex": "5"}, {"hex": "00" * 257}, {"hex": "00", "x": ""}):
        with pytest.raises(ValueError, match="send: "):
            bs.command("send", args)
    requests = options(ONE, poll={"every_s": 0.1, "send": "5A0404"}, on_connect=["5A05"])
    assert bs.poll(requests) == (0.1, b"\x5a\x04\x04")
    assert bs.on_connect(requests) == [b"\x5a\x05"]
    encoder = bs.make_encoder(requests)
    assert encoder.encode(Reading(stamp=S, name="x", value=1.0)) == []
    assert encoder.respond(b"\x5a\x04\x04") == [b"\xa5\x01\x00"]


def test_a_lost_number_is_what_its_type_makes_of_it() -> None:
    """999.9 as a float of four bytes is 999.9000244."""
    fields = [{"name": "slant_range", "at": 1, "type": "f32", "lost": [999.9]}]
    data = b"\xa5" + struct.pack("<f", 999.9) + b"\xa5" + struct.pack("<f", 999.8)
    measurements = decoded(data, {"sync": "a5", "length": 5, "fields": fields})
    assert [m.valid for m in measurements if isinstance(m, Range)] == [False, True]


def test_numbers_high_byte_first_and_the_checksum_low_byte_first() -> None:
    """Modbus RTU: the question that the maker of the laser TW10S prints, 01 03, register 15, two of them, F4 08."""
    fields = [{"name": "register", "at": 2, "type": "u16"}, {"name": "count", "at": 4, "type": "u16"}]
    checksum = {"kind": "crc16_modbus", "byte_order": "little"}
    table = {"sync": "0103", "length": 8, "byte_order": "big", "fields": fields, "checksum": checksum}
    assert values(bytes.fromhex("0103000f0002f408"), table) == [15.0, 2.0]
    assert values(bytes.fromhex("0103000f000208f4"), table) == []
    measurements = decoded(bytes.fromhex("0103000f0002f408"), table)
    encoder = bs.make_encoder(options(table))
    assert [frame for m in measurements for frame in encoder.encode(m)] == [bytes.fromhex("0103000f0002f408")]


@given(st.binary(max_size=200))
def test_without_its_checksum_nothing_is_taken(garbage: bytes) -> None:
    for m in decoded(garbage, LWNX):
        raise AssertionError(m)
