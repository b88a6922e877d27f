"""HMR2300: boundaries without a checksum, both forms of samples, commands, and the emulated device's rules."""

from __future__ import annotations

import re
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.drivers import Counters
from fti.drivers import honeywell_hmr2300 as hmr
from fti.drivers.honeywell_hmr2300.framing import ENDS, MAX_JUMP_COUNTS, SAMPLE
from fti.messages.measurements import Ack, MagneticField, Measurement, Reading, Stamp

Counts = tuple[int, int, int]
S = Stamp(1)
COUNT_T = 1e-4 / 15_000


def pack(*samples: Counts) -> bytes:
    return b"".join(b"".join(c.to_bytes(2, "big", signed=True) for c in sample) + b"\r" for sample in samples)


def decode(data: bytes, **options: Any) -> tuple[list[Measurement], Counters]:
    decoder = hmr.make_decoder(hmr.Options(**options))
    return decoder.feed(data, 1), decoder.counters


def counts_of(measurements: list[Measurement]) -> list[Counts]:
    fields = [m.field_b for m in measurements if isinstance(m, MagneticField)]
    return [(round(x / COUNT_T), round(y / COUNT_T), round(z / COUNT_T)) for x, y, z in fields]


def steady(count: int, first: Counts = (3000, -500, 6500)) -> list[Counts]:
    """A still field with noise of a few counts, and without 0D inside."""
    return [(first[0] + k % 3, first[1] - k % 2, first[2] + 2 * (k % 4)) for k in range(count)]


# -------------------------------------------------------------------------------------------------------- values


def test_the_data_sheet_prints_a_wrong_word() -> None:
    """-1.0 G is -15000 counts, C5 68 in two's complement; the printed C3 74 would be -15500 counts, -1.033 G."""
    right, printed = (decode(bytes.fromhex(f"{word}000000000D"))[0] for word in ("C568", "C374"))
    assert isinstance(right[0], MagneticField)
    assert right[0].field_b[0] == pytest.approx(-1e-4, abs=1e-12)
    assert counts_of(printed) == [(-15_500, 0, 0)]


@pytest.mark.parametrize(("count", "valid"), [(30_000, True), (30_001, False), (-30_000, True), (-32_768, False)])
def test_outside_two_gauss_a_sample_is_not_valid(count: int, valid: bool) -> None:
    found, _ = decode(pack((100, 200, count)) * 4)
    assert isinstance(found[0], MagneticField)
    assert found[0].valid is valid


@pytest.mark.parametrize("text", ["  1,234  -    12  +     0  \r", "-12,345        7      890  \r"])
def test_ascii_values_may_be_short(text: str) -> None:
    found, counters = decode(text.encode())
    assert counts_of(found) == [tuple(int(re.sub(r"[ ,]", "", text[at : at + 9])) for at in (0, 9, 18))]
    assert counters.messages == {"ascii": 1}


@pytest.mark.parametrize(
    "text", ["  123,4    5,678    9,012  \r", "  1 234    5,678    9,012  \r", "  1,234    5,678  \r"]
)
def test_ascii_values_of_another_form_are_refused(text: str) -> None:
    found, counters = decode(text.encode() * 2)
    assert not counts_of(found)
    assert not counters.messages


def test_three_samples_after_a_pulse_are_not_valid() -> None:
    found, _ = decode(pack(*steady(2)) + b"SET\r" + pack(*steady(5)))
    valid = [m.valid for m in found if isinstance(m, MagneticField)]
    assert valid == [True, True, False, False, False, True, True]


# ---------------------------------------------------------------------------------------------------- boundaries


def test_after_a_lost_byte_the_next_boundary_is_found_within_four_samples() -> None:
    good = steady(12)
    stream = pack(*good)
    for lost in range(3 * SAMPLE, 4 * SAMPLE - 1):
        found, counters = decode(stream[:lost] + stream[lost + 1 :])
        assert counts_of(found) == good[:3] + good[4:], lost
        assert counters.skipped == {"no_boundary": SAMPLE - 1}


def test_without_a_boundary_nothing_comes_out_before_four_ends() -> None:
    good = steady(6)
    stream = pack(*good)[3:]
    for size in range(SAMPLE * ENDS):
        assert not decode(stream[:size])[0]
    assert counts_of(decode(stream)[0]) == good[1:]


def test_three_ends_are_not_enough() -> None:
    found, counters = decode(b"\x01" * 9 + b"\r" + pack(*steady(2)) + b"\x01" * 200)
    assert not counts_of(found)
    assert not counters.messages


