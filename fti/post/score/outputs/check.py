"""All checks of all outputs that a configuration requires, for one flight."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from fti.arrays import Array, Mask
from fti.config import Vector
from fti.hil.faults.applicability import applies_to
from fti.hil.oracle.flag_definitions import GROUND_DRIFT, HEIGHT, INTEGRITY, SOLUTION, FlagAllowance
from fti.hil.oracle.flight_flags import flight_allowances
from fti.hil.oracle.output_effects import Interval, OutputEffects, interval_mask
from fti.hil.oracle.required_outputs import (
    GLIDE,
    GROUND_FIX,
    HEIGHT_BELOW,
    RequiredOutput,
    approach_altimeter,
    required_outputs,
)
from fti.hil.tables.fault_types import Duplicated
from fti.logger.reading.recording import Recording
from fti.messages.reasons import Reason
from fti.post.score.outputs.accuracy import accuracy, explained_error_row, fault_error_rows
from fti.post.score.outputs.availability import approach_due, availability
from fti.post.score.outputs.consistency import Consistency
from fti.post.score.outputs.errors import Comparison
from fti.post.score.outputs.flight_reference import FlightReference
from fti.post.score.outputs.pairs import PAIRS
from fti.post.score.outputs.presence import presence
from fti.post.score.outputs.protection import (
    ANGLES,
    ANGLES_COMPARED_S,
    height_error,
    navigated_error,
    protection,
    protection_row,
    stated_level,
)
from fti.post.score.outputs.row import OutputRow
from fti.post.score.outputs.value_check import unsent_intervals, value_rows
from fti.post.score.series import TopicSeries, read_series

#: Lateness of the emulator affects outputs for this time after it [s].
AFTER_LATE_S = 1.0
#: Maximum ratio of the error of a DME fix to that of its ranges (station geometry).
RANGES_OF_FIX = 3.0
#: Share of messages of a real line that may share one read: 0.7 % did on a busy computer.
SAME_READ_SHARE = 0.02


def check_outputs(recording: Recording, reference: FlightReference) -> list[OutputRow]:
    """Rows of every output that the configuration requires, topic by topic.  Raises RecordingError."""
    required = required_outputs(reference.config, reference.reference, reference.sent)
    series = read_series(recording, [output.topic for output in required])
    checks = _Checks(reference, series)
    return [row for output in required for row in checks.of(output)]


class _Checks:
    def __init__(self, reference: FlightReference, series: Mapping[str, TopicSeries]) -> None:
        self._reference, self._series = reference, series
        self._affected = OutputEffects(reference.scenario.fault, reference.craft, reference.truth)
        self._late = [(from_s, until_s + AFTER_LATE_S) for from_s, until_s in reference.late]
        self._allowances = flight_allowances(reference.craft, reference.truth)
        header = reference.reference.header if reference.reference else None
        self._stated = frozenset(
            sd
            for sd in ("horizontal_sd", "vertical_sd")
            if all(f"position.{sd}" in reference.intended.get(name, {}) for name in reference.config.nav.position)
        )
        radio = reference.config.nav.radio
        self._fix_m = RANGES_OF_FIX * radio.dme_sd_m if radio else 0.0
        self._glide = math.radians(header.airfield.glide_deg) if header else None

    def of(self, output: RequiredOutput) -> Iterator[OutputRow]:
        """Every check of one output."""
        reference, series = self._reference, self._series[output.topic]
        t = reference.table.seconds(series.log_ns)
        flight = (reference.start_s, reference.truth.end_s)
        lost = [*self._affected.loss_intervals(output), *self._late, *self._unsent_intervals(output)]
        yield from presence(output, series, t, flight, lost, copies=self._copies(output))
        if not len(series):
            return
        during = (t >= flight[0]) & (t <= flight[1])
        yield from availability(
            series,
            during & self._due(output, t) & ~interval_mask(t, lost),
            t,
            self._allowances_of(output),
            reference.scenario.limits,
        )
        yield from self._values(output, series, t, during, interval_mask(t, lost))

    def _unsent_intervals(self, output: RequiredOutput) -> Iterator[Interval]:
        """Intervals in which the device had no such value, as a DME below the horizon of its stations."""
        reference, (_, device, kind) = self._reference, output.topic.split("/")[:3]
        if device in reference.intended:
            yield from unsent_intervals(reference.intended[device], kind, reference.table.begin_ns)

    def _values(
        self, output: RequiredOutput, series: TopicSeries, t: Array, during: Mask, lost: Mask
    ) -> Iterator[OutputRow]:
        reference = self._reference
        valid = during & series.valid
        by_fault = valid & interval_mask(t, self._affected.truth_checked_intervals(output))
        free = valid & ~interval_mask(t, [*self._affected.error_intervals(output), *self._late])
        nominal, faulted = free & ~by_fault, free & by_fault
        limits, explained = reference.scenario.limits, valid & ~nominal & ~faulted
        # values without a protection level may be wrong until detection
        undetected = interval_mask(t, self._affected.undetected_intervals())
        begun = interval_mask(t, self._affected.onset_intervals(ANGLES_COMPARED_S))
        for quantity in Comparison(
            series, reference.table, limits, self._arm_b(output), stated=self._stated, fix_m=self._fix_m
        ).errors():
            yield from accuracy(output.topic, quantity, nominal, t, limits, lost=lost)
            level = stated_level(series, self._series, quantity.name)
            protected = ~begun if quantity.name in ANGLES else np.ones_like(begun)
            due = faulted & (np.isfinite(level) & protected | ~undetected)
            yield from fault_error_rows(output.topic, quantity, due, t, limits, level=level)
            yield from protection_row(output.topic, quantity, free & protected, t, level)
            yield from explained_error_row(output.topic, quantity, explained, t, limits)
        yield from self._value_rows(output, series)
        yield from Consistency(series, nominal, t, reference.config, self._glide).rows(reference.table)
        if pair := PAIRS.get(output.topic):
            other, check = pair
            yield check(series, self._series[other])
        if output.topic == INTEGRITY:
            error = navigated_error(series, self._series[SOLUTION], reference.table)
            height = height_error(series, error, limits.vertical_m)
            yield from accuracy(output.topic, height, nominal, t, limits, lost=lost)
            yield from protection(series, error, nominal | faulted, t)

    def _value_rows(self, output: RequiredOutput, series: TopicSeries) -> Iterator[OutputRow]:
        reference, device = self._reference, output.topic.split("/")[1]
        if device in reference.intended:
            exempt = [*self._affected.loss_intervals(output), *self._affected.error_intervals(output), *self._late]
            span = (reference.start_s, reference.truth.end_s)
            yield from value_rows(series, reference.intended[device], span, exempt, reference.table.begin_ns)

    def _arm_b(self, output: RequiredOutput) -> Vector:
        """Lever arm of the device of a measurement; outputs of navigation refer to P."""
        device = self._reference.config.find_device(output.topic.split("/")[1])
        return device.lever_arm_b if device else (0.0, 0.0, 0.0)

    def _copies(self, output: RequiredOutput) -> float:
        """The share of messages that may have content and time of the message before.

        A fault may send messages twice; late messages of one serial read have one time.
        """
        reference = self._reference
        owners = output.topic.split("/")  # a measurement of the device, or a height of the altimeter
        bound_devices = (bound for bound in reference.craft.devices if bound.device.name in owners)
        duplicating = [fault for fault in reference.scenario.fault if isinstance(fault, Duplicated)]
        if any(applies_to(fault, bound) for bound in bound_devices for fault in duplicating):
            return 1.0
        return SAME_READ_SHARE if reference.real_time else 0.0

    def _allowances_of(self, output: RequiredOutput) -> Sequence[FlagAllowance]:
        """The flags of an output that the flight allows; dependent outputs inherit those of monitor or altimeters."""
        if output.topic == HEIGHT_BELOW:
            of_heights = (one for one in self._allowances if one.place.startswith(HEIGHT))
            no_height = (Reason.NO_HEIGHT,)
            return [FlagAllowance(HEIGHT_BELOW, one.from_s, one.until_s, one.words and no_height) for one in of_heights]
        if output.topic != GLIDE:
            return self._allowances
        of_integrity = (one for one in self._allowances if one.place == INTEGRITY)
        return [FlagAllowance(GLIDE, one.from_s, one.until_s, one.words) for one in of_integrity]

    def _due(self, output: RequiredOutput, t: Array) -> Mask:
        """Messages that must be valid by the flight, without regard to faults."""
        reference = self._reference
        if output.topic in (INTEGRITY, GLIDE):
            altimeter = approach_altimeter(reference.config, reference.reference)
            if altimeter is None or reference.reference is None:
                return np.zeros(len(t), dtype=bool)
            due = approach_due(reference.table, reference.reference, reference.craft, altimeter, reference.start_s)
            return np.asarray(np.interp(t, reference.truth.t, due.astype(float)) >= 1.0)
        if output.topic in (GROUND_FIX, GROUND_DRIFT):  # whether it is valid is a property of the ground
            return np.zeros(len(t), dtype=bool)
        nav = reference.config.nav
        of_navigation = output.topic.startswith("/nav/")
        if of_navigation and not (nav.attitude and (nav.position or output.topic.startswith(HEIGHT))):
            return np.zeros(len(t), dtype=bool)
        after = t >= reference.start_s + output.lead_s
        blind = [
            (one.from_s, one.until_s)
            for one in self._allowances_of(output)
            if not one.words and one.explains(output.topic, "")
        ]
        return np.asarray(after & ~interval_mask(t, blind))
