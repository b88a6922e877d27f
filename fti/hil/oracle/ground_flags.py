"""Flags from the comparison with known terrain: wrong ranges of altimeters, and wrong positions.

Errors of more than ``DEVIATION_M`` must be flagged; smaller ones may be.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fti.arrays import Array, Mask
from fti.hil.faults.gnss import GnssFaults
from fti.hil.oracle.flag_definitions import (
    CLOSURE_M,
    CONTRADICTION_M,
    CONTRADICTION_MPS,
    CONTRADICTION_S,
    DEVIATION_M,
    HEIGHT,
    MEMORY_S,
    NAV_S,
    READMISSION_S,
    SILENT_S,
    SOLUTION,
    STUCK_M,
    STUCK_S,
    STUCK_SHARE,
    ExpectedFlag,
    FaultCase,
    RuleResult,
)
from fti.hil.tables.fault_base import QuantityFault
from fti.hil.tables.fault_types import Bias, Fog, Forced, GnssOffset, Noise, Ramp, Scale, Stuck, WrongUnit
from fti.messages.reasons import Reason

#: Why a stuck device raises no flag.
REPEATED_POSITION = (
    "navigation refuses its position if it repeats in motion (repeated), but uses the first device of nav.position"
)
REPEATED_VALUES = "only a repeated position of nav.position, or range of nav.altimeters, is detectable"
#: Quantities of an altimeter.
RANGE_QUANTITIES = frozenset({"range.slant_range", "radio_height.height_agl"})


def wrong_value_flags(fault: QuantityFault, case: FaultCase) -> RuleResult:
    """A wrong range is compared with the terrain; other quantities are not monitored."""
    reason = "no monitor compares this quantity with another source"
    if fault.quantity not in RANGE_QUANTITIES:
        return [], reason
    return _range_flags(case, _faulty_range(fault, case), reason)


def stuck_flags(fault: Stuck, case: FaultCase) -> RuleResult:
    """Repeated values of an altimeter are flagged as soon as the true range has changed enough.

    Over known terrain the predicted range shows the change, and a large error is rejected as well; otherwise the
    altitude shows it.
    """
    craft, inside, true = case.craft, _in_interval_mask(case), _true_range(case)
    if case.name not in craft.altimeters or not inside.any():
        return [], REPEATED_POSITION if case.name in craft.positions else REPEATED_VALUES
    value = float(true[inside][0])
    deviates, unknown = _range_flags(case, np.full(len(true), value), "the range changes too little")
    expected_flags = [*_repetition_flags(case, value), *deviates]
    return expected_flags, "" if expected_flags else unknown


def _repetition_flags(case: FaultCase, value: float) -> Sequence[ExpectedFlag]:
    """Expected once the range, or without known terrain the altitude, has changed by more than any step."""
    craft, truth, inside = case.craft, case.truth, _in_interval_mask(case)
    if case.name not in craft.altimeters or not craft.positions or not np.isfinite(value):
        return []
    range_m = _true_range(case) if craft.has_terrain else np.cumsum(truth.climb * np.gradient(truth.t))
    known = inside & _in_range_mask(case.name, case) & ~craft.terrain_edge_mask(truth)
    changed = known & (abs(range_m - float(range_m[inside][0])) > STUCK_M + STUCK_SHARE * value)
    if (shown := truth.span(changed)) is None:
        return []
    until = case.until_s - shown[1] + MEMORY_S  # it stays rejected until its value changes
    return [ExpectedFlag(f"{HEIGHT}/{case.name}", (Reason.STUCK,), *shown, STUCK_S, until)]


def fog_flags(fault: Fog, case: FaultCase) -> RuleResult:
    """A laser has no return, or measures the range of the fog."""
    craft, t = case.craft, case.truth.t
    if not craft.is_laser(case.name):
        return [], ""
    if fault.echo_m is not None:
        echo = np.interp(t, (fault.from_s, fault.to_s), fault.echo_m)
        return _range_flags(case, echo, "no monitor compares the range of the fog with another source")
    true = _true_range(case)
    blind = case.truth.span((true > fault.visibility_m) & _in_interval_mask(case) & (true < craft.range_m(case.name)))
    if blind is None:
        return [], ""
    soon = craft.period_s(case.name) + NAV_S
    return [ExpectedFlag(f"{HEIGHT}/{case.name}", ("no_return", "device_flag"), *blind, soon, 2 * soon)], ""


def gnss_offset_flags(fault: GnssOffset, case: FaultCase) -> RuleResult:
    """A receiver that aids the filter contradicts it and is rejected; otherwise the height of the solution is wrong.

    Then every altimeter over known terrain deviates.
    """
    craft, truth = case.craft, case.truth
    if case.name in craft.filter_gnss:
        return _contradiction_flags(fault, case)
    down = GnssFaults(case.name, [fault]).offset_n(truth.t)[0][:, 2]
    wrong = (abs(down) > DEVIATION_M) & _in_interval_mask(case) & ~craft.terrain_edge_mask(truth)
    is_flagged = craft.has_terrain and "position" in craft.preferred_roles(case.name)
    expected_flags = [
        expected_flag
        for name in (craft.altimeters if is_flagged else ())
        for expected_flag in _deviation_flags(name, case, wrong & _in_range_mask(name, case))
    ]
    return expected_flags, "" if expected_flags else "no monitor detects this position offset"


def _contradiction_flags(fault: GnssOffset, case: FaultCase) -> RuleResult:
    """The receiver is rejected as position source; ramps below the resolution of the inertial unit raise no flag."""
    size = math.hypot(fault.north_m, fault.east_m)
    is_detectable = size >= CONTRADICTION_M and size >= CONTRADICTION_MPS * fault.over_s
    if not is_detectable or case.craft.positions[:1] != (case.name,):
        return [], "no monitor detects this position offset"
    words = (f"position not from {case.name}",)
    clears_s = READMISSION_S if fault.over_s == 0.0 or size >= CLOSURE_M else math.inf
    return [ExpectedFlag(SOLUTION, words, case.from_s, case.until_s, CONTRADICTION_S, clears_s)], ""


def _range_flags(case: FaultCase, measured: Array, reason: str) -> RuleResult:
    """Flags of a wrong range [m] at the times of the truth.  reason : why there is none without a comparison"""
    craft, limits = case.craft, case.craft.altimeter(case.name)
    if limits is None or case.name not in craft.altimeters or not craft.has_terrain:
        return [], reason
    is_range = (measured >= limits.range_m[0]) & (measured <= limits.range_m[1])
    known = _in_interval_mask(case) & _in_range_mask(case.name, case) & ~craft.terrain_edge_mask(case.truth)
    wrong = abs(measured - _true_range(case)) > DEVIATION_M
    expected_flags = _deviation_flags(case.name, case, known & is_range & wrong)
    return expected_flags, "" if expected_flags else f"the range is not wrong by more than {DEVIATION_M:g} m"


def _deviation_flags(name: str, case: FaultCase, where: Mask) -> Sequence[ExpectedFlag]:
    shown = case.truth.span(where)
    if shown is None:
        return []
    clears_s = case.until_s - shown[1] + SILENT_S + case.craft.period_s(name)
    return [ExpectedFlag(f"{HEIGHT}/{name}", (Reason.DEVIATION,), *shown, SILENT_S, clears_s)]


def _faulty_range(fault: QuantityFault, case: FaultCase) -> Array:
    """The faulty range of the device [m]; noise as a constant error of one sigma."""
    true, since = _true_range(case), case.truth.t - fault.from_s
    match fault:
        case Bias():
            return true + fault.value
        case Ramp():
            return true + fault.rate * since
        case Noise():
            return true + fault.sd
        case WrongUnit():
            return true * fault.factor
        case Scale():
            return true * (1.0 + fault.percent / 100.0)
        case Forced():
            return np.full(len(true), fault.value)
    raise AssertionError(f"no faulty range for {type(fault).__name__}")


def _true_range(case: FaultCase, name: str = "") -> Array:
    """True range of its beam if the truth has it, else the height [m]."""
    return case.truth.ranges.get(name or case.name, (case.truth.height_agl,))[0]


def _in_range_mask(name: str, case: FaultCase) -> Mask:
    """Where the ground is within its range."""
    return np.asarray(_true_range(case, name) < case.craft.range_m(name))


def _in_interval_mask(case: FaultCase) -> Mask:
    return np.asarray((case.truth.t >= case.from_s) & (case.truth.t < case.until_s))
