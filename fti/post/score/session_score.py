"""The scores of a recorded session: one for each flight of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from fti.hil.scenario import Scenario
from fti.logger.reading.recording import Recording
from fti.post.reprocess import Setup
from fti.post.score.comparison import Score, score_flight
from fti.post.score.messages import read_observed_flags
from fti.post.score.outputs.check import check_outputs
from fti.post.score.outputs.flight_reference import flight_reference
from fti.post.score.outputs.recorded_links import recorded_links
from fti.post.score.reference_setup import compare_recorded, read_reference_setup, scenario_setup, user_setup_finding
from fti.post.score.truth_reader import read_flight_truth


def score_session(
    recording: Recording,
    scenario: Scenario,
    truths: Iterable[Path],
    setup: Setup | None = None,
    reading: Callable[[], AbstractContextManager[None]] = nullcontext,
) -> Iterator[Score]:
    """Score every flight.

    truths : its truth files; setup : configuration, instead of that of the emulator
    reading : context that is entered while the session is read
    """
    channels = [expectation.channel for expectation in scenario.expect]
    for flight_truth in [read_flight_truth(file, scenario) for file in truths]:
        reference_setup = setup or read_reference_setup(flight_truth, scenario)
        findings = user_setup_finding() if setup else compare_recorded(reference_setup, recording)
        with reading():
            observed_flags = read_observed_flags(recording, reference_setup.config, flight_truth, channels)
            outputs = [
                *check_outputs(recording, flight_reference(scenario, reference_setup, flight_truth, observed_flags)),
                *recorded_links(recording, flight_truth, reference_setup.config),
            ]
        yield score_flight(
            scenario,
            reference_setup,
            flight_truth,
            observed_flags,
            own=scenario_setup(scenario, reference_setup),
            configuration=findings,
            outputs=outputs,
        )
