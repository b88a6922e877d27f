"""Falsifications of what values are called: validity, reasons, sources, sensors, states, topics."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from fti.logger.reading.mcap_file import McapMessage
from tests.post.score.sabotage.falsification import (
    GLIDE_SLOPE,
    HEIGHT,
    INTEGRITY,
    MIN_VALID,
    Falsification,
    Sample,
    Target,
    checked_outputs,
    of_topics,
    once,
)
from tests.post.score.sabotage.message_edits import Forgery, Table, tables

#: States of the monitor that vouch for nothing and warn of nothing.
QUIET_STATES = ("acquire", "monitor", "unavailable")


def _with_reasons(sample: Sample) -> list[str]:
    return [topic for topic in checked_outputs(sample) if "reasons" in tables(sample.session, topic)[0]]


def _heights(sample: Sample) -> list[str]:
    return [topic for topic in checked_outputs(sample) if topic.startswith(HEIGHT)]


def _solutions(sample: Sample) -> list[str]:
    return [topic for topic in checked_outputs(sample) if "position_source" in tables(sample.session, topic)[0]]


def _often_invalid(sample: Sample) -> list[str]:
    """Outputs that are invalid for some time while the flight goes on."""
    return [
        topic
        for topic in sample.outputs
        if sum(table.get("valid") is False for table in tables(sample.session, topic)) >= MIN_VALID
    ]


def _often_with_reasons(sample: Sample) -> list[str]:
    """Outputs that say for some time why they are not valid."""
    return [
        topic
        for topic in sample.outputs
        if sum(table.get("valid") is False and bool(table["reasons"]) for table in tables(sample.session, topic))
        >= MIN_VALID
    ]


def _edit(change: Callable[[Table], None], from_share: float = 0.0) -> Callable[[Forgery, str], None]:
    """The same change of every message of a topic, from a part of the flight on."""

    def apply(forgery: Forgery, topic: str) -> None:
        def at(table: Table, t: float) -> None:
            if t >= from_share * forgery.session.end_s:
                change(table)

        forgery.edit_tables("derived", [topic], at)

    return apply


def _set_values(**keys: object) -> Callable[[Table], None]:
    def change(table: Table) -> None:
        table.update(keys)

    return change


def _set_reason(reason: str) -> Callable[[Table], None]:
    """The output is not valid, and the reason explains it elsewhere."""

    def change(table: Table) -> None:
        table["valid"], table["reasons"] = False, [reason]
        if "state" in table:
            table["state"] = "no_profile" if reason == "no_profile" else "unavailable"

    return change


def _drop_reasons(table: Table) -> None:
    if not table["valid"]:
        table["reasons"] = []


def _add_reason(table: Table) -> None:
    if table["valid"]:
        table["reasons"] = [*table["reasons"], "stale"]


def _swap_topics(forgery: Forgery) -> None:
    """What one altimeter says stands under the name of the other, with the sensor as it was."""
    first, second = forgery.session.topics("derived", HEIGHT)[:2]
    topics = {item.topic.name: item.topic for item in forgery.session.items("derived")}
    other = {first: topics[second], second: topics[first]}

    def change(item: McapMessage) -> list[McapMessage]:
        return [item._replace(topic=other[item.topic.name])]

    forgery.edit("derived", [first, second], change)


def _two_altimeters(sample: Sample) -> Iterator[Target]:
    if len(_heights(sample)) > 1:
        yield from once(_swap_topics)(sample)


def _other_source(name: str) -> Callable[[Table], None]:
    def change(table: Table) -> None:
        if table[name] is not None:
            table[name] = "spare" if table[name] != "spare" else "other"

    return change


def _states(sample: Sample, wanted: tuple[str, ...]) -> list[str]:
    """The monitor's topic where it says one of these often enough."""
    return [
        topic
        for topic in sample.outputs
        if topic == INTEGRITY
        and sum(table["state"] in wanted for table in tables(sample.session, topic)) >= MIN_VALID / 2
    ]


def _state(before: tuple[str, ...], after: str) -> Callable[[Table], None]:
    def change(table: Table) -> None:
        if table["state"] in before:
            table["state"] = after
            table["valid"] = after in ("ok", "alert", "caution")
            table["reasons"] = [] if after == "ok" else table["reasons"]

    return change


