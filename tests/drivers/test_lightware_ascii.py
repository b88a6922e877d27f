"""LightWare text lines: a lost signal is never a range, and incomplete lines are rejected."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.drivers import lightware_ascii as lw
from fti.messages.measurements import Ack, Range, Stamp

S = Stamp(1)
LDF = lw.Options(query="ldf")


def ranges(data: bytes, options: lw.Options | None = None) -> list[float | None]:
    measurements = lw.make_decoder(options or lw.Options()).feed(data, 1)
    assert all(m.valid == (m.slant_range is not None) for m in measurements if isinstance(m, Range))
    return [m.slant_range for m in measurements if isinstance(m, Range)]


def test_the_example_of_the_manual_in_metres() -> None:
    """SF11 manual, command set: "98.67<CR><LF>" is 98.67 m."""
    assert ranges(b"\r\n98.67\r\n") == [98.67]


def test_an_answer_of_an_lw20_is_understood_whoever_asked_and_a_number_alone_is_its_end() -> None:
    assert ranges(b"\rldf,1:23.67\r\n") == [23.67]
    assert ranges(b"ldf,1:23.67\r\n30.00\r\n", LDF) == [23.67]


@pytest.mark.parametrize("reported", ["130.00", "160.00", "230.00", "250.00", "-1.00", "-0.01", "-130.00"])
def test_what_means_a_lost_signal_is_lost(reported: str) -> None:
    assert ranges(f"\r{reported}\r".encode()) == [None]
    assert ranges(f"ldf,1:{reported}\r\n".encode(), LDF) == [None]


@pytest.mark.parametrize("reported", ["129.99", "130.01", "0.00", "16.00"])
def test_its_neighbours_are_ranges(reported: str) -> None:
    assert ranges(f"\r{reported}\r".encode()) == [float(reported)]


def test_the_list_is_an_option() -> None:
    options = lw.Options(lost_m=(230.0,))
    assert ranges(b"\r130.00\r230.00\r-1.00\r", options) == [130.0, None, None]
    assert ranges(b"\r-1.00\r", lw.Options(lost_m=())) == [None]


@pytest.mark.parametrize("cut", range(1, 7))
def test_a_line_whose_beginning_was_not_seen_is_not_taken(cut: int) -> None:
    """The end of a lost 130.00 is 30.00, a good 30 m for whoever believes it."""
    decoder = lw.make_decoder(lw.Options())
    assert decoder.feed(b"130.00\r"[cut:] + b"12.34\r", 1) == [Range(stamp=S, slant_range=12.34)]
    assert decoder.counters.skipped["no_beginning"] == (7 - cut if cut < 6 else 0)


def test_where_each_datagram_is_a_line_the_first_is_taken() -> None:
    assert ranges(b"12.34\r", lw.Options(first_line="take")) == [12.34]


def test_a_line_may_come_in_pieces_and_end_twice() -> None:
    decoder = lw.make_decoder(lw.Options())
    pieces = [b"\r\n1", b"30", b".", b"00", b"\r", b"\r", b"\n3", b"1.50\r"]
    measurements = [m for i, piece in enumerate(pieces) for m in decoder.feed(piece, i)]
    assert [(m.stamp.t_rx_ns, m.slant_range) for m in measurements if isinstance(m, Range)] == [(0, None), (6, 31.5)]


@pytest.mark.parametrize(
    "line",
    ["12.3", "12.345", "12", ".12", "1 2.34", "+12.34", "12.34m", "nan", "1e3.00", "12345.00", "12.\xb234", "--1.00"],
)
def test_other_lines_are_no_distances(line: str) -> None:
    decoder = lw.make_decoder(lw.Options())
    assert decoder.feed(b"\r" + line.encode("latin-1") + b"\r7.00\r", 1) == [Range(stamp=S, slant_range=7.0)]
    assert decoder.counters.skipped["no_distance"] == len(line) + 1


def test_what_has_no_end_is_not_kept() -> None:
    decoder = lw.make_decoder(lw.Options())
    assert decoder.feed(b"\r" + b"1" * 1000, 1) == []
    assert decoder.counters.held < lw.MAX_LINE_BYTES
    assert decoder.feed(b"30.00\r8.00\r", 1) == [Range(stamp=S, slant_range=8.0)]
    assert decoder.counters.skipped["too_long"] == 1000 // lw.MAX_LINE_BYTES * lw.MAX_LINE_BYTES


@given(st.binary(max_size=200))
def test_no_garbage_makes_a_lost_signal_a_range(garbage: bytes) -> None:
    """Whatever stood before, behind the next end of line a lost signal is one."""
    assert ranges(garbage + b"\r130.00\r160.00\r")[-2:] == [None, None]


# --------------------------------------------------------------------------------------------------- asked devices


def test_a_model_that_is_asked_answers_each_question_with_its_last_distance() -> None:
    for query, question, answer in (
        ("d", b"d", b"12.34\r\n"),
        ("ldf", b"?LDF,1\r\n", b"ldf,1:12.34\r\n"),
    ):
        options = lw.Options(query=query)  # type: ignore[arg-type]
        encoder = lw.make_encoder(options)
        assert lw.poll(options) == (0.1, question)
        assert encoder.respond(question) == []
        assert encoder.encode(Range(stamp=S, slant_range=12.34)) == []
        assert [a for i in range(len(question)) for a in encoder.respond(question[i : i + 1])] == [answer]
        assert encoder.respond(question * 2) == [answer] * 2


def test_one_that_talks_by_itself_is_not_asked() -> None:
    assert lw.poll(lw.Options()) is None
    assert lw.on_connect(lw.Options()) == []
    assert lw.on_connect(LDF) == [b"www\r\n"]


def test_a_lost_signal_is_reported_as_the_device_sends_it() -> None:
    lost = Range(stamp=S, slant_range=None, valid=False)
    assert lw.make_encoder(lw.Options()).encode(lost) == [b"130.00\r"]
    assert lw.make_encoder(lw.Options(lost_m=(230.0,))).encode(lost) == [b"230.00\r"]
    assert lw.make_encoder(lw.Options(lost_m=())).encode(lost) == [b"-1.00\r"]


@pytest.mark.parametrize(
    ("name", "args", "sent", "detail"),
    [
        ("identify", {}, b"?P\r\n", "LW20,1.0,1.0"),
        ("laser", {"state": "off"}, b"#LF,0\r\n", "0"),
        ("laser", {"state": "on"}, b"#LF,1\r\n", "1"),
        ("zero_offset", {"metres": "-0.23"}, b"#LO,-0.23\r\n", "-0.23"),
        ("save", {}, b"%P\r\n", ""),
    ],
)
def test_commands_are_sent_and_acknowledged(name: str, args: dict[str, str], sent: bytes, detail: str) -> None:
    assert lw.command(name, args, LDF) == sent
    answers = lw.make_encoder(LDF).respond(sent)
    (ack,) = lw.make_decoder(LDF).feed(b"".join(answers), 1)
    assert ack == Ack(stamp=S, command=name, accepted=True, detail=detail)


@pytest.mark.parametrize(
    ("name", "args", "sentence"),
    [
        ("fire", {}, "no command 'fire'; there are identify, laser"),
        ("laser", {}, "laser: state is missing: on or off"),
        ("laser", {"state": "1"}, "laser: state = '1': must be on or off"),
        ("zero_offset", {"metres": "11"}, "zero_offset: metres = '11': must be -10 to 10"),
        ("zero_offset", {"metres": "nan"}, "must be -10 to 10"),
        ("identify", {"x": "1"}, "identify: no argument 'x'; there are none"),
    ],
)
def test_a_wrong_command_is_one_sentence(name: str, args: dict[str, str], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence.replace("(", r"\(")):
        lw.command(name, args, LDF)


def test_only_the_lw20_takes_commands() -> None:
    with pytest.raises(ValueError, match="needs query = 'ldf'"):
        lw.command("identify", {}, lw.Options())


def test_an_answer_to_something_else_is_counted_by_its_name() -> None:
    decoder = lw.make_decoder(LDF)
    assert decoder.feed(b"lt:34.10\r\n$ldf,1:2.50\r\n98.67\r\ndf,1:30.00\r\n", 1) == [Range(stamp=S, slant_range=2.5)]
    assert decoder.counters.messages == {"lt": 1, "distance": 1, "df": 1}
    assert decoder.counters.skipped == {"no_distance": 6}


def fed(options: lw.Options, *reads: tuple[float, bytes]) -> list[float | None]:
    """The ranges of reads at times [s]."""
    decoder = lw.make_decoder(options)
    measurements = [m for t_s, data in reads for m in decoder.feed(data, round(t_s * 1e9))]
    return [m.slant_range for m in measurements if isinstance(m, Range)]


NINE_HZ = tuple((k / 9, b"130.00\r\n") for k in range(1, 21))


def test_the_end_of_a_lost_signal_after_the_port_was_lost_is_no_range() -> None:
    """The cable comes off behind a line, and the port is open again in the midst of another one."""
    assert fed(lw.Options(), *NINE_HZ, (4.0, b"30.00\r\n"), (4.1, b"12.34\r\n"))[19:] == [12.34]
    assert fed(lw.Options(), *NINE_HZ, (4.0, b"\n12.33\r\n"))[19:] == [12.33]  # its beginning was seen


@pytest.mark.parametrize("query", ["none", "ldf"])
def test_halves_of_two_lines_with_the_loss_of_the_port_between_them_are_no_range(query: str) -> None:
    begin = b"ldf,1:1" if query == "ldf" else b"1"
    options = lw.Options(query=query)  # type: ignore[arg-type]
    whole = begin + b"2.34\r\n"
    assert fed(options, (0.0, b"\n"), (0.1, begin), (0.3, b"0.50\r\n"), (0.4, whole)) == [12.34]
    assert fed(options, (0.0, b"\n"), (0.1, begin), (0.11, b"2.34\r\n")) == [12.34]


def test_a_pause_that_is_usual_loses_nothing() -> None:
    slow = [(float(k), b"12.34\r\n") for k in range(30)]
    assert len(fed(lw.Options(), *slow)) == 29
    bursts = [(t + k / 500, b"12.34\r\n") for t in range(20) for k in range(15)]
    assert len(fed(lw.Options(), *bursts)) >= 20 * 15 - 2
    datagrams = [(t, b"12.34\r\n") for t in (*(k / 9 for k in range(20)), 9.0, 9.1)]
    assert len(fed(lw.Options(first_line="take"), *datagrams)) == 22


def test_names_on_the_line_do_not_fill_the_memory() -> None:
    decoder = lw.make_decoder(LDF)
    for first, second, third in itertools.product("abcdefgh", repeat=3):
        decoder.feed(f"{first}{second}{third}:1\r\n".encode(), 1)
    assert len(decoder.counters.messages) == lw.MAX_NAMES + 1
    assert decoder.counters.messages.total() == 8**3
