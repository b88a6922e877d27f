"""ARINC 429 words in packets: bus, time and error flags, damaged packets, maximum sizes."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.config import bind
from fti.drivers import arinc429
from fti.drivers.arinc429 import word as wire
from fti.drivers.arinc429.apmp import Apmp
from fti.drivers.arinc429.chapter10 import HEADER, Chapter10
from fti.drivers.arinc429.packets import Packets
from fti.drivers.arinc429.word import BnrState
from fti.messages.measurements import Attitude, Measurement, RadioHeight, Stamp, TimeScale
from tests.drivers.vectorfiles import load

FOOT = 0.3048
KINDS: dict[str, type[Apmp | Chapter10]] = {"apmp": Apmp, "chapter10": Chapter10}
each_kind = pytest.mark.parametrize("kind", KINDS)


def height_word(height_ft: float) -> int:
    return wire.encode_bnr("164", height_ft, 8192.0, 16, state=BnrState.NORMAL)


def options(**changes: object) -> arinc429.Options:
    return bind(arinc429.Options, changes, "test.toml")


def decoder(kind: str, **changes: object) -> arinc429.Decoder:
    return arinc429.make_decoder(options(packets=kind, **changes))


def heights(results: list[Measurement]) -> list[float]:
    measurements = [m.height_agl for m in results if isinstance(m, RadioHeight)]
    return [round(height / FOOT, 6) for height in measurements if height is not None]


def packet(kind: str, *heights_ft: float, bus: int = 0, packer: Packets | None = None) -> bytes:
    return (packer or KINDS[kind]()).pack([height_word(h) for h in heights_ft], bus, 1_000_000_000)


# ------------------------------------------------------------------------------------------------------------ both


@each_kind
def test_a_word_has_the_time_of_the_maker_of_packets(kind: str) -> None:
    sent = Attitude(stamp=Stamp(5, 3_600_000_000_100, TimeScale.BOOT), pitch=0.1, roll=-0.1)
    (data,) = arinc429.make_encoder(options(packets=kind, set="ahrs")).encode(sent)
    measurements = decoder(kind, set="ahrs").feed(data, 9)
    assert [m.stamp for m in measurements] == [Stamp(9, 3_600_000_000_100, TimeScale.BOOT)] * 2


@each_kind
def test_only_the_configured_bus_is_received(kind: str) -> None:
    data = packet(kind, 100.0, bus=2) + packet(kind, 200.0, 300.0, bus=3)
    assert heights(decoder(kind).feed(data, 1)) == [100.0, 200.0, 300.0]
    chosen = decoder(kind, bus=3)
    assert heights(chosen.feed(data, 1)) == [200.0, 300.0]
    assert chosen.counters.messages == {"radio_height": 2, "other_bus": 1}


@each_kind
def test_a_word_in_bad_parity_is_counted_and_nothing_more(kind: str) -> None:
    data = KINDS[kind]().pack([height_word(100.0) ^ 1 << 20, height_word(200.0)], 0, 0)
    reference = decoder(kind)
    assert heights(reference.feed(data, 1)) == [200.0]
    assert reference.counters.messages == {"bad_parity": 1, "radio_height": 1}
    assert len(heights(decoder(kind, parity="none").feed(data, 1))) == 2


@each_kind
def test_labels_that_the_card_has_turned(kind: str) -> None:
    (data,) = arinc429.make_encoder(options(packets=kind, label_reversed=False)).encode(
        RadioHeight(stamp=Stamp(0), height_agl=100.0 * FOOT)
    )
    assert heights(decoder(kind, label_reversed=False).feed(data, 1)) == [100.0]
    assert heights(decoder(kind).feed(data, 1)) == []


@each_kind
def test_packets_that_never_came_are_counted_and_a_new_beginning_is_none(kind: str) -> None:
    packer = KINDS[kind]()
    data = [packer.pack([height_word(100.0)], 0, k * 1_000_000) for k in range(10)]
    measurements = decoder(kind)
    for k in (0, 1, 4, 5, 9, 0, 1):
        measurements.feed(data[k], 1)
    assert measurements.counters.lost == {kind: 2 + 3}


@each_kind
@given(st.integers(0, 50), st.binary(max_size=20))
def test_the_next_whole_packet_is_found_after_a_broken_one(kind: str, lost: int, noise: bytes) -> None:
    broken = packet(kind, 100.0, 101.0)
    result = decoder(kind)
    measurements = heights(result.feed(broken[: len(broken) - lost - 1] + noise + packet(kind, 200.0, bus=1) * 3, 1))
    assert measurements[-2:] == [200.0, 200.0]
    assert result.counters.held < 64


# ------------------------------------------------------------------------------------------------------------ APMP


def test_the_converter_says_what_it_does_not_believe() -> None:
    """Bit 31 of the control word; and a status whose low half is not zero."""
    good = packet("apmp", 100.0, 200.0)
    marked = good[:48] + bytes([0x80]) + good[49:]
    measurements = decoder("apmp")
    assert heights(measurements.feed(marked, 1)) == [200.0]
    assert measurements.counters.messages == {"bus_error": 1, "radio_height": 1}
    bad_status = good[:8] + struct.pack(">I", 0x00010002) + good[12:]
    measurements = decoder("apmp")
    assert heights(measurements.feed(bad_status + good, 1)) == [100.0, 200.0]
    assert measurements.counters.messages == {"bad_status": 1, "radio_height": 2}


@pytest.mark.parametrize(
    ("at", "value", "reason"), [(0, 2, "bad_mode"), (28, 1392, "bad_length"), (28, 17, "bad_length")]
)
def test_what_is_no_packet_of_words_is_skipped(at: int, value: int, reason: str) -> None:
    data = bytearray(packet("apmp", 100.0))
    data[at : at + 4] = struct.pack(">I", value)
    measurements = decoder("apmp")
    assert heights(measurements.feed(bytes(data) + packet("apmp", 200.0), 1)) == [200.0]
    assert measurements.counters.skipped[reason] == 1


def test_a_length_that_reaches_over_other_packets_is_not_waited_for() -> None:
    """The last byte of the header has become 240, where three packets of 64 bytes follow."""
    broken = packet("apmp", 100.0)[:31] + bytes([240])
    measurements = decoder("apmp")
    assert heights(measurements.feed(broken + packet("apmp", 200.0) * 3, 1)) == [200.0] * 3
    assert measurements.counters.skipped["cut_short"] == 1


def test_a_packet_and_each_channel_count_on() -> None:
    packer = Apmp()
    data = [packet("apmp", 1.0, 2.0, bus=bus, packer=packer) for bus in (1, 1, 2)]
    assert [int.from_bytes(d[4:8], "big") for d in data] == [0, 1, 2]
    assert [(d[48], d[49], d[65]) for d in data] == [(1, 0, 1), (1, 2, 3), (2, 0, 1)]


# ------------------------------------------------------------------------------------------------------- chapter 10


def test_no_packet_is_accepted_whose_checksum_does_not_hold() -> None:
    """Every bit of a packet that pychapter10 made, turned by itself."""
    vector = load("arinc429_chapter10")
    data = vector.data[:40]
    for bit in range(len(data) * 8):
        broken = bytearray(data)
        broken[bit // 8] ^= 1 << bit % 8
        measurements = vector.decoder()
        assert measurements.feed(bytes(broken), 1) == []
        assert measurements.counters.framed == 0


def test_nor_one_whose_secondary_header_is_damaged() -> None:
    vector = load("arinc429_chapter10_buses")
    data = vector.data[vector.data.rindex(b"\x25\xeb") :]
    assert vector.decoder().feed(data, 1)
    for bit in range(24 * 8, 36 * 8):
        broken = bytearray(data)
        broken[bit // 8] ^= 1 << bit % 8
        measurements = vector.decoder()
        assert measurements.feed(bytes(broken), 1) == []
        assert measurements.counters.skipped["bad_checksum"] == 1


def test_the_header_of_a_datagram_is_distinguished() -> None:
    measurements = decoder("chapter10")
    datagram = b"\x01\x34\x12\x00" + packet("chapter10", 100.0)
    for data in (datagram, datagram):
        assert heights(measurements.feed(data, 1)) == [100.0]
    assert measurements.counters.skipped == {"transfer_header": 8}


def test_a_packet_that_is_longer_than_any_is_not_waited_for() -> None:
    head = HEADER.pack(b"\x25\xeb", 1, 131_072, 131_000, 6, 0, 0, 0x40, 0, 0, 0)
    head = head[:-2] + struct.pack("<H", sum(struct.unpack("<11H", head[:-2])) & 0xFFFF)
    measurements = decoder("chapter10")
    assert heights(measurements.feed(head + packet("chapter10", 100.0), 1)) == [100.0]
    assert measurements.counters.skipped["too_long"] == 1


def test_a_count_that_does_not_fit_the_length_is_refused_before_the_body_has_come() -> None:
    data = bytearray(packet("chapter10", 100.0, 200.0))
    data[24] = 9
    measurements = decoder("chapter10")
    measurements.feed(bytes(data[:32]), 1)
    assert measurements.counters.skipped["bad_count"] == 1


def test_the_counter_of_the_recorder_has_48_bits() -> None:
    last = ((1 << 48) - 1) * 100
    (received,) = Chapter10().unpack(Chapter10().pack([height_word(1.0)], 0, last))[1]
    assert received.t_dev_ns == last
