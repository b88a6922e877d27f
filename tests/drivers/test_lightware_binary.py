"""LWNX packets: outputs in the order of their bits, lost signals, configuration of the device."""

from __future__ import annotations

import struct

import pytest

from fti.drivers import lightware_binary as lw
from fti.messages.measurements import Ack, Measurement, Range, Reading, Stamp

S = Stamp(1)


def decoded(packet: bytes, **options: object) -> list[Measurement]:
    return lw.make_decoder(lw.Options.model_validate(options)).feed(packet, 1)


def test_requests_are_the_makers() -> None:
    """The bytes that LightWare prints in lw_sf45.m for the requests of name, hardware, firmware, serial number."""
    printed = ("AA400000709F", "AA400001518F", "AA40000232BF", "AA40000313AF")
    assert [lw.make_packet(i).hex().upper() for i in range(4)] == list(printed)


def test_centimetres_and_percent() -> None:
    measurements = decoded(lw.make_packet(44, struct.pack("<hh", 1234, 80)))
    assert measurements == [
        Reading(stamp=S, name="first_strength", value=80.0, unit="%"),
        Range(stamp=S, slant_range=12.34),
    ]


def test_millimetres() -> None:
    measurements = decoded(lw.make_packet(45, struct.pack("<i", 12_345)), unit="mm", outputs=("first_raw",))
    assert measurements == [Range(stamp=S, slant_range=12.345)]


@pytest.mark.parametrize("cm", [13000, 16000, 23000, 25000, -1, -100, -32768])
def test_what_means_a_lost_signal_is_lost(cm: int) -> None:
    measurements = decoded(lw.make_packet(44, struct.pack("<h", cm)), outputs=("first_raw",))
    assert measurements == [Range(stamp=S, slant_range=None, valid=False)]


def test_what_the_newer_guide_says_for_lost_is_lost_in_millimetres() -> None:
    """SF20 product guide, command 95: "The distance output lost signal indication -1000"."""
    measurements = decoded(lw.make_packet(45, struct.pack("<i", -1000)), unit="mm", outputs=("first_raw",))
    assert measurements == [Range(stamp=S, slant_range=None, valid=False)]


def test_outputs_stand_in_the_order_of_their_bits_and_one_is_the_distance() -> None:
    """SF45: first return raw (bit 0), last return raw (3), temperature (7), yaw (8), however they are listed."""
    outputs = ("yaw_angle", "last_raw", "temperature", "first_raw")
    options = {"family": "sf45", "outputs": outputs, "distance": "last_raw"}
    measurements = decoded(lw.make_packet(44, struct.pack("<hhhh", 100, 250, 3512, -4500)), **options)
    assert measurements[0] == Reading(stamp=S, name="temperature", value=35.12, unit="degC")
    assert isinstance(measurements[1], Reading)
    assert measurements[1].value == pytest.approx(-0.785398, abs=1e-6)
    assert measurements[2] == Range(stamp=S, slant_range=2.5)


def test_other_outputs_than_the_configured_ones_are_not_guessed() -> None:
    decoder = lw.make_decoder(lw.Options())
    wrong = lw.make_packet(44, b"\x10\x00") + lw.make_packet(45, b"\x10\x00\x00\x00") + lw.make_packet(44)
    assert decoder.feed(wrong, 1) == []
    assert decoder.counters.messages == {"distance_of_other_outputs": 3}


def test_the_device_is_woken_and_sent_its_outputs_and_the_stream() -> None:
    reported = lw.on_connect(lw.Options(family="sf45", outputs=("last_raw", "yaw_angle"), distance="last_raw"))
    assert reported[:3] == [bytes.fromhex("AA400000709F")] * 3
    assert reported[3][3:8] == bytes([27, 0x08, 1, 0, 0])  # bits 3 and 8, as in lw_sf45.m
    assert reported[4][3:8] == bytes([30, 5, 0, 0, 0])
    assert reported[4][1] & 1


def test_every_request_is_answered_and_acknowledged() -> None:
    encoder, decoder = lw.make_encoder(lw.Options()), lw.make_decoder(lw.Options())
    answers = [a for request in lw.on_connect(lw.Options()) for a in encoder.respond(request)]
    acks = decoder.feed(b"".join(answers), 1)
    assert [m.command for m in acks if isinstance(m, Ack)] == ["identify"] * 3 + ["stream"]
    assert isinstance(acks[0], Ack)
    assert acks[0].detail == "SF20"
    assert decoder.counters.messages == {"product_name": 3, "distance_output": 1, "stream": 1}


@pytest.mark.parametrize(
    ("name", "args", "payload"),
    [
        ("laser", {"state": "off"}, bytes([50, 0])),
        ("stream", {"state": "off"}, bytes([30, 0, 0, 0, 0])),
        ("stream", {"state": "on"}, bytes([30, 5, 0, 0, 0])),
        ("zero_offset", {"mm": "-230"}, bytes([94]) + (-230).to_bytes(4, "little", signed=True)),
    ],
)
def test_commands_are_writes_and_are_acknowledged(name: str, args: dict[str, str], payload: bytes) -> None:
    sent = lw.command(name, args)
    assert sent == lw.make_packet(payload[0], payload[1:], write=True)
    (ack,) = lw.make_decoder(lw.Options()).feed(lw.make_encoder(lw.Options()).respond(sent)[0], 1)
    assert isinstance(ack, Ack)
    assert (ack.command, ack.accepted) == (name, True)


@pytest.mark.parametrize(
    ("name", "args", "sentence"),
    [
        ("fire", {}, "no command 'fire'; there are identify"),
        ("laser", {}, r"laser: state is missing: on or off"),
        ("laser", {"state": "x"}, "laser: state = 'x': must be on or off"),
        ("zero_offset", {"mm": "0.5"}, "must be a whole number from -10000 to 10000"),
    ],
)
def test_a_wrong_command_is_one_sentence(name: str, args: dict[str, str], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        lw.command(name, args)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"outputs": ("yaw_angle",)}, "outputs: 'yaw_angle'; sf20 has first_raw"),
        ({"distance": "last_raw"}, "distance = 'last_raw': must be one of the outputs: first_raw"),
        ({"outputs": ("noise",), "distance": "noise"}, "distance = 'noise'"),
    ],
)
def test_outputs_that_do_not_fit_are_refused(options: dict[str, object], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        lw.make_decoder(lw.Options.model_validate(options))


def test_lengths_that_cannot_be_cost_one_byte() -> None:
    decoder = lw.make_decoder(lw.Options())
    good = lw.make_packet(44, struct.pack("<hh", 500, 1))
    measurements = decoder.feed(b"\xaa\x00\x00" + b"\xaa\x7e\x00" + good, 1)
    assert [m for m in measurements if isinstance(m, Range)] == [Range(stamp=S, slant_range=5.0)]
    assert decoder.counters.skipped["bad_length"] == 2
