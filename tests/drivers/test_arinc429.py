"""ARINC 429: words against another encoder, sign/status, options, resynchronisation."""

from __future__ import annotations

import math

import arinc429 as independent
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.config import bind
from fti.drivers import arinc429
from fti.drivers.arinc429 import word as wire
from fti.drivers.arinc429.word import BcdState, BnrState
from fti.messages.measurements import (
    Attitude,
    DeviceStatus,
    Measurement,
    PressureAltitude,
    RadioHeight,
    Stamp,
    StaticPressure,
)

FOOT = 0.3048
S = Stamp(0)


def options(**changes: object) -> arinc429.Options:
    return bind(arinc429.Options, changes, "test.toml")


def feed(data: bytes, chosen: arinc429.Options | None = None) -> list[Measurement]:
    return arinc429.make_decoder(chosen or arinc429.Options()).feed(data, 1)


def words(*values: int) -> bytes:
    return b"".join(value.to_bytes(4, "big") for value in values)


def height_word(height_ft: float, state: BnrState = BnrState.NORMAL, sdi: int = 0) -> int:
    return wire.encode_bnr("164", height_ft, 8192.0, 16, state=state, sdi=sdi)


HEIGHT_100 = height_word(100.0)

# ---------------------------------------------------------------------------------------------------------- word


@pytest.mark.parametrize(
    ("printed", "label", "value", "full", "bits"),
    [
        (0xE269402E, "164", 1234.5, 8192.0, 16),
        (0xFF8E402B, "324", -5.0, 180.0, 14),
        (0x68000033, "314", 90.0, 180.0, 15),
        (0xE13880C1, "203", 10000.0, 131072.0, 17),
        (0xE0F00011, "210", 120.0, 2048.0, 15),
    ],
)
def test_the_five_words(printed: int, label: str, value: float, full: float, bits: int) -> None:
    turns = full == 180.0
    number = wire.encode_bnr(label, value, full, bits, state=BnrState.NORMAL, turns=turns)
    lsb = full / 2**bits
    if label == "324":  # the printed word has the value cut off, not rounded, to its resolution
        assert wire.decode_bnr(printed, full, bits) == pytest.approx(value, abs=lsb)
    else:
        assert number == printed
        assert wire.decode_bnr(printed, full, bits) == value
    assert wire.label_octal(printed) == label
    assert wire.is_intact(printed)
    assert wire.ssm(printed) == BnrState.NORMAL


@given(st.integers(0, 255), st.integers(8, 18), st.integers(-(2**17), 2**17 - 1), st.integers(0, 3), st.integers(0, 3))
def test_words_are_those_of_an_independent_encoder(label: int, bits: int, raw: int, ssm: int, sdi: int) -> None:
    """PyPI arinc429; whole steps only, for it cuts where we round.  Its sign leaks into the SSM, hence positive."""
    value = abs(raw) % 2**bits
    encoder = independent.Encoder()
    encoder.encode(value=value, msb=29, lsb=29 - bits, label=label, sdi=sdi, ssm=ssm, scale=1.0, encoding="BNR")
    number = wire.encode_bnr(f"{label:03o}", float(value), 2.0**bits, bits, state=BnrState(ssm), sdi=sdi)
    assert number == encoder[0].word
    assert wire.decode_bnr(number, 2.0**bits, bits) == value


@given(st.integers(8, 20), st.data())
def test_every_step_of_the_scale_comes_back_with_its_sign(bits: int, data: st.DataObject) -> None:
    raw = data.draw(st.integers(-(2**bits), 2**bits - 1))
    word = wire.encode_bnr("310", raw * 180.0 / 2**bits, 180.0, bits, state=BnrState.NORMAL)
    assert wire.decode_bnr(word, 180.0, bits) == raw * 180.0 / 2**bits
    assert wire.is_intact(word)


def test_a_twenty_bit_word_reaches_into_the_sdi() -> None:
    """48.1 deg: 280203 steps of 180/2^20, bits 28-9; label 310 turned is 13 hex."""
    word = wire.encode_bnr("310", 48.1, 180.0, 20, state=BnrState.NORMAL, sdi=3)
    assert word & 0x7FFFFFFF == 0b11 << 29 | 280203 << 8 | 0x13


def test_the_scale_saturates_and_an_angle_goes_on_at_the_other_end() -> None:
    assert wire.decode_bnr(height_word(9000.0), 8192.0, 16) == 8191.875
    assert wire.decode_bnr(height_word(-9000.0), 8192.0, 16) == -8192.0
    for angle, measurements in ((270.0, -90.0), (180.0, -180.0), (-190.0, 170.0)):
        word = wire.encode_bnr("314", angle, 180.0, 16, state=BnrState.NORMAL, turns=True)
        assert wire.decode_bnr(word, 180.0, 16) == pytest.approx(measurements, abs=0.003)


