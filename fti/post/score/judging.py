"""The comparison: every fault with what it had to raise, what was raised and nobody expected, and ``[[expect]]``."""

from __future__ import annotations

from dataclasses import dataclass

from fti.hil.expected.aircraft import Aircraft
from fti.hil.expected.fallbacks import of_fallbacks
from fti.hil.expected.flags import told
from fti.hil.expected.of_flight import of_flight
from fti.hil.scenario import Scenario
from fti.post.reprocess import Setup
from fti.post.score.evidence import Evidence
from fti.post.score.expectations import meet_expectation
from fti.post.score.flag_rows import flag_rows
from fti.post.score.flown import Flown, Pause, merged
from fti.post.score.rows import FAILURES, Met, Row, Unexpected, Verdict
from fti.post.score.said import Said
from fti.post.score.unexpected_flags import allowed_flags, unexpected_flags

#: Navigation that is behind for a larger part of a flight is too slow; for less the machine had no time for it.
BEHIND_SHARE = 0.5
#: No machine is busy for so long that navigation says nothing: when a flight ends so, it is gone [s].
GONE_S = 15.0


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
    may = [*of_flight(craft, flown.truth), *allowed_flags([one for _, one in belongs], pauses)]
    evidence = Evidence(said, flown.truth.end_s, (*pauses, Pause(0.0, said.began_s)))
    return Score(
        scenario,
        flown,
        said,
        tuple(flag_rows(belongs, scenario.fault, evidence)),
        tuple(unexpected_flags(said, may, evidence.end_s)),
        tuple(meet_expectation(expectation, evidence) for expectation in scenario.expect),
        pauses,
    )
