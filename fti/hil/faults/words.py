"""The words that a person reads for the faults of a scenario, while they act."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fti.hil.tables.bases import OnDevices, OnLinks
from fti.hil.tables.kinds import Fault, FaultKind, Obstacle

#: What is wrong, with the fault's own figures in it.
WORDS: Mapping[FaultKind, str] = {
    FaultKind.OBSTACLE: "obstacle of {height_m:g} m, {before_threshold_m:g} m before the threshold",
    FaultKind.OFF_TRACK: "{right_m:+g} m off the track",
    FaultKind.CUT: "cable cut",
    FaultKind.FREEZE: "last messages again and again",
    FaultKind.STUCK: "values stuck",
    FaultKind.INVALID: "says that it does not measure",
    FaultKind.BIAS: "{quantity} {value:+g}",
    FaultKind.RAMP: "{quantity} {rate:+g} a second",
    FaultKind.NOISE: "{quantity} noisy, sigma {sd:g}",
    FaultKind.WRONG_UNIT: "{quantity} in a wrong unit, times {factor:g}",
    FaultKind.FORCED: "{quantity} forced to {value:g}",
    FaultKind.FOG: "fog, {visibility_m:g} m",
    FaultKind.GNSS_OUTAGE: "no satellites",
    FaultKind.GNSS_DEGRADED: "position degraded, sigma {horizontal_m:g} and {vertical_m:g} m",
    FaultKind.GNSS_OFFSET: "position drawn away",
    FaultKind.CLOCK_JUMP: "clock off by {by_s:+g} s",
    FaultKind.CLOCK_DRIFT: "clock fast by {ppm:g} ppm",
    FaultKind.BIT_ERRORS: "bit errors",
    FaultKind.LOST_HEADER: "headers lost",
    FaultKind.TRUNCATED: "messages cut short",
    FaultKind.DUPLICATED: "messages twice",
    FaultKind.REORDERED: "messages out of order",
    FaultKind.WRONG_CHECKSUM: "wrong checksums",
    FaultKind.WRONG_LABEL: "unknown labels",
    FaultKind.BURST: "held back for {hold_s:g} s, then all at once",
    FaultKind.BABBLING: "a node babbles, {rate_hz:g} frames a second",
    FaultKind.BUS_OFF: "bus off",
    FaultKind.CAN_STATUS: "controller in trouble",
    FaultKind.BREAKER: "breaker tripped",
    FaultKind.BROWN_OUT: "supply at {supply_v:g} V",
}


def active(faults: Sequence[Fault], t: float) -> Iterator[dict[str, Any]]:
    """The faults that act at t [s], in plain JSON types.

    on      : devices or links that are named; empty: every one that it can be on, or the world
    until_s : None of an obstacle, which is there all the time
    """
    for fault in faults:
        if isinstance(fault, Obstacle) or fault.from_s <= t < fault.to_s:
            yield {"kind": fault.kind, "words": describe(fault), "on": list(_named(fault)), "until_s": _end(fault)}


def describe(fault: Fault) -> str:
    """What is wrong, in words."""
    return WORDS[FaultKind(fault.kind)].format_map(fault.model_dump())


def _named(fault: Fault) -> tuple[str, ...]:
    if isinstance(fault, OnDevices):
        return fault.devices
    return fault.links if isinstance(fault, OnLinks) else ()


def _end(fault: Fault) -> float | None:
    return None if isinstance(fault, Obstacle) else fault.to_s
