"""The alarms that must follow from the flags of a fault.

An alarm is a flag at ``/fti/alarm``; its word is its identity (docs/alarms.md).  It stands while its condition lasts,
whether or not a person has acknowledged it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from fti.alarms.condition import device_id
from fti.hil.oracle.flag_definitions import (
    DEVICES,
    HEALTH_S,
    HEIGHT,
    INTEGRITY,
    LINKS,
    MEMORY_S,
    SOLUTION,
    ExpectedFlag,
    FaultFlags,
    monitor_recovery_s,
)
from fti.hil.oracle.roles import AircraftRoles
from fti.logger.schemas import ALARM_TOPIC
from fti.nav.alarm_conditions import ALTIMETER_FAULTS, INTEGRITY_IDS
from fti.nav.navigation import FILTER, RADIO
from fti.types import LinkState, Reason

#: From a flag to its alarm, and from the end of the one to that of the other [s]: health is judged twice a second, and
#: recorded every second time; an altimeter must be wrong for half a second; a wrong rate must last for 5 s.
ALARM_LATENCY_S, FAULT_S, RATE_S = 1.0, 0.5, 5.0
#: Devices that were never good are no alarm at first, and a position that was never valid was not lost [s].
STARTUP_S = 10.0
#: What health says of a device that does not speak as it should.
BAD_DEVICE_STATES = (LinkState.SILENT, LinkState.NOISE, LinkState.WRONG_RATE)
#: Alarms that no fault of a sensor raises and that are no flags: of the start of the daemon, and of the computer on
#: which it runs.  How late navigation is, is judged for the whole flight.
COMPUTER_ALARMS = frozenset(
    {"navigation_starting", "terrain_loading", "navigation_late", "space", "storage_full", "storage_slow"}
)


class _AlarmDelay(NamedTuple):
    """One of these alarms begins at most so long after a flag, and ends at most so long after it [s]."""

    alarms: tuple[str, ...]
    begins_s: float
    ends_s: float


def flags_of_alarms(
    belongs: Sequence[tuple[int, FaultFlags]], craft: AircraftRoles
) -> Iterator[tuple[int, FaultFlags]]:
    """The alarms that are due.  belongs : the flags that are due, with the index of their fault"""
    for index, one in belongs:
        flags = [expected_flag for expected_flag in one.expected_flags if expected_flag.from_s >= STARTUP_S]
        expected_flags = [
            _alarm_flag(expected_flag, follows)
            for expected_flag in flags
            if (follows := _find_alarms(expected_flag, craft))
        ]
        if due := FaultFlags.from_flags(one.subject, expected_flags, ()).expected_flags:
            yield index, FaultFlags(one.subject, due, ())


def alarm_hold_s(alarm: str, craft: AircraftRoles) -> float:
    """How long an alarm may last behind its state: the integrity monitor fills another window before it judges [s]."""
    return monitor_recovery_s(craft) if alarm in INTEGRITY_IDS else 0.0


def _alarm_flag(expected_flag: ExpectedFlag, follows: _AlarmDelay) -> ExpectedFlag:
    within_s, clears_s = expected_flag.within_s + follows.begins_s, expected_flag.clears_s + follows.ends_s
    return replace(expected_flag, place=ALARM_TOPIC, words=follows.alarms, within_s=within_s, clears_s=clears_s)


def _find_alarms(expected_flag: ExpectedFlag, craft: AircraftRoles) -> _AlarmDelay | None:
    """The alarms that follow from a flag: none from one that a person need not act upon."""
    above, _, name = expected_flag.place.rpartition("/")
    words = set(expected_flag.words)
    if above == DEVICES and not words.isdisjoint(BAD_DEVICE_STATES):
        return _AlarmDelay(
            (device_id(name),), ALARM_LATENCY_S + (RATE_S if LinkState.WRONG_RATE in words else 0.0), HEALTH_S
        )
    if above == LINKS:
        return _AlarmDelay((f"link:{name}",), ALARM_LATENCY_S, HEALTH_S)
    if above == HEIGHT and words <= ALTIMETER_FAULTS:
        return _AlarmDelay((f"altimeter:{name}",), FAULT_S + ALARM_LATENCY_S, MEMORY_S)
    if expected_flag.place == INTEGRITY and words == {Reason.OBSTACLE}:
        return _AlarmDelay(INTEGRITY_IDS[:2], ALARM_LATENCY_S, ALARM_LATENCY_S)
    if expected_flag.place == SOLUTION and craft.positions and words == {f"position not from {craft.positions[0]}"}:
        others = (*craft.positions[1:], FILTER, RADIO)
        return _AlarmDelay(
            ("position", *(f"position_by:{other}" for other in others)), ALARM_LATENCY_S, ALARM_LATENCY_S
        )
    return None