@given(st.integers(0, 79_999), st.booleans())
def test_bcd_digits_come_back_and_an_independent_encoder_agrees(number: int, minus: bool) -> None:
    value = -number * 0.1 if minus else number * 0.1
    word = wire.encode_bcd("165", value, 0.1, state=BcdState.PLUS)
    encoder = independent.Encoder()
    encoder.encode(value=number, label=0o165, ssm=3 if minus and number else 0, encoding="BCD")
    assert word == encoder[0].word
    assert wire.decode_bcd(word, 0.1) == pytest.approx(value, abs=1e-9)


def test_a_bcd_digit_above_nine_is_no_number() -> None:
    word = wire.with_parity(wire.label_byte("165") | 0xA << 10)
    assert wire.decode_bcd(word, 0.1) is None
    chosen = options(set="radio_altimeter_bcd")
    measurements = feed(words(word, word, word), chosen)
    assert measurements[0] == RadioHeight(stamp=Stamp(1), height_agl=None, valid=False)
    assert measurements[1] == DeviceStatus(stamp=Stamp(1), ok=False, flags=("radio_height_bad_digit",))


# ----------------------------------------------------------------------------------------------- sign and status


@pytest.mark.parametrize(
    ("state", "height", "flag"),
    [
        (BnrState.FAILURE, None, "radio_height_failure"),
        (BnrState.NO_COMPUTED_DATA, None, "radio_height_no_computed_data"),
        (BnrState.FUNCTIONAL_TEST, 100.0 * FOOT, "radio_height_functional_test"),
    ],
)
def test_only_normal_is_valid(state: BnrState, height: float | None, flag: str) -> None:
    (measured, status, *_) = feed(words(height_word(100.0, state), HEIGHT_100, HEIGHT_100))
    assert measured == RadioHeight(stamp=Stamp(1), height_agl=height, valid=False)
    assert status == DeviceStatus(stamp=Stamp(1), ok=False, flags=(flag,))


def test_a_failed_pressure_is_a_status_and_no_pressure() -> None:
    word = wire.encode_bnr("217", 28.0, 64.0, 16, state=BnrState.FAILURE)
    measurements = feed(words(word, word, word), options(set="air_data"))
    assert {type(m) for m in measurements} == {DeviceStatus}


def test_the_emulator_says_what_is_not_valid() -> None:
    encoder = arinc429.make_encoder(arinc429.Options())
    (lost,) = encoder.encode(RadioHeight(stamp=S, height_agl=None, valid=False))
    (doubtful,) = encoder.encode(RadioHeight(stamp=S, height_agl=100.0 * FOOT, valid=False))
    assert wire.ssm(int.from_bytes(lost, "big")) == BnrState.NO_COMPUTED_DATA
    assert wire.ssm(int.from_bytes(doubtful, "big")) == BnrState.FUNCTIONAL_TEST


# ------------------------------------------------------------------------------------------------------- options


@pytest.mark.parametrize("order", ["big", "little"])
@pytest.mark.parametrize("turned", [True, False])
def test_byte_order_and_turned_labels_go_there_and_back(order: str, turned: bool) -> None:
    chosen = options(byte_order=order, label_reversed=turned)
    data = arinc429.make_encoder(chosen).encode(RadioHeight(stamp=S, height_agl=1234.5 * FOOT))
    label = data[0][3 if order == "big" else 0]
    assert label == (0x2E if turned else 0o164)
    assert feed(data[0] * 3, chosen) == [RadioHeight(stamp=Stamp(1), height_agl=1234.5 * FOOT)] * 3


def test_own_labels_go_before_the_set_and_take_sdi_and_sign() -> None:
    left = {"label": "164", "quantity": "radio_height", "unit": "ft", "range": 4096.0, "bits": 16, "sdi": 1, "sign": -1}
    chosen = options(labels=[left])
    one = wire.encode_bnr("164", -100.0, 4096.0, 16, state=BnrState.NORMAL, sdi=1)
    measurements = feed(words(one, HEIGHT_100, one, HEIGHT_100), chosen)
    assert [m.height_agl for m in measurements if isinstance(m, RadioHeight)] == pytest.approx([100.0 * FOOT] * 4)


def test_altitudes_with_and_without_standard_setting_are_two_labels() -> None:
    encoder = arinc429.make_encoder(options(set="air_data"))
    (standard,) = encoder.encode(PressureAltitude(stamp=S, alt_press=100.0, setting_pa=101_325.0))
    (corrected,) = encoder.encode(PressureAltitude(stamp=S, alt_press=100.0))
    assert [wire.label_octal(int.from_bytes(w, "big")) for w in (standard, corrected)] == ["203", "204"]


# --------------------------------------------------------------------------------------------------------- units


def test_units_of_the_wire_become_si() -> None:
    encoder = arinc429.make_encoder(options(set="air_data"))
    data = encoder.encode(StaticPressure(stamp=S, p_static=101_325.0))[0]
    assert wire.decode_bnr(int.from_bytes(data, "big"), 64.0, 16) == pytest.approx(29.9213, abs=0.0005)  # inHg, ISA
    encoder = arinc429.make_encoder(options(set="ahrs"))
    data = encoder.encode(Attitude(stamp=S, roll=math.radians(30.0)))[0]
    assert wire.decode_bnr(int.from_bytes(data, "big"), 180.0, 14) == pytest.approx(30.0, abs=0.006)
