"""ARINC 429 words on a line: synchronisation in noise, after losses, and with constant words."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.config import bind
from fti.drivers import arinc429
from fti.drivers.arinc429 import word as wire
from fti.drivers.arinc429.stream import SEARCH_BYTES, required_words
from fti.drivers.arinc429.word import BnrState
from fti.messages.measurements import Measurement, RadioHeight

FOOT = 0.3048
WANTED = required_words(2, "odd")  # label 164, and 377 of the equipment


def options(**changes: object) -> arinc429.Options:
    return bind(arinc429.Options, changes, "test.toml")


def words(*values: int) -> bytes:
    return b"".join(value.to_bytes(4, "big") for value in values)


def height_word(height_ft: float) -> int:
    return wire.encode_bnr("164", height_ft, 8192.0, 16, state=BnrState.NORMAL)


def heights(found: list[Measurement]) -> list[float]:
    measurements = [m.height_agl for m in found if isinstance(m, RadioHeight)]
    return [round(height / FOOT, 6) for height in measurements if height is not None]


HEIGHT_100 = height_word(100.0)
OTHER = wire.encode_bnr("101", 5.0, 180.0, 12, state=BnrState.NORMAL)
CLIMB = [100.0 + 0.5 * k for k in range(40)]


def test_a_stream_that_begins_with_a_word_is_accepted_after_three() -> None:
    decoder = arinc429.make_decoder(options())
    for t in (1, 2):
        assert decoder.feed(words(HEIGHT_100), t) == []
    assert decoder.counters.held == 8
    assert [m.stamp.t_rx_ns for m in decoder.feed(words(HEIGHT_100), 3)] == [1, 2, 3]
    assert [m.stamp.t_rx_ns for m in decoder.feed(words(HEIGHT_100), 4)] == [4]


def test_anywhere_else_as_many_words_are_wanted_as_noise_can_not_make() -> None:
    decoder = arinc429.make_decoder(options())
    assert decoder.feed(b"\x00" + words(*map(height_word, CLIMB[: WANTED - 1])), 1) == []
    measurements = decoder.feed(words(height_word(CLIMB[WANTED - 1])), 2)
    assert heights(measurements) == CLIMB[:WANTED]


@pytest.mark.parametrize(
    ("enabled", "parity", "wanted"), [(1, "odd", 4), (10, "odd", 7), (20, "odd", 8), (10, "none", 7)]
)
def test_how_many_words_are_wanted(enabled: int, parity: wire.Parity, wanted: int) -> None:
    """By hand: q = 10/256; q/2 (q/(1+q))^6 = 5.5e-11 and ^5 = 1.5e-9; without parity q^7 = 1.4e-10, q^6 = 3.6e-9."""
    assert required_words(enabled, parity) == wanted


def test_noise_is_not_accepted(scale: int) -> None:
    """Two words would have been believed 40 times in the quick run."""
    decoder = arinc429.make_decoder(options(set="ahrs"))
    noise = random.Random(429)
    for _ in range(15 * scale):
        assert decoder.feed(noise.randbytes(4096), 1) == []
    assert decoder.counters.framed == 0


def test_a_lost_byte_costs_its_word_and_nothing_false() -> None:
    stream = [words(height_word(h)) for h in CLIMB]
    for lost in range(4):
        broken = [*stream[:9], stream[9][:lost] + stream[9][lost + 1 :], *stream[10:]]
        values = heights(arinc429.make_decoder(options()).feed(b"".join(broken), 1))
        assert values == [*CLIMB[:9], *CLIMB[10:]]


def test_a_flipped_bit_costs_its_word_and_is_waited_for_by_two() -> None:
    for bit in range(32):
        decoder = arinc429.make_decoder(options())
        measurements = decoder.feed(words(*map(height_word, CLIMB[:9]), height_word(CLIMB[9]) ^ 1 << bit), 1)
        measurements += decoder.feed(words(*map(height_word, CLIMB[10:12])), 2)
        assert heights(measurements) == [*CLIMB[:9], *CLIMB[10:12]]
        assert decoder.counters.skipped == {"bad_parity": 4}


@given(st.lists(st.tuples(st.integers(0, 159), st.integers(0, 7)), max_size=12))
def test_whatever_is_flipped_only_true_heights_come_out(hits: list[tuple[int, int]]) -> None:
    """Odd numbers of flips in a word are told by the parity; one word is never hit twice here."""
    stream = bytearray(words(*map(height_word, CLIMB)))
    for at, bit in {at // 4: (at, bit) for at, bit in hits}.values():
        stream[at] ^= 1 << bit
    assert set(heights(arinc429.make_decoder(options()).feed(bytes(stream), 1))) <= set(CLIMB)


def test_a_constant_word_is_not_found_at_the_wrong_place() -> None:
    """Turned by a byte it keeps its parity; only the label tells."""
    for start in range(1, 4):
        decoder = arinc429.make_decoder(options())
        assert set(heights(decoder.feed((words(HEIGHT_100) * 20)[start:], 1))) == {100.0}
        assert decoder.counters.skipped == {"no_sync": 4 - start}


def test_a_lost_byte_among_words_that_do_not_change_is_noticed() -> None:
    """All places have good parity for ever; the one with the labels is found again, and soon."""
    decoder = arinc429.make_decoder(options())
    decoder.feed(words(HEIGHT_100) * 10 + words(HEIGHT_100)[:3], 1)
    values = heights(decoder.feed(words(HEIGHT_100) * 10, 2))
    assert set(values) == {100.0}
    assert len(values) >= 9
    assert decoder.counters.messages == {"radio_height": len(values) + 10}


def test_two_places_that_look_alike_are_not_chosen_between() -> None:
    """Data bytes that read like the label, and nothing that changes: released as soon as something does."""
    alike = wire.with_parity(BnrState.NORMAL << 29 | 0x2E << 16 | 0x2E)
    decoder = arinc429.make_decoder(options())
    assert decoder.feed(words(alike) * 30, 1) == []
    assert decoder.counters.skipped["ambiguous"] > 0
    assert heights(decoder.feed(words(*map(height_word, CLIMB)), 2))[-20:] == CLIMB[-20:]


def test_words_that_are_not_enabled_are_framed_and_counted() -> None:
    decoder = arinc429.make_decoder(options())
    assert decoder.feed(words(HEIGHT_100, HEIGHT_100, height_word(50.0), OTHER), 1)
    assert decoder.counters.held == 4
    decoder = arinc429.make_decoder(options())
    measurements = decoder.feed(words(HEIGHT_100, OTHER, OTHER, height_word(50.0), OTHER, HEIGHT_100), 1)
    assert len(measurements) == 3
    assert decoder.counters.messages == {"radio_height": 3, "other": 3}


def test_rare_labels_are_found_among_many_others() -> None:
    decoder = arinc429.make_decoder(options())
    measurements = decoder.feed((words(HEIGHT_100) + words(OTHER) * 100) * 4, 1)
    assert len(measurements) == 4
    assert decoder.counters.messages["other"] >= 400 - 64
    assert decoder.counters.held <= SEARCH_BYTES


def test_even_parity_is_another_line() -> None:
    even = words(*(wire.with_parity(height_word(h), "even") for h in CLIMB))
    assert heights(arinc429.make_decoder(options(parity="even")).feed(even, 1)) == CLIMB
    assert arinc429.make_decoder(options()).feed(even, 1) == []


def test_without_parity_the_labels_tell() -> None:
    """Bit 32 is whatever the converter makes of it."""
    line = words(*(height_word(h) & 0x7FFFFFFF | (k % 2) << 31 for k, h in enumerate(CLIMB)))
    decoder = arinc429.make_decoder(options(parity="none"))
    assert heights(decoder.feed(line[3:], 1)) == CLIMB[1:]
    assert decoder.counters.skipped == {"no_sync": 1}
