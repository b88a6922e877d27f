"""Expected and allowed flags of device faults, kind by kind."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from fti.hil.oracle.flag_definitions import (
    CLOCK_AWAY_S,
    CLOCK_LEARN_S,
    CLOCK_RELEARN_S,
    DISAGREE_WORDS,
    GROUND_DRIFT,
    HEALTH_S,
    HEIGHT,
    HEIGHT_EXCLUSION_S,
    INTEGRITY,
    LINKS,
    MEMORY_S,
    MEMORY_WORDS,
    MIN_CLOCK_ERROR_S,
    MIN_WRONG_BITS,
    NAV_EVENT,
    NAV_S,
    RATE_SHARE,
    SILENT_S,
    SOLUTION,
    SOURCE_REFUSAL_S,
    TRIAL_S,
    UNCERTAIN_WORDS,
    UNIT_S,
    WINDOW_S,
    ExpectedFlag,
    FaultCase,
    FaultFlags,
    FlagAllowance,
    RuleResult,
    monitor_recovery_s,
)
from fti.hil.oracle.ground_flags import fog_flags, gnss_offset_flags, stuck_flags, wrong_value_flags
from fti.hil.oracle.scan_drift_flags import scan_fault_flags
from fti.hil.oracle.source_flags import INDISTINGUISHABLE, expected_source_flags
from fti.hil.oracle.truth_checked_faults import SourceFault
from fti.hil.tables import fault_types
from fti.hil.tables.fault_base import DeviceFault, QuantityFault

#: Shortest message, to estimate the number of wrong bits.
MESSAGE_BITS = 64.0


def flags_on_device(fault: DeviceFault, case: FaultCase) -> FaultFlags:
    """The flags of one fault on one device."""
    for kinds, rule in RULES:
        if isinstance(fault, kinds):
            expected_flags, unknown = rule(fault, case)
            expected_flags = [*expected_flags, *expected_source_flags(fault, case)]
            unknown = "" if expected_flags else unknown
            health = next((words for kinds, words in HEALTH_WORDS if isinstance(fault, kinds)), ())
            return FaultFlags.from_flags(case.name, expected_flags, tuple(consequences(case, *health)), unknown)
    raise AssertionError(f"no rule for {type(fault).__name__}")


def silence_flags(case: FaultCase) -> list[ExpectedFlag]:
    """Flags while no message of the device arrives."""
    craft, name = case.craft, case.name
    within_s = HEALTH_S + (SILENT_S if craft.is_alone(name) else WINDOW_S)
    health = case.expected_flag(
        case.health, "silent", "noise", within_s=within_s, clears_s=craft.boot_s(name) + HEALTH_S + 1.0
    )
    return [health, *_stale_flags(case)]


def _power_flags(fault: fault_types.Breaker | fault_types.BrownOut, case: FaultCase) -> RuleResult:
    """A breaker is open, or the voltage is too low for the device; power units report which."""
    if isinstance(fault, fault_types.BrownOut) and not case.craft.stops_at(case.name, fault.supply_v):
        return [], ""
    word = f"{case.name}_{'tripped' if isinstance(fault, fault_types.Breaker) else 'brown_out'}"
    units = case.craft.power_units
    within_s, clears_s = UNIT_S, UNIT_S + case.craft.boot_s(case.name)
    flags = [case.expected_flag(f"/{unit}/device_status", word, within_s=within_s, clears_s=clears_s) for unit in units]
    return [*flags, *silence_flags(case)], ""


def _stale_flags(case: FaultCase) -> list[ExpectedFlag]:
    age = case.craft.max_age_s(case.name)
    back = case.craft.boot_s(case.name) + 2 * case.craft.period_s(case.name) + NAV_S
    return _loss_flags(case, ("stale",), age + NAV_S, back)


def _loss_flags(
    case: FaultCase, height_reasons: tuple[str, ...], within_s: float, clears_s: float
) -> list[ExpectedFlag]:
    """Flags of navigation without the device: reasons at its height, and the change of source."""
    craft, name, found = case.craft, case.name, list[ExpectedFlag]()
    if name in craft.altimeters:
        found.append(case.expected_flag(f"{HEIGHT}/{name}", *height_reasons, within_s=within_s, clears_s=clears_s))
    for role in craft.preferred_roles(name):
        words = (f"{role} not from {name}",)
        found.append(case.expected_flag(SOLUTION, *words, within_s=within_s, clears_s=clears_s + SOURCE_REFUSAL_S))
    return found


def _invalid_flags(fault: fault_types.Invalid, case: FaultCase) -> RuleResult:
    """The device declares its measurements invalid."""
    if not case.craft.can_declare_invalid(case.name):
        return [], "the protocol cannot declare a measurement invalid"
    soon = case.craft.period_s(case.name) + NAV_S
    back = 2 * case.craft.period_s(case.name) + NAV_S
    words = fault.flags
    expected_flags = [case.expected_flag(f"/{case.name}/", "invalid", *words, within_s=soon, clears_s=back)]
    expected_flags += [
        case.expected_flag(f"/{case.name}/device_status", word, within_s=soon, clears_s=back) for word in words
    ]
    return expected_flags + _loss_flags(case, ("device_flag", "no_return"), soon, back), ""


def _outage_flags(fault: fault_types.GnssOutage, case: FaultCase) -> RuleResult:
    """A receiver declares its position invalid, and has a fix again FIX_S after the signals return."""
    name, period = case.name, case.craft.period_s(case.name)
    if not case.craft.is_receiver(name):
        return [], "the device continues without satellites"
    soon, back = period + NAV_S, 2 * period + NAV_S + case.craft.FIX_S
    expected_flags = [case.expected_flag(f"/{name}/", "invalid", within_s=soon, clears_s=back)]
    if "position" in case.craft.preferred_roles(name):
        expected_flags.append(
            case.expected_flag(SOLUTION, f"position not from {name}", within_s=soon, clears_s=back + SOURCE_REFUSAL_S)
        )
    return expected_flags, ""


def _degraded_flags(fault: fault_types.GnssDegraded, case: FaultCase) -> RuleResult:
    """A receiver states its standard deviation with each position, if the protocol has a field for it."""
    if not case.craft.is_receiver(case.name):
        return [], "the device does not state a standard deviation of the position"
    stated = {"horizontal": fault.horizontal_m, "vertical": fault.vertical_m}
    soon = case.craft.period_s(case.name) + SILENT_S  # positions may have a lower rate than its other messages
    place = f"/{case.name}/position"
    return [
        replace(case.expected_flag(f"{place}.{axis}_sd", within_s=soon, clears_s=0.0), value=sd)
        for axis, sd in stated.items()
    ], ""


def _freeze_flags(fault: fault_types.Freeze, case: FaultCase) -> RuleResult:
    """Repeated messages have old timestamps; without a device time they cannot be detected."""
    if not case.craft.sends_time(case.name):
        return [], "repeated messages without a device time are not detectable"
    return [_clock_away_flag(case)], ""


def _clock_away_flag(case: FaultCase) -> ExpectedFlag:
    due = case.expected_flag(
        case.health, "clock away", within_s=CLOCK_AWAY_S + HEALTH_S, clears_s=_relearn_s(case) + HEALTH_S
    )
    return replace(due, clock=case.name)


def _relearn_s(case: FaultCase) -> float:
    """Time until the clock is known again after the fault [s]: a long error was learned."""
    return CLOCK_RELEARN_S if case.until_s - case.from_s > CLOCK_LEARN_S else 1.0


def _clock_jump_flags(fault: fault_types.ClockJump, case: FaultCase) -> RuleResult:
    if abs(fault.by_s) < MIN_CLOCK_ERROR_S:
        return [], f"the clock error is less than {MIN_CLOCK_ERROR_S:g} s"
    return [_clock_away_flag(case)], ""


def _damage_flags(fault: Any, case: FaultCase) -> RuleResult:
    """Damaged bytes are rejected; data become stale only with share = 1.  On CAN only short frames are rejected."""
    if case.craft.is_on_can(case.name) and not isinstance(fault, fault_types.Truncated):
        return [], "wrong data in a CAN frame with a correct checksum"
    bits = MESSAGE_BITS * (case.until_s - case.from_s) / case.craft.period_s(case.name)
    if isinstance(fault, fault_types.BitErrors) and fault.rate * bits < MIN_WRONG_BITS:
        return [], f"fewer than {MIN_WRONG_BITS:g} wrong bits"
    rejected = case.expected_flag(case.health, "damaged bytes", within_s=HEALTH_S + 1.0, clears_s=HEALTH_S + 1.0)
    return [rejected, *(_stale_flags(case) if getattr(fault, "share", 0.0) >= 1.0 else [])], ""


def _wrong_label_flags(fault: fault_types.WrongLabel, case: FaultCase) -> RuleResult:
    """Messages with an unknown identifier count as missing."""
    if fault.share < 1.0:
        return [], "messages with an unknown identifier may belong to another device"
    late = WINDOW_S + HEALTH_S
    health = [case.expected_flag(case.health, "silent", "noise", "wrong rate", within_s=late, clears_s=late)]
    return [*(health if case.craft.has_rate(case.name) else []), *_stale_flags(case)], ""


def _duplicate_flags(fault: fault_types.Duplicated, case: FaultCase) -> RuleResult:
    if fault.share < RATE_SHARE or not case.craft.has_rate(case.name):
        return [], f"duplicated messages, at a share below {RATE_SHARE:g} or without a rate_hz"
    return [
        case.expected_flag(case.health, "wrong rate", within_s=WINDOW_S + HEALTH_S, clears_s=WINDOW_S + HEALTH_S)
    ], ""


def _burst_flags(fault: fault_types.Burst, case: FaultCase) -> RuleResult:
    """Messages are stale if they are held longer than their age limit."""
    if fault.hold_s < case.craft.max_age_s(case.name) + 2 * NAV_S:
        return [], "the bursts are shorter than the age limit (max_age_ms)"
    return _stale_flags(case), ""


def _undetected_rule(reason: str) -> Callable[[Any, FaultCase], RuleResult]:
    return lambda fault, case: ([], reason)


#: Kinds of device faults and their rules.
RULES: Sequence[tuple[Any, Callable[[Any, FaultCase], RuleResult]]] = (
    (fault_types.Cut, lambda fault, case: (silence_flags(case), "")),
    (fault_types.Breaker | fault_types.BrownOut, _power_flags),
    (fault_types.Freeze, _freeze_flags),
    (fault_types.Stuck, stuck_flags),
    (fault_types.Invalid, _invalid_flags),
    (fault_types.GnssOutage, _outage_flags),
    (QuantityFault, wrong_value_flags),
    (fault_types.GnssDegraded, _degraded_flags),
    (fault_types.GnssOffset, gnss_offset_flags),
    (fault_types.Mounting | fault_types.Latency, scan_fault_flags),
    (fault_types.LeverArm, _undetected_rule("a wrong mounting position is not detectable")),
    (
        fault_types.GnssRamp
        | fault_types.SwappedCoordinates
        | fault_types.Undulation
        | fault_types.AttitudeOffset
        | fault_types.InertialBias,
        _undetected_rule(INDISTINGUISHABLE),
    ),
    (fault_types.Fog, fog_flags),
    (fault_types.ClockJump, _clock_jump_flags),
    (fault_types.ClockDrift, _undetected_rule("a slow drift is taken as the drift of the clock itself")),
    (fault_types.BitErrors | fault_types.LostHeader | fault_types.Truncated | fault_types.WrongChecksum, _damage_flags),
    (fault_types.WrongLabel, _wrong_label_flags),
    (fault_types.Duplicated, _duplicate_flags),
    (fault_types.Reordered, _undetected_rule("messages out of order raise no flag")),
    (fault_types.Burst, _burst_flags),
)


#: Allowed health states per fault; other faults: any.  A wrong number may be outside the range of its field: then no
#: message is sent.
NO_MESSAGE_WORDS = ("silent", "noise", "wrong rate")
HEALTH_WORDS: Sequence[tuple[Any, tuple[str, ...]]] = (
    (QuantityFault | fault_types.SwappedCoordinates, ("invalid", *NO_MESSAGE_WORDS)),
    (
        fault_types.Stuck
        | fault_types.Invalid
        | fault_types.Fog
        | fault_types.GnssDegraded
        | fault_types.GnssOffset
        | fault_types.Mounting
        | SourceFault,
        ("invalid",),
    ),
    (fault_types.GnssOutage, ("invalid", "clock away")),
    (fault_types.ClockJump | fault_types.ClockDrift, ("clock away",)),
    (fault_types.Duplicated, ("wrong rate",)),
    (fault_types.Cut | fault_types.Breaker | fault_types.BrownOut, ("invalid", "clock away", *NO_MESSAGE_WORDS)),
)


def consequences(case: FaultCase, *in_health: str) -> Iterator[FlagAllowance]:
    """Allowed flags of a fault on a device.  in_health : allowed health states; none: any"""
    craft, name, begin, end = case.craft, case.name, case.from_s, case.until_s + case.craft.boot_s(case.name)
    age = craft.max_age_s(name) + 1.0
    health = WINDOW_S + HEALTH_S + 1.0 + (_relearn_s(case) if craft.sends_time(name) else 0.0)
    yield FlagAllowance(f"/{name}/", begin, end + age + craft.FIX_S)
    yield FlagAllowance(case.health, begin, end + health, in_health)
    yield from (FlagAllowance(f"/{unit}/device_status", begin, end + UNIT_S) for unit in craft.power_units)
    yield FlagAllowance(f"/fti/event/{name}", begin, end + health)
    if not in_health or "silent" in in_health:
        yield FlagAllowance(f"{LINKS}/{craft.link_of(name)}", begin, end + health)
    if name in craft.altimeters:
        yield FlagAllowance(f"{HEIGHT}/{name}", begin, end + age)
        yield FlagAllowance(f"{HEIGHT}/{name}", begin, end + age + MEMORY_S, MEMORY_WORDS)
        for other in craft.altimeters:  # either of two that disagree may be flagged
            yield FlagAllowance(f"{HEIGHT}/{other}", begin, end + age + MEMORY_S, DISAGREE_WORDS)
            yield FlagAllowance(f"/fti/event/{other}", begin, end + age + MEMORY_S)
    if name in craft.filter_altimeters:
        yield FlagAllowance(NAV_EVENT, begin, end + age + HEIGHT_EXCLUSION_S)
        yield FlagAllowance(f"{HEIGHT}/{name}", begin, end + age + HEIGHT_EXCLUSION_S, ("excluded",))
    if name in craft.sources:
        until_s = end + age + craft.FIX_S + SOURCE_REFUSAL_S
        places = (SOLUTION, HEIGHT, NAV_EVENT, f"/fti/event/{name}")
        yield from (FlagAllowance(place, begin, until_s) for place in places)
        yield FlagAllowance(HEIGHT, begin, end + age + craft.FIX_S + MEMORY_S, MEMORY_WORDS)
        yield from (FlagAllowance(f"/fti/event/{other}", begin, end + age + craft.FIX_S) for other in craft.altimeters)
        for other in craft.filter_altimeters:  # a correct one contradicts a filter with a wrong position
            yield FlagAllowance(f"{HEIGHT}/{other}", begin, end + age + craft.FIX_S + HEIGHT_EXCLUSION_S, ("excluded",))
            yield FlagAllowance(NAV_EVENT, begin, end + age + craft.FIX_S + HEIGHT_EXCLUSION_S)
    if craft.scan_drift and name in {*craft.scan_drift, craft.filter_imu, *craft.sources}:
        # the pairs may contradict until the next calibration, which needs a turn
        yield from (FlagAllowance(place, begin, case.truth.end_s) for place in (GROUND_DRIFT, NAV_EVENT))
    if name in craft.altimeters or name in craft.sources:
        until_s = end + age + craft.FIX_S + monitor_recovery_s(craft)
        yield FlagAllowance(INTEGRITY, begin, until_s)
        if name in craft.filter_gnss:
            yield FlagAllowance(INTEGRITY, begin, until_s + TRIAL_S, UNCERTAIN_WORDS)
