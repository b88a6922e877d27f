"""What the daemon must say of the faults of devices, kind by kind."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from fti.hil.expected.compared import OfSource
from fti.hil.expected.duties import (
    BITS,
    CLOCK_RENEW_S,
    CLOCK_SEEN_S,
    DISAGREE_WORDS,
    DOUBT_S,
    EXCLUDED_HEIGHT_S,
    HEALTH_S,
    HEIGHT,
    INTEGRITY,
    LINKS,
    MEMORY_S,
    MEMORY_WORDS,
    NAV_EVENT,
    NAV_S,
    RATE_SHARE,
    RENEWED_S,
    SILENT_S,
    SOLUTION,
    SOURCE_REFUSED_S,
    TRIAL_S,
    UNCERTAIN_WORDS,
    UNIT_S,
    WINDOW_S,
    Case,
    Duty,
    Found,
    May,
    Told,
    doubted_s,
)
from fti.hil.expected.ground_flags import drawn_away, in_fog, stands_still, wrong_value
from fti.hil.expected.source_flags import NOT_COMPARED, source_duties
from fti.hil.tables.bases import OnDevices, OnQuantity
from fti.hil.tables.kinds import (
    AttitudeOffset,
    BitErrors,
    Breaker,
    BrownOut,
    Burst,
    ClockDrift,
    ClockJump,
    Cut,
    Duplicated,
    Fog,
    Freeze,
    GnssDegraded,
    GnssOffset,
    GnssOutage,
    GnssRamp,
    InertialBias,
    Invalid,
    Latency,
    LeverArm,
    LostHeader,
    Reordered,
    Stuck,
    SwappedCoordinates,
    Truncated,
    Undulation,
    WrongChecksum,
    WrongLabel,
)


def on_device(fault: OnDevices, case: Case) -> Told:
    """What is due of one fault on one device; duties that are too long for it are not."""
    for kinds, rule in RULES:
        if isinstance(fault, kinds):
            duties, unknown = rule(fault, case)
            duties = [*duties, *source_duties(fault, case)]
            unknown = "" if duties else unknown
            return Told.from_duties(case.name, duties, tuple(consequences(case, *_in_health(fault))), unknown)
    raise AssertionError(f"no flags are stated for {type(fault).__name__}")


def _is_silent(fault: Cut, case: Case) -> Found:
    return silence(case), ""


def silence(case: Case) -> list[Duty]:
    """Nothing of the device arrives any more."""
    craft, name = case.craft, case.name
    noticed = HEALTH_S + (SILENT_S if craft.is_alone(name) else WINDOW_S)
    health = case.duty(case.health, "silent", "noise", within_s=noticed, clears_s=craft.boot_s(name) + HEALTH_S + 1.0)
    return [health, *_stale(case)]


def _has_no_power(fault: Breaker | BrownOut, case: Case) -> Found:
    """A breaker is open, or the voltage is below what the device needs; power units say which."""
    if isinstance(fault, BrownOut) and not case.craft.stops_at(case.name, fault.supply_v):
        return [], ""
    word = f"{case.name}_{'tripped' if isinstance(fault, Breaker) else 'brown_out'}"
    units = case.craft.power_units
    within_s, clears_s = UNIT_S, UNIT_S + case.craft.boot_s(case.name)
    told = [case.duty(f"/{unit}/device_status", word, within_s=within_s, clears_s=clears_s) for unit in units]
    return [*told, *silence(case)], ""


def _stale(case: Case) -> list[Duty]:
    """Navigation has nothing new of the device."""
    age = case.craft.max_age_s(case.name)
    back = case.craft.boot_s(case.name) + 2 * case.craft.period_s(case.name) + NAV_S
    return _lost(case, ("stale",), age + NAV_S, back)


def _lost(case: Case, against_height: tuple[str, ...], within_s: float, clears_s: float) -> list[Duty]:
    """What navigation says when it cannot use a device: of the height, and that another source has taken over."""
    craft, name, found = case.craft, case.name, list[Duty]()
    if name in craft.altimeters:
        found.append(case.duty(f"{HEIGHT}/{name}", *against_height, within_s=within_s, clears_s=clears_s))
    for role in craft.preferred_for(name):
        words = (f"{role} not from {name}",)
        found.append(case.duty(SOLUTION, *words, within_s=within_s, clears_s=clears_s + SOURCE_REFUSED_S))
    return found


def _says_so(fault: Invalid, case: Case) -> Found:
    """The device declares its measurements invalid."""
    if not case.craft.says_invalid(case.name):
        return [], "its protocol has no way to say so"
    soon = case.craft.period_s(case.name) + NAV_S
    back = 2 * case.craft.period_s(case.name) + NAV_S
    words = fault.flags
    duties = [case.duty(f"/{case.name}/", "invalid", *words, within_s=soon, clears_s=back)]
    duties += [case.duty(f"/{case.name}/device_status", word, within_s=soon, clears_s=back) for word in words]
    return duties + _lost(case, ("device_flag", "no_return"), soon, back), ""


def _has_no_fix(fault: GnssOutage, case: Case) -> Found:
    """A receiver declares its position invalid, and has a fix again a while after the signals are back."""
    name, period = case.name, case.craft.period_s(case.name)
    if not case.craft.is_receiver(name):
        return [], "it goes on with what it has besides satellites"
    soon, back = period + NAV_S, 2 * period + NAV_S + case.craft.FIX_S
    duties = [case.duty(f"/{name}/", "invalid", within_s=soon, clears_s=back)]
    if "position" in case.craft.preferred_for(name):
        duties.append(case.duty(SOLUTION, f"position not from {name}", within_s=soon, clears_s=back + SOURCE_REFUSED_S))
    return duties, ""


def _is_worse(fault: GnssDegraded, case: Case) -> Found:
    """A receiver states its standard deviation with each position, where its protocol has a place for it."""
    if not case.craft.is_receiver(case.name):
        return [], "a position without a standard deviation"
    stated = {"horizontal": fault.horizontal_m, "vertical": fault.vertical_m}
    soon = case.craft.period_s(case.name) + SILENT_S  # positions may be rarer than its other messages
    place = f"/{case.name}/position"
    return [
        replace(case.duty(f"{place}.{axis}_sd", within_s=soon, clears_s=0.0), value=sd) for axis, sd in stated.items()
    ], ""


def _is_frozen(fault: Freeze, case: Case) -> Found:
    """Old messages say old times; of a device without a clock nobody can tell."""
    if not case.craft.says_time(case.name):
        return [], "old messages without a time look like new ones"
    return [_clock_away(case)], ""


def _clock_away(case: Case) -> Duty:
    due = case.duty(case.health, "clock away", within_s=DOUBT_S + HEALTH_S, clears_s=_learned_s(case) + HEALTH_S)
    return replace(due, clock=case.name)


def _learned_s(case: Case) -> float:
    """What has lasted was learned, and has to be learned again when it ends [s]."""
    return CLOCK_RENEW_S if case.until_s - case.from_s > RENEWED_S else 1.0


def _clock_jumps(fault: ClockJump, case: Case) -> Found:
    if abs(fault.by_s) < CLOCK_SEEN_S:
        return [], "a clock that is off by less than what is usual"
    return [_clock_away(case)], ""


def _clock_drifts(fault: ClockDrift, case: Case) -> Found:
    return [], "a slow drift, which is taken for the clock's own"


def _is_damaged(fault: Any, case: Case) -> Found:
    """Bytes are refused; of a share of messages nothing else follows.  On CAN that is a frame that is too short."""
    if case.craft.is_on_can(case.name) and not isinstance(fault, Truncated):
        return [], "wrong data in a frame whose checksum is good"
    if isinstance(fault, BitErrors) and _wrong_bits(fault, case) < BITS:
        return [], "fewer wrong bits than can be relied upon"
    refused = case.duty(case.health, "damaged bytes", within_s=HEALTH_S + 1.0, clears_s=HEALTH_S + 1.0)
    return [refused, *(_stale(case) if getattr(fault, "share", 0.0) >= 1.0 else [])], ""


def _wrong_bits(fault: BitErrors, case: Case) -> float:
    bits_per_message = 64.0
    return fault.rate * bits_per_message * (case.until_s - case.from_s) / case.craft.period_s(case.name)


def _is_renamed(fault: WrongLabel, case: Case) -> Found:
    """What nobody knows is as if it had not been sent."""
    if fault.share < 1.0:
        return [], "messages with an unknown identifier, which are another device's for all that is known"
    late = WINDOW_S + HEALTH_S
    health = [case.duty(case.health, "silent", "noise", "wrong rate", within_s=late, clears_s=late)]
    return [*(health if case.craft.has_rate(case.name) else []), *_stale(case)], ""


def _is_doubled(fault: Duplicated, case: Case) -> Found:
    if fault.share < RATE_SHARE or not case.craft.has_rate(case.name):
        return [], "messages that come twice"
    return [case.duty(case.health, "wrong rate", within_s=WINDOW_S + HEALTH_S, clears_s=WINDOW_S + HEALTH_S)], ""


def _comes_in_bursts(fault: Burst, case: Case) -> Found:
    """Held back for longer than a measurement may be old."""
    if fault.hold_s < case.craft.max_age_s(case.name) + 2 * NAV_S:
        return [], "messages that come together and not too late"
    return _stale(case), ""


def _is_not_detected(what: str) -> Callable[[Any, Case], Found]:
    return lambda fault, case: ([], what)


#: Kinds of faults of devices, and what is due.
RULES: Sequence[tuple[Any, Callable[[Any, Case], Found]]] = (
    (Cut, _is_silent),
    (Breaker | BrownOut, _has_no_power),
    (Freeze, _is_frozen),
    (Stuck, stands_still),
    (Invalid, _says_so),
    (GnssOutage, _has_no_fix),
    (OnQuantity, wrong_value),
    (GnssDegraded, _is_worse),
    (GnssOffset, drawn_away),
    (LeverArm, _is_not_detected("a device that is mounted elsewhere")),
    (
        GnssRamp | SwappedCoordinates | Undulation | AttitudeOffset | InertialBias | Latency,
        _is_not_detected(NOT_COMPARED),
    ),
    (Fog, in_fog),
    (ClockJump, _clock_jumps),
    (ClockDrift, _clock_drifts),
    (BitErrors | LostHeader | Truncated | WrongChecksum, _is_damaged),
    (WrongLabel, _is_renamed),
    (Duplicated, _is_doubled),
    (Reordered, _is_not_detected("messages out of order")),
    (Burst, _comes_in_bursts),
)


#: What health may say of a device whose messages come whole, in time and with the right time: that they are invalid.
#: A wrong number may be one that no message can carry: then none comes.
NO_MESSAGE = ("silent", "noise", "wrong rate")
IN_HEALTH: Sequence[tuple[Any, tuple[str, ...]]] = (
    (OnQuantity | SwappedCoordinates, ("invalid", *NO_MESSAGE)),
    (Stuck | Invalid | Fog | GnssDegraded | GnssOffset | OfSource, ("invalid",)),
    (GnssOutage, ("invalid", "clock away")),
    (ClockJump | ClockDrift, ("clock away",)),
    (Duplicated, ("wrong rate",)),
    (Cut | Breaker | BrownOut, ("invalid", "clock away", *NO_MESSAGE)),
)


def _in_health(fault: OnDevices) -> tuple[str, ...]:
    """The words with which health may speak of the device because of the fault; none: any."""
    return next((words for kinds, words in IN_HEALTH if isinstance(fault, kinds)), ())


def consequences(case: Case, *in_health: str) -> Iterator[May]:
    """Where a fault of a device may show, and until when.  in_health : the words that health may say; none: any"""
    craft, name, begin, end = case.craft, case.name, case.from_s, case.until_s + case.craft.boot_s(case.name)
    age = craft.max_age_s(name) + 1.0
    health = WINDOW_S + HEALTH_S + 1.0 + (_learned_s(case) if craft.says_time(name) else 0.0)
    yield May(f"/{name}/", begin, end + age + craft.FIX_S)
    yield May(case.health, begin, end + health, in_health)
    yield from (May(f"/{unit}/device_status", begin, end + UNIT_S) for unit in craft.power_units)
    yield May(f"/fti/event/{name}", begin, end + health)
    if not in_health or "silent" in in_health:
        yield May(f"{LINKS}/{craft.link_of(name)}", begin, end + health)
    if name in craft.altimeters:
        yield May(f"{HEIGHT}/{name}", begin, end + age)
        yield May(f"{HEIGHT}/{name}", begin, end + age + MEMORY_S, MEMORY_WORDS)
        for other in craft.altimeters:  # one of two that disagree may be any
            yield May(f"{HEIGHT}/{other}", begin, end + age + MEMORY_S, DISAGREE_WORDS)
            yield May(f"/fti/event/{other}", begin, end + age + MEMORY_S)
    if name in craft.filter_altimeters:
        yield May(NAV_EVENT, begin, end + age + EXCLUDED_HEIGHT_S)
        yield May(f"{HEIGHT}/{name}", begin, end + age + EXCLUDED_HEIGHT_S, ("excluded",))
    if name in craft.sources:
        refused = end + age + craft.FIX_S + SOURCE_REFUSED_S
        places = (SOLUTION, HEIGHT, NAV_EVENT, f"/fti/event/{name}")
        yield from (May(place, begin, refused) for place in places)
        yield May(HEIGHT, begin, end + age + craft.FIX_S + MEMORY_S, MEMORY_WORDS)
        yield from (May(f"/fti/event/{other}", begin, end + age + craft.FIX_S) for other in craft.altimeters)
        for other in craft.filter_altimeters:  # a sound one contradicts a filter that has followed a wrong place
            yield May(f"{HEIGHT}/{other}", begin, end + age + craft.FIX_S + EXCLUDED_HEIGHT_S, ("excluded",))
            yield May(NAV_EVENT, begin, end + age + craft.FIX_S + EXCLUDED_HEIGHT_S)
    if name in craft.altimeters or name in craft.sources:
        judged = end + age + craft.FIX_S + doubted_s(craft)
        yield May(INTEGRITY, begin, judged)
        if name in craft.filter_gnss:
            yield May(INTEGRITY, begin, judged + TRIAL_S, UNCERTAIN_WORDS)
