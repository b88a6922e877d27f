"""Fault detection and exclusion between the sources that aid the filter.

Each class of sources (``source_class``) is compared with copies of the filter that run without it.  A faulty class
(``monitor``) is excluded, and the filter continues from the oldest copy without it; of several receivers only the
contradicting ones are excluded.  ``readmission`` ends the exclusion.  If heights separate while the filter refuses none
of them, the contradiction is unresolved: satellites or barometer may be wrong.

Without satellites, airspeed and magnetic heading separate the filter from its copies, which does not show a fault of
the satellites: separations are tested only while positions are accepted.  If the filter refuses satellites that return,
and the copy from before agrees with them, airspeed and heading are excluded.  Positions from the ground and drifts
between looks are compared with the satellites (``ground_watch``, ``drift_watch``).
Source: the specification in docs/fault-detection.md.  Checked against: tests/nav/test_fault_detection.py.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence

import numpy as np

from fti.config import Filter
from fti.constants import SECOND_NS
from fti.messages.outputs import Event
from fti.messages.reasons import Reason
from fti.messages.refusals import CarriedRefusal, RefusedPart
from fti.nav.confirmation import Confirmation, Size
from fti.nav.filter.aiding import Aiding
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.innovation_gate import LIMITS, GateDecision
from fti.nav.filter.look_mark import SCAN_DRIFT
from fti.nav.filter.measurement_update import compute_nis
from fti.nav.filter.navigator import InertialNavigator
from fti.nav.filter.position_mark import MARK
from fti.nav.filter.segment import FilterSegment, Moment, cut
from fti.nav.plausibility.source import UnconfirmedSource
from fti.nav.separation.copies import Separation, separate
from fti.nav.separation.drift_watch import DriftWatch
from fti.nav.separation.exclusions import (
    ExcludedReceiver,
    describe_exclusion,
    describe_misled,
    describe_readmission,
    describe_return,
    describe_unconfirmed,
    describe_wrong_drift,
    size_of,
)
from fti.nav.separation.ground_watch import GroundWatch
from fti.nav.separation.monitor import HALF_K_FA, QUANTITY_AXES, REFUSED_NS, UNRESOLVED_END_NS, SourceFault
from fti.nav.separation.protection import ProtectionLevels, filter_levels, provisional_levels
from fti.nav.separation.provisional import ProvisionalFilters, ProvisionalResult
from fti.nav.separation.readmission import Contradiction, ReadmissionCheck
from fti.nav.separation.source_class import (
    BOUNDED_NS,
    HEIGHT,
    HEIGHTS,
    QUANTITIES,
    SATELLITES,
    SourceClass,
    long_absence_ns,
    make_classes,
    names_of,
    receiver_names,
)

#: Ratio of the separation without a wrong receiver to that without any other one.
SINGLE_FAULT_RATIO = 1.5
COMMANDED_TEXT = "the operator commands it"


class FaultDetection:
    """Fault detection of one filter.  settings : its aiding sources"""

    def __init__(self, navigator: InertialNavigator, settings: Filter) -> None:
        self._navigator = navigator
        self._classes = make_classes(settings, has_looks=bool(navigator.model.looks)) if settings.gnss else []
        self._ground = GroundWatch(settings) if settings.gnss and MARK[0] in navigator.model.columns else None
        self._drifts = DriftWatch(settings) if settings.gnss and navigator.model.looks else None
        self._refused: dict[str, ExcludedReceiver] = {}  # by label
        self._events: list[Event] = []
        self._end_ns: int | None = None
        self._tolerance = 0.0
        self._unresolved_ns: int | None = None
        self._several = settings.gnss if len(settings.gnss) > 1 else ()
        self._is_restarted = False
        self._long_absence_ns = long_absence_ns(settings.unit)
        self._provisional = ProvisionalFilters()
        self._excluded_aids = frozenset[str]()

    # ---------------------------------------------------------------------------------------------------------- outputs

    @property
    def refused(self) -> dict[str, int]:
        """Start of the contradiction of receivers that are excluded as a whole, by device."""
        return {r.device: r.onset_ns for r in self._refused.values() if r.label == r.device}

    @property
    def refused_heights(self) -> frozenset[str]:
        """Receivers whose heights do not aid, with or without their positions."""
        return frozenset(r.device for r in self._refused.values() if f"{r.device}.height" in r.names)

    @property
    def is_unresolved(self) -> bool:
        """Whether sources contradict each other and it is unknown which is wrong."""
        return self._unresolved_ns is not None

    @property
    def is_reacquired(self) -> bool:
        """Whether the copies are younger than the configured ages."""
        rings = (group for group in self._classes if group.label not in self._several and self._aiding_devices(group))
        return any(not w.monitor.copy_ring.is_full or w.absence.is_on_trial for w in rings)

    @property
    def refusals(self) -> list[CarriedRefusal]:
        """Refusals in force."""
        return [
            CarriedRefusal(
                receiver.device,
                RefusedPart.AIDING if receiver.label == receiver.device else RefusedPart.AIDING_HEIGHT,
                Reason.EXCLUDED,
                receiver.onset_ns,
                is_standing=True,
            )
            for receiver in self._refused.values()
        ]

    def restore(self, refusals: Iterable[CarriedRefusal], t_ns: int) -> None:
        """Start with refusals from before this process: the filter does not start with these receivers."""
        parts = {RefusedPart.AIDING: ("{}", QUANTITIES), RefusedPart.AIDING_HEIGHT: ("{} height", HEIGHT)}
        known = frozenset[str]().union(*(group.devices for group in self._classes))
        for refusal in refusals:
            if refusal.part not in parts or refusal.source not in known:
                continue
            name, quantities = parts[refusal.part]
            check = ReadmissionCheck({f"{refusal.source}.{q}": Contradiction(QUANTITY_AXES[q]) for q in quantities})
            check.reset()
            label = name.format(refusal.source)
            self._refused[label] = ExcludedReceiver(refusal.source, label, refusal.onset_ns, check)
            text = f"{label}: still refused after navigation was started again"
            text += f"; it aids again after {describe_readmission(self._refused[label])}"
            self._add_event(t_ns, "warning", text)

    def levels(self, t_ns: int) -> ProtectionLevels | None:
        """Protection levels of the filter at a time; None without an estimate."""
        estimate = self._navigator.at(t_ns)
        if estimate is None:
            return None
        levels = [filter_levels(estimate), *self._levels_of_copies(t_ns)]
        return ProtectionLevels(
            max(each.horizontal for each in levels) + self._tolerance,
            max(each.vertical for each in levels) + self._tolerance,
        )

    @property
    def _watches(self) -> tuple[GroundWatch | DriftWatch, ...]:
        """Comparisons of satellites with the ground, and with drifts over it."""
        return tuple(watch for watch in (self._ground, self._drifts) if watch is not None)

    def _lag_s(self, t_ns: int) -> float:
        """Age of the copies at a time."""
        return 0.0 if self._end_ns is None else max(0.0, (t_ns - self._end_ns) / SECOND_NS)

    def _levels_of_copies(self, t_ns: int) -> list[ProtectionLevels]:
        lag_s = self._lag_s(t_ns)
        levels = [group.levels(lag_s) for group in self._classes]
        if self._ground:
            levels.append(self._ground.levels(lag_s))
        if self._drifts:
            absence = self._classes[0].absence
            is_away = absence.is_on_trial or absence.is_absent(t_ns)
            if is_away and self._drifts.is_complete:
                levels[0] = levels[0]._replace(horizontal=0.0)
            if is_away or self.is_unresolved or not self._drifts.has_satellites:
                levels.append(self._drifts.levels(lag_s))
        return levels

    def provisional(self, t_ns: int) -> list[ProvisionalResult]:
        """Provisional filters of unconfirmed receivers at a time; empty without an estimate."""
        final = self._navigator.find_last_final()
        estimate = self._navigator.at(t_ns) if self._provisional.is_any else None
        if final is None or estimate is None:
            return []
        copies, tolerance = self._levels_of_copies(t_ns), self._tolerance
        results = []
        for device, offset in self._provisional.find_offsets(final, self._lag_s(t_ns)):
            horizontal, vertical = provisional_levels(offset.offset_n, estimate, copies)
            levels = ProtectionLevels(horizontal + tolerance, vertical + tolerance)
            results.append(ProvisionalResult(device, offset, levels, self._readmission(device)))
        return results

    def _readmission(self, device: str) -> str:
        """The ways to readmit a receiver that the filter excludes, its own tests refuse, or both."""
        texts = [describe_readmission(r) for r in self._refused.values() if r.device == device]
        return "; ".join(filter(None, (*texts, self._provisional.own_readmission(device))))

    @property
    def separations(self) -> dict[str, list[Separation]]:
        """Separations of the filter from the copies of each class, the oldest copy first."""
        return {group.label: group.monitor.separations for group in self._classes}

    def drain_events(self) -> list[Event]:
        """Events since the last call."""
        events, self._events = self._events, []
        return events

    # ----------------------------------------------------------------------------------------------------------- update

    def set_suspects(self, devices: frozenset[str]) -> None:
        """Set the receivers that tests of one source suspect."""
        for group in self._classes:
            group.is_suspect = group.label != HEIGHTS and not devices.isdisjoint(group.devices)

    def feed_unconfirmed(self, device: str, unconfirmed: UnconfirmedSource, t_ns: int, parts: Iterable[Aiding]) -> None:
        """Take a measurement of an unconfirmed receiver that its own tests refuse."""
        if self._navigator.is_aligned:
            self._provisional.feed_aiding(
                device, receiver_names(device, unconfirmed.quantities), unconfirmed.readmission, t_ns, parts
            )

    def update(self, t_ns: int) -> None:
        """Follow the filter to its last segment; exclude sources that contradict, readmit those that agree."""
        segments = self._navigator.drain_segments()
        for segment in segments:
            self._follow(segment)
        if self._excluded_aids:
            self._report_readmitted_aids(t_ns)
        if segments and self._navigator.is_aligned:  # the filter can only be changed at the end of the last one
            if self._is_restarted:
                self._exclude_again(t_ns)
                return
            for receiver in list(self._refused.values()):
                self._try_readmission(receiver, segments[-1].end.estimate, t_ns)
            self._check_classes(segments[-1], t_ns)

    def _follow(self, segment: FilterSegment) -> None:
        if segment.begin_ns != self._end_ns:
            self._reset()
        self._end_ns = segment.end.estimate.t_ns
        if not self._navigator.is_aligned:
            return
        self._compare_refused(segment)
        pieces = cut(segment)
        self._provisional.follow(segment, pieces, self._unconfirmed)
        for group in self._classes:
            if self._is_bounded(group, segment) or (self.is_unresolved and group.label in self._several):
                group.follow(segment, pieces)
            else:
                group.clear()
        for watch in self._watches:
            watch.follow(segment, pieces)
        if not self.is_reacquired:
            self._tolerance = 0.0
        self._report_returns(segment)

    @property
    def _unconfirmed(self) -> dict[str, frozenset[str]]:
        """Names of excluded receivers whose own tests have passed for long enough, by device."""
        names = dict[str, frozenset[str]]()
        for receiver in self._refused.values():
            if receiver.readmission_check.has_passed:
                names[receiver.device] = names.get(receiver.device, frozenset()) | receiver.names
        return names

    def _report_returns(self, segment: FilterSegment) -> None:
        for group in self._classes:
            if group.has_returned and group.label == SATELLITES:
                self._add_event(segment.end.estimate.t_ns, "info", describe_return(group))

    def _is_bounded(self, group: SourceClass, segment: FilterSegment) -> bool:
        """Whether the copies of a class are usable: it aids, and and another of several receivers aids."""
        if not self._aiding_devices(group):
            return False
        if group.label not in self._several:
            return True
        if self._is_silent(group.label, segment.end):
            return False
        others = (segment.end.gate_states.get(f"{name}.position") for name in self._several if name != group.label)
        accepted = [other.accepted_ns for other in others if other is not None and other.accepted_ns is not None]
        return any(segment.end.estimate.t_ns - accepted_ns <= BOUNDED_NS for accepted_ns in accepted)

    def _is_silent(self, device: str, moment: Moment) -> bool:
        """Whether the filter has accepted no position of a receiver for the maximum age of the oldest copy.

        A copy without it then differs from the filter by rounding only, and must not contradict it.
        """
        state = moment.gate_states.get(f"{device}.position")
        if state is None or state.accepted_ns is None:
            return True
        return moment.estimate.t_ns - state.accepted_ns > self._long_absence_ns

    def _reset(self) -> None:
        """The filter has restarted: its copies are not valid any more; exclusions remain."""
        self._forget_copies()
        self._provisional.clear()
        self._unresolved_ns, self._tolerance, self._is_restarted = None, 0.0, True
        for receiver in self._refused.values():
            receiver.readmission_check.reset()

    def _exclude_again(self, t_ns: int) -> None:
        """Repeat the exclusions in a filter that has restarted."""
        self._is_restarted = False
        for receiver in self._refused.values():
            self._navigator.exclude(receiver.names, receiver.onset_ns, None)
            text = f"{receiver.label}: still refused after a restart of the filter"
            text += f"; it aids again after {describe_readmission(receiver)}"
            self._add_event(t_ns, "warning", text)

    # -------------------------------------------------------------------------------------------- tests between classes

    def _check_classes(self, segment: FilterSegment, t_ns: int) -> None:
        """Exclude at most one class at a time: its exclusion changes what the others are compared with."""
        if self._drifts and (wrong_drift := self._drifts.find_wrong_drift(segment)):
            text = describe_wrong_drift(wrong_drift, t_ns)
            self._exclude_aids(frozenset({SCAN_DRIFT}), wrong_drift, text, t_ns)
            return
        faulty = {group.label: (group, finding) for group in self._classes if (finding := group.find(segment))}
        if SATELLITES in faulty:
            group, finding = faulty[SATELLITES]
            if group.was_misled(finding, segment.end.estimate.t_ns) and (names := self._aids_of(group)):
                self._exclude_aids(names, finding, describe_misled(group, names, finding, t_ns), t_ns)
            else:
                self._attribute(group, finding, segment, t_ns)
            return
        if HEIGHTS in faulty:
            group, finding = faulty[HEIGHTS]
            if finding.refused:
                self._attribute(group, finding, segment, t_ns)
            else:
                self._report_unresolved(finding, t_ns)
            return
        wrong = [each for each in faulty.values() if self._is_single_fault(*each)]
        if len(wrong) == 1:
            group, finding = wrong[0]
            self._exclude(group.devices, group.quantities, finding, segment, t_ns)
        elif faulty:
            self._report_unresolved(next(iter(faulty.values()))[1], t_ns)
        elif contradiction := next(filter(None, (watch.find(segment) for watch in self._watches)), None):
            self._report_unresolved(contradiction, t_ns)
        elif self._unresolved_ns is not None:
            self._end_unresolved(t_ns)

    def _is_single_fault(self, group: SourceClass, finding: SourceFault) -> bool:
        """Whether exactly this one of several receivers is wrong.

        If two receivers contradict each other, the separations without either are alike.  Of three, the one without
        the wrong receiver is twice as large as the others.  While unresolved, the filter may follow either of them.
        """
        if finding.refused or self.is_unresolved:
            return not self.is_unresolved
        others = (w.monitor.ratio for w in self._classes if w.label in self._several and w is not group)
        return group.monitor.ratio > SINGLE_FAULT_RATIO * max(others, default=0.0)

    def _aiding_devices(self, group: SourceClass) -> tuple[str, ...]:
        """Devices of a class that are not excluded."""
        if not self._refused:
            return group.devices
        excluded = frozenset[str]().union(*(r.names for r in self._refused.values()))
        return tuple(d for d in group.devices if not receiver_names(d, group.quantities) <= excluded)

    def _attribute(self, group: SourceClass, finding: SourceFault, segment: FilterSegment, t_ns: int) -> None:
        """Exclude the one of several receivers whose removal ends the contradiction; none if it is unknown."""
        aiding = self._aiding_devices(group)
        devices = tuple(d for d in aiding if _is_accepted_since(d, group, finding, segment.end)) or aiding
        if len(devices) > 1 and group.label == SATELLITES and (self.is_unresolved or not finding.refused):
            devices = self._find_faulty(devices, group)
        elif len(devices) > 1:
            wrong = tuple(d for d in devices if _contradicts(d, group, finding, segment))
            devices = tuple(d for d in devices if d in wrong or _is_alike(d, wrong, group, finding, segment))
        if devices:
            self._exclude(devices, group.quantities, finding, segment, t_ns)
        else:
            self._report_unresolved(finding, t_ns)

    def _find_faulty(self, devices: tuple[str, ...], group: SourceClass) -> tuple[str, ...]:
        """The one receiver without which the filter agrees with the oldest copy; all if they have a common fault.

        With a common fault they agree with each other, and the filter without any one of them contradicts a copy.  A
        young copy shows a velocity change best, but may contain the fault: it cannot identify a single receiver.
        Empty if it is not clear, or without a copy.
        """
        if not group.monitor.copy_ring.copies:
            return ()
        ratios, k_fa = ({device: self._ratios_without(device, group) for device in devices}, group.monitor.k_fa)
        if self._receivers_agree(devices) and all(max(of_copies) >= k_fa for of_copies in ratios.values()):
            return devices
        still = tuple(device for device in devices if ratios[device][0] >= k_fa)
        ending = tuple(device for device in devices if ratios[device][0] < HALF_K_FA)
        if len(still) == len(devices):
            return devices
        return ending if len(ending) == 1 and len(still) == len(devices) - 1 else ()

    def _receivers_agree(self, devices: tuple[str, ...]) -> bool:
        """Whether receivers are compared with each other, and no one contradicts."""
        monitors = [group.monitor for group in self._classes if group.label in devices]
        return all(monitor.separations and monitor.ratio < monitor.k_fa for monitor in monitors)

    def _ratios_without(self, device: str, group: SourceClass) -> list[float]:
        """|d| over sigma of the copy without one receiver from copies without any; infinite without such a copy."""
        mine = next(each.monitor.copy_ring.oldest for each in self._classes if each.label == device)
        if mine is None:
            return [np.inf]
        separations = [separate(mine.estimate, copy.estimate) for copy in group.monitor.copy_ring.copies]
        return [max(separation.level_ratios) for separation in separations]

    def _exclude(
        self,
        devices: Sequence[str],
        quantities: tuple[str, ...],
        finding: SourceFault,
        segment: FilterSegment,
        t_ns: int,
    ) -> None:
        for device in devices:
            label = device if quantities == QUANTITIES else f"{device} height"
            check = ReadmissionCheck({f"{device}.{q}": _contradiction(device, q, finding, segment) for q in quantities})
            self._refused[label] = ExcludedReceiver(device, label, finding.onset_ns, check)
            self._add_event(t_ns, "warning", describe_exclusion(device, label, finding, t_ns))
        copy = finding.copy.estimate if finding.copy else None
        self._navigator.exclude(names_of(devices, quantities), finding.onset_ns, copy)
        for watch in self._watches:
            watch.clear()
        for group in self._classes:
            if group.label != SATELLITES:
                group.clear()
            elif quantities == QUANTITIES:  # copies without satellites do not use their heights, either
                self._continue_without(group, finding)

    def _continue_without(self, satellites: SourceClass, finding: SourceFault) -> None:
        """After the exclusion of a receiver: the oldest copy is kept to test the receivers that still aid."""
        is_oldest = finding.copy is not None and finding.copy is satellites.monitor.copy_ring.oldest
        if is_oldest and self._aiding_devices(satellites):
            satellites.restart_from_oldest()
        else:
            satellites.clear()

    def _aids_of(self, group: SourceClass) -> frozenset[str]:
        """Dead-reckoning aids that are not excluded."""
        return group.dead_reckoning - self._navigator.find_exclusions().keys()

    def _exclude_aids(self, names: frozenset[str], finding: SourceFault, text: str, t_ns: int) -> None:
        """Continue from a copy without dead-reckoning aids that were used without satellites."""
        assert finding.copy is not None
        self._navigator.exclude(names, finding.onset_ns, finding.copy.estimate)
        self._excluded_aids |= names
        for each in (*self._classes, *self._watches):
            if isinstance(each, SourceClass) and each.label == SATELLITES:  # its copies never use them
                each.restart_from_oldest()
            else:
                each.clear()
        self._add_event(t_ns, "warning", text)

    def _report_readmitted_aids(self, t_ns: int) -> None:
        readmitted = self._excluded_aids - self._navigator.find_exclusions().keys()
        self._excluded_aids -= readmitted
        for name in sorted(readmitted):
            self._add_event(t_ns, "info", f"{name}: aids the filter again")

    def _report_unresolved(self, finding: SourceFault, t_ns: int) -> None:
        if self._unresolved_ns is None:
            text = f"contradiction: {finding.text}; it is unknown which of the sources is wrong, none is excluded"
            self._add_event(t_ns, "warning", text)
        self._unresolved_ns = self._end_ns

    def _end_unresolved(self, t_ns: int) -> None:
        assert self._unresolved_ns is not None
        monitors = [*(group.monitor for group in self._classes), *itertools.chain(*(w.monitors for w in self._watches))]
        if any(monitor.ratio > HALF_K_FA for monitor in monitors):
            self._unresolved_ns = self._end_ns
        elif (self._end_ns or 0) - self._unresolved_ns >= UNRESOLVED_END_NS:
            self._unresolved_ns = None
            self._add_event(t_ns, "info", "contradiction: the sources agree again")

    def _forget_copies(self) -> None:
        for group in (*self._classes, *self._watches):
            group.clear()

    # ------------------------------------------------------------------------------------------------------ readmission

    def _compare_refused(self, segment: FilterSegment) -> None:
        for receiver in self._refused.values():
            for entry in segment.entries:
                if entry.aiding.name in receiver.names and entry.decision is GateDecision.EXCLUDED:
                    receiver.readmission_check.compare(entry, segment.end.estimate)

    def _try_readmission(self, receiver: ExcludedReceiver, estimate: Estimate, t_ns: int) -> None:
        if not receiver.readmission_check.has_agreed(estimate.t_ns):
            receiver.is_announced = False
        elif receiver.readmission_check.is_confirmed(estimate):
            self._readmit(receiver, t_ns, receiver.readmission_check.tolerance or 0.0, "its contradiction has ended")
        elif not receiver.is_announced:
            receiver.is_announced = True
            self._add_event(t_ns, "warning", describe_unconfirmed(receiver))

    def _readmit(
        self, receiver: ExcludedReceiver, t_ns: int, tolerance: float, reason: str, disagreement: float = 0.0
    ) -> None:
        del self._refused[receiver.label]
        self._provisional.end(receiver.device)
        self._navigator.readmit(receiver.names, disagreement)
        self._tolerance = max(self._tolerance, tolerance)
        self._forget_copies()
        self._add_event(t_ns, "info", f"{receiver.label}: aids the filter again: {reason}")

    def readmit(self, device: str, t_ns: int) -> None:
        """Readmit a receiver on the operator's command, if it is excluded or its own tests refuse it."""
        mine = [r for r in self._refused.values() if r.device == device]
        if not mine:
            self._admit(device, t_ns)
        for receiver in mine:
            self._readmit(receiver, t_ns, 0.0, COMMANDED_TEXT, receiver.readmission_check.size)

    def _admit(self, device: str, t_ns: int) -> None:
        """Let the coasting filter follow a receiver that only its own tests have refused."""
        distance, waiting = self._provisional.distance(device), self._provisional.end(device)
        if distance is None:
            return
        self._navigator.readmit((), distance)
        for entry in waiting:
            if self._navigator.reaches(entry.t_ns):
                self._navigator.feed_aiding(entry.t_ns, entry.aiding)
        self._forget_copies()
        self._add_event(t_ns, "info", f"{device}: aids the filter again: {COMMANDED_TEXT}")

    @property
    def contradiction_sizes(self) -> dict[str, Size]:
        """Contradictions of receivers that do not aid, by device: of position and height, as far as known [m]."""
        return {r.device: size_of(r) for r in self._refused.values() if r.label == r.device}

    def confirm(self, confirmation: Confirmation, t_ns: int) -> None:
        """An independent source agrees with a receiver: readmit it, or restart the filter."""
        receiver = self._refused.get(confirmation.device)
        if receiver is None:
            self._provisional.end(confirmation.device)
            return
        if confirmation.is_against_filter:
            self._restart_with(receiver, confirmation.source, t_ns)
        elif self._end_ns is not None and receiver.readmission_check.has_agreed(self._end_ns):
            reason = f"{confirmation.source} agrees with it to {confirmation.tolerance:.0f} m"
            self._readmit(receiver, t_ns, confirmation.tolerance, reason)

    def _restart_with(self, receiver: ExcludedReceiver, source: str, t_ns: int) -> None:
        del self._refused[receiver.label]
        self._navigator.restart(Reason.DIVERGED)
        text = f"filter: restarts: {receiver.label} and {source} agree, and contradict it"
        self._add_event(t_ns, "warning", text)

    def _add_event(self, t_ns: int, level: str, text: str) -> None:
        self._events.append(Event(t_ns=t_ns, level=level, source="nav", text=text))


