"""Every fault with the flags that it had to raise: whether each was there in time, and gone in time."""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Sequence
from dataclasses import replace

from fti.hil.expected.compared import is_compared
from fti.hil.expected.duties import Duty, Told
from fti.hil.faults.words import describe
from fti.hil.tables.kinds import Fault
from fti.post.score.evidence import BEFORE_S, Evidence
from fti.post.score.rows import FAILURES, Row, Verdict
from fti.post.score.said import Span


def flag_rows(
    belongs: Sequence[tuple[int, Told]], faults: Sequence[Fault], sources: Container[str], evidence: Evidence
) -> Iterator[Row]:
    """One row for each flag.

    belongs : what is due, with the index of its fault; sources : devices that give position or attitude
    """
    for i, one in _held_on(belongs):
        is_judged = is_compared(faults[i], on_source=one.subject in sources)
        yield from _fault_rows(i, faults[i], one, evidence, unknown=Verdict.COMPARED if is_judged else Verdict.UNKNOWN)


def vanished_rows(
    own: Sequence[tuple[int, Told]], belongs: Sequence[tuple[int, Told]], faults: Sequence[Fault], evidence: Evidence
) -> Iterator[Row]:
    """Flags that are due with the scenario's own configuration and not with the one that was played: a role is missing.

    own, belongs : what is due with either, with the index of its fault
    """
    there = {_identity(i, duty) for i, one in belongs for duty in one.duties}
    for i, one in own:
        for duty in one.duties:
            row = _row(i, faults[i], one, duty)
            gone = _identity(i, duty) not in there
            if gone and _judged(row, duty, evidence).verdict not in (Verdict.NOT_FLOWN, Verdict.PORTS):
                yield replace(row, verdict=Verdict.NOT_CONFIGURED)


def _identity(fault: int, duty: Duty) -> tuple[int, str, tuple[str, ...]]:
    return fault, duty.place, duty.words


def _held_on(belongs: Sequence[tuple[int, Told]]) -> list[tuple[int, Told]]:
    """The same; a flag that another fault raises before it must have gone need not go until that one ends."""
    duties = sorted((duty for _, one in belongs for duty in one.duties), key=lambda duty: duty.from_s)
    return [
        (i, replace(one, duties=tuple(replace(duty, until_s=_until_s(duty, duties)) for duty in one.duties)))
        for i, one in belongs
    ]


def _until_s(duty: Duty, duties: Sequence[Duty]) -> float:
    """When nothing raises its flag any more [s].  duties : of all faults, in order of ``from_s``"""
    until_s = duty.until_s
    for other in duties:
        same = other.place == duty.place and not set(other.words).isdisjoint(duty.words)
        if same and duty.from_s <= other.from_s <= until_s + duty.clears_s:
            until_s = max(until_s, other.until_s)
    return until_s


def _fault_rows(index: int, fault: Fault, one: Told, evidence: Evidence, *, unknown: Verdict) -> Iterator[Row]:
    what = describe(fault)
    span = getattr(fault, "from_s", 0.0), getattr(fault, "to_s", evidence.end_s)
    if one.unknown:
        yield Row(index, what, one.subject, one.unknown, *span, unknown)
    elif not one.duties:
        yield Row(index, what, one.subject, "too short, too small, or of no role", *span, Verdict.NOT_DUE)
    for duty in one.duties:
        row = _row(index, fault, one, duty)
        judged = _judged(row, duty, evidence)
        yield replace(judged, verdict=_excuse(judged, duty, evidence))


def _row(index: int, fault: Fault, one: Told, duty: Duty) -> Row:
    flag = f"{duty.place} {' or '.join(duty.words) if duty.value is None else f'= {duty.value:g}'}"
    span = duty.from_s, duty.until_s
    return Row(index, describe(fault), one.subject, flag, *span, Verdict.FOUND, within_s=duty.within_s)


def _excuse(row: Row, duty: Duty, evidence: Evidence) -> Verdict:
    """The verdict, unless the unit was starting or the bench was late when the flag had to stand, or had to be gone.

    A late bench gives time for it: the window over which is judged, anew.  A flag that does not come then is missing.
    """
    if row.verdict not in FAILURES:
        return row.verdict
    stays = row.verdict is Verdict.STAYS
    cause_s, allowed_s = (row.until_s, row.clears_s) if stays else (row.from_s, row.within_s)
    if cause_s < evidence.start_s:
        return Verdict.START
    latest_s = evidence.latest_s(cause_s - BEFORE_S, cause_s + (allowed_s or 0.0))
    if latest_s is None:
        return row.verdict
    came_s = cause_s + row.after_s if row.verdict is Verdict.LATE and row.after_s is not None else duty.until_s
    in_time = stays or came_s <= latest_s + (allowed_s or 0.0) + BEFORE_S
    return Verdict.LATE_BENCH if in_time else row.verdict


def _judged(row: Row, duty: Duty, evidence: Evidence) -> Row:
    if duty.from_s + duty.within_s > evidence.end_s:
        return replace(row, verdict=Verdict.NOT_FLOWN)
    if duty.ports and not evidence.has_ports:
        return replace(row, verdict=Verdict.PORTS)
    if duty.clock and not evidence.said.knows_clock(duty.clock, duty.from_s):
        return replace(row, verdict=Verdict.NOT_DUE)
    said = evidence.said
    spans = said.at(duty.place, duty.words) if duty.value is None else said.near(duty.place, duty.value)
    standing = [span for span in spans if span.until_s > duty.from_s and span.from_s < duty.until_s]
    return _timed(row, duty, standing, evidence) if standing else replace(row, verdict=Verdict.MISSING)


def _timed(row: Row, duty: Duty, standing: Sequence[Span], evidence: Evidence) -> Row:
    """How long it took to stand, and to go; what is excused of either is allowed for."""
    after_s = max(standing[0].from_s - duty.from_s, 0.0)
    if duty.value is not None:
        within_s = duty.within_s + evidence.excused(duty.from_s, duty.from_s + after_s)
        return replace(row, verdict=Verdict.LATE if after_s > within_s else Verdict.FOUND, after_s=after_s)
    gone_s = max(max(span.until_s for span in standing) - duty.until_s, 0.0)
    within_s = duty.within_s + evidence.excused(duty.from_s, duty.from_s + after_s)
    clears_s = duty.clears_s + evidence.excused(duty.until_s, duty.until_s + gone_s)
    verdict = Verdict.FOUND
    if after_s > within_s:
        verdict = Verdict.LATE
    elif gone_s > clears_s and duty.until_s + clears_s <= evidence.end_s:
        verdict = Verdict.STAYS
    clear_s = gone_s if math.isfinite(gone_s) else None
    return replace(row, verdict=verdict, after_s=after_s, within_s=within_s, clear_s=clear_s, clears_s=clears_s)
