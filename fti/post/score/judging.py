"""The comparison: every fault with what it had to raise, what was raised and nobody expected, and ``[[expect]]``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from fti.hil.expected.aircraft import Aircraft
from fti.hil.expected.duties import Duty, May, Told
from fti.hil.expected.fallbacks import of_fallbacks
from fti.hil.expected.flags import told
from fti.hil.expected.of_flight import of_flight
from fti.hil.faults.words import describe
from fti.hil.scenario import Scenario
from fti.hil.tables.kinds import Fault
from fti.hil.tables.schema import Expectation
from fti.post.reprocess import Setup
from fti.post.score.flown import Flown, Pause, merged
from fti.post.score.said import Said, Span

#: After navigation's first word devices are judged over a window that is not full: its length, and a report [s].
WINDOW_S = 5.0
#: What a pause of the bench leaves behind: a window of the integrity monitor [s].
AFTER_PAUSE_S = 14.0
#: What is judged over a window may have a pause in it from so long before [s].
BEFORE_S = 5.0
#: Navigation that is behind for a larger part of a flight is too slow; for less the machine had no time for it.
BEHIND_SHARE = 0.5
#: No machine is busy for so long that navigation says nothing: when a flight ends so, it is gone [s].
GONE_S = 15.0
#: A word that stands for less beyond what is allowed is a matter of rounding [s].
MOMENT_S = 0.05


class Verdict(StrEnum):
    """What became of something that was expected."""

    FOUND = "found"
    LATE = "late"
    MISSING = "missing"
    STAYS = "does not clear"
    UNKNOWN = "not known yet"
    NOT_FLOWN = "not flown"
    PORTS = "needs real ports"
    NOT_DUE = "nothing is due"
    LATE_BENCH = "bench was late"


FAILURES = frozenset((Verdict.LATE, Verdict.MISSING, Verdict.STAYS))


@dataclass(frozen=True, slots=True)
class Row:
    """One flag of one fault.

    from_s, until_s : of its cause [s of the flight]; after_s : found so long after it, clear_s : gone so long after its
    end; within_s, clears_s : how long each may take
    """

    fault: int
    what: str
    subject: str
    flag: str
    from_s: float
    until_s: float
    verdict: Verdict
    after_s: float | None = None
    within_s: float | None = None
    clear_s: float | None = None
    clears_s: float | None = None


@dataclass(frozen=True, slots=True)
class Unexpected:
    """A word that stood where no fault explains it."""

    place: str
    word: str
    from_s: float
    until_s: float


@dataclass(frozen=True, slots=True)
class Met:
    """A row of ``[[expect]]``.  after_s : met so long after its time; value : the last that was said until then."""

    expectation: Expectation
    verdict: Verdict
    after_s: float | None
    value: object


@dataclass(frozen=True, slots=True)
class Score:
    """Everything about one flight."""

    scenario: Scenario
    flown: Flown
    said: Said
    rows: tuple[Row, ...]
    unexpected: tuple[Unexpected, ...]
    expected: tuple[Met, ...]
    pauses: tuple[Pause, ...]

    @property
    def verdicts(self) -> list[Verdict]:
        """Of every row, and of every row of ``[[expect]]``."""
        return [row.verdict for row in self.rows] + [met.verdict for met in self.expected]

    @property
    def told(self) -> bool:
        """Was the bench in time for most of it?  Else nothing has been shown."""
        return self.verdicts.count(Verdict.LATE_BENCH) <= self.verdicts.count(Verdict.FOUND)

    @property
    def behind(self) -> float:
        """The part of the flight for which navigation was behind, or had not begun."""
        times = merged((*self.said.behind, Pause(0.0, min(self.said.began_s, self.flown.truth.end_s))))
        return sum(p.until_s - max(p.from_s, 0.0) for p in times if p.until_s > 0.0) / self.flown.truth.end_s

    @property
    def silent_s(self) -> float:
        """How long navigation had said nothing when the flight ended [s]."""
        return max(self.flown.truth.end_s - self.said.spoke_s, 0.0)

    @property
    def keeps_up(self) -> bool:
        """Was navigation in time for most of it, and there until the end?"""
        return self.behind <= BEHIND_SHARE and self.silent_s <= GONE_S

    @property
    def holds(self) -> bool:
        """Was everything raised in time, and nothing else?"""
        return self.told and self.keeps_up and not self.unexpected and not FAILURES & set(self.verdicts)


def judge(scenario: Scenario, setup: Setup, flown: Flown, said: Said) -> Score:
    """Compare.  setup : the configuration that the session was recorded with."""
    craft = Aircraft(setup.config, setup.devices, scenario)
    belongs = [(i, one) for i, fault in enumerate(scenario.fault) for one in told(fault, craft, flown.truth)]
    belongs += of_fallbacks(scenario.fault, craft)
    pauses = tuple(merged((*flown.pauses, *said.pauses, *said.behind)))
    may = [*of_flight(craft, flown.truth), *_allowed([one for _, one in belongs], pauses)]
    evidence = _Evidence(said, flown.truth.end_s, (*pauses, Pause(0.0, said.began_s)))
    belongs = _held_on(belongs)
    return Score(
        scenario,
        flown,
        said,
        tuple(row for i, one in belongs for row in _rows(i, scenario.fault[i], one, evidence)),
        tuple(_unexpected(said, may, evidence.end_s)),
        tuple(_meet(expectation, evidence) for expectation in scenario.expect),
        pauses,
    )


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


def _allowed(belongs: Sequence[Told], pauses: Sequence[Pause]) -> Iterator[May]:
    """Everything that may be said: consequences, what must be said, and what a late bench leaves behind."""
    for one in belongs:
        yield from one.may
        yield from (May(duty.place, duty.from_s, duty.until_s + duty.clears_s) for duty in one.duties)
    yield from (May("", pause.from_s, pause.until_s + AFTER_PAUSE_S) for pause in pauses)


# ----------------------------------------------------------------------------------------------------- what is due


@dataclass(frozen=True, slots=True)
class _Evidence:
    """What was said until the end of the flight, and when the bench was late."""

    said: Said
    end_s: float
    pauses: Sequence[Pause]

    def paused(self, from_s: float, until_s: float) -> float:
        """So much of an interval was a pause [s]."""
        return sum(max(0.0, min(p.until_s, until_s) - max(p.from_s, from_s)) for p in self.pauses)


def _rows(index: int, fault: Fault, one: Told, evidence: _Evidence) -> Iterator[Row]:
    what = describe(fault)
    span = getattr(fault, "from_s", 0.0), getattr(fault, "to_s", evidence.end_s)
    if one.unknown:
        yield Row(index, what, one.subject, one.unknown, *span, Verdict.UNKNOWN)
    elif not one.duties:
        yield Row(index, what, one.subject, "too short, too small, or of no role", *span, Verdict.NOT_DUE)
    for duty in one.duties:
        flag = f"{duty.place} {' or '.join(duty.words) if duty.value is None else f'= {duty.value:g}'}"
        row = Row(index, what, one.subject, flag, duty.from_s, duty.until_s, Verdict.FOUND, within_s=duty.within_s)
        judged = _judged(row, duty, evidence)
        yield replace(judged, verdict=Verdict.LATE_BENCH) if _is_excused(judged, evidence) else judged


def _is_excused(row: Row, evidence: _Evidence) -> bool:
    """Had the bench no time until the flag had to stand, or, where it did not go, until it had to be gone?"""
    if row.verdict not in FAILURES:
        return False
    stays = row.verdict is Verdict.STAYS
    cause_s, allowed_s = (row.until_s, row.clears_s) if stays else (row.from_s, row.within_s)
    return evidence.paused(cause_s - BEFORE_S, cause_s + (allowed_s or 0.0)) > 0.0


def _judged(row: Row, duty: Duty, evidence: _Evidence) -> Row:
    if duty.from_s + duty.within_s > evidence.end_s:
        return replace(row, verdict=Verdict.NOT_FLOWN)
    if duty.ports and not evidence.said.ports:
        return replace(row, verdict=Verdict.PORTS)
    if duty.clock and not evidence.said.knows_clock(duty.clock, duty.from_s):
        return replace(row, verdict=Verdict.NOT_DUE)
    said = evidence.said
    spans = said.at(duty.place, duty.words) if duty.value is None else said.near(duty.place, duty.value)
    standing = [span for span in spans if span.until_s > duty.from_s and span.from_s < duty.until_s]
    return _timed(row, duty, standing, evidence) if standing else replace(row, verdict=Verdict.MISSING)


def _timed(row: Row, duty: Duty, standing: Sequence[Span], evidence: _Evidence) -> Row:
    """How long it took to stand, and to go; a pause of the bench in either is allowed for."""
    after_s = max(standing[0].from_s - duty.from_s, 0.0)
    if duty.value is not None:
        within_s = duty.within_s + evidence.paused(duty.from_s, duty.from_s + after_s)
        return replace(row, verdict=Verdict.LATE if after_s > within_s else Verdict.FOUND, after_s=after_s)
    gone_s = max(max(span.until_s for span in standing) - duty.until_s, 0.0)
    within_s = duty.within_s + evidence.paused(duty.from_s, duty.from_s + after_s)
    clears_s = duty.clears_s + evidence.paused(duty.until_s, duty.until_s + gone_s)
    verdict = Verdict.FOUND
    if after_s > within_s:
        verdict = Verdict.LATE
    elif gone_s > clears_s and duty.until_s + clears_s <= evidence.end_s:
        verdict = Verdict.STAYS
    clear_s = gone_s if math.isfinite(gone_s) else None
    return replace(row, verdict=verdict, after_s=after_s, within_s=within_s, clear_s=clear_s, clears_s=clears_s)


# -------------------------------------------------------------------------------------------------- what is not


def _unexpected(said: Said, may: Sequence[May], end_s: float) -> Iterator[Unexpected]:
    """What is left of every word when all that explains it is taken away.

    Before the flight nothing is sent: a daemon that waits for it may say so.
    """
    begin_s = max(said.began_s, 0.0) + WINDOW_S
    for (place, word), spans in sorted(said.spans.items()):
        allowed = sorted((m.from_s, m.until_s) for m in may if m.explains(place, word))
        for span in spans:
            for from_s, until_s in _without(span, [(-math.inf, begin_s), *allowed]):
                if from_s < end_s:
                    yield Unexpected(place, word, from_s, until_s)


def _without(span: Span, allowed: Sequence[tuple[float, float]]) -> Iterator[tuple[float, float]]:
    """The parts of a span that no interval covers; what is shorter than a moment is none, unless the whole span is."""
    least = min(MOMENT_S, span.until_s - span.from_s)
    at = span.from_s
    for from_s, until_s in allowed:
        if until_s >= at and from_s <= span.until_s:
            if from_s - at > least:
                yield at, from_s
            at = max(at, math.nextafter(until_s, math.inf))
    if at <= span.until_s and span.until_s - at >= least:
        yield at, span.until_s


# -------------------------------------------------------------------------------------------------- [[expect]]


def _meet(expectation: Expectation, evidence: _Evidence) -> Met:
    begin, end = expectation.at_s, expectation.at_s + expectation.within_s
    if end > evidence.end_s:
        return Met(expectation, Verdict.NOT_FLOWN, None, None)
    during = [(t, value) for t, value in evidence.said.values[expectation.channel] if begin <= t <= end]
    for t, value in during:
        if _is_met(expectation, value):
            return Met(expectation, Verdict.FOUND, t - begin, value)
    verdict = Verdict.LATE_BENCH if evidence.paused(begin - BEFORE_S, end) else Verdict.MISSING
    return Met(expectation, verdict, None, during[-1][1] if during else None)


def _is_met(expectation: Expectation, value: object) -> bool:
    wanted = expectation.value
    if isinstance(value, list):
        return wanted in value
    if isinstance(wanted, bool | str) or isinstance(value, bool) or not isinstance(value, int | float):
        return value == wanted
    return wanted - expectation.minus <= value <= wanted + expectation.plus
