"""Fault detection and exclusion between the sources that aid the filter.

Each class of sources (``source_class``) is compared with copies of the filter that run without it (``comparisons``).  A
faulty class (``monitor``) is excluded, and the filter continues from the oldest copy without it; of several receivers
only the contradicting ones are excluded (``attribution``).  ``readmission`` ends the exclusion of a receiver
(``excluded_receivers``).  If heights separate while the filter refuses none of them, the contradiction is unresolved:
satellites or barometer may be wrong.

Without satellites, airspeed and magnetic heading separate the filter from its copies, which does not show a fault of
the satellites: separations are tested only while positions are accepted.  If the filter refuses satellites that return,
and the copy from before agrees with them, airspeed and heading are excluded.  Positions from the ground and drifts
between looks are compared with the satellites (``ground_watch``, ``drift_watch``).
Source: the specification in docs/fault-detection.md.  Checked against: tests/nav/test_fault_detection.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from fti.config import Filter
from fti.constants import SECOND_NS
from fti.messages.outputs import Event
from fti.messages.reasons import Reason
from fti.messages.refusals import CarriedRefusal
from fti.nav.confirmation import Confirmation, Size
from fti.nav.filter.aiding import Aiding
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.look_mark import SCAN_DRIFT
from fti.nav.filter.navigator import InertialNavigator
from fti.nav.filter.segment import FilterSegment, cut
from fti.nav.plausibility.source import UnconfirmedSource
from fti.nav.separation.attribution import Attribution, is_single_fault
from fti.nav.separation.comparisons import Comparisons
from fti.nav.separation.copies import Separation
from fti.nav.separation.event_texts import (
    describe_contradiction,
    describe_exclusion,
    describe_filter_restart,
    describe_misled,
    describe_return,
    describe_still_excluded,
    describe_unconfirmed,
    describe_wrong_drift,
)
from fti.nav.separation.excluded_receivers import ExcludedReceiver, ExcludedReceivers, describe_readmission
from fti.nav.separation.monitor import SourceFault
from fti.nav.separation.protection import ProtectionLevels, filter_levels, provisional_levels
from fti.nav.separation.provisional import ProvisionalFilters, ProvisionalResult
from fti.nav.separation.source_class import SourceClass, receiver_names
from fti.nav.separation.unresolved import UnresolvedContradiction

COMMANDED_TEXT = "the operator commands it"


class FaultDetection:
    """Fault detection of one filter.  settings : its aiding sources"""

    def __init__(self, navigator: InertialNavigator, settings: Filter) -> None:
        self._navigator = navigator
        self._excluded = ExcludedReceivers()
        self._excluded_aids = frozenset[str]()
        self._comparisons = Comparisons(settings, navigator.model, self._excluded)
        self._unresolved = UnresolvedContradiction()
        self._provisional = ProvisionalFilters()
        self._events: list[Event] = []
        self._end_ns: int | None = None
        self._tolerance = 0.0
        self._is_restarted = False

    # ---------------------------------------------------------------------------------------------------------- outputs

    @property
    def refused(self) -> dict[str, int]:
        """Start of the contradiction of receivers that are excluded as a whole, by device."""
        return self._excluded.onsets

    @property
    def refused_heights(self) -> frozenset[str]:
        """Receivers whose heights do not aid, with or without their positions."""
        return self._excluded.without_heights

    @property
    def is_unresolved(self) -> bool:
        """Whether sources contradict each other and it is unknown which is wrong."""
        return self._unresolved.is_present

    @property
    def is_reacquired(self) -> bool:
        """Whether the copies are younger than the configured ages."""
        return self._comparisons.is_reacquired

    @property
    def refusals(self) -> list[CarriedRefusal]:
        """Refusals in force."""
        return self._excluded.refusals

    @property
    def contradiction_sizes(self) -> dict[str, Size]:
        """Contradictions of receivers that do not aid, by device: of position and height, as far as known [m]."""
        return self._excluded.sizes

    @property
    def separations(self) -> dict[str, list[Separation]]:
        """Separations of the filter from the copies of each class, the oldest copy first."""
        return self._comparisons.separations

    def levels(self, t_ns: int) -> ProtectionLevels | None:
        """Protection levels of the filter at a time; None without an estimate."""
        estimate = self._navigator.at(t_ns)
        return None if estimate is None else filter_levels(estimate, self._levels_of_copies(t_ns), self._tolerance)

    def _lag_s(self, t_ns: int) -> float:
        """Age of the copies at a time."""
        return 0.0 if self._end_ns is None else max(0.0, (t_ns - self._end_ns) / SECOND_NS)

    def _levels_of_copies(self, t_ns: int) -> list[ProtectionLevels]:
        return self._comparisons.levels(t_ns, self._lag_s(t_ns), is_unresolved=self.is_unresolved)

    def provisional(self, t_ns: int) -> list[ProvisionalResult]:
        """Provisional filters of unconfirmed receivers at a time; empty without an estimate."""
        final = self._navigator.find_last_final()
        estimate = self._navigator.at(t_ns) if self._provisional.is_any else None
        if final is None or estimate is None:
            return []
        copies, results = self._levels_of_copies(t_ns), []
        for device, offset in self._provisional.find_offsets(final, self._lag_s(t_ns)):
            levels = provisional_levels(offset.offset_n, estimate, copies, self._tolerance)
            results.append(ProvisionalResult(device, offset, levels, self._readmission(device)))
        return results

    def _readmission(self, device: str) -> str:
        """The ways to readmit a receiver that the filter excludes, its own tests refuse, or both."""
        texts = [describe_readmission(receiver) for receiver in self._excluded.of_device(device)]
        return "; ".join(filter(None, (*texts, self._provisional.own_readmission(device))))

    def drain_events(self) -> list[Event]:
        """Events since the last call."""
        events, self._events = self._events, []
        return events

    def _add_event(self, t_ns: int, level: str, text: str) -> None:
        self._events.append(Event(t_ns=t_ns, level=level, source="nav", text=text))

    # ----------------------------------------------------------------------------------------------------------- update

    def restore(self, refusals: Iterable[CarriedRefusal], t_ns: int) -> None:
        """Start with refusals from before this process: the filter does not start with these receivers."""
        known = self._comparisons.satellites.devices
        for refusal in refusals:
            receiver = self._excluded.restore(refusal) if refusal.source in known else None
            if receiver is not None:
                self._add_event(t_ns, "warning", describe_still_excluded(receiver, "navigation was started again"))

    def set_suspects(self, devices: frozenset[str]) -> None:
        """Set the receivers that tests of one source suspect."""
        self._comparisons.set_suspects(devices)

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
            for receiver in self._excluded:
                self._try_readmission(receiver, segments[-1].end.estimate, t_ns)
            self._check_sources(segments[-1], t_ns)

    def _follow(self, segment: FilterSegment) -> None:
        if segment.begin_ns != self._end_ns:
            self._reset()
        self._end_ns = segment.end.estimate.t_ns
        if not self._navigator.is_aligned:
            return
        self._excluded.compare(segment)
        pieces = cut(segment)
        self._provisional.follow(segment, pieces, self._excluded.unconfirmed)
        self._comparisons.follow(segment, pieces, is_unresolved=self.is_unresolved)
        if not self.is_reacquired:
            self._tolerance = 0.0
        if self._comparisons.satellites.has_returned:
            self._add_event(self._end_ns, "info", describe_return(self._comparisons.satellites))

    def _reset(self) -> None:
        """The filter has restarted: its copies are not valid any more; exclusions remain."""
        self._comparisons.clear()
        self._provisional.clear()
        self._unresolved.clear()
        self._tolerance, self._is_restarted = 0.0, True
        self._excluded.reset()

    def _exclude_again(self, t_ns: int) -> None:
        """Repeat the exclusions in a filter that has restarted."""
        self._is_restarted = False
        for receiver in self._excluded:
            self._navigator.exclude(receiver.names, receiver.onset_ns, None)
            self._add_event(t_ns, "warning", describe_still_excluded(receiver, "a restart of the filter"))

    # -------------------------------------------------------------------------------------------- tests between sources

    def _check_sources(self, segment: FilterSegment, t_ns: int) -> None:
        """Exclude at most one class at a time: its exclusion changes what the others are compared with."""
        comparisons = self._comparisons
        if finding := comparisons.find_wrong_drift(segment):
            self._exclude_aids(frozenset({SCAN_DRIFT}), finding, describe_wrong_drift(finding, t_ns), t_ns)
        elif finding := comparisons.satellites.find(segment):
            self._judge_satellites(finding, segment, t_ns)
        elif comparisons.heights is not None and (finding := comparisons.heights.find(segment)):
            self._judge_heights(comparisons.heights, finding, segment, t_ns)
        elif faulty := comparisons.find_faulty_receivers(segment):
            self._judge_receivers(faulty, segment, t_ns)
        elif finding := comparisons.find_contradiction(segment):
            self._report_unresolved(finding, segment, t_ns)
        elif self._unresolved.try_end(segment.end.estimate.t_ns, is_calm=comparisons.is_calm):
            self._add_event(t_ns, "info", "contradiction: the sources agree again")

    def _judge_satellites(self, finding: SourceFault, segment: FilterSegment, t_ns: int) -> None:
        """Exclude the aids that have misled the filter without satellites, or the wrong receivers."""
        satellites = self._comparisons.satellites
        aids = satellites.dead_reckoning - self._navigator.find_exclusions().keys()
        if aids and satellites.was_misled(finding, segment.end.estimate.t_ns):
            self._exclude_aids(aids, finding, describe_misled(satellites, aids, finding, t_ns), t_ns)
            return
        by_copies = self.is_unresolved or not finding.refused
        self._attribute(satellites, finding, segment, t_ns, by_copies=by_copies)

    def _judge_heights(self, heights: SourceClass, finding: SourceFault, segment: FilterSegment, t_ns: int) -> None:
        if finding.refused:
            self._attribute(heights, finding, segment, t_ns, by_copies=False)
        else:
            self._report_unresolved(finding, segment, t_ns)

    def _judge_receivers(
        self, faulty: Sequence[tuple[SourceClass, SourceFault]], segment: FilterSegment, t_ns: int
    ) -> None:
        """Exclude the one of several receivers that is wrong; while unresolved, the filter may follow any of them."""
        receivers = self._comparisons.receivers
        wrong = [each for each in faulty if each[1].refused or is_single_fault(each[0], receivers)]
        if len(wrong) == 1 and not self.is_unresolved:
            receiver, finding = wrong[0]
            self._exclude(receiver.devices, receiver.quantities, finding, segment, t_ns)
        else:
            self._report_unresolved(faulty[0][1], segment, t_ns)

    def _attribute(
        self, group: SourceClass, finding: SourceFault, segment: FilterSegment, t_ns: int, *, by_copies: bool
    ) -> None:
        """Exclude the wrong ones of the receivers of a class; none if they are unknown."""
        attribution = Attribution(group, finding, segment, self._comparisons.receivers)
        devices = attribution.find_wrong(self._excluded.aiding_devices(group), by_copies=by_copies)
        if devices:
            self._exclude(devices, group.quantities, finding, segment, t_ns)
        else:
            self._report_unresolved(finding, segment, t_ns)

    def _exclude(
        self,
        devices: Iterable[str],
        quantities: tuple[str, ...],
        finding: SourceFault,
        segment: FilterSegment,
        t_ns: int,
    ) -> None:
        """Continue from the copy without these quantities of receivers."""
        names = frozenset[str]()
        for device in devices:
            receiver = self._excluded.add(device, quantities, finding, segment)
            names |= receiver.names
            self._add_event(t_ns, "warning", describe_exclusion(device, receiver.label, finding, t_ns))
        self._navigator.exclude(names, finding.onset_ns, finding.copy.estimate if finding.copy else None)
        self._comparisons.continue_without_receivers(quantities, finding)

    def _exclude_aids(self, names: frozenset[str], finding: SourceFault, text: str, t_ns: int) -> None:
        """Continue from a copy without dead-reckoning aids that were used without satellites."""
        assert finding.copy is not None
        self._navigator.exclude(names, finding.onset_ns, finding.copy.estimate)
        self._excluded_aids |= names
        self._comparisons.continue_without_aids()
        self._add_event(t_ns, "warning", text)

    def _report_readmitted_aids(self, t_ns: int) -> None:
        readmitted = self._excluded_aids - self._navigator.find_exclusions().keys()
        self._excluded_aids -= readmitted
        for name in sorted(readmitted):
            self._add_event(t_ns, "info", f"{name}: aids the filter again")

    def _report_unresolved(self, finding: SourceFault, segment: FilterSegment, t_ns: int) -> None:
        if self._unresolved.continue_at(segment.end.estimate.t_ns):
            self._add_event(t_ns, "warning", describe_contradiction(finding))

    # ------------------------------------------------------------------------------------------------------ readmission

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
        self._excluded.remove(receiver)
        self._provisional.end(receiver.device)
        self._navigator.readmit(receiver.names, disagreement)
        self._tolerance = max(self._tolerance, tolerance)
        self._comparisons.clear()
        self._add_event(t_ns, "info", f"{receiver.label}: aids the filter again: {reason}")

    def readmit(self, device: str, t_ns: int) -> None:
        """Readmit a receiver on the operator's command, if it is excluded or its own tests refuse it."""
        mine = self._excluded.of_device(device)
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
        self._comparisons.clear()
        self._add_event(t_ns, "info", f"{device}: aids the filter again: {COMMANDED_TEXT}")

    def confirm(self, confirmation: Confirmation, t_ns: int) -> None:
        """An independent source agrees with a receiver: readmit it, or restart the filter."""
        receiver = self._excluded.find_whole(confirmation.device)
        if receiver is None:
            self._provisional.end(confirmation.device)
            return
        if confirmation.is_against_filter:
            self._excluded.remove(receiver)
            self._navigator.restart(Reason.DIVERGED)
            self._add_event(t_ns, "warning", describe_filter_restart(receiver, confirmation.source))
        elif self._end_ns is not None and receiver.readmission_check.has_agreed(self._end_ns):
            reason = f"{confirmation.source} agrees with it to {confirmation.tolerance:.0f} m"
            self._readmit(receiver, t_ns, confirmation.tolerance, reason)
