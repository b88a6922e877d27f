"""The queue of a sink: what it keeps, what it replaces, what it counts."""

from __future__ import annotations

import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fti.publish import sink_queue
from fti.publish.fan_out import FanOut
from fti.publish.message import PublishedMessage
from fti.publish.sink_queue import SinkQueue

TIMEOUT_S = 5.0


class SimulatedClock:
    """In the place of the module ``time``."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def monotonic(self) -> float:
        return self.now_s


def value(number: int, topic: str = "/nav/glide_slope") -> PublishedMessage:
    return PublishedMessage(topic, b"{}", number)


def event(number: int, size: int = 2) -> PublishedMessage:
    return PublishedMessage("/event", b"x" * size, number)


def numbers(messages: list[PublishedMessage]) -> list[int]:
    return [message.number for message in messages]


def test_events_are_all_kept_in_order_and_of_values_the_newest() -> None:
    queue = SinkQueue()
    for number in (1, 2, 3):
        queue.put(value(number))
        queue.put(event(number))
    assert queue.waiting_events == 3
    messages = queue.take(TIMEOUT_S)
    assert [(m.topic, m.number) for m in messages] == [
        ("/event", 1),
        ("/event", 2),
        ("/event", 3),
        ("/nav/glide_slope", 3),
    ]
    assert (queue.counts.replaced, queue.counts.skipped, queue.counts.lost_events) == (2, 0, 0)
    assert queue.take(0.0) == []


def test_events_beyond_the_limit_are_lost_oldest_first_and_counted() -> None:
    queue = SinkQueue()
    for number in range(sink_queue.MAX_EVENTS + 10):
        queue.put(event(number))
    assert queue.counts.lost_events == 10
    messages = queue.take(TIMEOUT_S)
    assert numbers(messages) == [*range(10, sink_queue.MAX_EVENTS + 10)]


def test_events_beyond_the_limit_of_bytes_are_lost() -> None:
    queue, size = SinkQueue(), sink_queue.MAX_EVENT_BYTES // 4
    for number in range(7):
        queue.put(event(number, size))
    assert numbers(queue.take(TIMEOUT_S)) == [3, 4, 5, 6]
    for number in range(4):  # the bytes of what was taken are free again
        queue.put(event(number, size))
    assert queue.counts.lost_events == 3


def test_a_failed_batch_returns_in_front_of_newer_events() -> None:
    queue = SinkQueue()
    queue.put(event(1))
    queue.put(event(2))
    failed = queue.take(TIMEOUT_S)
    queue.put(event(3))
    queue.put_back(failed)
    assert numbers(queue.take(TIMEOUT_S)) == [1, 2, 3]


def test_after_a_reconnection_the_newest_value_of_each_topic_is_sent_again() -> None:
    queue = SinkQueue(max_rate_hz=0.01)
    queue.put(value(1, "/health"))
    queue.put(value(1))
    queue.put(value(2))
    queue.put(event(1))
    assert len(queue.take(TIMEOUT_S)) == 3
    queue.queue_all_values()
    assert {(m.topic, m.number) for m in queue.take(TIMEOUT_S)} == {("/health", 1), ("/nav/glide_slope", 2)}


def test_only_configured_topics_are_kept() -> None:
    queue = SinkQueue(["/nav/*", "/event"])
    for topic in ("/nav/glide_slope", "/nav/height_above_ground/radalt", "/health", "/event"):
        queue.put(value(1, topic))
    assert {m.topic for m in queue.take(TIMEOUT_S)} == {
        "/nav/glide_slope",
        "/nav/height_above_ground/radalt",
        "/event",
    }


def test_the_rate_limits_each_topic_and_counts_what_it_leaves_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten seconds at 50 Hz of a simulated clock give 5 Hz; the last value is sent."""
    clock = SimulatedClock()
    monkeypatch.setattr(sink_queue, "time", clock)
    queue, sent = SinkQueue(max_rate_hz=5.0), []
    for number in range(500):
        queue.put(value(number))
        sent += numbers(queue.take(0.0))
        clock.now_s += 0.02
    clock.now_s += 0.2
    sent += numbers(queue.take(0.0))
    assert 49 <= len(sent) <= 52
    assert sent[-1] == 499
    assert (queue.counts.skipped, queue.counts.replaced) == (500 - len(sent), 0)


def test_without_a_reader_values_are_replaced_not_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = SimulatedClock()
    monkeypatch.setattr(sink_queue, "time", clock)
    queue = SinkQueue(max_rate_hz=5.0)
    for number in range(500):
        queue.put(value(number))
        clock.now_s += 1.0
    assert (queue.counts.skipped, queue.counts.replaced) == (0, 499)


def test_take_waits_for_a_message() -> None:
    queue = SinkQueue()
    timer = threading.Timer(0.05, queue.put, [event(1)])
    timer.start()
    assert numbers(queue.take(TIMEOUT_S)) == [1]
    timer.join()


def test_close_ends_take_and_keeps_what_waits() -> None:
    queue = SinkQueue()
    timer = threading.Timer(0.05, queue.close)
    timer.start()
    assert queue.take(TIMEOUT_S) == []
    timer.join()
    queue.put(value(7))
    assert queue.take(TIMEOUT_S) == []
    assert numbers(queue.take_all()) == [7]


def test_the_numbers_of_each_topic_count_from_one_for_all_sinks() -> None:
    queues = [SinkQueue(["/event"]), SinkQueue()]
    fan_out = FanOut(queues)
    for topic in ("/event", "/health", "/event"):
        fan_out.publish(topic, b"{}")
    assert numbers(queues[0].take(TIMEOUT_S)) == [1, 2]
    assert [(m.topic, m.number) for m in queues[1].take(TIMEOUT_S)] == [("/event", 1), ("/event", 2), ("/health", 1)]


def test_a_flood_of_topics_is_bounded() -> None:
    queue = SinkQueue()
    fan_out = FanOut([queue])
    for number in range(3 * sink_queue.MAX_TOPICS):
        fan_out.publish(f"/nav/x{number}", b"{}")
    assert len(queue.take(TIMEOUT_S)) == sink_queue.MAX_TOPICS


Step = st.one_of(st.just("event"), st.sampled_from(["/a", "/b"]), st.sampled_from(["take", "fail", "reconnect"]))


@given(st.lists(Step, max_size=80))
def test_no_event_is_lost_and_the_newest_values_arrive(steps: list[str]) -> None:
    """Whatever fails in between: events arrive in order, at least once, and the last value of each topic arrives."""
    queue, put, got = SinkQueue(), {"/event": 0, "/a": 0, "/b": 0}, []
    for step in [*steps, "reconnect"]:
        if step in ("take", "fail"):
            batch = queue.take_all()
            if step == "fail":
                queue.put_back(batch)
                queue.queue_all_values()
            else:
                got += batch
        elif step == "reconnect":
            queue.queue_all_values()
        else:
            topic = "/event" if step == "event" else step
            put[topic] += 1
            queue.put(PublishedMessage(topic, b"{}", put[topic]))
    got += queue.take_all()
    assert [m.number for m in got if m.topic == "/event"] == [*range(1, put["/event"] + 1)]
    for topic in ("/a", "/b"):
        order = [m.number for m in got if m.topic == topic]
        assert order == sorted(order)
        assert (order[-1] if order else 0) == put[topic]
