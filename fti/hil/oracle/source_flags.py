"""Flags of faulty sources that contradict themselves or the filter, as a table.

A fault without a row raises no certain flag.  The outputs are compared with the truth in any case.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from fti.hil.oracle.flag_definitions import SOLUTION, SOURCE_REFUSAL_S, ExpectedFlag, FaultCase
from fti.hil.tables.fault_base import DeviceFault
from fti.hil.tables.fault_types import AttitudeOffset, ClockJump, FaultKind, GnssRamp

#: With a tactical-grade inertial unit, smallest detectable ramp [m/s], from this time of the flight on [s], when the
#: filter has run without the receiver for 20 s.  Smallest detectable step of a device time [s].
MIN_RAMP_MPS, FILTER_SETTLING_S, MIN_CLOCK_STEP_S = 1.0, 40.0, 0.5
#: Smallest detectable difference to the attitude of the filter [deg]: tilt, heading (filter heading: 1 deg 1-sigma).
TILT_DEG, HEADING_DEG = 3.0, 12.0


def _is_detectable_ramp(fault: DeviceFault) -> bool:
    assert isinstance(fault, GnssRamp)
    return fault.from_s >= FILTER_SETTLING_S and math.hypot(fault.north_mps, fault.east_mps) >= MIN_RAMP_MPS


def _is_detectable_offset(fault: DeviceFault) -> bool:
    assert isinstance(fault, AttitudeOffset)
    is_far = max(abs(fault.roll_deg), abs(fault.pitch_deg)) >= TILT_DEG or abs(fault.heading_deg) >= HEADING_DEG
    return fault.from_s >= FILTER_SETTLING_S and is_far


def _is_detectable_step(fault: DeviceFault) -> bool:
    assert isinstance(fault, ClockJump)
    return abs(fault.by_s) > MIN_CLOCK_STEP_S


@dataclass(frozen=True, slots=True)
class SourceFlag:
    """Navigation rejects the device as the source of a role, if it is the first one of that role.

    within_s : after the start of the fault; clears_s : after its end, inf: it may stay rejected [s]
    when     : the condition, to be read after "and"; "": none; is_detectable : does a fault fulfil it?
    """

    within_s: float
    clears_s: float = SOURCE_REFUSAL_S
    when: str = ""
    is_detectable: Callable[[DeviceFault], bool] = lambda _fault: True
    role: str = "position"


SOURCE_FLAGS: Mapping[str | None, SourceFlag] = {
    FaultKind.STUCK: SourceFlag(5.0),
    FaultKind.GNSS_RAMP: SourceFlag(
        30.0,
        math.inf,
        f"it aids [nav.filter], the horizontal rate is {MIN_RAMP_MPS:g} m/s or more, "
        f"and from_s {FILTER_SETTLING_S:g} s or more",
        _is_detectable_ramp,
    ),
    FaultKind.SWAPPED_COORDINATES: SourceFlag(3.0),
    FaultKind.UNDULATION: SourceFlag(10.0, when="the undulation there is more than 5 m"),
    FaultKind.ATTITUDE_OFFSET: SourceFlag(
        10.0,
        when=f"[nav.filter] is configured, from_s is {FILTER_SETTLING_S:g} s or more, "
        f"roll_deg or pitch_deg is {TILT_DEG:g} or more, or heading_deg {HEADING_DEG:g}",
        is_detectable=_is_detectable_offset,
        role="attitude",
    ),
    FaultKind.CLOCK_JUMP: SourceFlag(
        5.0,
        math.inf,
        when=f"DEVICE sends its own time, and by_s is more than {MIN_CLOCK_STEP_S:g} s",
        is_detectable=_is_detectable_step,
    ),
}
#: Reason of faults without a flag.
INDISTINGUISHABLE = "no other source contradicts it with certainty"


def expected_source_flags(fault: DeviceFault, case: FaultCase) -> Sequence[ExpectedFlag]:
    """The flags of the table for a fault."""
    kind = getattr(fault, "kind", None)
    flag = SOURCE_FLAGS.get(kind)
    if flag is None or not flag.is_detectable(fault) or flag.role not in case.craft.preferred_roles(case.name):
        return []
    if kind == FaultKind.GNSS_RAMP and case.name not in case.craft.filter_gnss:
        return []
    if kind == FaultKind.ATTITUDE_OFFSET and not case.craft.filter_gnss:
        return []
    if kind == FaultKind.CLOCK_JUMP and not case.craft.sends_time(case.name):
        return []
    words = f"{flag.role} not from {case.name}"
    return [case.expected_flag(SOLUTION, words, within_s=flag.within_s, clears_s=flag.clears_s)]
