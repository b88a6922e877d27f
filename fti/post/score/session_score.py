"""The scores of a recorded session: one for each flight of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from fti.config import CanLink, Config
from fti.hil.scenario import Scenario
from fti.logger.reading.recording import Recording
from fti.messages.topics import RAW_PREFIX
from fti.post.reprocess import Setup
from fti.post.score.comparison import Score, score_flight
from fti.post.score.messages import read_observed_flags
from fti.post.score.outputs.check import check_outputs
from fti.post.score.outputs.flight_reference import flight_reference
from fti.post.score.outputs.row import OutputCheck, OutputRow, result_of
from fti.post.score.reference_setup import compare_recorded, read_reference_setup, scenario_setup, user_setup_finding
from fti.post.score.truth_reader import FlightTruth, read_flight_truth


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


#: A recorded CAN frame [bytes]: the kernel's ``can_frame`` and ``canfd_frame``.
CAN_BYTES, CAN_FD_BYTES = 16, 72
#: Minimum recorded share: an overloaded computer loses some data, an accelerated flight none.
MIN_SHARE, ACCELERATED_SHARE = 0.985, 0.999
#: Bytes of the flight may arrive up to this time after it [ns].
AFTER_NS = 3_000_000_000


def recorded_links(recording: Recording, flight_truth: FlightTruth, config: Config) -> Iterator[OutputRow]:
    """A row for each link; none where the truth does not state the sent bytes.  Raises RecordingError."""
    if not flight_truth.sent:
        return
    until_ns = flight_truth.begin_ns + round(flight_truth.truth.end_s * 1e9) + AFTER_NS
    recorded = Counter[str]()
    for topic, t_ns, _, _, data in recording.messages(RAW_PREFIX, kind="raw"):
        if flight_truth.begin_ns <= t_ns <= until_ns:
            recorded[topic.removeprefix(RAW_PREFIX)] += len(data)
    min_share = MIN_SHARE if flight_truth.real_time else ACCELERATED_SHARE
    for link in config.link:
        sent = flight_truth.sent.get(link.name)
        if sent is None:
            continue
        received, expected, unit = recorded[link.name], sent.bytes, "bytes"
        if isinstance(link, CanLink):  # frames, because an adapter sends their bytes in another form
            received, expected, unit = received // (CAN_FD_BYTES if link.fd else CAN_BYTES), sent.messages, "frames"
        result = result_of((received / expected if expected else 1.0) >= min_share)
        text, limit = f"{received} of {expected} sent {unit}", f">= {min_share:.1%}"
        yield OutputRow(f"{RAW_PREFIX}{link.name}", OutputCheck.RECORDED, "", result, text, limit)
