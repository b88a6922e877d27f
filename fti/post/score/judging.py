"""The comparison: every fault with what it had to raise, what was raised and nobody expected, and ``[[expect]]``."""

from __future__ import annotations

from dataclasses import dataclass

from fti.hil.expected.aircraft import Aircraft
from fti.hil.expected.fallbacks import of_fallbacks
from fti.hil.expected.flags import told
from fti.hil.expected.of_flight import of_flight
from fti.hil.scenario import Scenario
from fti.post.reprocess import Setup
from fti.post.score.evidence import Evidence, start_limit_s
from fti.post.score.expectations import meet_expectation
from fti.post.score.flag_rows import flag_rows
from fti.post.score.flown import Flown
from fti.post.score.outcome import Excused, Outcome, bench_finding, decide, measure_excused
from fti.post.score.rows import Finding, Met, Row, Unexpected, Verdict
from fti.post.score.said import Said
from fti.post.score.unexpected_flags import allowed_flags, unexpected_flags
from fti.post.score.unit_findings import unit_findings


@dataclass(frozen=True, slots=True)
class Score:
    """Everything about one flight."""

    scenario: Scenario
    flown: Flown
    said: Said
    rows: tuple[Row, ...]
    unexpected: tuple[Unexpected, ...]
    expected: tuple[Met, ...]
    findings: tuple[Finding, ...]
    bench: Finding
    excused: Excused

    @property
    def verdicts(self) -> list[Verdict]:
        """Of every row, of every row of ``[[expect]]``, and of every finding."""
        rows: list[Row | Met | Finding] = [*self.rows, *self.expected, *self.findings]
        return [row.verdict for row in rows]

    @property
    def outcome(self) -> Outcome:
        """What the flight has shown."""
        return decide(self.verdicts, bool(self.unexpected), self.bench)

    @property
    def holds(self) -> bool:
        """Was everything raised in time, and nothing else, and the bench in time to see it?"""
        return self.outcome is Outcome.HOLDS


def judge(scenario: Scenario, setup: Setup, flown: Flown, said: Said) -> Score:
    """Compare.  setup : the configuration by which flags are expected."""
    craft = Aircraft(setup.config, setup.devices, scenario)
    belongs = [(i, one) for i, fault in enumerate(scenario.fault) for one in told(fault, craft, flown.truth)]
    belongs += of_fallbacks(scenario.fault, craft)
    evidence = Evidence.of_flight(flown, said)
    may = [*of_flight(craft, flown.truth), *allowed_flags([one for _, one in belongs], flown.pauses)]
    rows = tuple(flag_rows(belongs, scenario.fault, evidence))
    expected = tuple(meet_expectation(expectation, evidence) for expectation in scenario.expect)
    flags: list[Row | Met] = [*rows, *expected]
    excused = measure_excused(evidence)
    return Score(
        scenario,
        flown,
        said,
        rows,
        tuple(unexpected_flags(evidence, may)),
        expected,
        tuple(unit_findings(evidence, start_limit_s(flown))),
        bench_finding(excused, [flag.verdict for flag in flags]),
        excused,
    )
