"""The comparison: expected flags of every fault, unexpected flags, and ``[[expect]]``."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass

from fti.hil.oracle.alarm_flags import flags_of_alarms
from fti.hil.oracle.fault_flags import flags_of_scenario
from fti.hil.oracle.flight_flags import flight_allowances
from fti.hil.oracle.roles import AircraftRoles
from fti.hil.scenario import Scenario
from fti.hil.tables.schema import Expectation
from fti.post.reprocess import Setup
from fti.post.score.flag_rows import flag_rows, unconfigured_rows
from fti.post.score.flight_observation import BEFORE_S, FlightObservation, start_limit_s
from fti.post.score.observed_flags import ObservedFlags
from fti.post.score.outcome import BenchLateness, FlightOutcome, bench_finding, decide, measure_lateness, truth_finding
from fti.post.score.outputs.row import OutputRow
from fti.post.score.rows import ExpectationRow, FlagRow, FlightFinding, Result, UnexpectedFlag
from fti.post.score.truth_reader import FlightTruth, overlap_s
from fti.post.score.unexpected_flags import allowed_flags, unexpected_flags
from fti.post.score.unit_findings import unit_findings


@dataclass(frozen=True, slots=True)
class Score:
    """The score of one flight."""

    scenario: Scenario
    flight_truth: FlightTruth
    observed_flags: ObservedFlags
    rows: tuple[FlagRow, ...]
    unexpected: tuple[UnexpectedFlag, ...]
    expected: tuple[ExpectationRow, ...]
    findings: tuple[FlightFinding, ...]
    bench: FlightFinding
    lateness: BenchLateness
    outputs: tuple[OutputRow, ...] = ()

    @property
    def results(self) -> list[Result]:
        """The results of all flags, rows of ``[[expect]]``, findings and outputs."""
        rows: list[FlagRow | ExpectationRow | FlightFinding | OutputRow] = [
            *self.rows,
            *self.expected,
            *self.findings,
            *self.outputs,
        ]
        return [row.result for row in rows]

    @property
    def outcome(self) -> FlightOutcome:
        """The outcome of the flight."""
        return decide(self.results, bool(self.unexpected), self.bench)

    @property
    def holds(self) -> bool:
        """Were all expected flags raised in time, and no others, while the bench was in time?"""
        return self.outcome is FlightOutcome.HOLDS


def score_flight(
    scenario: Scenario,
    setup: Setup,
    flight_truth: FlightTruth,
    observed_flags: ObservedFlags,
    *,
    own: Setup | None = None,
    configuration: Sequence[FlightFinding] = (),
    outputs: Sequence[OutputRow] = (),
) -> Score:
    """Score a flight.

    setup : the configuration for the expected flags; own : the scenario's, where it is another one
    configuration : findings on the recorded configuration; outputs : checks of the required outputs
    """
    craft = AircraftRoles(setup.config, setup.devices, scenario)
    fault_flags = flags_of_scenario(scenario.fault, craft, flight_truth.truth)
    observation = FlightObservation.of_flight(flight_truth, observed_flags, scenario.limits)
    may = [
        *flight_allowances(craft, flight_truth.truth),
        *allowed_flags([one for _, one in fault_flags], flight_truth.pauses),
    ]
    due = sorted([*fault_flags, *flags_of_alarms(fault_flags, craft)], key=operator.itemgetter(0))
    rows = list(flag_rows(due, scenario.fault, craft.sources, observation))
    if own:
        own_flags = flags_of_scenario(
            scenario.fault, AircraftRoles(own.config, own.devices, scenario), flight_truth.truth
        )
        rows += unconfigured_rows(own_flags, fault_flags, scenario.fault, observation)
    expected = tuple(_meet_expectation(expectation, observation) for expectation in scenario.expect)
    flags: list[FlagRow | ExpectationRow] = [*rows, *expected]
    lateness = measure_lateness(observation)
    return Score(
        scenario,
        flight_truth,
        observed_flags,
        tuple(rows),
        tuple(unexpected_flags(observation, may, craft)),
        expected,
        (*configuration, *unit_findings(observation, start_limit_s(flight_truth, scenario.limits))),
        truth_finding(flight_truth.complete) or bench_finding(lateness, [flag.result for flag in flags]),
        lateness,
        tuple(outputs),
    )


def _meet_expectation(expectation: Expectation, observation: FlightObservation) -> ExpectationRow:
    """Score a row of ``[[expect]]``."""
    begin, end = expectation.at_s, expectation.at_s + expectation.within_s
    if end > observation.end_s:
        return ExpectationRow(expectation, Result.NOT_FLOWN, None, None)
    during = [(t, value) for t, value in observation.observed_flags.values[expectation.channel] if begin <= t <= end]
    for t, value in during:
        if _is_met(expectation, value):
            return ExpectationRow(expectation, Result.FOUND, t - begin, value)
    result = Result.MISSING
    if begin < observation.start_s:
        result = Result.START
    elif overlap_s(observation.pauses, begin - BEFORE_S, end):
        result = Result.LATE_BENCH
    return ExpectationRow(expectation, result, None, during[-1][1] if during else None)


def _is_met(expectation: Expectation, value: object) -> bool:
    expected = expectation.value
    if isinstance(value, list):
        return expected in value
    if isinstance(expected, bool | str) or isinstance(value, bool) or not isinstance(value, int | float):
        return value == expected
    return expected - expectation.minus <= value <= expected + expectation.plus
