"""Table of the flags that each kind of fault raises, for documentation; ``fault_flags`` has the rules.

A word in capitals stands for a name: DEVICE has the fault, LINK has it or carries the device, ALTIMETER is one of
``nav.altimeters``, UNIT is a power unit, FLAG is one of the flags of the fault itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fti.hil.oracle.flag_definitions import (
    CONTRADICTION_M,
    CONTRADICTION_MPS,
    CONTRADICTION_S,
    DEVIATION_M,
    GROUND_DRIFT,
    HEIGHT,
    INTEGRITY,
    MIN_CLOCK_ERROR_S,
    MIN_WRONG_BITS,
    NAV_EVENT,
    OBSTACLE_M,
    RATE_SHARE,
    SOLUTION,
    STUCK_M,
    STUCK_S,
    STUCK_SHARE,
)
from fti.hil.oracle.scan_drift_flags import ANNOUNCED_S, MIN_LATE_S, MIN_YAW_DEG
from fti.hil.oracle.source_flags import SOURCE_FLAGS
from fti.hil.tables.fault_types import FaultKind


@dataclass(frozen=True, slots=True)
class KindFlag:
    """A flag that a kind of fault raises.

    place : topic, with the name of the device or link
    words : one of them is raised; empty: the number of the fault in place of a word
    when  : the condition, to be read after "if"; "": none
    """

    place: str
    words: tuple[str, ...]
    when: str = ""


HEALTH = "/fti/health/devices/DEVICE"
WHEN_ALTIMETER = "DEVICE is in nav.altimeters"
WHEN_OVER_TERRAIN = (
    f"{WHEN_ALTIMETER}, [nav.terrain] is configured, and the range is wrong by more than {DEVIATION_M:g} m"
)
WHEN_LOOKS_TURN = (
    f"DEVICE gives the looks of [nav.scan_drift], for a latency alone, and the aircraft has turned while it receives "
    f"satellites; within {ANNOUNCED_S:g} s of the end of the first turn"
)
WHEN_OVER_OBSTACLE = (
    f"the aircraft flies over it, it is {OBSTACLE_M:g} m high or more, and [nav.approach] is configured"
)
WHEN_OFF_TRACK = "the aircraft is farther from the track than nav.approach.y_max_m"
WHEN_MANY_BITS = f"DEVICE is not on CAN, and {MIN_WRONG_BITS:g} bits or more are wrong"
WHEN_POSITION_LOST = "no other device of nav.position is left"

SILENT = KindFlag(HEALTH, ("silent", "noise"))
DAMAGED_BYTES = KindFlag(HEALTH, ("damaged bytes",))
CLOCK_AWAY = KindFlag(HEALTH, ("clock away",), "DEVICE sends its own time")
NO_POSITION = KindFlag(SOLUTION, ("position not from DEVICE",), "DEVICE is the first of nav.position")
OTHER_SOURCE = (NO_POSITION, KindFlag(SOLUTION, ("attitude not from DEVICE",), "DEVICE is the first of nav.attitude"))
STALE = (KindFlag(f"{HEIGHT}/DEVICE", ("stale",), WHEN_ALTIMETER), *OTHER_SOURCE)
ALL_STALE = tuple(KindFlag(flag.place, flag.words, f"share = 1, and {flag.when}") for flag in STALE)
WRONG_RANGE = KindFlag(f"{HEIGHT}/DEVICE", ("deviation",), WHEN_OVER_TERRAIN)
STUCK_RANGE = KindFlag(
    f"{HEIGHT}/DEVICE",
    ("stuck",),
    f"{WHEN_ALTIMETER}, and its range (without [nav.terrain] the altitude of the aircraft) changes by more than "
    f"{STUCK_M:g} m and {STUCK_SHARE:g} of the range; within {STUCK_S:g} s",
)
TAKE_OVER = (
    KindFlag(SOLUTION, ("position from filter",), f"{WHEN_POSITION_LOST}, and [nav.filter] is configured"),
    KindFlag(NAV_EVENT, ("position: from filter instead of DEVICE",), "the same"),
    KindFlag(
        SOLUTION, ("position from radio",), f"{WHEN_POSITION_LOST}, nor the filter, and [nav.radio] has three stations"
    ),
    KindFlag(NAV_EVENT, ("position: from radio instead of DEVICE",), "the same, without a filter"),
)
FALLBACK = (
    *TAKE_OVER,
    KindFlag(
        NAV_EVENT, ("position: from radio instead of filter",), "DEVICE is nav.filter.imu, and the filter is used"
    ),
)


def _source_flags(kind: FaultKind) -> tuple[KindFlag, ...]:
    """The flag of ``SOURCE_FLAGS`` for a kind."""
    flag = SOURCE_FLAGS[kind]
    when = f"DEVICE is the first of nav.{flag.role}" + (f", and {flag.when}" if flag.when else "")
    return (KindFlag(SOLUTION, (f"{flag.role} not from DEVICE",), f"{when}; within {flag.within_s:g} s"),)


#: Every flag that a fault of a kind can raise; none: the daemon does not detect it.
FLAGS: Mapping[FaultKind, tuple[KindFlag, ...]] = {
    FaultKind.OBSTACLE: (
        KindFlag(INTEGRITY, ("obstacle",), WHEN_OVER_OBSTACLE),
        KindFlag(
            f"{HEIGHT}/ALTIMETER", ("deviation",), "the same, ALTIMETER is a radar, and [nav.terrain] is configured"
        ),
    ),
    FaultKind.OFF_TRACK: (KindFlag(INTEGRITY, ("off_track",), WHEN_OFF_TRACK),),
    FaultKind.TERRAIN_SHIFT: (),
    FaultKind.CUT: (SILENT, *STALE, *FALLBACK),
    FaultKind.FREEZE: (CLOCK_AWAY,),
    FaultKind.STUCK: (STUCK_RANGE, WRONG_RANGE, *_source_flags(FaultKind.STUCK)),
    FaultKind.INVALID: (
        KindFlag("/DEVICE/", ("invalid", "FLAG"), "the protocol of DEVICE can declare a measurement invalid"),
        KindFlag("/DEVICE/device_status", ("FLAG",), "the same, and FLAG is one of its flags"),
        KindFlag(f"{HEIGHT}/DEVICE", ("device_flag", "no_return"), f"the same, and {WHEN_ALTIMETER}"),
        *OTHER_SOURCE,
        *FALLBACK,
    ),
    FaultKind.BIAS: (WRONG_RANGE,),
    FaultKind.RAMP: (WRONG_RANGE,),
    FaultKind.NOISE: (WRONG_RANGE,),
    FaultKind.FOG: (
        KindFlag(f"{HEIGHT}/DEVICE", ("no_return", "device_flag"), "DEVICE is a laser, and the ground is farther away"),
        KindFlag(f"{HEIGHT}/DEVICE", ("deviation",), f"echo_m is given, and {WHEN_OVER_TERRAIN}"),
    ),
    FaultKind.GNSS_OUTAGE: (
        KindFlag("/DEVICE/", ("invalid",), "DEVICE is a receiver and nothing else"),
        NO_POSITION,
        *TAKE_OVER,
    ),
    FaultKind.GNSS_DEGRADED: tuple(
        KindFlag(f"/DEVICE/position.{axis}_sd", (), "DEVICE is a receiver and nothing else")
        for axis in ("horizontal", "vertical")
    ),
    FaultKind.GNSS_OFFSET: (
        KindFlag(
            SOLUTION,
            ("position not from DEVICE",),
            f"DEVICE is the first of nav.position and aids [nav.filter], and the shift is {CONTRADICTION_M:g} m or "
            f"more and grows by {CONTRADICTION_MPS:g} m/s or more; within {CONTRADICTION_S:g} s",
        ),
        KindFlag(
            f"{HEIGHT}/ALTIMETER",
            ("deviation",),
            "DEVICE is the first of nav.position and does not aid [nav.filter], [nav.terrain] is configured, and the "
            f"height is wrong by more than {DEVIATION_M:g} m",
        ),
    ),
    FaultKind.GNSS_RAMP: _source_flags(FaultKind.GNSS_RAMP),
    FaultKind.SWAPPED_COORDINATES: _source_flags(FaultKind.SWAPPED_COORDINATES),
    FaultKind.UNDULATION: _source_flags(FaultKind.UNDULATION),
    FaultKind.LEVER_ARM: (),
    FaultKind.MOUNTING: (
        KindFlag(GROUND_DRIFT, ("contradiction",), f"yaw_deg is {MIN_YAW_DEG:g} or more, {WHEN_LOOKS_TURN}"),
    ),
    FaultKind.ATTITUDE_OFFSET: _source_flags(FaultKind.ATTITUDE_OFFSET),
    FaultKind.INERTIAL_BIAS: (),
    FaultKind.LATENCY: (
        KindFlag(GROUND_DRIFT, ("contradiction",), f"by_s is {MIN_LATE_S:g} or more, {WHEN_LOOKS_TURN}"),
    ),
    FaultKind.CLOCK_JUMP: (
        KindFlag(HEALTH, ("clock away",), f"by_s is {MIN_CLOCK_ERROR_S:g} s or more"),
        *_source_flags(FaultKind.CLOCK_JUMP),
    ),
    FaultKind.CLOCK_DRIFT: (),
    FaultKind.BIT_ERRORS: (KindFlag(HEALTH, ("damaged bytes",), WHEN_MANY_BITS),),
    FaultKind.LOST_HEADER: (DAMAGED_BYTES, *ALL_STALE),
    FaultKind.TRUNCATED: (DAMAGED_BYTES, *ALL_STALE),
    FaultKind.DUPLICATED: (
        KindFlag(HEALTH, ("wrong rate",), f"DEVICE has a rate_hz, and share is {RATE_SHARE:g} or more"),
    ),
    FaultKind.REORDERED: (),
    FaultKind.WRONG_CHECKSUM: (DAMAGED_BYTES, *ALL_STALE),
    FaultKind.WRONG_LABEL: (
        KindFlag(HEALTH, ("silent", "noise", "wrong rate"), "share = 1, and DEVICE has a rate_hz"),
        *ALL_STALE,
    ),
    FaultKind.WRONG_UNIT: (WRONG_RANGE,),
    FaultKind.SCALE: (WRONG_RANGE,),
    FaultKind.FORCED: (WRONG_RANGE,),
    FaultKind.BURST: tuple(
        KindFlag(flag.place, flag.words, f"hold_s is longer than the age limit (max_age_ms) of DEVICE, and {flag.when}")
        for flag in STALE
    ),
    FaultKind.BABBLING: (),
    FaultKind.BUS_OFF: (KindFlag("/fti/health/links/LINK", ("silent",)), SILENT, *STALE),
    FaultKind.CAN_STATUS: (KindFlag("/fti/ledger/LINK", ("slcan_FLAG",), "FLAG is one of its flags, on real ports"),),
    FaultKind.BREAKER: (KindFlag("/UNIT/device_status", ("DEVICE_tripped",)), SILENT, *STALE, *FALLBACK),
    FaultKind.BROWN_OUT: (
        KindFlag("/UNIT/device_status", ("DEVICE_brown_out",), "supply_v is below sensor.DEVICE.minimum_v"),
        KindFlag(HEALTH, ("silent", "noise"), "the same"),
        *STALE,
        *FALLBACK,
    ),
}

#: Conditions in which a detectable kind of fault raises no flag.
NO_FLAG: Mapping[FaultKind, str] = {
    FaultKind.MOUNTING: "the device gives no looks of [nav.scan_drift], or the aircraft flies straight on",
    FaultKind.LATENCY: "the device gives no looks of [nav.scan_drift], or the aircraft flies straight on",
    FaultKind.OBSTACLE: "the aircraft does not fly over it",
    FaultKind.OFF_TRACK: "the aircraft stays within nav.approach.y_max_m, or no approach is monitored",
    FaultKind.FOG: "the device is not a laser altimeter, or the ground is nearer than visibility_m or out of its range",
    FaultKind.BURST: "navigation does not use the device",
    FaultKind.BROWN_OUT: "the device works at this voltage (sensor.NAME.minimum_v)",
}
