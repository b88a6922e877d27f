"""What known ground says of an altimeter that measures something else, and of a place that is another.

Due is what is wrong by more than ``DEVIATION_M``; what is less wrong may be told all the same.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

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
from fti.hil.oracle.roles import Array, Mask
from fti.hil.tables.fault_base import QuantityFault
from fti.hil.tables.fault_types import Bias, Fog, Forced, GnssOffset, Noise, Ramp, Scale, Stuck, WrongUnit
from fti.types import Reason

#: What an altimeter measures.
RANGE_QUANTITIES = frozenset({"range.slant_range", "radio_height.height_agl"})


def wrong_value_flags(fault: QuantityFault, case: FaultCase) -> RuleResult:
    """A range is held against the ground, nothing else against anything."""
    nobody = "a wrong value of one device: nothing compares it with another's"
    return (
        _range_flags(case, _faulty_range(fault, case), nobody) if fault.quantity in RANGE_QUANTITIES else ([], nobody)
    )


def stuck_flags(fault: Stuck, case: FaultCase) -> RuleResult:
    """Repeated values are seen of an altimeter as soon as the range has changed enough.

    Known ground tells it with the true range, and refuses it as soon as it is wrong by much; without one the altitude
    tells it.
    """
    craft, inside, true = case.craft, _in_interval_mask(case), _true_range(case)
    if case.name not in craft.altimeters or not inside.any():
        return [], "values that stand still with fresh times"
    stood = float(true[inside][0])
    deviates, unknown = _range_flags(case, np.full(len(true), stood), "a range that does not change by much")
    expected_flags = [*_repetition_flags(case, stood), *deviates]
    return expected_flags, "" if expected_flags else unknown


def _repetition_flags(case: FaultCase, stood: float) -> Sequence[ExpectedFlag]:
    """Due from where on the range, or without known ground the altitude, has changed by more than any step."""
    craft, truth, inside = case.craft, case.truth, _in_interval_mask(case)
    if case.name not in craft.altimeters or not craft.positions or not np.isfinite(stood):
        return []
    flown = _true_range(case) if craft.has_terrain else np.cumsum(truth.climb * np.gradient(truth.t))
    known = inside & _in_range_mask(case.name, case) & ~craft.terrain_edge_mask(truth)
    changed = known & (abs(flown - float(flown[inside][0])) > STUCK_M + STUCK_SHARE * stood)
    if (shown := truth.span(changed)) is None:
        return []
    until = case.until_s - shown[1] + MEMORY_S  # it stays refused until its value has changed
    return [ExpectedFlag(f"{HEIGHT}/{case.name}", (Reason.STUCK,), *shown, STUCK_S, until)]


def fog_flags(fault: Fog, case: FaultCase) -> RuleResult:
    """A laser sees no ground; or takes the fog for it."""
    craft, t = case.craft, case.truth.t
    if not craft.is_laser(case.name):
        return [], ""
    if fault.echo_m is not None:
        echo = np.interp(t, (fault.from_s, fault.to_s), fault.echo_m)
        return _range_flags(case, echo, "fog that is taken for the ground")
    true = _true_range(case)
    blind = case.truth.span((true > fault.visibility_m) & _in_interval_mask(case) & (true < craft.range_m(case.name)))
    if blind is None:
        return [], ""
    soon = craft.period_s(case.name) + NAV_S
    return [ExpectedFlag(f"{HEIGHT}/{case.name}", ("no_return", "device_flag"), *blind, soon, 2 * soon)], ""


def gnss_offset_flags(fault: GnssOffset, case: FaultCase) -> RuleResult:
    """A receiver that aids the filter contradicts it and is refused; else the height of the place that counts is wrong.

    Every altimeter over known ground then says another one.
    """
    craft, truth = case.craft, case.truth
    if case.name in craft.filter_gnss:
        return _contradiction_flags(fault, case)
    down = GnssFaults(case.name, [fault]).offset_n(truth.t)[0][:, 2]
    wrong = (abs(down) > DEVIATION_M) & _in_interval_mask(case) & ~craft.terrain_edge_mask(truth)
    told = [name for name in craft.altimeters if "position" in craft.preferred_roles(case.name) and craft.has_terrain]
    expected_flags = [
        expected_flag
        for name in told
        for expected_flag in _deviation_flags(name, case, wrong & _in_range_mask(name, case))
    ]
    return expected_flags, "" if expected_flags else "a position that is drawn away"


def _contradiction_flags(fault: GnssOffset, case: FaultCase) -> RuleResult:
    """The receiver gives no position any more; ramps that an inertial unit does not see are not due."""
    size = math.hypot(fault.north_m, fault.east_m)
    is_detectable = size >= CONTRADICTION_M and size >= CONTRADICTION_MPS * fault.over_s
    if not is_detectable or case.craft.positions[:1] != (case.name,):
        return [], "a position that is drawn away"
    words = (f"position not from {case.name}",)
    clears_s = READMISSION_S if fault.over_s == 0.0 or size >= CLOSURE_M else math.inf
    return [ExpectedFlag(SOLUTION, words, case.from_s, case.until_s, CONTRADICTION_S, clears_s)], ""


def _range_flags(case: FaultCase, said: Array, otherwise: str) -> RuleResult:
    """A range [m] at the times of the truth that is not the true one.  otherwise : where nothing compares it"""
    craft, limits = case.craft, case.craft.altimeter(case.name)
    if limits is None or case.name not in craft.altimeters or not craft.has_terrain:
        return [], otherwise
    is_range = (said >= limits.range_m[0]) & (said <= limits.range_m[1])
    known = _in_interval_mask(case) & _in_range_mask(case.name, case) & ~craft.terrain_edge_mask(case.truth)
    expected_flags = _deviation_flags(case.name, case, known & is_range & (abs(said - _true_range(case)) > DEVIATION_M))
    return expected_flags, "" if expected_flags else "a range that is not wrong by much"


def _deviation_flags(name: str, case: FaultCase, where: Mask) -> Sequence[ExpectedFlag]:
    shown = case.truth.span(where)
    if shown is None:
        return []
    clears_s = case.until_s - shown[1] + SILENT_S + case.craft.period_s(name)
    return [ExpectedFlag(f"{HEIGHT}/{name}", (Reason.DEVIATION,), *shown, SILENT_S, clears_s)]


def _faulty_range(fault: QuantityFault, case: FaultCase) -> Array:
    """The range that the device tells [m]; of a noisy one what it is off by usually."""
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
    raise AssertionError(f"nobody states what {type(fault).__name__} makes of a range")


def _true_range(case: FaultCase, name: str = "") -> Array:
    """Of its beam where the truth has it, else the height [m]."""
    return case.truth.ranges.get(name or case.name, (case.truth.height_agl,))[0]


def _in_range_mask(name: str, case: FaultCase) -> Mask:
    """Is the ground in its range?"""
    return np.asarray(_true_range(case, name) < case.craft.range_m(name))


def _in_interval_mask(case: FaultCase) -> Mask:
    return np.asarray((case.truth.t >= case.from_s) & (case.truth.t < case.until_s))
