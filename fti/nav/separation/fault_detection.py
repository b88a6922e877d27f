"""Fault detection and exclusion between the sources that aid the filter.

Each class of sources (``source_class``) is compared with copies of the filter that go without it.  A class that is
faulty (``monitor``) is excluded, and the filter goes on from the oldest copy without it; of several receivers only
those that contradict.  It comes back by ``readmission``.  Heights that separate while the filter refuses none of them
are a contradiction without a culprit: satellites or barometer may be wrong.

Without satellites airspeed and magnetic heading move the filter away from its copies, which says nothing of the
satellites: separations count only while positions are believed.  Where the filter refuses satellites that come back,
and the copy from before agrees with them, airspeed and heading are excluded.
Source: the specification in docs/fault-detection.md.  Checked against: tests/nav/test_fault_detection.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from fti.config import Filter
from fti.nav.carried_refusal import CarriedRefusal, RefusedPart
from fti.nav.filter.aiding import Aiding
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.innovation_gate import LIMITS, GateDecision
from fti.nav.filter.measurement_update import compute_nis
from fti.nav.filter.navigator import InertialNavigator
from fti.nav.filter.segment import FilterSegment, Moment, cut
from fti.nav.plausibility.source import UnconfirmedSource
from fti.nav.separation.copies import Separation, separate
from fti.nav.separation.exclusions import (
    ExcludedReceiver,
    describe_exclusion,
    describe_misled,
    describe_readmission,
    describe_return,
    describe_unconfirmed,
    size_of,
)
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
    SECOND_NS,
    SourceClass,
    long_absence_ns,
    make_classes,
    names_of,
    receiver_names,
)
from fti.nav.witnesses import Confirmation, Size
from fti.types import Event, Reason

#: The filter separates so much farther without a wrong receiver than without any other one.
ALONE_RATIO = 1.5
COMMANDED_TEXT = "the operator commands it"


class FaultDetection:
    """Of one filter, which is aided as the settings say."""

    def __init__(self, navigator: InertialNavigator, settings: Filter) -> None:
        self._navigator = navigator
        self._classes = make_classes(settings) if settings.gnss else []
        self._refused: dict[str, ExcludedReceiver] = {}  # by what
        self._events: list[Event] = []
        self._end_ns: int | None = None
        self._tolerance = 0.0
        self._unresolved_ns: int | None = None
        self._several = settings.gnss if len(settings.gnss) > 1 else ()
        self._is_restarted = False
        self._long_absence_ns = long_absence_ns(settings.unit)
        self._provisional = ProvisionalFilters()
        self._excluded_aids = frozenset[str]()

    # ---------------------------------------------------------------------------------------------------- telling

    @property
    def refused(self) -> dict[str, int]:
        """Since when receivers that are excluded as a whole have contradicted, by device."""
        return {r.device: r.onset_ns for r in self._refused.values() if r.what == r.device}

    @property
    def refused_heights(self) -> frozenset[str]:
        """Receivers whose heights do not aid, alone or with their positions."""
        return frozenset(r.device for r in self._refused.values() if f"{r.device}.height" in r.names)

    @property
    def is_unresolved(self) -> bool:
        """Whether sources contradict each other and it is unknown which is wrong."""
        return self._unresolved_ns is not None

    @property
    def is_reacquired(self) -> bool:
        """Whether the copies are younger than the configured ages."""
        rings = (
            watched for watched in self._classes if watched.what not in self._several and self._aiding_devices(watched)
        )
        return any(not w.monitor.copy_ring.is_full or w.absence.is_on_trial for w in rings)

    @property
    def refusals(self) -> list[CarriedRefusal]:
        """Those in force."""
        return [
            CarriedRefusal(
                refused.device,
                RefusedPart.AIDING if refused.what == refused.device else RefusedPart.AIDING_HEIGHT,
                Reason.EXCLUDED,
                refused.onset_ns,
                is_standing=True,
            )
            for refused in self._refused.values()
        ]

    def restore(self, refusals: Iterable[CarriedRefusal], t_ns: int) -> None:
        """Begin with refusals of before this process: the filter does not begin with these receivers."""
        parts = {RefusedPart.AIDING: ("{}", QUANTITIES), RefusedPart.AIDING_HEIGHT: ("{} height", HEIGHT)}
        known = frozenset[str]().union(*(watched.devices for watched in self._classes))
        for refusal in refusals:
            if refusal.part not in parts or refusal.source not in known:
                continue
            name, quantities = parts[refusal.part]
            back = ReadmissionCheck({f"{refusal.source}.{q}": Contradiction(QUANTITY_AXES[q]) for q in quantities})
            back.begin_anew()
            what = name.format(refusal.source)
            self._refused[what] = ExcludedReceiver(refusal.source, what, refusal.onset_ns, back)
            text = f"{what}: still refused after navigation was started again"
            text += f"; it aids again after {describe_readmission(self._refused[what])}"
            self._add_event(t_ns, "warning", text)

    def levels(self, t_ns: int) -> ProtectionLevels | None:
        """Protection levels of the filter at a time; None where there is no filter."""
        here = self._navigator.at(t_ns)
        if here is None:
            return None
        found = [filter_levels(here), *self._levels_of_copies(t_ns)]
        return ProtectionLevels(
            max(level.horizontal for level in found) + self._tolerance,
            max(level.vertical for level in found) + self._tolerance,
        )

    def _lag_s(self, t_ns: int) -> float:
        """How old the copies are at a time."""
        return 0.0 if self._end_ns is None else max(0.0, (t_ns - self._end_ns) / SECOND_NS)

    def _levels_of_copies(self, t_ns: int) -> list[ProtectionLevels]:
        return [watched.levels(self._lag_s(t_ns)) for watched in self._classes]

    def provisional(self, t_ns: int) -> list[ProvisionalResult]:
        """Provisional filters of unconfirmed receivers at a time; none where there is no filter."""
        final = self._navigator.last_final
        here = self._navigator.at(t_ns) if self._provisional.is_any else None
        if final is None or here is None:
            return []
        copies, added = self._levels_of_copies(t_ns), self._tolerance
        found = []
        for device, offset in self._provisional.find_offsets(final, self._lag_s(t_ns)):
            horizontal, vertical = provisional_levels(offset.offset_n, here, copies)
            levels = ProtectionLevels(horizontal + added, vertical + added)
            found.append(ProvisionalResult(device, offset, levels, self._readmission(device)))
        return found

    def _readmission(self, device: str) -> str:
        """What would readmit a receiver that the filter excludes, its own tests refuse, or both."""
        texts = [describe_readmission(r) for r in self._refused.values() if r.device == device]
        return "; ".join(filter(None, (*texts, self._provisional.own_readmission(device))))

    @property
    def separations(self) -> dict[str, list[Separation]]:
        """Of the filter from the copies of each class, the oldest copy first."""
        return {watched.what: watched.monitor.separations for watched in self._classes}

    def drain_events(self) -> list[Event]:
        """What happened since the last call."""
        events, self._events = self._events, []
        return events

    # ------------------------------------------------------------------------------------------------- following

    def set_suspects(self, devices: frozenset[str]) -> None:
        """Receivers that tests of one source suspect from now on."""
        for watched in self._classes:
            watched.is_suspect = watched.what != HEIGHTS and not devices.isdisjoint(watched.devices)

    def feed_unconfirmed(self, device: str, what: UnconfirmedSource, t_ns: int, parts: Iterable[Aiding]) -> None:
        """Take a measurement of a receiver that its own tests refuse, and that is unconfirmed."""
        if self._navigator.is_aligned:
            self._provisional.feed_aiding(
                device, receiver_names(device, what.quantities), what.readmission, t_ns, parts
            )

    def update(self, t_ns: int) -> None:
        """Follow the filter to its last segment; exclude what contradicts, let back in what agrees."""
        segments = self._navigator.drain_segments()
        for segment in segments:
            self._follow(segment)
        if self._excluded_aids:
            self._report_readmitted_aids(t_ns)
        if segments and self._navigator.is_aligned:  # the filter can only be changed where the last one ends
            if self._is_restarted:
                self._exclude_again(t_ns)
                return
            for refused in list(self._refused.values()):
                self._try_readmission(refused, segments[-1].end.estimate, t_ns)
            self._judge(segments[-1], t_ns)

    def _follow(self, segment: FilterSegment) -> None:
        if segment.begin_ns != self._end_ns:
            self._begin_anew()
        self._end_ns = segment.end.estimate.t_ns
        if not self._navigator.is_aligned:
            return
        self._compare_refused(segment)
        pieces = cut(segment)
        self._provisional.follow(segment, pieces, self._unconfirmed)
        for watched in self._classes:
            if self._is_bounded(watched, segment) or (self.is_unresolved and watched.what in self._several):
                watched.follow(segment, pieces)
            else:
                watched.clear()
        if not self.is_reacquired:
            self._tolerance = 0.0
        self._report_returns(segment)

    @property
    def _unconfirmed(self) -> dict[str, frozenset[str]]:
        """Names with which receivers that are excluded agree with themselves, by device."""
        found = dict[str, frozenset[str]]()
        for refused in self._refused.values():
            if refused.back.has_passed:
                found[refused.device] = found.get(refused.device, frozenset()) | refused.names
        return found

    def _report_returns(self, segment: FilterSegment) -> None:
        for watched in self._classes:
            if watched.has_returned and watched.what == SATELLITES:
                self._add_event(segment.end.estimate.t_ns, "info", describe_return(watched))

    def _is_bounded(self, watched: SourceClass, segment: FilterSegment) -> bool:
        """Whether the copies of a class are of use: it aids, and of one of several receivers that another one does."""
        if not self._aiding_devices(watched):
            return False
        if watched.what not in self._several:
            return True
        if self._is_silent(watched.what, segment.end):
            return False
        others = (segment.end.gate_states.get(f"{name}.position") for name in self._several if name != watched.what)
        believed = [other.accepted_ns for other in others if other is not None and other.accepted_ns is not None]
        return any(segment.end.estimate.t_ns - then_ns <= BOUNDED_NS for then_ns in believed)

    def _is_silent(self, device: str, now: Moment) -> bool:
        """Whether the filter has believed no position of a receiver for as long as the oldest copy gets old.

        A copy that goes without it is then the filter itself but for rounding, and would contradict it for nothing.
        """
        standing = now.gate_states.get(f"{device}.position")
        if standing is None or standing.accepted_ns is None:
            return True
        return now.estimate.t_ns - standing.accepted_ns > self._long_absence_ns

    def _begin_anew(self) -> None:
        """The filter has begun again: what was known of its copies is not true of it; who was excluded still is."""
        self._forget_copies()
        self._provisional.clear()
        self._unresolved_ns, self._tolerance, self._is_restarted = None, 0.0, True
        for refused in self._refused.values():
            refused.back.begin_anew()

    def _exclude_again(self, t_ns: int) -> None:
        """Of a filter that has begun again."""
        self._is_restarted = False
        for refused in self._refused.values():
            self._navigator.exclude(refused.names, refused.onset_ns, None)
            text = f"{refused.what}: still refused after the filter began again"
            text += f"; it aids again after {describe_readmission(refused)}"
            self._add_event(t_ns, "warning", text)

    # --------------------------------------------------------------------------------------------------- judging

    def _judge(self, segment: FilterSegment, t_ns: int) -> None:
        """Exclude at most one class at a time: its exclusion changes what the others are compared with."""
        found = {watched.what: (watched, finding) for watched in self._classes if (finding := watched.find(segment))}
        if SATELLITES in found:
            watched, finding = found[SATELLITES]
            if watched.was_misled(finding, segment.end.estimate.t_ns) and self._aids_of(watched):
                self._exclude_aids(watched, finding, t_ns)
            else:
                self._attribute(watched, finding, segment, t_ns)
            return
        if HEIGHTS in found:
            watched, finding = found[HEIGHTS]
            if finding.refused:
                self._attribute(watched, finding, segment, t_ns)
            else:
                self._report_unresolved(finding, t_ns)
            return
        wrong = [each for each in found.values() if self._is_alone(*each)]
        if len(wrong) == 1:
            watched, finding = wrong[0]
            self._exclude(watched.devices, watched.quantities, finding, segment, t_ns)
        elif found:
            self._report_unresolved(next(iter(found.values()))[1], t_ns)
        elif self._unresolved_ns is not None:
            self._end_unresolved(t_ns)

    def _is_alone(self, watched: SourceClass, finding: SourceFault) -> bool:
        """Whether one of several receivers is wrong, and not one of two of which either may be.

        Without either of two that contradict each other the filter separates alike; without the wrong one of three
        twice as far as without another one.  During a draw the filter may have come to follow either, by its gate.
        """
        if finding.refused or self.is_unresolved:
            return not self.is_unresolved
        others = (w.monitor.ratio for w in self._classes if w.what in self._several and w is not watched)
        return watched.monitor.ratio > ALONE_RATIO * max(others, default=0.0)

    def _aiding_devices(self, watched: SourceClass) -> tuple[str, ...]:
        """Devices of a class that are not excluded."""
        if not self._refused:
            return watched.devices
        out = frozenset[str]().union(*(r.names for r in self._refused.values()))
        return tuple(d for d in watched.devices if not receiver_names(d, watched.quantities) <= out)

    def _attribute(self, watched: SourceClass, finding: SourceFault, segment: FilterSegment, t_ns: int) -> None:
        """Of several receivers exclude the one whose removal ends the contradiction; where it is unknown, none."""
        aiding = self._aiding_devices(watched)
        devices = tuple(d for d in aiding if _is_accepted_since(d, watched, finding, segment.end)) or aiding
        if len(devices) > 1 and watched.what == SATELLITES and (self.is_unresolved or not finding.refused):
            devices = self._find_faulty(devices, watched)
        elif len(devices) > 1:
            wrong = tuple(d for d in devices if _contradicts(d, watched, finding, segment))
            devices = tuple(d for d in devices if d in wrong or _is_alike(d, wrong, watched, finding, segment))
        if devices:
            self._exclude(devices, watched.quantities, finding, segment, t_ns)
        else:
            self._report_unresolved(finding, t_ns)

    def _find_faulty(self, devices: tuple[str, ...], watched: SourceClass) -> tuple[str, ...]:
        """The one receiver without which the filter agrees with the oldest copy; all where they lie alike.

        Those agree with each other, and the filter without any one of them contradicts a copy.  A young copy shows a
        change of the velocity best, but may itself have begun behind a lie: it does not show which one is wrong alone.
        None while it is not clear, as without a copy.
        """
        if not watched.monitor.copy_ring.copies:
            return ()
        ratios, k_fa = {device: self._ratios_without(device, watched) for device in devices}, watched.monitor.k_fa
        if self._agree(devices) and all(max(separation_ratios) >= k_fa for separation_ratios in ratios.values()):
            return devices
        still = tuple(device for device in devices if ratios[device][0] >= k_fa)
        ending = tuple(device for device in devices if ratios[device][0] < HALF_K_FA)
        if len(still) == len(devices):
            return devices
        return ending if len(ending) == 1 and len(still) == len(devices) - 1 else ()

    def _agree(self, devices: tuple[str, ...]) -> bool:
        """Whether receivers are compared with each other, and none contradicts."""
        monitors = [watched.monitor for watched in self._classes if watched.what in devices]
        return all(monitor.separations and monitor.ratio < monitor.k_fa for monitor in monitors)

    def _ratios_without(self, device: str, watched: SourceClass) -> list[float]:
        """|d| over sigma of the filter without one receiver from copies without any; infinite while there is none."""
        mine = next(each.monitor.copy_ring.oldest for each in self._classes if each.what == device)
        if mine is None:
            return [np.inf]
        separations = [separate(mine.estimate, copy.estimate) for copy in watched.monitor.copy_ring.copies]
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
            what = device if quantities == QUANTITIES else f"{device} height"
            back = ReadmissionCheck({f"{device}.{q}": _contradiction(device, q, finding, segment) for q in quantities})
            self._refused[what] = ExcludedReceiver(device, what, finding.onset_ns, back)
            self._add_event(t_ns, "warning", describe_exclusion(device, what, finding, t_ns))
        copy = finding.copy.estimate if finding.copy else None
        self._navigator.exclude(names_of(devices, quantities), finding.onset_ns, copy)
        for watched in self._classes:
            if watched.what != SATELLITES:
                watched.clear()
            elif quantities == QUANTITIES:  # copies without satellites go without their heights, too
                self._continue_without(watched, finding)

    def _continue_without(self, satellites: SourceClass, finding: SourceFault) -> None:
        """Behind the exclusion of a receiver: where another one aids, it may be the next that the oldest copy finds."""
        is_oldest = finding.copy is not None and finding.copy is satellites.monitor.copy_ring.oldest
        if is_oldest and self._aiding_devices(satellites):
            satellites.restart_from_oldest()
        else:
            satellites.clear()

    def _aids_of(self, watched: SourceClass) -> frozenset[str]:
        """What aids the filter without satellites, and is not excluded."""
        return watched.dead_reckoning - self._navigator.exclusions.keys()

    def _exclude_aids(self, watched: SourceClass, finding: SourceFault, t_ns: int) -> None:
        """Go on without what has aided while satellites were gone, from the oldest copy."""
        assert finding.copy is not None
        names = self._aids_of(watched)
        self._navigator.exclude(names, finding.onset_ns, finding.copy.estimate)
        self._excluded_aids |= names
        for each in self._classes:
            if each is watched:
                each.restart_from_oldest()
            else:
                each.clear()
        self._add_event(t_ns, "warning", describe_misled(watched, names, finding, t_ns))

    def _report_readmitted_aids(self, t_ns: int) -> None:
        """Say which aids that were excluded aid again."""
        back = self._excluded_aids - self._navigator.exclusions.keys()
        self._excluded_aids -= back
        for name in sorted(back):
            self._add_event(t_ns, "info", f"{name}: aids the filter again")

    def _report_unresolved(self, finding: SourceFault, t_ns: int) -> None:
        if self._unresolved_ns is None:
            text = f"contradiction: {finding.text}; it is unknown which of the sources is wrong, none is excluded"
            self._add_event(t_ns, "warning", text)
        self._unresolved_ns = self._end_ns

    def _end_unresolved(self, t_ns: int) -> None:
        assert self._unresolved_ns is not None
        if any(watched.monitor.ratio > HALF_K_FA for watched in self._classes):
            self._unresolved_ns = self._end_ns
        elif (self._end_ns or 0) - self._unresolved_ns >= UNRESOLVED_END_NS:
            self._unresolved_ns = None
            self._add_event(t_ns, "info", "contradiction: the sources agree again")

    def _forget_copies(self) -> None:
        for watched in self._classes:
            watched.clear()

    # -------------------------------------------------------------------------------------------------- back in

    def _compare_refused(self, segment: FilterSegment) -> None:
        for refused in self._refused.values():
            for entry in segment.entries:
                if entry.aiding.name in refused.names and entry.decision is GateDecision.EXCLUDED:
                    refused.back.compare(entry, segment.end.estimate)

    def _try_readmission(self, refused: ExcludedReceiver, here: Estimate, t_ns: int) -> None:
        if not refused.back.has_agreed(here.t_ns):
            refused.is_announced = False
        elif refused.back.is_confirmed(here):
            self._readmit(refused, t_ns, refused.back.tolerance or 0.0, "its contradiction has ended")
        elif not refused.is_announced:
            refused.is_announced = True
            self._add_event(t_ns, "warning", describe_unconfirmed(refused))

    def _readmit(
        self, refused: ExcludedReceiver, t_ns: int, tolerance: float, why: str, disagreement: float = 0.0
    ) -> None:
        del self._refused[refused.what]
        self._provisional.end(refused.device)
        self._navigator.readmit(refused.names, disagreement)
        self._tolerance = max(self._tolerance, tolerance)
        self._forget_copies()
        self._add_event(t_ns, "info", f"{refused.what}: aids the filter again: {why}")

    def readmit(self, device: str, t_ns: int) -> None:
        """Let a receiver back in because the operator commands it, if it is excluded or its own tests refuse it."""
        mine = [r for r in self._refused.values() if r.device == device]
        if not mine:
            self._admit(device, t_ns)
        for refused in mine:
            self._readmit(refused, t_ns, 0.0, COMMANDED_TEXT, refused.back.size)

    def _admit(self, device: str, t_ns: int) -> None:
        """The filter, which has coasted, is to follow a receiver that only its own tests have refused."""
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
        return {r.device: size_of(r) for r in self._refused.values() if r.what == r.device}

    def confirm(self, found: Confirmation, t_ns: int) -> None:
        """An independent source agrees with a receiver: it is back in, or the filter begins anew."""
        refused = self._refused.get(found.device)
        if refused is None:
            self._provisional.end(found.device)
            return
        if found.is_against_filter:
            self._restart_with(refused, found.witness, t_ns)
        elif self._end_ns is not None and refused.back.has_agreed(self._end_ns):
            why = f"{found.witness} agrees with it to {found.tolerance:.0f} m"
            self._readmit(refused, t_ns, found.tolerance, why)

    def _restart_with(self, refused: ExcludedReceiver, witness: str, t_ns: int) -> None:
        del self._refused[refused.what]
        self._navigator.restart(Reason.DIVERGED)
        text = f"filter: begins anew: {refused.what} and {witness} agree, and contradict it"
        self._add_event(t_ns, "warning", text)

    def _add_event(self, t_ns: int, level: str, text: str) -> None:
        self._events.append(Event(t_ns=t_ns, level=level, source="nav", text=text))


def _is_accepted_since(device: str, watched: SourceClass, finding: SourceFault, now: Moment) -> bool:
    """Whether the filter has taken anything of a receiver since the copy began, or refuses it now.

    One that was silent, or was never there, has not made the filter wrong.
    """
    began_ns = finding.copy.began_ns if finding.copy else 0
    believed = (now.gate_states[name].accepted_ns for name in receiver_names(device) if name in now.gate_states)
    is_believed = any(then_ns is not None and then_ns >= began_ns for then_ns in believed)
    return is_believed or watched.refusals.since(now, receiver_names(device)) is not None


def _contradiction(device: str, quantity: str, finding: SourceFault, segment: FilterSegment) -> Contradiction:
    """As it was when the source was excluded: its last innovation that the filter refused, or the separation.

    A lie that the filter has seen sharply may lie within the gate of the copy that it goes on from.
    """
    name, size = f"{device}.{quantity}", finding.sizes.get(quantity, 0.0)
    for entry in segment.entries:
        if entry.aiding.name == name and entry.decision is GateDecision.REFUSED and entry.innovation is not None:
            size = max(size, float(np.linalg.norm(entry.innovation)))
    is_real = size > 0.0
    return Contradiction(QUANTITY_AXES[quantity], size, segment.end.estimate.t_ns if is_real else None, is_real)


def _is_alike(
    device: str, wrong: Iterable[str], watched: SourceClass, finding: SourceFault, segment: FilterSegment
) -> bool:
    """Whether a receiver tells the filter the same as one that it refuses, though its own refusal has not lasted."""
    names = receiver_names(device) & watched.tested
    others = (receiver_names(other) & watched.tested for other in wrong)
    return finding.refused and any(watched.refusals.is_alike(segment.end, other, names) for other in others)


def _contradicts(device: str, watched: SourceClass, finding: SourceFault, segment: FilterSegment) -> bool:
    """Whether one of several receivers is refused by the filter, or its last one is outside the gate of the copy."""
    if finding.refused:
        since = watched.refusals.since(segment.end, receiver_names(device) & watched.tested)
        return since is not None and segment.end.estimate.t_ns - since >= REFUSED_NS
    last = [e for e in segment.entries if e.aiding.name in receiver_names(device, watched.quantities[:1])]
    if not last:
        return False
    here = finding.copy.estimate if finding.copy else segment.end.estimate
    matrices = last[-1].aiding.compute_matrices(here)
    return compute_nis(here, matrices) > LIMITS[len(matrices[0])]
