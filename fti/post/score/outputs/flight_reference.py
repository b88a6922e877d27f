"""Reference for the outputs of a flight: configuration, truth, and the values that the emulator sent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fti.config import Config
from fti.devices import parse_reference
from fti.errors import RecordingError
from fti.hil.oracle.output_effects import Interval
from fti.hil.oracle.roles import AircraftRoles, TruthSeries
from fti.hil.scenario import Scenario
from fti.hil.truth_log import RATES_ATTACHMENT
from fti.logger.reading.json_message import parse_table
from fti.nav.integrity.reference import ApproachReference
from fti.post.reprocess import Setup
from fti.post.score.flight_observation import FlightObservation
from fti.post.score.observed_flags import ObservedFlags
from fti.post.score.outputs.value_check import IntendedValues, read_intended_values
from fti.post.score.truth_reader import FlightTruth
from fti.post.score.truth_table import TruthTable


@dataclass(frozen=True, slots=True)
class FlightReference:
    """Reference for the outputs of a flight.

    sent : rate [Hz] of each kind of measurement of each device; intended : values that each device sent
    late : intervals in which the emulator was late [s of the flight]
    start_s : outputs are required from this time on [s of the flight]; real_time : over ports, not accelerated
    """

    scenario: Scenario
    config: Config
    reference: ApproachReference | None
    craft: AircraftRoles
    truth: TruthSeries
    table: TruthTable
    sent: Mapping[str, Mapping[str, float]]
    intended: Mapping[str, IntendedValues]
    late: Sequence[Interval]
    start_s: float
    real_time: bool


def flight_reference(
    scenario: Scenario, setup: Setup, flight_truth: FlightTruth, observed_flags: ObservedFlags
) -> FlightReference:
    """The reference for one flight.  setup : configuration of the emulator.

    Raises ConfigError, MissingError, RecordingError.
    """
    return FlightReference(
        scenario,
        setup.config,
        setup.reference or parse_reference(setup.config, setup.texts),
        AircraftRoles(setup.config, setup.devices, scenario),
        flight_truth.truth,
        flight_truth.table,
        _sent_rates(flight_truth),
        read_intended_values(flight_truth.file),
        [(pause.from_s, pause.until_s) for pause in flight_truth.pauses],
        FlightObservation.of_flight(flight_truth, observed_flags, scenario.limits).start_s,
        flight_truth.real_time,
    )


def _sent_rates(flight_truth: FlightTruth) -> dict[str, dict[str, float]]:
    """Rates in the truth file; empty for older files.  Raises RecordingError."""
    data = flight_truth.attached.get(RATES_ATTACHMENT)
    if data is None:
        return {}
    try:
        return {
            device: {kind: float(rate_hz) for kind, rate_hz in kinds.items()}
            for device, kinds in parse_table(data).items()
        }
    except (ValueError, AttributeError, TypeError) as error:
        raise RecordingError(f"{flight_truth.file}: {RATES_ATTACHMENT}: cannot be read: {error}") from None
