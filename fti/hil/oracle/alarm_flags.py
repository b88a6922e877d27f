"""Expected alarms, derived from the expected flags of a fault.

An alarm is a flag on ``/fti/alarm``; its word is the alarm identity (docs/alarms.md).  It lasts as long as its
condition, whether or not the operator has acknowledged it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

from fti.alarms.condition import device_id
from fti.hil.oracle.flag_definitions import (
    DEVICES,
    GROUND_DRIFT,
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
from fti.messages.frames import LinkState
from fti.messages.reasons import Reason
from fti.messages.topics import ALARM_TOPIC
from fti.nav.alarm_conditions import ALTIMETER_FAULTS, INTEGRITY_IDS
from fti.nav.navigation import FILTER, RADIO

#: Maximum latency from a flag to its alarm, at begin and end [s]: health is evaluated at 2 Hz and recorded at 1 Hz; an
#: altimeter must be wrong for 0.5 s; a wrong rate must last for 5 s.
ALARM_LATENCY_S, FAULT_S, RATE_S = 1.0, 0.5, 5.0
#: After the start, devices and positions that were never valid raise no alarm for this time [s].
STARTUP_S = 10.0
#: Health states of a device that does not send as configured.
BAD_DEVICE_STATES = (LinkState.SILENT, LinkState.NOISE, LinkState.WRONG_RATE)
#: Alarms that do not depend on sensor faults: start of the daemon, and its computer.  The latency of navigation is
#: checked separately for the whole flight.
COMPUTER_ALARMS = frozenset(
    {"navigation_starting", "terrain_loading", "navigation_late", "space", "storage_full", "storage_slow"}
)
#: Alarms of a single word at an output.
ALARMS_OF_OUTPUTS: Mapping[tuple[str, ...], tuple[str, ...]] = MappingProxyType(
    {
        (INTEGRITY, Reason.OBSTACLE): INTEGRITY_IDS[:2],
        (GROUND_DRIFT, Reason.CONTRADICTION): ("ground_drift",),
    }
)


class _AlarmDelay(NamedTuple):
    """One of ``alarms`` begins within begins_s of a flag, and ends within ends_s of its end [s]."""

    alarms: tuple[str, ...]
    begins_s: float
    ends_s: float


def flags_of_alarms(flags: Sequence[tuple[int, FaultFlags]], craft: AircraftRoles) -> Iterator[tuple[int, FaultFlags]]:
    """The expected alarms.  flags : expected flags, with the index of their fault"""
    for index, one in flags:
        later = [flag for flag in one.expected_flags if flag.from_s >= STARTUP_S]
        alarms = [_alarm_flag(flag, delay) for flag in later if (delay := _find_alarms(flag, craft))]
        if due := FaultFlags.from_flags(one.subject, alarms, ()).expected_flags:
            yield index, FaultFlags(one.subject, due, ())


def alarm_hold_s(alarm: str, craft: AircraftRoles) -> float:
    """Maximum duration of an alarm after its cause [s]: the integrity monitor must fill a new window."""
    return monitor_recovery_s(craft) if alarm in INTEGRITY_IDS else 0.0


def _alarm_flag(flag: ExpectedFlag, delay: _AlarmDelay) -> ExpectedFlag:
    within_s, clears_s = flag.within_s + delay.begins_s, flag.clears_s + delay.ends_s
    return replace(flag, place=ALARM_TOPIC, words=delay.alarms, within_s=within_s, clears_s=clears_s)


def _find_alarms(expected_flag: ExpectedFlag, craft: AircraftRoles) -> _AlarmDelay | None:
    """The alarms of a flag; None if the operator need not act on it."""
    parent, _, name = expected_flag.place.rpartition("/")
    words = set(expected_flag.words)
    if parent == DEVICES and not words.isdisjoint(BAD_DEVICE_STATES):
        return _AlarmDelay(
            (device_id(name),), ALARM_LATENCY_S + (RATE_S if LinkState.WRONG_RATE in words else 0.0), HEALTH_S
        )
    if parent == LINKS:
        return _AlarmDelay((f"link:{name}",), ALARM_LATENCY_S, HEALTH_S)
    if parent == HEIGHT and words <= ALTIMETER_FAULTS:
        return _AlarmDelay((f"altimeter:{name}",), FAULT_S + ALARM_LATENCY_S, MEMORY_S)
    if (alarms := ALARMS_OF_OUTPUTS.get((expected_flag.place, *expected_flag.words))) is not None:
        return _AlarmDelay(alarms, ALARM_LATENCY_S, ALARM_LATENCY_S)
    if expected_flag.place == SOLUTION and craft.positions and words == {f"position not from {craft.positions[0]}"}:
        others = (*craft.positions[1:], FILTER, RADIO)
        return _AlarmDelay(
            ("position", *(f"position_by:{other}" for other in others)), ALARM_LATENCY_S, ALARM_LATENCY_S
        )
    return None
