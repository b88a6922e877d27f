"""The alarms that must follow from the flags of a fault.

An alarm is a flag at ``/fti/alarm``; its word is its identity (docs/alarms.md).  It stands while its condition lasts,
whether or not a person has acknowledged it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from fti.alarms.condition import device_id
from fti.hil.expected.aircraft import Aircraft
from fti.hil.expected.duties import (
    DEVICES,
    HEALTH_S,
    HEIGHT,
    INTEGRITY,
    LINKS,
    MEMORY_S,
    SOLUTION,
    Duty,
    Told,
    doubted_s,
)
from fti.logger.schemas import ALARM_TOPIC
from fti.nav.alarm_conditions import ALTIMETER_FAULTS, INTEGRITY_IDS
from fti.nav.navigation import FILTER, RADIO
from fti.types import LinkState, Reason

#: From a flag to its alarm, and from the end of the one to that of the other [s]: health is judged twice a second, and
#: recorded every second time; an altimeter must be wrong for half a second; a wrong rate must last for 5 s.
JUDGED_S, FAULT_S, RATE_S = 1.0, 0.5, 5.0
#: Devices that were never good are no alarm at first, and a position that was never valid was not lost [s].
STARTED_S = 10.0
#: What health says of a device that does not speak as it should.
NOT_AS_CONFIGURED = (LinkState.SILENT, LinkState.NOISE, LinkState.WRONG_RATE)
#: Alarms that no fault of a sensor raises and that are no flags: of the start of the daemon, and of the computer on
#: which it runs.  How late navigation is, is judged for the whole flight.
OF_COMPUTER = frozenset(
    {"navigation_starting", "terrain_loading", "navigation_late", "space", "storage_full", "storage_slow"}
)


class _Follows(NamedTuple):
    """One of these alarms begins at most so long after a flag, and ends at most so long after it [s]."""

    alarms: tuple[str, ...]
    begins_s: float
    ends_s: float


def alarms_of_flags(belongs: Sequence[tuple[int, Told]], craft: Aircraft) -> Iterator[tuple[int, Told]]:
    """The alarms that are due.  belongs : the flags that are due, with the index of their fault"""
    for index, one in belongs:
        flags = [duty for duty in one.duties if duty.from_s >= STARTED_S]
        duties = [_alarm_duty(duty, follows) for duty in flags if (follows := _find_alarms(duty, craft))]
        if due := Told.from_duties(one.subject, duties, ()).duties:
            yield index, Told(one.subject, due, ())


def outlasts_s(alarm: str, craft: Aircraft) -> float:
    """How long an alarm may last behind its state: the integrity monitor fills another window before it judges [s]."""
    return doubted_s(craft) if alarm in INTEGRITY_IDS else 0.0


def _alarm_duty(duty: Duty, follows: _Follows) -> Duty:
    within_s, clears_s = duty.within_s + follows.begins_s, duty.clears_s + follows.ends_s
    return replace(duty, place=ALARM_TOPIC, words=follows.alarms, within_s=within_s, clears_s=clears_s)


def _find_alarms(duty: Duty, craft: Aircraft) -> _Follows | None:
    """The alarms that follow from a flag: none from one that a person need not act upon."""
    above, _, name = duty.place.rpartition("/")
    words = set(duty.words)
    if above == DEVICES and not words.isdisjoint(NOT_AS_CONFIGURED):
        return _Follows((device_id(name),), JUDGED_S + (RATE_S if LinkState.WRONG_RATE in words else 0.0), HEALTH_S)
    if above == LINKS:
        return _Follows((f"link:{name}",), JUDGED_S, HEALTH_S)
    if above == HEIGHT and words <= ALTIMETER_FAULTS:
        return _Follows((f"altimeter:{name}",), FAULT_S + JUDGED_S, MEMORY_S)
    if duty.place == INTEGRITY and words == {Reason.OBSTACLE}:
        return _Follows(INTEGRITY_IDS[:2], JUDGED_S, JUDGED_S)
    if duty.place == SOLUTION and craft.positions and words == {f"position not from {craft.positions[0]}"}:
        others = (*craft.positions[1:], FILTER, RADIO)
        return _Follows(("position", *(f"position_by:{other}" for other in others)), JUDGED_S, JUDGED_S)
    return None
