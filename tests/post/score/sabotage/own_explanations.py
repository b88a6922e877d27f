"""Falsifications with an explanation that the unit under test writes itself: a flag is hidden, or an output has a hole.

Only the emulator knows whether the bench was late; it says so in the truth file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

import orjson

from fti.logger.reading.mcap_file import McapMessage
from tests.post.score.sabotage.falsification import Falsification, Sample, Target, checked_outputs
from tests.post.score.sabotage.flags import HEALTH, Flag, flags_of, hide
from tests.post.score.sabotage.message_edits import Forgery, Table
from tests.post.score.sabotage.session_copy import SECOND_NS

#: What is falsified where a session has no expected flag: a hole of this length [s], at this part of the flight.
HOLE_S, HOLE_AT = 5.0, 0.45
#: An explanation stands from so long before the fault until so long after [s].
EXPLANATION_S = 4.0
#: So many flags of a session are hidden, or so many outputs have a hole, with each explanation.
MAX_PICKED = 3
Explanation = Callable[[Forgery, float], None]
T = TypeVar("T")


def _lag_of_health(forgery: Forgery, at_s: float) -> None:
    """Navigation says in each report that it is 600 ms behind."""
    forgery.edit_notes(HEALTH, lambda note, t: note["navigation"].update(lag_ms=600.0))


def _lag_during(forgery: Forgery, at_s: float) -> None:
    def change(note: Table, t: float) -> None:
        if abs(t - at_s) < EXPLANATION_S:
            note["navigation"]["lag_ms"] = 600.0

    forgery.edit_notes(HEALTH, change)


def _begins_late(forgery: Forgery, at_s: float) -> None:
    """Navigation says nothing of itself until the fault is over."""

    def change(note: Table, t: float) -> None:
        if t < at_s + EXPLANATION_S:
            note["navigation"]["lag_ms"] = None

    forgery.edit_notes(HEALTH, change)


def _remove_ticks(forgery: Forgery, at_s: float) -> None:
    """The recorder stood still, so that it did not tick."""
    forgery.edit(
        "raw",
        ["/fti/tick"],
        lambda item: [] if abs(forgery.session.seconds(item.log_time) - at_s) < EXPLANATION_S else [item],
    )
    forgery.renumber()


def _busy_event(forgery: Forgery, at_s: float) -> None:
    """An event says that the machine had no time."""
    at_ns = forgery.session.ns(at_s)
    for kind in ("raw", "derived"):
        events = [item for item in forgery.session.items(kind) if item.topic.name == "/fti/event"]
        if events:
            forgery.rearrange(kind, "/fti/event", _insert(_event(events[0], at_ns)))


def _insert(message: McapMessage) -> Callable[[list[McapMessage]], list[McapMessage]]:
    return lambda items: sorted([*items, message], key=_log_time)


def _event(like: McapMessage, at_ns: int) -> McapMessage:
    table = orjson.loads(like.data) | {
        "timestamp": {"sec": at_ns // SECOND_NS, "nsec": at_ns % SECOND_NS},
        "level": 2,
        "name": "pipeline",
        "message": "the machine is busy: navigation is late",
    }
    return like._replace(log_time=at_ns, publish_time=at_ns, data=orjson.dumps(table))


def _log_time(item: McapMessage) -> int:
    return item.log_time


def _other_kind_of_flight(forgery: Forgery, at_s: float) -> None:
    """An accelerated flight says that it was flown in real time, and the other way round."""
    metadata = forgery.session.files["raw"][0].metadata["fti"]
    forgery.set_metadata("fti", "accelerated", None if metadata.get("accelerated") == "true" else "true")


def _late_publish_times(forgery: Forgery, at_s: float) -> None:
    """Everything of the session was written a second after it was true."""
    for kind in ("raw", "derived"):
        forgery.edit(
            kind,
            forgery.session.topics(kind),
            lambda item: [item._replace(publish_time=item.publish_time + SECOND_NS)],
        )


def _all_explanations(forgery: Forgery, at_s: float) -> None:
    """All explanations of navigation at a time."""
    for explain in (_lag_of_health, _remove_ticks, _busy_event, _late_publish_times, _other_kind_of_flight):
        explain(forgery, at_s)


EXPLANATIONS: Sequence[tuple[str, Explanation]] = (
    ("lag of 600 ms in each health", _lag_of_health),
    ("lag of 600 ms around the fault", _lag_during),
    ("navigation that begins behind the fault", _begins_late),
    ("ticks missing around the fault", _remove_ticks),
    ("an event that says busy", _busy_event),
    ("another kind of flight", _other_kind_of_flight),
    ("late publish times", _late_publish_times),
    ("all of these", _all_explanations),
)


def _targets(explain: Explanation) -> Callable[[Sample], Iterator[Target]]:
    def targets(sample: Sample) -> Iterator[Target]:
        flags = [flag for flag in flags_of(sample) if flag.value is None]
        if not flags:
            yield from (_hole(topic, explain) for topic in _pick(checked_outputs(sample)))
        for flag in _pick(flags):
            yield Target(flag.name, lambda forgery, flag=flag: _hide_and_explain(forgery, flag, explain))  # type: ignore[misc]

    return targets


def _pick(things: Sequence[T]) -> Sequence[T]:
    """Some of them, from the first to the last."""
    return things[:: max(1, len(things) // MAX_PICKED)][:MAX_PICKED]


def _hide_and_explain(forgery: Forgery, flag: Flag, explain: Explanation) -> None:
    hide(forgery, flag)
    explain(forgery, flag.from_s)


def _hole(topic: str, explain: Explanation) -> Target:
    def apply(forgery: Forgery) -> None:
        begin_s = HOLE_AT * forgery.session.end_s
        forgery.edit(
            "derived",
            [topic],
            lambda item: [] if 0.0 <= forgery.session.seconds(item.log_time) - begin_s < HOLE_S else [item],
        )
        explain(forgery, begin_s)

    return Target(f"hole in {topic}", apply)


OWN_EXPLANATIONS: Sequence[Falsification] = tuple(
    Falsification(
        f"explained by {name}",
        "only the emulator knows when the bench was late; what the unit under test writes explains nothing",
        _targets(explain),
    )
    for name, explain in EXPLANATIONS
)