noise = st.integers(-20, 20)
high_0d = st.integers(0x0D00, 0x0DFF)
axis = st.integers(-9000, 9000)


@st.composite
def still_fields(draw: st.DrawFn, *, moving: bool = False) -> list[Counts]:
    """20 samples of a field of the Earth's size with one axis whose high byte is 0D, and with noise.

    moving : this axis changes by two counts or more from sample to sample, the condition of smoothness
    """
    field = [draw(axis), draw(axis), draw(axis)]
    with_0d = draw(st.integers(0, 2))
    field[with_0d] = draw(high_0d)
    samples = [[c + draw(noise) for c in field] for _ in range(20)]
    if moving:
        for k, sample in enumerate(samples):
            sample[with_0d] = field[with_0d] + draw(st.integers(1, 20)) * (-1) ** k
    return [(x, y, z) for x, y, z in samples]


@given(still_fields(moving=True), st.integers(0, 6), st.sampled_from(["begin", "lose", "insert"]), st.integers(0, 255))
def test_a_high_byte_of_0d_does_not_pass_for_the_end(samples: list[Counts], at: int, how: str, byte: int) -> None:
    """Wherever the stream begins or a byte is lost or put in, at most the damaged sample comes out wrong.

    A byte put in moves the column of X hi to that of the end: then the sample before it, too.
    """
    stream = pack(*samples)
    cut = 8 * SAMPLE + at
    data = {
        "begin": stream[at:],
        "lose": stream[:cut] + stream[cut + 1 :],
        "insert": stream[:cut] + bytes([byte]) + stream[cut:],
    }[how]
    counts = counts_of(decode(data)[0])
    wrong = [c for c in counts if c not in samples]
    assert len(wrong) <= {"begin": 0, "lose": 1, "insert": 2}[how]
    assert len(counts) >= 20 - 1 - (ENDS + 2 if how == "begin" else ENDS + 3)


@given(still_fields())
def test_an_undamaged_stream_loses_nothing(samples: list[Counts]) -> None:
    """Doubt costs time, three samples at most, and none of them."""
    found, counters = decode(pack(*samples))
    assert counts_of(found) == samples[: len(counts_of(found))]
    assert len(counts_of(found)) >= len(samples) - 3
    assert not counters.skipped


def test_an_inserted_byte_that_makes_a_sample_end_in_its_own_low_byte_is_seen_by_the_jump() -> None:
    good = [(x, y, 0x1A0D) for x, y, _ in steady(9)]
    stream = pack(*good)
    counts = counts_of(decode(stream[:21] + b"\x55" + stream[21:])[0])
    assert set(counts) <= set(good)
    assert abs((0x55 << 8) - good[0][0]) > MAX_JUMP_COUNTS


def test_a_field_that_stands_still_to_the_count_keeps_the_boundary_that_was_known() -> None:
    still = [(0x0D20, 100, 200)] * 10
    assert counts_of(decode(pack(*still))[0]) == still[:-2]  # two wait for those behind them


@given(st.integers(0, 6))
def test_a_field_that_stands_still_to_the_count_says_nothing_when_two_phases_fit(at: int) -> None:
    """X hi is 0D: from the middle of a sample both phases have their ends and neither moves."""
    found, counters = decode(b"\x00" * SAMPLE + pack(*[(0x0D20, 100, 200)] * 10)[at:])
    assert not counts_of(found)
    assert counters.skipped["ambiguous"]


