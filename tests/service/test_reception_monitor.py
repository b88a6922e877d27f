"""Events of lost frames, refused stamps and pauses of the recorder: how many, on which link, and why."""

from __future__ import annotations

from dataclasses import replace

from fti.buffers.triple_buffer import TripleBuffer
from fti.links import LinkStatus
from fti.service.recorder.reception_monitor import EVENT_PERIOD_NS, ReceptionMonitor
from fti.service.recorder.storage_monitor import Dropped

SECOND_NS = 1_000_000_000
TICK_NS = 20_000_000
BEGIN_NS = 1_700_000_000 * SECOND_NS


class Session:
    """A recorder with one link: its loop turns every 20 ms, its counters are looked at twice a second."""

    def __init__(self) -> None:
        self.monitor, self.status, self.now_ns = ReceptionMonitor(), LinkStatus(), BEGIN_NS
        self.events: list[tuple[float, str, str]] = []
        self.pauses: list[float] = []

    def run(self, seconds: float, dropped_per_check: int = 0) -> None:
        """Let time pass."""
        for _ in range(round(seconds * SECOND_NS / TICK_NS)):
            self.now_ns += TICK_NS
            self.pauses += filter(None, [self.monitor.on_cycle(self.now_ns)])
            if self.now_ns % (SECOND_NS // 2) == 0:
                self.status.socket_dropped += dropped_per_check
                self.check()

    def check(self, *, final: bool = False) -> None:
        """The counters."""
        for level, source, text in self.monitor.events(self.now_ns, [("eth", self.status)], final=final):
            assert level == "warning"
            self.events.append(((self.now_ns - BEGIN_NS) / SECOND_NS, source, text))

    def stand_still(self, seconds: float) -> None:
        """The process gets no time."""
        self.now_ns += round(seconds * SECOND_NS)

    def texts(self, source: str) -> list[str]:
        return [text for _, who, text in self.events if who == source]


def test_nothing_is_reported_while_all_is_well() -> None:
    session = Session()
    session.run(60)
    session.check(final=True)
    assert session.events == []
    assert session.pauses == []


def test_a_recorder_that_stood_still_is_the_cause_of_what_the_kernel_dropped() -> None:
    session = Session()
    session.run(1)
    session.stand_still(12.5)
    session.run(0.5, dropped_per_check=40_000)  # reported with the first datagrams after the pause
    session.run(0.5, dropped_per_check=3_768)  # and what is asked for
    session.run(1)
    assert session.pauses == [12.52]
    assert session.texts("recorder") == ["stood still for 12.5 s: no data were read or written"]
    (text,) = session.texts("eth")
    assert (
        text == "the kernel dropped 43768 frames: the recorder stood still for 12.5 s, and the receive queue was full"
    )


def test_a_late_recorder_is_not_reported_as_a_standstill() -> None:
    session = Session()
    session.run(1)
    session.stand_still(0.9)
    session.run(0.5, dropped_per_check=7)
    session.run(1)
    assert session.pauses == []
    assert session.texts("eth") == [
        "the kernel dropped 7 frames: the receive queue was full before the recorder read it"
    ]


def test_a_pause_long_ago_is_not_the_cause() -> None:
    session = Session()
    session.stand_still(0)
    session.run(1)
    session.stand_still(30)
    session.run(5)
    session.run(0.5, dropped_per_check=7)
    session.run(1)
    assert session.texts("eth") == [
        "the kernel dropped 7 frames: the receive queue was full before the recorder read it"
    ]


def test_what_goes_on_for_a_minute_is_reported_now_and_then_and_adds_up() -> None:
    session = Session()
    session.run(60, dropped_per_check=3)
    session.check(final=True)
    counts = [int(text.split()[3]) for text in session.texts("eth")]
    assert sum(counts) == session.status.socket_dropped == 360
    assert len(counts) <= 60 * SECOND_NS / EVENT_PERIOD_NS + 1


def test_the_last_frames_are_reported_at_the_end() -> None:
    session = Session()
    session.run(3)
    session.status.socket_dropped, session.status.stamp_refused = 2, 1
    session.check(final=True)
    drops, stamps = session.texts("eth")
    assert drops.startswith("the kernel dropped 2 frames: ")
    assert stamps.startswith("1 kernel timestamps were refused: ")


def test_refused_stamps_are_reported_beside_drops() -> None:
    session = Session()
    session.run(1)
    session.status.stamp_refused = 5
    session.run(2)
    (text,) = session.texts("eth")
    assert text.startswith("5 kernel timestamps were refused: they may be from before a step of the real-time clock")


def test_losses_of_an_outage_are_those_of_the_buffers_and_of_the_kernel() -> None:
    before = Dropped(frames=10, bytes=100, kernel_frames=5)
    buffer = replace(TripleBuffer(1000).stats, dropped_frames=13, dropped_bytes=160)
    now = Dropped.of(buffer, LinkStatus(socket_dropped=43_773))
    assert now.describe_since(before, "eth") == ["3 frames (60 bytes) of eth", "43768 frames of eth by the kernel"]
    assert before.describe_since(before, "eth") == []
