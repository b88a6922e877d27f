"""Topics that a configuration requires, their rates, and the devices on which each depends.

Rates of navigation: ``fti.nav.pipeline`` and ``fti.nav.fallbacks``.  Measurements have the rate at which the emulator
sends them (``fti.hil.sensors.sent_rates``); a recording may reduce it to ``MIN_RECORDED_HZ``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from fti.config import Config, Device, Nav, position_sources
from fti.hil.oracle.flag_definitions import GROUND_DRIFT, HEIGHT, INTEGRITY, SOLUTION
from fti.nav.integrity.reference import ApproachReference, fits

GLIDE, LOCATION = "/nav/glide_slope", "/nav/location"
VALIDITY = "/nav/source_validity"
HEIGHT_BELOW = "/nav/height_below_aircraft"
FILTER, VERTICAL, FIX = "/nav/filter_solution", "/nav/vertical_solution", "/nav/position_fix"
GROUND_FIX = "/nav/terrain_fix"
SOLUTION_HZ, FILTER_HZ, FIX_HZ = 25.0, 5.0, 2.0
#: Repetition rate of unchanged outputs; maximum update rates of the monitor and of the validity of a source [Hz].
REPEAT_HZ, MONITOR_HZ, VALIDITY_HZ = 2.0, 5.0, 10.0
#: Maximum gap of navigation outputs: the repetition, and two ticks [s].
NAV_GAP_S = 0.56
#: Maximum age of an output that is computed each tick: tick, and jitter of the emulator [s].
OUTPUT_AGE_S = 0.1
#: Minimum rate of a measurement in a recording [Hz].
MIN_RECORDED_HZ = 5.0
#: Maximum gap of measurements in a recording, in periods, plus a margin [s]: one may be left out and the next be late.
MAX_GAP_PERIODS, GAP_MARGIN_S = 3.0, 0.1
#: Relative tolerance of a rate.
TOLERANCE = 0.1
#: From the first input to the alignment of a filter, or to the first fix [s].
ALIGNMENT_S, FIRST_FIX_S = 20.0, 5.0
#: Duration of the effect of a wrong input: on a filter, on a fix, on an output per sample [s].
FILTER_MEMORY_S, FIX_MEMORY_S, SAMPLE_MEMORY_S = 30.0, 10.0, 3.0
#: Profiles until a fix is confirmed, with the alignment; and the largest age of one.
PROFILES = 4
#: Rate of the drift over the ground: the repetition, and after each pair of looks [Hz].
DRIFT_HZ = (0.9 * FIX_HZ, 7.5)
#: Time in which it agrees with satellites before it is valid; and the largest age of a valid one [s].
CALIBRATION_S = 60.0


@dataclass(frozen=True, slots=True)
class RequiredOutput:
    """A topic that the configuration requires.

    devices     : its inputs; a fault of one may lower its rate or make it invalid
    preferred   : lists of devices in order of preference: a wrong value of a later one has no effect while an earlier
                  one is available.  Devices that are only in ``devices`` are always used
    rate_hz     : minimum and maximum without faults
    gap_s       : maximum time without a message, without faults
    always_gap_s: the same with any faults; None: unlimited
    age_s       : maximum age of a valid message [s]
    lead_s      : time after the first input in which it may be invalid
    memory_s    : duration of the effect of a fault after its end
    """

    topic: str
    devices: tuple[str, ...]
    rate_hz: tuple[float, float]
    gap_s: float
    age_s: float
    preferred: tuple[tuple[str, ...], ...] = ()
    always_gap_s: float | None = None
    lead_s: float = 1.0
    memory_s: float = SAMPLE_MEMORY_S


def required_outputs(
    config: Config, reference: ApproachReference | None, sent: Mapping[str, Mapping[str, float]]
) -> list[RequiredOutput]:
    """All required outputs.

    sent : rate [Hz] of each kind of measurement of each device; empty: an older truth file without rates
    """
    return [
        *_navigation_outputs(config.nav),
        *_source_outputs(config, sent),
        *_height_outputs(config, sent),
        *_height_below_outputs(config, sent),
        *_approach_outputs(config, reference),
        *_measurement_outputs(config, sent),
    ]


def _tolerance_band(rate_hz: float) -> tuple[float, float]:
    return (1.0 - TOLERANCE) * rate_hz, (1.0 + TOLERANCE) * rate_hz


def _navigation_outputs(nav: Nav) -> Iterator[RequiredOutput]:
    roles = (nav.position, nav.attitude)
    sources = _devices(*roles)
    yield RequiredOutput(
        SOLUTION, sources, _tolerance_band(SOLUTION_HZ), 0.1, OUTPUT_AGE_S, roles, always_gap_s=NAV_GAP_S
    )
    if nav.position and nav.attitude:  # the position of P needs the attitude: the antenna is not at P
        yield RequiredOutput(LOCATION, sources, _tolerance_band(SOLUTION_HZ), 0.1, OUTPUT_AGE_S, roles)
    if nav.filter:
        inputs = _devices((nav.filter.imu,), nav.filter.gnss, nav.filter.altimeters, nav.filter.baro, *roles)
        for topic in (FILTER, VERTICAL):
            yield RequiredOutput(
                topic,
                inputs,
                _tolerance_band(FILTER_HZ),
                0.5,
                OUTPUT_AGE_S,
                always_gap_s=NAV_GAP_S,
                lead_s=ALIGNMENT_S,
                memory_s=FILTER_MEMORY_S,
            )
    if nav.filter and nav.terrain_position:
        inputs = _devices((nav.filter.imu, nav.terrain_position.altimeter), nav.filter.gnss, nav.filter.baro, *roles)
        lead_s = ALIGNMENT_S + PROFILES * nav.terrain_position.window_s
        yield RequiredOutput(
            GROUND_FIX, inputs, _tolerance_band(FIX_HZ), 1.1, lead_s, always_gap_s=1.1, lead_s=lead_s, memory_s=lead_s
        )
    if nav.filter and nav.scan_drift:
        inputs = _devices((nav.filter.imu, *nav.scan_drift.devices), nav.filter.gnss, nav.filter.baro, *roles)
        lead_s = ALIGNMENT_S + CALIBRATION_S
        yield RequiredOutput(
            GROUND_DRIFT, inputs, DRIFT_HZ, 1.1, lead_s, always_gap_s=1.1, lead_s=lead_s, memory_s=lead_s
        )
    if nav.radio:
        inputs = _devices((nav.radio.receiver, nav.radio.altimeter), *roles)
        yield RequiredOutput(
            FIX,
            inputs,
            _tolerance_band(FIX_HZ),
            1.1,
            OUTPUT_AGE_S,
            always_gap_s=1.1,
            lead_s=FIRST_FIX_S,
            memory_s=FIX_MEMORY_S,
        )


def _source_outputs(config: Config, sent: Mapping[str, Mapping[str, float]]) -> Iterator[RequiredOutput]:
    """Validity of each source of position or attitude: on change, and repeated."""
    rate_hz = ((1.0 - TOLERANCE) * REPEAT_HZ, (1.0 + TOLERANCE) * VALIDITY_HZ)
    for name in _devices(position_sources(config.nav), config.nav.attitude):
        if not {"position", "attitude"}.isdisjoint(sent.get(name, {})):
            age_s = _max_age_s(config, name) + OUTPUT_AGE_S
            yield RequiredOutput(f"{VALIDITY}/{name}", (name,), rate_hz, NAV_GAP_S, age_s, always_gap_s=NAV_GAP_S)


def _height_outputs(config: Config, sent: Mapping[str, Mapping[str, float]]) -> Iterator[RequiredOutput]:
    """One output per sample of each altimeter; stale ones are repeated in addition."""
    roles = (config.nav.position, config.nav.attitude)
    for name in config.nav.altimeters:
        kinds = sent.get(name, {})
        rate_hz = max(kinds.get("radio_height", 0.0), kinds.get("range", 0.0))
        min_hz, max_hz = _tolerance_band(rate_hz) if rate_hz else (0.0, math.inf)
        gap_s = max(3.0 / rate_hz, 0.1) if rate_hz else NAV_GAP_S
        yield RequiredOutput(
            f"{HEIGHT}/{name}",
            _devices((name,), *roles),
            (min_hz, max_hz + REPEAT_HZ),
            gap_s,
            _max_age_s(config, name) + OUTPUT_AGE_S,
            roles,
            always_gap_s=_max_age_s(config, name) + NAV_GAP_S,
        )


def _height_below_outputs(config: Config, sent: Mapping[str, Mapping[str, float]]) -> Iterator[RequiredOutput]:
    """One output per sample of the selected altimeter, which may change."""
    nav, heights = config.nav, list(_height_outputs(config, sent))
    if heights:
        yield RequiredOutput(
            HEIGHT_BELOW,
            _devices(nav.altimeters, nav.position, nav.attitude),
            (min(one.rate_hz[0] for one in heights), max(one.rate_hz[1] for one in heights)),
            max(one.gap_s for one in heights),
            max(one.age_s for one in heights),
            (nav.position, nav.attitude),
            always_gap_s=max(one.always_gap_s or NAV_GAP_S for one in heights),
        )


def _approach_outputs(config: Config, reference: ApproachReference | None) -> Iterator[RequiredOutput]:
    """The monitor publishes even without an approach."""
    altimeter = approach_altimeter(config, reference)
    roles = (config.nav.position, config.nav.attitude)
    devices = _devices((altimeter,), *roles)
    max_hz = (1.0 + TOLERANCE) * (MONITOR_HZ if altimeter else 0.0) + REPEAT_HZ
    rate_hz = ((1.0 - TOLERANCE) * REPEAT_HZ, max(max_hz, (1.0 + TOLERANCE) * REPEAT_HZ))
    age_s = NAV_GAP_S + (_max_age_s(config, altimeter) if altimeter else 0.0)
    for topic in (INTEGRITY, GLIDE):
        yield RequiredOutput(topic, devices, rate_hz, NAV_GAP_S, age_s, roles, always_gap_s=NAV_GAP_S)


def approach_altimeter(config: Config, reference: ApproachReference | None) -> str | None:
    """The altimeter that monitors the approach: the first one that fits the reference."""
    if reference is None:
        return None
    devices = (config.find_device(name) for name in config.nav.altimeters)
    return next((device.name for device in devices if device and fits(device, reference.header.sensor)), None)


def _measurement_outputs(config: Config, sent: Mapping[str, Mapping[str, float]]) -> Iterator[RequiredOutput]:
    for device, kinds in sent.items():
        for kind, rate_hz in kinds.items():
            recorded_hz = min(rate_hz, MIN_RECORDED_HZ)
            gap_s = MAX_GAP_PERIODS / recorded_hz + GAP_MARGIN_S
            age_s = _max_age_s(config, device) + OUTPUT_AGE_S
            yield RequiredOutput(
                f"/{device}/{kind}", (device,), ((1.0 - TOLERANCE) * recorded_hz, math.inf), gap_s, age_s
            )


def _devices(*names: tuple[str | None, ...]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for several in names for name in several if name is not None))


def _max_age_s(config: Config, name: str) -> float:
    device: Device | None = config.find_device(name)
    return device.max_age_ms / 1e3 if device else 0.0