def _is_accepted_since(device: str, group: SourceClass, finding: SourceFault, moment: Moment) -> bool:
    """Whether the filter has accepted a measurement of a receiver since the copy began, or refuses it now.

    A receiver that was silent cannot be the cause of a wrong filter.
    """
    began_ns = finding.copy.began_ns if finding.copy else 0
    accepted = (moment.gate_states[name].accepted_ns for name in receiver_names(device) if name in moment.gate_states)
    is_accepted = any(accepted_ns is not None and accepted_ns >= began_ns for accepted_ns in accepted)
    return is_accepted or group.refusals.since(moment, receiver_names(device)) is not None


def _contradiction(device: str, quantity: str, finding: SourceFault, segment: FilterSegment) -> Contradiction:
    """The contradiction at the exclusion of a source: its last refused innovation, or the separation.

    The innovation may lie within the gate of the copy that the filter continues from.
    """
    name, size = f"{device}.{quantity}", finding.sizes.get(quantity, 0.0)
    for entry in segment.entries:
        if entry.aiding.name == name and entry.decision is GateDecision.REFUSED and entry.innovation is not None:
            size = max(size, float(np.linalg.norm(entry.innovation)))
    is_real = size > 0.0
    return Contradiction(QUANTITY_AXES[quantity], size, segment.end.estimate.t_ns if is_real else None, is_real)


def _is_alike(
    device: str, wrong: Iterable[str], group: SourceClass, finding: SourceFault, segment: FilterSegment
) -> bool:
    """Whether a receiver has the same innovations as a refused one, although its own refusal has not lasted."""
    names = receiver_names(device) & group.tested_names
    others = (receiver_names(other) & group.tested_names for other in wrong)
    return finding.refused and any(group.refusals.is_alike(segment.end, other, names) for other in others)


def _contradicts(device: str, group: SourceClass, finding: SourceFault, segment: FilterSegment) -> bool:
    """Whether the filter refuses one of several receivers, or its last fix is outside the gate of the copy."""
    if finding.refused:
        since = group.refusals.since(segment.end, receiver_names(device) & group.tested_names)
        return since is not None and segment.end.estimate.t_ns - since >= REFUSED_NS
    last = [e for e in segment.entries if e.aiding.name in receiver_names(device, group.quantities[:1])]
    if not last:
        return False
    estimate = finding.copy.estimate if finding.copy else segment.end.estimate
    matrices = last[-1].aiding.compute_matrices(estimate)
    return compute_nis(estimate, matrices) > LIMITS[len(matrices[0])]