def test_noise_locks_as_seldom_as_stated(scale: int) -> None:
    """2^-32 for each byte: none in a million; with one end less, 2^-24, there would be some in 10^8."""
    import random

    size = 10**5 if scale == 1 else 10**7
    decoder = hmr.make_decoder(hmr.Options())
    source = random.Random(1)
    measurements = [m for _ in range(size // 1000) for m in decoder.feed(source.randbytes(1000), 1)]
    assert not counts_of(measurements)


def test_answers_and_a_change_of_form_stand_between_samples() -> None:
    binary, text = pack(*steady(3)), b"  1,000  - 2,000    3,000  \r"
    stream = binary + b"OK\rASCII ON\r" + text * 2 + b"OK\rBINARY ON\r" + binary
    found, counters = decode(stream)
    assert counts_of(found) == [*steady(3), *[(1000, -2000, 3000)] * 2, *steady(3)]
    assert counters.messages == {"binary": 6, "ascii": 2, "answer": 4}
    assert not counters.skipped


def test_the_rest_of_a_damaged_ascii_sample_is_no_binary_one() -> None:
    """Six characters and the end are left over; behind ASCII samples that is no boundary."""
    text = b"  1,000  - 2,000    3,000  \r"
    found, _ = decode(text * 2 + text[-SAMPLE:] + text * 2)
    assert counts_of(found) == [(1000, -2000, 3000)] * 4


# ------------------------------------------------------------------------------------------------------- answers


def acks(data: bytes, **options: Any) -> list[tuple[str, bool]]:
    return [(m.command, m.accepted) for m in decode(data, **options)[0] if isinstance(m, Ack)]


def test_the_ok_of_the_write_enable_is_not_the_answer() -> None:
    assert acks(b"OK\r") == []
    assert acks(b"OK\rOK\r") == [("", True)]
    assert acks(b"OK\rBINARY ON\rOK\rOK\r") == [("format", True), ("", True)]
    assert acks(b"OK\rRe-enter\rOK\r") == [("", False)]
    assert acks(b"OK\rOK\r", enable="apart") == [("write_enable", True), ("", True)]


def test_an_ok_long_before_is_forgotten() -> None:
    """The second answer was lost; the next command's write enable is not taken for it."""
    assert acks(b"OK\r" + pack(*steady(2)) + b"OK\r") == []
    assert acks(b"OK\r" + pack(*steady(1)) + b"OK\r") == [("", True)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("WE OFF", ("", False)),
        ("Re-enter", ("", False)),
        ("S/R ON", ("set_reset_mode", True)),
        ("RST", ("set_reset_pulse", True)),
        ("ZERO OFF", ("zero", True)),
        ("AVG ON", ("average", True)),
        ("ID= 07", ("identify", True)),
        ("S/W vers: 1.23", ("software_version", True)),
        ("ASCII, POLLED, S/R ON, ZERO OFF, AVG OFF, R ON, ID=00, 20 sps", ("query", True)),
    ],
)
def test_answers_name_their_command(text: str, expected: tuple[str, bool]) -> None:
    assert acks(text.encode() + b"\r") == [expected]


def test_the_speed_of_the_line_is_a_reading() -> None:
    found, _ = decode(b"OK\rOK\rBAUD= 19,200\r")
    assert found[-1] == Reading(stamp=S, name="baud", value=19_200.0)


# ------------------------------------------------------------------------------------------------------ commands

SOME_VALUE = {
    "format": "ascii",
    "rate": "154",
    "set_reset_mode": "off",
    "set_reset_pulse": "reset",
    "zero": "on",
    "average": "on",
    "re_enter": "off",
    "set_id": "7",
    "baud": "19200",
}


def arguments(name: str) -> dict[str, str]:
    return dict.fromkeys(hmr.COMMANDS[name].arguments, SOME_VALUE.get(name, ""))


@pytest.mark.parametrize("name", [n for n, c in hmr.COMMANDS.items() if c.answered and n != "write_enable"])
def test_the_emulated_device_answers_each_command_under_its_name(name: str) -> None:
    device, decoder = hmr.make_encoder(hmr.Options()), hmr.make_decoder(hmr.Options())
    answers = device.respond(hmr.command(name, arguments(name)))
    measurements = [m for data in answers for m in decoder.feed(data, 1)]
    (ack,) = [m for m in measurements if isinstance(m, Ack)]
    assert ack.accepted
    assert ack.command in ("", name)


def test_bytes_of_commands_are_those_of_the_data_sheet() -> None:
    options = hmr.Options(id=7)
    assert hmr.command("rate", {"samples_per_s": "123"}, options) == b"*07WE\r*07R=123\r"
    assert hmr.command("rate", {"samples_per_s": "123"}, hmr.Options(enable="apart")) == b"*00R=123\r"
    assert hmr.command("baud", {"baud": "19200"}, options) == b"*99WE\r*99!BR=F\r"
    assert hmr.command("identify", {}, options) == b"*99ID=\r"
    assert hmr.command("stop", {}) == b"\x1b"
    assert hmr.command("set_reset_pulse", {"pulse": "set"}, options) == b"*07]S\r"
    assert hmr.on_connect(options) == [b"\x1b", b"*07WE\r", b"*07B\r"]
    assert hmr.poll(options) == (0.05, b"*07P\r")
    continuous = hmr.Options(mode="continuous", rate=50, format="ascii")
    assert hmr.on_connect(continuous) == [b"\x1b", b"*00WE\r", b"*00R=50\r", b"*00WE\r", b"*00A\r", b"*00C\r"]
    assert hmr.poll(continuous) is None


@pytest.mark.parametrize(
    ("name", "args", "match"),
    [
        ("rate", {}, "samples_per_s is missing"),
        ("rate", {"samples_per_s": "21"}, "one of 10, 20, 25"),
        ("set_id", {"id": "99"}, "0 to 98"),
        ("query", {"x": "1"}, "no argument 'x'"),
    ],
)
def test_bad_arguments_are_refused(name: str, args: dict[str, str], match: str) -> None:
    with pytest.raises(ValueError, match=match):
        hmr.command(name, args)


# ------------------------------------------------------------------------------------------------------ emulator

FIELD = MagneticField(stamp=S, field_b=(2e-5, -1e-6, 4.4e-5))


def test_a_polled_device_is_silent_until_it_is_asked() -> None:
    device = hmr.make_encoder(hmr.Options(id=3))
    assert device.respond(b"*03P\r") == []  # nothing was measured yet
    assert device.encode(FIELD) == []
    (sample,) = device.respond(b"*0") + device.respond(b"3P\r")
    assert counts_of(decode(sample)[0]) == [(3000, -150, 6600)]
    assert device.respond(b"*04P\r") == []  # another device
    assert len(device.respond(b"*99P\r*99P\r")) == 2


def test_continuous_mode_begins_with_c_and_ends_with_escape() -> None:
    device = hmr.make_encoder(hmr.Options())
    assert device.respond(b"*00C\r") == []
    assert len(device.encode(FIELD)) == 1
    device.respond(b"\x1b")
    assert device.encode(FIELD) == []


def test_a_setting_needs_a_write_enable_each_time() -> None:
    device = hmr.make_encoder(hmr.Options())
    assert device.respond(b"*00A\r") == [b"WE OFF\r"]
    assert device.respond(b"*00WE\r*00A\r") == [b"OK\r", b"ASCII ON\r"]
    assert device.respond(b"*00B\r") == [b"WE OFF\r"]
    device.encode(FIELD)
    assert device.respond(b"*00P\r") == [b"  3,000  -   150    6,600  \r"]


def test_what_is_not_understood_is_answered_unless_that_is_off() -> None:
    device = hmr.make_encoder(hmr.Options())
    assert device.respond(b"hello\r*00XY\r*00WEWEWEWEWEWE\r*00WE\r*00R=21\r") == [
        *[b"Re-enter\r"] * 3,
        b"OK\r",
        b"Re-enter\r",
    ]
    device.respond(b"*00WE\r*00N\r")
    assert device.respond(b"hello\r*00XY\r") == []


def test_zero_and_average_change_the_samples() -> None:
    device = hmr.make_encoder(hmr.Options(mode="continuous"))
    device.encode(FIELD)
    device.respond(b"*00WE\r*00ZN\r")
    assert counts_of(decode(device.encode(FIELD)[0])[0]) == [(0, 0, 0)]
    device.respond(b"*00WE\r*00ZF\r*00WE\r*00VN\r")
    first, second = (counts_of(decode(device.encode(FIELD)[0])[0])[0][0] for _ in range(2))
    assert (first, second) == (2250, 2625)  # the mean of 0 and 3000 was 1500 before


def test_factory_settings_and_stored_ones_come_back() -> None:
    device = hmr.make_encoder(hmr.Options(mode="continuous", rate=50))
    assert device.respond(b"*00WE\r*00D\r") == [b"OK\r", b"OK\r", b"BAUD= 9600\r"]
    (settings,) = device.respond(b"*00Q\r")
    assert settings == b"ASCII, POLLED, S/R ON, ZERO OFF, AVG OFF, R ON, ID=00, 20 sps\r"
    assert 62 <= len(settings) <= 72  # as the data sheet says
    device.respond(b"*00WE\r*00RST\r")
    assert device.respond(b"*00Q\r")[0].startswith(b"BINARY, POLLED")


def test_the_emulated_device_is_set_up_by_what_is_sent_at_connect() -> None:
    options = hmr.Options(mode="continuous", format="binary")
    device, decoder = hmr.make_encoder(hmr.Options(format="ascii")), hmr.make_decoder(options)
    answers = [data for reported in hmr.on_connect(options) for data in device.respond(reported)]
    measurements = [m for data in [*answers, *device.encode(FIELD)] for m in decoder.feed(data, 1)]
    assert counts_of(measurements) == [(3000, -150, 6600)]
    assert not decoder.counters.skipped
