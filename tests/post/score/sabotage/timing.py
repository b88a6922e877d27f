"""Falsifications of when something was: repeated, out of order, shifted, standing still."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import orjson

from fti.logger.reading.mcap_file import McapMessage
from tests.post.score.sabotage.falsification import (
    LOCATION,
    MIN_VALID,
    Falsification,
    Sample,
    checked_outputs,
    of_topics,
    outputs,
)
from tests.post.score.sabotage.message_edits import Forgery, shift_times, tables
from tests.post.score.sabotage.session_copy import SECOND_NS

#: A stretch that is repeated, reversed or frozen: its begin as a share of the flight, its length [s].
STRETCH_AT, STRETCH_S = 0.3, 10.0
#: What a message says of times and origin, and not of the aircraft.
STAMPS = ("t_ns", "t_valid_ns", "timestamp")


def _stretch(forgery: Forgery) -> tuple[int, int]:
    begin_s = STRETCH_AT * forgery.session.end_s
    return forgery.session.ns(begin_s), forgery.session.ns(begin_s + STRETCH_S)


def _with_times_of(content: McapMessage, time: McapMessage) -> McapMessage:
    """The content of one message with all times of another."""
    table, stamps = orjson.loads(content.data), orjson.loads(time.data)
    table |= {name: stamps[name] for name in STAMPS if name in stamps}
    return time._replace(data=orjson.dumps(table))


def _repeat(forgery: Forgery, topic: str) -> None:
    forgery.edit("derived", [topic], lambda item: [item, item])


def _repeat_stretch(forgery: Forgery, topic: str) -> None:
    """What was said in a stretch is said once more behind it, with fresh times."""
    begin, end = _stretch(forgery)

    def arrange(items: list[McapMessage]) -> list[McapMessage]:
        again = [
            item._replace(
                log_time=item.log_time + end - begin,
                publish_time=item.publish_time + end - begin,
                data=shift_times(item, STRETCH_S),
            )
            for item in items
            if begin <= item.log_time < end
        ]
        return sorted([*items, *again], key=lambda item: item.log_time)

    forgery.rearrange("derived", topic, arrange)


def _swap_neighbours(forgery: Forgery, topic: str) -> None:
    """Contents of neighbours change places, with their inner times; log times stay."""

    def arrange(items: list[McapMessage]) -> list[McapMessage]:
        swapped = list(items)
        for k in range(0, len(items) - 1, 2):
            swapped[k] = items[k]._replace(data=items[k + 1].data)
            swapped[k + 1] = items[k + 1]._replace(data=items[k].data)
        return swapped

    forgery.rearrange("derived", topic, arrange)


def _reverse_stretch(forgery: Forgery, topic: str) -> None:
    """A stretch is told backwards, with the times that belong there."""
    begin, end = _stretch(forgery)

    def arrange(items: list[McapMessage]) -> list[McapMessage]:
        at = [k for k, item in enumerate(items) if begin <= item.log_time < end]
        turned = list(items)
        for k, other in zip(at, reversed(at), strict=True):
            turned[k] = items[k] if k == other else _with_times_of(items[other], items[k])
        return turned

    forgery.rearrange("derived", topic, arrange)


def _freeze(first: Callable[[Forgery], int], last: Callable[[Forgery], int]) -> Callable[[Forgery, str], None]:
    """From ``first`` to ``last`` [ns] every message says what the first one of them says, with fresh times."""

    def apply(forgery: Forgery, topic: str) -> None:
        begin, end = first(forgery), last(forgery)
        messages: list[McapMessage] = []

        def change(item: McapMessage) -> Iterable[McapMessage]:
            table = orjson.loads(item.data)
            if not begin <= item.log_time < end or not table.get("valid", True):
                return [item]
            messages[:] = messages or [item]
            frozen = _with_times_of(messages[0], item)
            return [item if frozen.data == item.data else frozen]

        forgery.edit("derived", [topic], change)

    return apply


def _shift_log_times(by_s: float) -> Callable[[Forgery, str], None]:
    def apply(forgery: Forgery, topic: str) -> None:
        by_ns = round(by_s * SECOND_NS)
        shifted = [("log_time", by_ns), ("publish_time", by_ns)]
        forgery.edit(
            "derived",
            [topic],
            lambda item: [item._replace(**{name: getattr(item, name) + ns for name, ns in shifted})],
        )

    return apply


def _shift_inner_times(by_s: float, *names: str) -> Callable[[Forgery, str], None]:
    def apply(forgery: Forgery, topic: str) -> None:
        def change(item: McapMessage) -> Iterable[McapMessage]:
            data = shift_times(item, by_s, names)
            return [item if data == item.data else item._replace(data=data)]

        forgery.edit("derived", [topic], change)

    return apply


def _shift_everything(by_s: float) -> Callable[[Forgery, str], None]:
    def apply(forgery: Forgery, topic: str) -> None:
        _shift_inner_times(by_s, "t_ns", "t_valid_ns")(forgery, topic)
        _shift_log_times(by_s)(forgery, topic)

    return apply


def _moving(sample: Sample) -> list[str]:
    """The compared outputs whose values change by more than any sigma during the flight: positions and heights."""
    return [
        topic
        for topic in checked_outputs(sample)
        if any(
            len(values) >= MIN_VALID and max(values) - min(values) > minimum
            for name, minimum in (("lat", 1e-4), ("latitude", 1e-3), ("s", 200.0), ("height_agl", 40.0), ("alt", 40.0))
            for values in [sample.values(topic).get(name, [])]
        )
    ]


def _moving_in_stretch(sample: Sample) -> list[str]:
    """Those of ``_moving`` that are valid in the stretch."""
    begin = STRETCH_AT * sample.session.end_s
    t_ns = sample.session.ns(begin), sample.session.ns(begin + STRETCH_S)
    return [
        topic
        for topic in _moving(sample)
        if sum(
            bool(table.get("valid", True)) and t_ns[0] <= table.get("t_ns", t_ns[0]) < t_ns[1]
            for table in tables(sample.session, topic)
        )
        >= MIN_VALID
    ]


def _with_validity_time(sample: Sample) -> list[str]:
    return [topic for topic in checked_outputs(sample) if topic != LOCATION]


AGE = "no output is valid for a time in the future, or for one longer ago than the device may be late (max_age_ms)"
SAME = "log time and time of an output are the same instant"
MOVED = "the aircraft moves 60 m in a second and 600 m in ten, far more than each stated sigma"

TIMING: Sequence[Falsification] = (
    Falsification("every message of output twice", "the rate is doubled", of_topics(outputs, _repeat)),
    Falsification(
        "stretch of output again with new times",
        f"twice the rate; {MOVED}",
        of_topics(checked_outputs, _repeat_stretch),
    ),
    Falsification("neighbours of output swapped", SAME, of_topics(outputs, _swap_neighbours)),
    Falsification("stretch of output backwards", MOVED, of_topics(_moving_in_stretch, _reverse_stretch)),
    Falsification(
        "output frozen for 10 s",
        MOVED,
        of_topics(
            _moving_in_stretch, _freeze(lambda forgery: _stretch(forgery)[0], lambda forgery: _stretch(forgery)[1])
        ),
    ),
    Falsification(
        "output frozen for the whole flight",
        MOVED,
        of_topics(_moving, _freeze(lambda forgery: 0, lambda forgery: 2**62)),
    ),
    Falsification("log times of output 1 s late", SAME, of_topics(outputs, _shift_log_times(1.0))),
    Falsification("log times of output 1 s early", SAME, of_topics(outputs, _shift_log_times(-1.0))),
    Falsification(
        "times inside of output 1 s late", SAME, of_topics(outputs, _shift_inner_times(1.0, "t_ns", "t_valid_ns"))
    ),
    Falsification(
        "times inside of output 1 s early", SAME, of_topics(outputs, _shift_inner_times(-1.0, "t_ns", "t_valid_ns"))
    ),
    Falsification(
        "validity times of output 1 s late", AGE, of_topics(_with_validity_time, _shift_inner_times(1.0, "t_valid_ns"))
    ),
    Falsification(
        "validity times of output 1 s early",
        AGE,
        of_topics(_with_validity_time, _shift_inner_times(-1.0, "t_valid_ns")),
    ),
    Falsification("output with all its times 3 s late", MOVED, of_topics(_moving, _shift_everything(3.0))),
    Falsification("output with all its times 3 s early", MOVED, of_topics(_moving, _shift_everything(-3.0))),
)
