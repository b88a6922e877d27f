"""Texts for the active faults of a scenario."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from fti.hil.tables.fault_base import DeviceFault, LinkFault
from fti.hil.tables.fault_types import Fault, FaultKind, WholeFlightFault

#: Text of each kind, with the parameters of the fault.
DESCRIPTIONS: Mapping[FaultKind, str] = {
    FaultKind.OBSTACLE: "obstacle of {height_m:g} m, {before_threshold_m:g} m before the threshold",
    FaultKind.OFF_TRACK: "{right_m:+g} m off the track",
    FaultKind.TERRAIN_SHIFT: "elevation model displaced by {north_m:+g} m north, {east_m:+g} m east, {up_m:+g} m up",
    FaultKind.CUT: "cable cut",
    FaultKind.FREEZE: "last messages repeated",
    FaultKind.STUCK: "values stuck",
    FaultKind.INVALID: "flagged invalid",
    FaultKind.BIAS: "{quantity} {value:+g}",
    FaultKind.RAMP: "{quantity} {rate:+g} per s",
    FaultKind.NOISE: "{quantity} noisy, sigma {sd:g}",
    FaultKind.WRONG_UNIT: "{quantity} in a wrong unit, factor {factor:g}",
    FaultKind.SCALE: "{quantity} scaled, {percent:+g} %",
    FaultKind.FORCED: "{quantity} forced to {value:g}",
    FaultKind.FOG: "fog, {visibility_m:g} m",
    FaultKind.GNSS_OUTAGE: "no satellite signals",
    FaultKind.GNSS_DEGRADED: "position degraded, sigma {horizontal_m:g} and {vertical_m:g} m",
    FaultKind.GNSS_OFFSET: "position offset",
    FaultKind.GNSS_RAMP: "position ramp, {north_mps:+g} m/s north, {east_mps:+g} m/s east, {up_mps:+g} m/s up",
    FaultKind.SWAPPED_COORDINATES: "latitude and longitude exchanged",
    FaultKind.UNDULATION: "height without the undulation, {stated}",
    FaultKind.LEVER_ARM: "mounted {forward_m:+g} m forward, {right_m:+g} m right, {down_m:+g} m down",
    FaultKind.MOUNTING: "mounting off: roll {roll_deg:+g}, pitch {pitch_deg:+g}, yaw {yaw_deg:+g} deg",
    FaultKind.ATTITUDE_OFFSET: "attitude off: roll {roll_deg:+g}, pitch {pitch_deg:+g}, heading {heading_deg:+g} deg",
    FaultKind.INERTIAL_BIAS: "biases step by {gyro_degph} deg/h and {accel_mg} mg",
    FaultKind.LATENCY: "latency {by_s:g} s",
    FaultKind.CLOCK_JUMP: "clock off by {by_s:+g} s",
    FaultKind.CLOCK_DRIFT: "clock fast by {ppm:g} ppm",
    FaultKind.BIT_ERRORS: "bit errors",
    FaultKind.LOST_HEADER: "headers lost",
    FaultKind.TRUNCATED: "messages truncated",
    FaultKind.DUPLICATED: "messages duplicated",
    FaultKind.REORDERED: "messages out of order",
    FaultKind.WRONG_CHECKSUM: "wrong checksums",
    FaultKind.WRONG_LABEL: "unknown message identifiers",
    FaultKind.BURST: "messages in bursts every {hold_s:g} s",
    FaultKind.BABBLING: "babbling node, {rate_hz:g} frames/s",
    FaultKind.BUS_OFF: "bus off",
    FaultKind.CAN_STATUS: "CAN controller errors",
    FaultKind.BREAKER: "breaker tripped",
    FaultKind.BROWN_OUT: "supply at {supply_v:g} V",
}


def active_faults(faults: Sequence[Fault], t: float) -> Iterator[dict[str, Any]]:
    """The faults that are active at t [s], in plain JSON types.

    on      : named devices or links; empty: every possible one, or the world
    until_s : None for a fault of the whole flight
    """
    for fault in faults:
        if isinstance(fault, WholeFlightFault) or fault.from_s <= t < fault.to_s:
            names = fault.devices if isinstance(fault, DeviceFault) else ()
            names = fault.links if isinstance(fault, LinkFault) else names
            until_s = None if isinstance(fault, WholeFlightFault) else fault.to_s
            yield {"kind": fault.kind, "words": describe(fault), "on": list(names), "until_s": until_s}


def describe(fault: Fault) -> str:
    """Text of a fault."""
    return DESCRIPTIONS[FaultKind(fault.kind)].format_map(fault.model_dump())