ALWAYS = "where the scenario and the configuration explain no failure, the output is valid, and says why where not"
LABELS: Sequence[Falsification] = (
    Falsification(
        "never valid, no reason", ALWAYS, of_topics(_with_reasons, _edit(_set_values(valid=False, reasons=[])))
    ),
    Falsification("never valid, stale", ALWAYS, of_topics(_with_reasons, _edit(_set_reason("stale")))),
    *(
        Falsification(
            f"never valid, explained by {reason}",
            "a reason explains an output where the truth has its cause, and nowhere else",
            of_topics(_with_reasons, _edit(_set_reason(reason))),
        )
        for reason in (
            "no_profile",
            "outside_profile",
            "position_not_observable",
            "end",
            "go_around",
            "above_range",
            "below_range",
            "below_150_m",
            "no_position",
            "roll",
            "terrain_edge",
        )
    ),
    Falsification(
        "not valid from half of the flight on, explained by outside_profile",
        "a reason explains an output where the truth has its cause, and nowhere else",
        of_topics(_with_reasons, _edit(_set_reason("outside_profile"), from_share=0.5)),
    ),
    Falsification(
        "always valid",
        "a fault must take the validity away; the values that are then there are missing or wrong",
        of_topics(_often_invalid, _edit(_set_values(valid=True, reasons=[]))),
    ),
    Falsification(
        "always valid, reasons kept",
        "no output is valid and not valid at a time",
        of_topics(_often_invalid, _edit(_set_values(valid=True))),
    ),
    Falsification(
        "reasons dropped",
        "an output that is not valid names the reason, and each expected flag is such a reason",
        of_topics(_often_with_reasons, _edit(_drop_reasons)),
    ),
    Falsification(
        "reason added", "nothing in the flight explains stale values", of_topics(_with_reasons, _edit(_add_reason))
    ),
    Falsification(
        "sensor renamed",
        "the topic and the configuration name the altimeter",
        of_topics(_heights, _edit(_set_values(sensor="other"))),
    ),
    Falsification(
        "heights of two altimeters exchanged", "the topic and the sensor name the same altimeter", _two_altimeters
    ),
    Falsification(
        "position source renamed",
        "the preferred device has the role as long as no fault takes it away",
        of_topics(_solutions, _edit(_other_source("position_source"))),
    ),
    Falsification(
        "attitude source renamed",
        "the preferred device has the role as long as no fault takes it away",
        of_topics(_solutions, _edit(_other_source("attitude_source"))),
    ),
    Falsification(
        "position source missing",
        "a valid position has a source",
        of_topics(_solutions, _edit(_set_values(position_source=None))),
    ),
    Falsification(
        "height of another datum",
        "the height above ground is above the ground",
        of_topics(_heights, _edit(_set_values(datum="msl"))),
    ),
    Falsification(
        "height of another point",
        "heights are those of P, as the truth is",
        of_topics(_heights, _edit(_set_values(point="antenna"))),
    ),
    Falsification(
        "ok in place of alert and caution",
        "an obstacle or an absolute mismatch of the flight must raise the alarm",
        of_topics(lambda sample: _states(sample, ("alert", "caution")), _edit(_state(("alert", "caution"), "ok"))),
    ),
    Falsification(
        "ok in place of unavailable",
        "a monitor without its inputs must not vouch for the height",
        of_topics(lambda sample: _states(sample, ("unavailable",)), _edit(_state(("unavailable",), "ok"))),
    ),
    Falsification(
        "alert in place of ok",
        "nothing in the flight explains an alarm",
        of_topics(lambda sample: _states(sample, ("ok",)), _edit(_state(("ok",), "alert"))),
    ),
    *(
        Falsification(
            f"{state} in place of ok",
            "on the published path, with its inputs there, the monitor vouches for the height",
            of_topics(lambda sample: _states(sample, ("ok",)), _edit(_state(("ok",), state))),
        )
        for state in QUIET_STATES
    ),
    Falsification(
        "deviation without validity",
        "while the monitor vouches for the height, the deviation is valid",
        of_topics(
            lambda sample: [topic for topic in checked_outputs(sample) if topic == GLIDE_SLOPE],
            _edit(_set_reason("integrity")),
        ),
    ),
)
