"""Intervals in which faults allow an output to be missing, invalid or wrong.

Loss of a device allows a lower rate or invalid outputs, not wrong values that are declared valid.  Wrong measurements
of a device allow wrong values, too; the flags that they must raise are checked separately.

Faults of ``truth_checked_faults`` allow no wrong value of navigation.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from fti.hil.faults.applicability import applies_to
from fti.hil.oracle.fault_flags import flags_of_fault
from fti.hil.oracle.flag_definitions import (
    HEIGHT,
    HEIGHT_EXCLUSION_S,
    INTEGRITY,
    SOLUTION,
    SOURCE_REFUSAL_S,
    monitor_recovery_s,
)
from fti.hil.oracle.required_outputs import (
    FILTER,
    FIX,
    GLIDE,
    GROUND_FIX,
    HEIGHT_BELOW,
    LOCATION,
    VERTICAL,
    RequiredOutput,
)
from fti.hil.oracle.roles import AircraftRoles, TruthSeries
from fti.hil.oracle.truth_checked_faults import SourceFault, is_truth_checked
from fti.hil.tables.fault_base import DeviceFault, QuantityFault
from fti.hil.tables.fault_types import (
    Babbling,
    BitErrors,
    Burst,
    BusOff,
    ClockDrift,
    ClockJump,
    Fault,
    Fog,
    Freeze,
    GnssDegraded,
    GnssOffset,
    LostHeader,
    Mounting,
    Obstacle,
    OffTrack,
    Reordered,
    Stuck,
    TerrainShift,
    Truncated,
    WrongLabel,
)

Interval = tuple[float, float]
#: Outputs that are compared with known terrain, and those that it aids.
MONITORED_TOPICS, AIDED_TOPICS = (INTEGRITY, GLIDE), (FILTER, VERTICAL, FIX, GROUND_FIX)
#: A fault that causes no loss of a device.
HARMLESS_FAULTS = GnssDegraded
#: Faults with wrong values, wrong timestamps, or confused messages.
WRONG_VALUE_FAULTS = (
    Stuck | Freeze | QuantityFault | Fog | GnssOffset | ClockJump | ClockDrift | Burst | Reordered
    | BitErrors | LostHeader | Truncated | WrongLabel | Mounting | SourceFault
)  # fmt: skip
#: Time until a returning device has its fix, its clock and its rate again [s].
RECOVERY_S = 2.0
#: A device is replaced by the next one within this time after its age limit [s].
SWITCH_S = 1.0


class OutputEffects:
    """Effects of the faults of a scenario on the outputs of a configuration."""

    def __init__(self, faults: Sequence[Fault], craft: AircraftRoles, truth: TruthSeries) -> None:
        self._faults, self._craft, self._truth = faults, craft, truth
        self._bound = {bound.device.name: bound for bound in craft.devices}

    def loss_intervals(self, output: RequiredOutput) -> list[Interval]:
        """When the output may have a low rate, or be invalid [s of the flight]."""
        found = list[Interval]()
        for fault, name in self._faults_on(output.devices):
            if not isinstance(fault, HARMLESS_FAULTS) and self._is_relevant(name, fault, output):
                memory_s = max(self._memory_s(output), self._exclusion_s(fault, name, output))
                whole = (fault.from_s, self._recovery_s(fault, name) + self._refusal_s(fault, name, output) + memory_s)
                found += self._switches(fault, name) if self._is_replaced(name, fault, output) else [whole]
        found += [
            *self._obstacle_intervals(output),
            *self._off_track_intervals(output),
            *self._disagreement_intervals(output),
        ]
        found += self._gnss_loss_intervals(output)
        return found + list(self._terrain_shift_intervals(output))

    def error_intervals(self, output: RequiredOutput) -> list[Interval]:
        """When the output may be wrong and declared valid [s of the flight]."""
        of_navigation = output.topic.startswith("/nav/")
        found = [
            (fault.from_s, self._recovery_s(fault, name) + self._memory_s(output))
            for fault, name in self._faults_on(output.devices)
            if isinstance(fault, WRONG_VALUE_FAULTS)
            and self._is_relevant(name, fault, output)
            and not (of_navigation and self._is_truth_checked(fault, name))
        ]
        return found + list(self._obstacle_intervals(output))

    def truth_checked_intervals(self, output: RequiredOutput) -> list[Interval]:
        """When the output of navigation must be correct or invalid during a fault [s of the flight]."""
        if not output.topic.startswith("/nav/"):
            return []
        found = [
            (fault.from_s, self._recovery_s(fault, name) + self._memory_s(output))
            for fault, name in self._faults_on(output.devices)
            if isinstance(fault, WRONG_VALUE_FAULTS)
            and self._is_truth_checked(fault, name)
            and self._is_relevant(name, fault, output)
        ]
        return found + list(self._terrain_shift_intervals(output))

    def undetected_intervals(self) -> list[Interval]:
        """From the effect of a truth-checked fault until the deadline of its flag [s of the flight]."""
        return [
            (flag.from_s, flag.from_s + flag.within_s)
            for fault in self._faults
            if is_truth_checked(fault)
            for one in flags_of_fault(fault, self._craft, self._truth)
            for flag in one.expected_flags
            if flag.place == SOLUTION
        ]

    def onset_intervals(self, within_s: float) -> list[Interval]:
        """The first ``within_s`` of each truth-checked fault [s of the flight]."""
        begins = [fault.from_s for fault in self._faults if isinstance(fault, DeviceFault) and is_truth_checked(fault)]
        return [(from_s, from_s + within_s) for from_s in begins]

    def _is_truth_checked(self, fault: DeviceFault | BusOff | Babbling, name: str) -> bool:
        return is_truth_checked(fault, on_source=name in self._craft.sources or name in self._craft.filter_gnss)

    def _faults_on(self, names: Sequence[str]) -> Iterator[tuple[DeviceFault | BusOff | Babbling, str]]:
        for fault in self._faults:
            for name in names:
                bound = self._bound.get(name)
                if bound and isinstance(fault, DeviceFault | BusOff) and applies_to(fault, bound):
                    yield fault, name
                if bound and isinstance(fault, Babbling) and bound.device.link in (fault.links or (bound.device.link,)):
                    yield fault, name

    def _is_relevant(self, name: str, fault: DeviceFault | BusOff | Babbling, output: RequiredOutput) -> bool:
        """Is the device used during the fault?  Not while an earlier one of every list is available."""
        lists = [names for names in output.preferred if name in names]
        is_only_listed = lists and not output.topic.endswith(f"/{name}")
        return not is_only_listed or any(self._is_selected(name, names, fault) for names in lists)

    def _is_selected(self, name: str, names: Sequence[str], fault: DeviceFault | BusOff | Babbling) -> bool:
        before = names[: names.index(name)]
        unavailable = {
            other
            for loss, other in self._faults_on(before)
            if loss.from_s < fault.to_s + RECOVERY_S and self._recovery_s(loss, other) > fault.from_s
        }
        return unavailable.issuperset(before)

    def _is_replaced(self, name: str, fault: DeviceFault | BusOff | Babbling, output: RequiredOutput) -> bool:
        """Does another device of each list take over?  Not for the monitor, which then starts a new window."""
        lists = [names for names in output.preferred if name in names]
        if not lists or output.topic in (INTEGRITY, GLIDE) or output.topic.endswith(f"/{name}"):
            return False
        end_s = self._recovery_s(fault, name)
        faulty = {
            other for loss, other in self._faults_on(output.devices) if loss.from_s < end_s and loss.to_s > fault.from_s
        }
        return all(set(names) - faulty - {name} for names in lists)

    def _switches(self, fault: DeviceFault | BusOff | Babbling, name: str) -> list[Interval]:
        """The intervals of the switch to another device, and back [s of the flight]."""
        age_s = self._craft.max_age_s(name)
        return [(fault.from_s, fault.from_s + age_s + SWITCH_S), (fault.to_s, self._recovery_s(fault, name))]

    def _recovery_s(self, fault: DeviceFault | BusOff | Babbling, name: str) -> float:
        """When the device is available again [s of the flight]."""
        craft = self._craft
        return fault.to_s + craft.boot_s(name) + craft.max_age_s(name) + craft.FIX_S + RECOVERY_S

    def _refusal_s(self, fault: DeviceFault | BusOff | Babbling, name: str, output: RequiredOutput) -> float:
        """How long a source that failed its own tests may stay rejected, if the output depends on it [s]."""
        lists = [names for names in output.preferred if name in names]
        is_used = not lists or any(self._is_selected(name, names, fault) for names in lists)
        is_refused = isinstance(fault, WRONG_VALUE_FAULTS) and name in self._craft.sources and is_used
        return SOURCE_REFUSAL_S if is_refused else 0.0

    def _memory_s(self, output: RequiredOutput) -> float:
        """How long the effect of a fault lasts in the output [s]."""
        return monitor_recovery_s(self._craft) if output.topic in (INTEGRITY, GLIDE) else output.memory_s

    def _exclusion_s(self, fault: DeviceFault | BusOff | Babbling, name: str, output: RequiredOutput) -> float:
        """How long after a wrong value the filter may exclude the altimeter, which makes its height invalid [s]."""
        is_height = output.topic.startswith((HEIGHT, HEIGHT_BELOW))
        excludes = is_height and isinstance(fault, WRONG_VALUE_FAULTS) and name in self._craft.filter_altimeters
        return HEIGHT_EXCLUSION_S if excludes else 0.0

    def _obstacle_intervals(self, output: RequiredOutput) -> Iterator[Interval]:
        """Obstacles, for outputs that are compared with known terrain."""
        monitored, aided = output.topic in MONITORED_TOPICS, output.topic in AIDED_TOPICS
        if not _depends_on_terrain(output):
            return
        for fault in self._faults:
            if isinstance(fault, Obstacle):
                for allowance in (a for one in flags_of_fault(fault, self._craft, self._truth) for a in one.allowances):
                    if (allowance.place == INTEGRITY) is monitored:
                        yield allowance.from_s, allowance.until_s + (output.memory_s if aided else 0.0)

    def _terrain_shift_intervals(self, output: RequiredOutput) -> Iterator[Interval]:
        """The whole flight, if the output is compared with terrain or aided by it."""
        if any(isinstance(fault, TerrainShift) for fault in self._faults) and _depends_on_terrain(output):
            yield 0.0, self._truth.end_s

    def _disagreement_intervals(self, output: RequiredOutput) -> Iterator[Interval]:
        """A correct altimeter may be rejected together with a wrong one that contradicts it."""
        if not output.topic.startswith((HEIGHT, HEIGHT_BELOW)):
            return
        others = [name for name in self._craft.altimeters if not output.topic.endswith(f"/{name}")]
        for fault, name in self._faults_on(others):
            if isinstance(fault, WRONG_VALUE_FAULTS):
                yield fault.from_s, self._recovery_s(fault, name) + self._memory_s(output)

    def _gnss_loss_intervals(self, output: RequiredOutput) -> Iterator[Interval]:
        """Protection levels grow while a receiver of the filter is lost or rejected, with any source of position."""
        if output.topic not in (SOLUTION, LOCATION):
            return
        for fault, name in self._faults_on(self._craft.filter_gnss):
            if not isinstance(fault, HARMLESS_FAULTS):
                refusal_s = SOURCE_REFUSAL_S if isinstance(fault, WRONG_VALUE_FAULTS) else 0.0
                yield fault.from_s, self._recovery_s(fault, name) + refusal_s

    def _off_track_intervals(self, output: RequiredOutput) -> Iterator[Interval]:
        for fault in self._faults:
            if isinstance(fault, OffTrack) and output.topic in (INTEGRITY, GLIDE):
                yield fault.from_s, fault.to_s + fault.turn_s + monitor_recovery_s(self._craft)


def _depends_on_terrain(output: RequiredOutput) -> bool:
    return output.topic in (*MONITORED_TOPICS, *AIDED_TOPICS) or output.topic.startswith((HEIGHT, HEIGHT_BELOW))


def interval_mask(t: NDArray[np.float64], intervals: Sequence[Interval]) -> NDArray[np.bool_]:
    """Mask of the times within one of the intervals, ends included; shape as t."""
    mask = np.zeros(np.shape(t), dtype=bool)
    for from_s, until_s in intervals:
        mask |= (t >= from_s) & (t <= until_s)
    return mask
