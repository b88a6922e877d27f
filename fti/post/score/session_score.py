"""The scores of a recorded session: one for each flight of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from fti.hil.scenario import Scenario
from fti.logger.reading.recording import Recording
from fti.post.reprocess import Setup
from fti.post.score.flown import read_flown
from fti.post.score.judging import Score, judge
from fti.post.score.messages import read_said
from fti.post.score.outputs.check import check_outputs
from fti.post.score.outputs.evidence import flight_evidence
from fti.post.score.outputs.recorded_links import recorded_links
from fti.post.score.promised import compare_recorded, given_by_user, own_setup, promised_setup


def judge_session(
    recording: Recording,
    scenario: Scenario,
    truths: Iterable[Path],
    given: Setup | None = None,
    reading: Callable[[], AbstractContextManager[None]] = nullcontext,
) -> Iterator[Score]:
    """Judge every flight.

    truths : its truth files; given : by this configuration, in place of the one that the emulator played
    reading : entered while the session is read
    """
    channels = [expectation.channel for expectation in scenario.expect]
    for flown in [read_flown(file, scenario) for file in truths]:
        promised = given or promised_setup(flown, scenario)
        compared = given_by_user() if given else compare_recorded(promised, recording)
        with reading():
            said = read_said(recording, promised.config, flown, channels)
            outputs = [
                *check_outputs(recording, flight_evidence(scenario, promised, flown, said)),
                *recorded_links(recording, flown, promised.config),
            ]
        yield judge(
            scenario,
            promised,
            flown,
            said,
            own=own_setup(scenario, promised),
            configuration=compared,
            outputs=outputs,
        )
