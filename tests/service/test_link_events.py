"""Ports that do not open are events; a moment without one is not."""

from __future__ import annotations

from typing import Any

from fti.clock import FakeClock
from fti.service.supervisor.event_publisher import MIN_DURATION_NS, EventPublisher, LinkEvents, RepetitionFilter

SECOND_NS = 1_000_000_000
Events = list[tuple[float, str, str]]


def follow(*states: tuple[float, str]) -> Events:
    """Events of a link with these states from these times [s] on, checked twice a second for 20 s."""
    link_events, events = LinkEvents(), Events()
    for half in range(40):
        t_s = half / 2
        state = [state for begin_s, state in states if begin_s <= t_s][-1]
        for level, source, text in link_events.update({"eth": {"state": state, "hint": "why"}}, round(t_s * SECOND_NS)):
            assert (level, source) == ("warning", "eth")
            events.append((t_s, text, state))
    return events


def test_a_lasting_state_is_reported_once_and_so_is_its_end() -> None:
    lasting_s = MIN_DURATION_NS / SECOND_NS
    assert follow((0.0, "absent"), (10.0, "silent"), (11.0, "good")) == [
        (lasting_s, "absent: why", "absent"),
        (10.0 + lasting_s, "the port is open now", "good"),
    ]


def test_another_trouble_is_reported_too() -> None:
    assert [text for _, text, _ in follow((0.0, "absent"), (7.0, "denied"))] == ["absent: why", "denied: why"]


def test_a_moment_and_what_is_wrong_with_the_bytes_are_not() -> None:
    assert follow((0.0, "absent"), (1.0, "good"), (5.0, "absent"), (6.0, "good")) == []
    assert follow((0.0, "good"), (2.0, "noise"), (6.0, "silent"), (9.0, "invalid"), (12.0, "wrong rate")) == []


def test_it_is_an_event_for_terminal_and_file() -> None:
    lines, notes = list[str](), list[Any]()
    event_publisher = EventPublisher(FakeClock(), lambda topic, payload: None, lines.append, notes.append)
    link = {"state": "busy", "hint": "127.0.0.1:1: in use by another program"}
    for t_ns in (0, MIN_DURATION_NS):
        event_publisher.health({"t_ns": t_ns, "links": {"eth": link}}, record=False)
    assert lines == ["warning: eth: busy: 127.0.0.1:1: in use by another program"]
    assert [note.event.source for note in notes] == ["eth"]


def test_ports_of_sensors_that_are_off_are_no_warning() -> None:
    link_events, events = LinkEvents(), list[tuple[float, str, str]]()

    def follow(name: str, until_s: float, state: str) -> None:
        for tenth in range(round(until_s * 10)):
            t_ns = begin_ns + tenth * SECOND_NS // 10
            for level, _, text in link_events.update({name: {"state": state, "hint": "why"}}, t_ns):
                events.append(((t_ns - begin_ns) / SECOND_NS, level, text))

    begin_ns = 0
    link_events.expect_changes(True, begin_ns)
    follow("opens", 5.0, "absent")
    follow("stays", 5.0, "absent")
    assert events == [(4.0, "info", "absent: why")] * 2
    begin_ns = 5 * SECOND_NS
    link_events.expect_changes(False, begin_ns)
    follow("opens", 5.0, "good")
    follow("stays", 5.0, "absent")
    assert events[2:] == [(4.0, "info", "the port is open now"), (4.0, "warning", "absent: why")]


def test_warnings_are_not_shown_while_the_sensors_are_off() -> None:
    lines, notes = list[str](), list[Any]()
    event_publisher = EventPublisher(FakeClock(), lambda topic, payload: None, lines.append, notes.append)
    for are_off in (True, False):
        event_publisher.set_sensors_off(are_off)
        for level in ("info", "warning", "error"):
            event_publisher.publish_event(level, "nav", f"sensors off: {are_off}")
    assert lines == [
        "error: nav: sensors off: True",
        "warning: nav: sensors off: False",
        "error: nav: sensors off: False",
    ]
    assert len(notes) == 6  # all are recorded


def test_repetitions_of_a_line_are_counted() -> None:
    """Twice a second until 12 s; another line is shown meanwhile."""
    repetitions, shown = RepetitionFilter(), list[tuple[float, str]]()
    for half in range(80):
        t_s = half / 2
        now_ns = round(t_s * SECOND_NS)
        lines = ["a"] if t_s <= 12.0 else []
        shown += [(t_s, line) for line in [*lines, *(["b"] if t_s == 3.0 else [])] if repetitions.admits(line, now_ns)]
        shown += [(t_s, line) for line in repetitions.flush(now_ns)]
    assert shown == [
        (0.0, "a"),
        (3.0, "b"),
        (10.0, "a (repeated 20 times in 10 s)"),
        (20.0, "a (repeated 4 times in 10 s)"),
    ]
    assert repetitions.admits("a", 40 * SECOND_NS)


def test_each_repetition_is_published_and_recorded() -> None:
    lines, topics, notes = list[str](), list[str](), list[Any]()
    publisher = EventPublisher(FakeClock(), lambda topic, payload: topics.append(topic), lines.append, notes.append)
    for _ in range(3):
        publisher.publish_event("warning", "ins", "position unconfirmed")
    assert lines == ["warning: ins: position unconfirmed"]
    assert len(topics) == len(notes) == 3
