"""The expected flags of every fault: was each raised in time, and cleared in time?"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Sequence
from dataclasses import replace

from fti.hil.faults.descriptions import describe
from fti.hil.oracle.flag_definitions import ExpectedFlag, FaultFlags
from fti.hil.oracle.truth_checked_faults import is_truth_checked
from fti.hil.tables.fault_types import Fault
from fti.post.score.flight_observation import BEFORE_S, FlightObservation
from fti.post.score.observed_flags import FlagInterval
from fti.post.score.rows import FAILURES, FlagRow, Result


def flag_rows(
    due: Sequence[tuple[int, FaultFlags]],
    faults: Sequence[Fault],
    sources: Container[str],
    observation: FlightObservation,
) -> Iterator[FlagRow]:
    """One row for each flag.

    due : expected flags, with the index of their fault; sources : devices that give position or attitude
    """
    for i, one in _extend_overlapping(due):
        is_compared = is_truth_checked(faults[i], on_source=one.subject in sources)
        unknown = Result.COMPARED if is_compared else Result.UNKNOWN
        yield from _fault_rows(i, faults[i], one, observation, unknown=unknown)


def unconfigured_rows(
    own: Sequence[tuple[int, FaultFlags]],
    emulated: Sequence[tuple[int, FaultFlags]],
    faults: Sequence[Fault],
    observation: FlightObservation,
) -> Iterator[FlagRow]:
    """Flags expected with the scenario's own configuration, not with the emulated one: a role is missing.

    own, emulated : expected flags of either, with the index of their fault
    """
    known = {_identity(i, expected_flag) for i, one in emulated for expected_flag in one.expected_flags}
    for i, one in own:
        for expected_flag in one.expected_flags:
            row = _row(i, faults[i], one, expected_flag)
            is_missing = _identity(i, expected_flag) not in known
            result = _compare_row(row, expected_flag, observation).result
            if is_missing and result not in (Result.NOT_FLOWN, Result.PORTS):
                yield replace(row, result=Result.NOT_CONFIGURED)


def _identity(fault: int, expected_flag: ExpectedFlag) -> tuple[int, str, tuple[str, ...]]:
    return fault, expected_flag.place, expected_flag.words


def _extend_overlapping(due: Sequence[tuple[int, FaultFlags]]) -> list[tuple[int, FaultFlags]]:
    """Extend each flag that another fault raises again before it must have cleared to the end of that fault."""
    expected_flags = sorted(
        (expected_flag for _, one in due for expected_flag in one.expected_flags),
        key=lambda expected_flag: expected_flag.from_s,
    )
    return [
        (
            i,
            replace(
                one,
                expected_flags=tuple(
                    replace(expected_flag, until_s=_until_s(expected_flag, expected_flags))
                    for expected_flag in one.expected_flags
                ),
            ),
        )
        for i, one in due
    ]


def _until_s(expected_flag: ExpectedFlag, expected_flags: Sequence[ExpectedFlag]) -> float:
    """End of all causes of a flag [s].  expected_flags : of all faults, in order of ``from_s``"""
    until_s = expected_flag.until_s
    for other in expected_flags:
        same = other.place == expected_flag.place and not set(other.words).isdisjoint(expected_flag.words)
        if same and expected_flag.from_s <= other.from_s <= until_s + expected_flag.clears_s:
            until_s = max(until_s, other.until_s)
    return until_s


def _fault_rows(
    index: int, fault: Fault, one: FaultFlags, observation: FlightObservation, *, unknown: Result
) -> Iterator[FlagRow]:
    what = describe(fault)
    span = getattr(fault, "from_s", 0.0), getattr(fault, "to_s", observation.end_s)
    if one.unknown:
        yield FlagRow(index, what, one.subject, one.unknown, *span, unknown)
    elif not one.expected_flags:
        yield FlagRow(index, what, one.subject, "too short, too small, or of no role", *span, Result.NOT_DUE)
    for expected_flag in one.expected_flags:
        row = _row(index, fault, one, expected_flag)
        scored = _compare_row(row, expected_flag, observation)
        yield replace(scored, result=_tolerate_lateness(scored, expected_flag, observation))


def _row(index: int, fault: Fault, one: FaultFlags, expected_flag: ExpectedFlag) -> FlagRow:
    words = " or ".join(expected_flag.words) if expected_flag.value is None else f"= {expected_flag.value:g}"
    flag, span = f"{expected_flag.place} {words}", (expected_flag.from_s, expected_flag.until_s)
    return FlagRow(index, describe(fault), one.subject, flag, *span, Result.FOUND, within_s=expected_flag.within_s)


def _tolerate_lateness(row: FlagRow, expected_flag: ExpectedFlag, observation: FlightObservation) -> Result:
    """The result, unless the unit was starting or the bench was late when the flag had to be raised or cleared.

    After a pause of the bench the time limit starts again.  A flag that is not raised then is missing.
    """
    if row.result not in FAILURES:
        return row.result
    stays = row.result is Result.STAYS
    cause_s, allowed_s = (row.until_s, row.clears_s) if stays else (row.from_s, row.within_s)
    if cause_s < observation.start_s:
        return Result.START
    last_pause_end_s = observation.last_pause_end_s(cause_s - BEFORE_S, cause_s + (allowed_s or 0.0))
    if last_pause_end_s is None:
        return row.result
    came_s = cause_s + row.after_s if row.result is Result.LATE and row.after_s is not None else expected_flag.until_s
    in_time = stays or came_s <= last_pause_end_s + (allowed_s or 0.0) + BEFORE_S
    return Result.LATE_BENCH if in_time else row.result


def _compare_row(row: FlagRow, expected_flag: ExpectedFlag, observation: FlightObservation) -> FlagRow:
    if expected_flag.from_s + expected_flag.within_s > observation.end_s:
        return replace(row, result=Result.NOT_FLOWN)
    if expected_flag.needs_ports and not observation.has_ports:
        return replace(row, result=Result.PORTS)
    if expected_flag.clock and not observation.observed_flags.knows_clock(expected_flag.clock, expected_flag.from_s):
        return replace(row, result=Result.NOT_DUE)
    observed_flags = observation.observed_flags
    spans = (
        observed_flags.intervals(expected_flag.place, expected_flag.words)
        if expected_flag.value is None
        else observed_flags.intervals_near_value(expected_flag.place, expected_flag.value)
    )
    raised = [span for span in spans if span.until_s > expected_flag.from_s and span.from_s < expected_flag.until_s]
    return _measure_times(row, expected_flag, raised, observation) if raised else replace(row, result=Result.MISSING)


def _measure_times(
    row: FlagRow, expected_flag: ExpectedFlag, raised: Sequence[FlagInterval], observation: FlightObservation
) -> FlagRow:
    """Measure the times to raise and to clear; exempt time extends their limits."""
    after_s = max(raised[0].from_s - expected_flag.from_s, 0.0)
    if expected_flag.value is not None:
        within_s = expected_flag.within_s + observation.exempt_time_s(
            expected_flag.from_s, expected_flag.from_s + after_s
        )
        return replace(row, result=Result.LATE if after_s > within_s else Result.FOUND, after_s=after_s)
    cleared_s = max(max(span.until_s for span in raised) - expected_flag.until_s, 0.0)
    within_s = expected_flag.within_s + observation.exempt_time_s(expected_flag.from_s, expected_flag.from_s + after_s)
    clears_s = expected_flag.clears_s + observation.exempt_time_s(
        expected_flag.until_s, expected_flag.until_s + cleared_s
    )
    result = Result.FOUND
    if after_s > within_s:
        result = Result.LATE
    elif cleared_s > clears_s and expected_flag.until_s + clears_s <= observation.end_s:
        result = Result.STAYS
    clear_s = cleared_s if math.isfinite(cleared_s) else None
    return replace(row, result=result, after_s=after_s, within_s=within_s, clear_s=clear_s, clears_s=clears_s)
