"""The comparison: every fault with what it had to raise, what was raised and nobody expected, and ``[[expect]]``."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass

from fti.hil.expected.aircraft import Aircraft
from fti.hil.expected.alarm_flags import alarms_of_flags
from fti.hil.expected.flags import flags_of_faults
from fti.hil.expected.of_flight import of_flight
from fti.hil.scenario import Scenario
from fti.post.reprocess import Setup
from fti.post.score.evidence import Evidence, start_limit_s
from fti.post.score.expectations import meet_expectation
from fti.post.score.flag_rows import flag_rows, vanished_rows
from fti.post.score.flown import Flown
from fti.post.score.outcome import Excused, Outcome, bench_finding, decide, measure_excused, truth_finding
from fti.post.score.outputs.row import OutputRow
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
    outputs: tuple[OutputRow, ...] = ()

    @property
    def verdicts(self) -> list[Verdict]:
        """Of every row, of every row of ``[[expect]]``, of every finding, and of every output."""
        rows: list[Row | Met | Finding | OutputRow] = [*self.rows, *self.expected, *self.findings, *self.outputs]
        return [row.verdict for row in rows]

    @property
    def outcome(self) -> Outcome:
        """What the flight has shown."""
        return decide(self.verdicts, bool(self.unexpected), self.bench)

    @property
    def holds(self) -> bool:
        """Was everything raised in time, and nothing else, and the bench in time to see it?"""
        return self.outcome is Outcome.HOLDS


def judge(
    scenario: Scenario,
    setup: Setup,
    flown: Flown,
    said: Said,
    *,
    own: Setup | None = None,
    configuration: Sequence[Finding] = (),
    outputs: Sequence[OutputRow] = (),
) -> Score:
    """Compare.

    setup : the configuration by which flags are expected; own : the scenario's, where that is another one
    configuration : what there is to say of the recorded one; outputs : checks of what the configuration promises
    """
    craft = Aircraft(setup.config, setup.devices, scenario)
    belongs = flags_of_faults(scenario.fault, craft, flown.truth)
    evidence = Evidence.of_flight(flown, said, scenario.limits)
    may = [*of_flight(craft, flown.truth), *allowed_flags([one for _, one in belongs], flown.pauses)]
    due = sorted([*belongs, *alarms_of_flags(belongs, craft)], key=operator.itemgetter(0))
    rows = list(flag_rows(due, scenario.fault, craft.sources, evidence))
    if own:
        without = flags_of_faults(scenario.fault, Aircraft(own.config, own.devices, scenario), flown.truth)
        rows += vanished_rows(without, belongs, scenario.fault, evidence)
    expected = tuple(meet_expectation(expectation, evidence) for expectation in scenario.expect)
    flags: list[Row | Met] = [*rows, *expected]
    excused = measure_excused(evidence)
    return Score(
        scenario,
        flown,
        said,
        tuple(rows),
        tuple(unexpected_flags(evidence, may, craft)),
        expected,
        (*configuration, *unit_findings(evidence, start_limit_s(flown, scenario.limits))),
        truth_finding(flown.complete) or bench_finding(excused, [flag.verdict for flag in flags]),
        excused,
        tuple(outputs),
    )
