"""What the outputs of a flight are judged by: configuration, truth, and what the emulator sent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fti.config import Config
from fti.errors import RecordingError
from fti.hil.expected.affected import Interval
from fti.hil.expected.aircraft import Aircraft, Truth
from fti.hil.scenario import Scenario
from fti.hil.truth import RATES_ATTACHMENT
from fti.logger.reading.json_message import parse_table
from fti.nav.integrity.reference import Reference
from fti.post.reprocess import Setup
from fti.post.score.evidence import Evidence
from fti.post.score.flown import Flown
from fti.post.score.outputs.measured import Intended, read_intended
from fti.post.score.said import Said
from fti.post.score.truth_table import TruthTable
from fti.service.binding import parse_reference


@dataclass(frozen=True, slots=True)
class FlightEvidence:
    """What a flight is judged by.

    sent : rate [Hz] of each kind of measurement of each device; intended : what each device meant to state
    late : when the emulator was late [s of the flight]
    start_s : outputs are required from then on [s of the flight]; real_time : over ports, not accelerated
    """

    scenario: Scenario
    config: Config
    reference: Reference | None
    craft: Aircraft
    truth: Truth
    table: TruthTable
    sent: Mapping[str, Mapping[str, float]]
    intended: Mapping[str, Intended]
    late: Sequence[Interval]
    start_s: float
    real_time: bool


def flight_evidence(scenario: Scenario, setup: Setup, flown: Flown, said: Said) -> FlightEvidence:
    """Of one flight.  setup : the configuration that is promised.  Raises ConfigError, MissingError, RecordingError."""
    return FlightEvidence(
        scenario,
        setup.config,
        setup.reference or parse_reference(setup.config, setup.texts),
        Aircraft(setup.config, setup.devices, scenario),
        flown.truth,
        flown.table,
        _sent_rates(flown),
        read_intended(flown.file),
        [(pause.from_s, pause.until_s) for pause in flown.pauses],
        Evidence.of_flight(flown, said, scenario.limits).start_s,
        flown.real_time,
    )


def _sent_rates(flown: Flown) -> dict[str, dict[str, float]]:
    """Nothing in older truth files.  Raises RecordingError."""
    data = flown.attached.get(RATES_ATTACHMENT)
    if data is None:
        return {}
    try:
        return {
            device: {kind: float(rate_hz) for kind, rate_hz in kinds.items()}
            for device, kinds in parse_table(data).items()
        }
    except (ValueError, AttributeError, TypeError) as error:
        raise RecordingError(f"{flown.file}: {RATES_ATTACHMENT}: cannot be read: {error}") from None
