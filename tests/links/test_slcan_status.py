"""The status of a Lawicel adapter: requests, all kinds of answers, counters."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.canframe import pack_can, unpack_can
from fti.constants import SECOND_NS
from fti.links.slcan import Lawicel, format_frame
from fti.links.slcan_status import FLAGS, MAX_UNANSWERED, StatusWatch

ZEROS = dict.fromkeys(FLAGS.values(), 0)
# As the manual has them: bit -> what it means.
BITS = [
    (0, "slcan_rx_fifo_full"),
    (1, "slcan_tx_fifo_full"),
    (2, "slcan_error_warning"),
    (3, "slcan_data_overrun"),
    (5, "slcan_error_passive"),
    (6, "slcan_arbitration_lost"),
    (7, "slcan_bus_error"),
]


class Bench:
    """A parser and its watch; seconds pass when told."""

    def __init__(self, commands: int = 0) -> None:
        self.errors: dict[str, int] = {}
        self.watch = StatusWatch(self.errors)
        self.frames: list[bytes] = []
        self.parser = Lawicel(lambda frame, t: self.frames.append(frame), self.watch)
        self.now_ns = 0
        self.requests = 1
        self.watch.begin(0, commands)

    def hear(self, *texts: bytes) -> None:
        for text in texts:
            self.parser.feed(text, self.now_ns)

    def second(self) -> bool:
        """A second passes; was the adapter asked?"""
        self.now_ns += SECOND_NS
        due = self.watch.is_due(self.now_ns)
        if due:
            self.watch.mark_requested()
            self.requests += 1
        return due

    def known(self) -> Bench:
        """The adapter has answered the first question and was asked again."""
        self.hear(b"F00\r")
        assert self.second()
        return self


def counted(**counts: int) -> dict[str, int]:
    return ZEROS | {f"slcan_{name}": count for name, count in counts.items()}


# ------------------------------------------------------------------------------------------------------ what is counted


@pytest.mark.parametrize(("bit", "name"), BITS)
def test_each_flag_has_its_count(bit: int, name: str) -> None:
    bench = Bench().known()
    bench.hear(b"F%02x\r" % (1 << bit))
    assert bench.errors == ZEROS | {name: 1}


def test_each_answer_in_which_a_flag_stands_counts_once() -> None:
    bench = Bench().known()
    for answer in (b"F08\r", b"F2C\r", b"F00\r", b"F88\r"):
        bench.hear(answer)
        bench.second()
    assert bench.errors == counted(data_overrun=3, error_warning=1, error_passive=1, bus_error=1)


def test_what_stood_before_the_channel_was_opened_is_not_ours() -> None:
    bench = Bench()
    bench.hear(b"FEF\r")
    assert bench.errors == ZEROS
    bench.second()
    bench.hear(b"F01\r")
    bench.watch.begin(bench.now_ns, 0)  # another connection
    bench.hear(b"FEF\r")
    assert bench.errors == counted(rx_fifo_full=1)


def test_no_answer_is_not_zero() -> None:
    assert Bench().errors == {}


def test_it_is_asked_once_a_second() -> None:
    watch = Bench().known().watch
    assert not watch.is_due(2 * SECOND_NS - 1)
    assert watch.is_due(2 * SECOND_NS)
    assert not watch.is_due(2 * SECOND_NS)
    assert watch.is_due(60 * SECOND_NS)  # the recorder was stopped: what it missed is not made up for
    assert not watch.is_due(61 * SECOND_NS - 1)


def test_nobody_asked_and_nothing_is_counted() -> None:
    bench = Bench().known()
    bench.hear(b"F01\r", b"F01\r", b"F01\r")
    assert bench.errors == counted(rx_fifo_full=1)
    assert bench.parser.noise == 0


# --------------------------------------------------------------------------------------------------------- how it comes


@pytest.mark.parametrize("cuts", list(itertools.combinations(range(1, 16), 2)))
def test_an_answer_between_frames_in_any_pieces(cuts: tuple[int, int]) -> None:
    bench = Bench().known()
    text = b"t1230\rF21\rt1230\r"
    bench.hear(text[: cuts[0]], text[cuts[0] : cuts[1]], text[cuts[1] :])
    assert bench.errors == counted(error_passive=1, rx_fifo_full=1)
    assert bench.frames == [pack_can(0x123, b"")] * 2
    assert bench.parser.noise == 0


def test_late_answers_count_each() -> None:
    bench = Bench().known()
    bench.second()
    bench.hear(b"F01\rF02\r")
    assert bench.errors == counted(rx_fifo_full=1, tx_fifo_full=1)


def test_an_adapter_that_answers_after_it_was_given_up_is_asked_again() -> None:
    bench = Bench()
    while bench.second():
        pass
    bench.hear(b"F00\r")
    assert bench.second()


# ------------------------------------------------------------------------------------------------- who does not know it


@pytest.mark.parametrize("answer", [b"", b"\a", b"\r"], ids=["mute", "refuses", "says yes"])
def test_who_never_answers_is_left_alone(answer: bytes) -> None:
    bench = Bench()
    for _ in range(20):
        bench.hear(answer)
        bench.second()
    assert bench.requests == MAX_UNANSWERED
    assert not bench.watch.is_channel_closed
    assert bench.errors == {}
    assert (bench.frames, bench.parser.noise, bench.parser.refusals) == ([], 0, 17 if answer == b"\a" else 0)


@pytest.mark.parametrize("answer", [b"00\r", b"7f\r", b"F10\r", b"F3f\r"])
def test_who_speaks_another_dialect_is_left_alone_at_once(answer: bytes) -> None:
    bench = Bench()
    bench.hear(answer)
    assert not bench.second()
    assert bench.errors == {}
    assert (bench.frames, bench.parser.noise, bench.parser.answers) == ([], 0, len(answer))


def test_refusals_of_other_commands_are_not_taken_for_ours() -> None:
    bench = Bench(commands=3)
    bench.hear(b"\r\a\r")  # close, bit rate, open
    assert bench.parser.refusals == 1
    bench.hear(b"\a")
    assert bench.parser.refusals == 1
    bench.second()
    bench.hear(b"\a\a")
    assert bench.parser.refusals == 2


def test_an_adapter_that_answered_and_now_refuses_has_closed_its_channel() -> None:
    bench = Bench().known()
    for _ in range(MAX_UNANSWERED):
        assert not bench.watch.is_channel_closed
        bench.hear(b"\a")
        assert bench.second()
    assert bench.watch.is_channel_closed
    bench.hear(b"F00\r")
    assert not bench.watch.is_channel_closed


def test_an_adapter_that_answered_and_is_mute_is_asked_on() -> None:
    bench = Bench().known()
    assert all(bench.second() for _ in range(20))
    assert not bench.watch.is_channel_closed


def test_frames_keep_their_bytes() -> None:
    """A frame whose data read like an answer is a frame."""
    bench = Bench().known()
    bench.hear(b"t1001F0\r", b"F0", b"0\r")
    assert [unpack_can(frame).data for frame in bench.frames] == [b"\xf0"]


# ----------------------------------------------------------------------------------------------------------------- fuzz

reported = st.integers(0, 255).map(lambda flags: b"F%02X\r" % flags)
texts = st.one_of(
    reported,
    st.sampled_from([b"\r", b"\a", b"z\r", b"00\r", b"F", b"F0", b"F001\r", b"fF0\r", b"FF00\r"]),
    st.builds(lambda can_id, data: format_frame(pack_can(can_id, data)), st.integers(0, 0x7FF), st.binary(max_size=8)),
    st.binary(max_size=10),
)


@given(st.integers(0, 4), st.lists(st.one_of(texts, st.none()), max_size=40), st.integers(1, 20))
def test_no_text_does_harm(commands: int, parts: list[bytes | None], size: int) -> None:
    """Whatever comes: every byte has its place, and no flag counts more often than was asked."""
    bench, total = Bench(commands), 0
    for part in parts:
        if part is None:
            bench.second()
            continue
        total += len(part)
        bench.hear(*(part[at : at + size] for at in range(0, len(part), size)))
        found = bench.parser
        assert found.framed + found.answers + found.held + found.noise == total
    assert max(bench.errors.values(), default=0) < bench.requests


frames = st.builds(pack_can, st.integers(0, 0x7FF), st.binary(max_size=8))
answers = st.sampled_from([b"", b"\a", b"\r", b"00\r", b"F00\r", b"F69\r", b"F10\r"])


@given(st.lists(st.tuples(st.lists(frames, max_size=4), answers, st.integers(0, 4)), max_size=8), st.integers(1, 30))
def test_frames_are_the_same_whatever_the_adapter_answers(
    seconds: list[tuple[list[bytes], bytes, int]], size: int
) -> None:
    """The answer comes between any two frames; all is read in pieces of any size."""
    bench, text = Bench(), b""
    for sent, answer, at in seconds:
        lines = [format_frame(frame) for frame in sent]
        text += b"".join([*lines[:at], answer if bench.second() else b"", *lines[at:]])
        ready = len(text) - len(text) % size
        bench.hear(*(text[i : i + size] for i in range(0, ready, size)))
        text = text[ready:]
    bench.hear(text)
    assert bench.frames == [frame for sent, _, _ in seconds for frame in sent]
    assert bench.parser.noise == 0
