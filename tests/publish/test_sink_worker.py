"""The thread of a sink: failures, reconnection, the end."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence

import pytest

from fti.publish.message import PublishedMessage
from fti.publish.sink import SinkError
from fti.publish.sink_queue import SinkQueue
from fti.service.publish import sink_worker
from fti.service.publish.sink_worker import SinkWorker, end_workers
from tests.helpers import until


class ScriptedSink:
    """Fails as it is told; remembers what arrived."""

    topics: Sequence[str] = ("*",)

    def __init__(self) -> None:
        self.refusals: list[str] = []
        self.failing = False
        self.blocked = threading.Event()
        self.blocked.set()
        self.received: list[PublishedMessage] = []
        self.is_open = False
        self.idle_calls = 0

    def open(self) -> None:
        if self.refusals:
            raise SinkError(self.refusals.pop(0))
        self.is_open = True

    def send(self, messages: Sequence[PublishedMessage]) -> None:
        self.blocked.wait(20.0)
        if self.failing:
            raise SinkError("broken pipe")
        self.idle_calls += not messages
        self.received += messages

    def count_peers(self) -> int | None:
        return 2

    def close(self) -> None:
        self.is_open = False


class Bench:
    def __init__(self) -> None:
        self.sink, self.queue = ScriptedSink(), SinkQueue()
        self.events: list[tuple[str, str, str]] = []
        self.worker = SinkWorker("mqtt", self.sink, self.queue, lambda *event: self.events.append(event))


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    monkeypatch.setattr(sink_worker, "FIRST_RETRY_S", 0.01)
    monkeypatch.setattr(sink_worker, "MAX_RETRY_S", 0.02)
    monkeypatch.setattr(sink_worker, "IDLE_S", 0.02)
    made = Bench()
    yield made
    made.sink.blocked.set()
    made.worker.request_end()
    assert made.worker.join()


def event(number: int) -> PublishedMessage:
    return PublishedMessage("/event", b"{}", number)


def test_it_connects_again_and_reports_each_failure_once(bench: Bench) -> None:
    bench.sink.refusals = ["127.0.0.1:1: connection refused"] * 5
    bench.queue.put(event(1))
    bench.worker.start()
    until(lambda: bench.sink.received)
    assert [(level, source) for level, source, _ in bench.events] == [
        ("warning", "publish mqtt"),
        ("info", "publish mqtt"),
    ]
    assert "127.0.0.1:1: connection refused" in bench.events[0][2]
    health = bench.worker.health()
    assert (health.state, health.hint, health.peers, health.sent, health.connects) == ("connected", "", 2, 1, 1)


def test_a_failed_send_loses_no_event_and_sends_all_values_again(bench: Bench) -> None:
    bench.worker.start()
    bench.queue.put(PublishedMessage("/health", b"{}", 9))
    until(lambda: bench.sink.received)
    bench.sink.failing = True
    for number in (1, 2, 3):
        bench.queue.put(event(number))
    until(lambda: bench.events)
    assert bench.worker.health().state == "retrying"
    assert bench.worker.health().waiting_events in (0, 3)  # 0: in the hands of a send that fails
    bench.sink.received.clear()
    bench.sink.failing = False
    until(lambda: len(bench.sink.received) >= 4)
    assert [m.number for m in bench.sink.received if m.topic == "/event"] == [1, 2, 3]
    assert [m.number for m in bench.sink.received if m.topic == "/health"][-1:] == [9]
    assert bench.worker.health().connects >= 2


def test_a_blocked_sink_never_blocks_the_queue(bench: Bench) -> None:
    bench.worker.start()
    until(lambda: bench.sink.idle_calls)
    bench.sink.blocked.clear()
    begin = time.monotonic()
    for number in range(20_000):
        bench.queue.put(PublishedMessage("/health", b"{}", number))
        bench.queue.put(event(number))
    assert bench.queue.waiting_events <= 4096
    assert time.monotonic() - begin < 15.0, "waited for the sink, which is blocked for 20 s"
    assert bench.worker.health().lost_events > 0


def test_the_last_messages_are_sent_at_the_end(bench: Bench) -> None:
    bench.worker.start()
    until(lambda: bench.sink.is_open)
    for number in (1, 2):
        bench.queue.put(event(number))
    bench.worker.request_end()
    assert bench.worker.join()
    assert [m.number for m in bench.sink.received] == [1, 2]
    assert not bench.sink.is_open


def test_a_peer_that_always_disconnects_is_tried_ever_more_rarely(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A broker that refuses a topic by ending the connection; each attempt gives two events."""
    monkeypatch.setattr(sink_worker, "MAX_RETRY_S", 10.0)
    bench.sink.failing = True
    bench.worker.start()
    until(lambda: bench.worker.health().connects >= 2)
    time.sleep(1.0)
    assert 3 <= bench.worker.health().connects <= 8  # 0.01 s, 0.02 s, ...: their sum is 1.27 s after seven
    bench.sink.failing = False


def test_events_that_wait_at_the_end_are_lost_and_reported(bench: Bench) -> None:
    bench.sink.refusals = ["127.0.0.1:1: connection refused"] * 1000
    for number in (1, 2, 3):
        bench.queue.put(event(number))
    bench.worker.start()
    until(lambda: bench.events)
    bench.worker.request_end()
    assert bench.worker.join()
    health = bench.worker.health()
    assert (health.waiting_events, health.lost_events) == (0, 3)
    assert bench.events[-1] == ("warning", "publish mqtt", "events that could not be sent before the end: 3")


def test_a_sink_that_blocks_does_not_hold_the_end(bench: Bench) -> None:
    bench.worker.start()
    until(lambda: bench.sink.idle_calls)
    bench.sink.blocked.clear()
    bench.queue.put(event(1))
    time.sleep(0.1)
    bench.worker.request_end()
    assert not bench.worker.join(0.2)


def test_an_unexpected_failure_of_a_library_is_reported_and_retried(bench: Bench) -> None:
    def panic() -> None:
        bench.sink.open = ScriptedSink.open.__get__(bench.sink)  # type: ignore[method-assign]
        raise BaseException("panic of a Rust library")

    bench.sink.open = panic  # type: ignore[method-assign]
    bench.worker.start()
    until(lambda: bench.sink.is_open)
    assert "panic of a Rust library" in bench.events[0][2]


def test_several_blocked_sinks_share_the_time_of_the_end() -> None:
    """The supervisor waits for 3 s altogether."""
    benches = [Bench() for _ in range(6)]
    for one in benches:
        one.worker.start()
        until(lambda one=one: one.sink.is_open)  # type: ignore[misc]
        one.sink.blocked.clear()
        one.queue.put(event(1))
    time.sleep(0.1)
    begin_s = time.monotonic()
    assert len(end_workers([one.worker for one in benches], timeout_s=0.5)) == 6
    assert time.monotonic() - begin_s < 6 * 0.5
    for one in benches:
        one.sink.blocked.set()
        assert one.worker.join()
