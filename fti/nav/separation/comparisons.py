"""All comparisons of the filter with its copies: classes of sources, positions from the ground, drifts between looks.

A class is compared while it aids.  One of several receivers is compared only while another one bounds the copy without
it.  While a contradiction is unresolved, all of several receivers are compared.
"""

from __future__ import annotations

from collections.abc import Sequence

from fti.config import Filter
from fti.nav.filter.error_states import FilterModel
from fti.nav.filter.position_mark import MARK
from fti.nav.filter.segment import FilterSegment, Moment, Piece
from fti.nav.separation.copies import Separation
from fti.nav.separation.drift_watch import DriftWatch
from fti.nav.separation.excluded_receivers import ExcludedReceivers
from fti.nav.separation.ground_watch import GroundWatch
from fti.nav.separation.monitor import HALF_K_FA, SourceFault
from fti.nav.separation.protection import ProtectionLevels
from fti.nav.separation.source_class import (
    BOUNDED_NS,
    QUANTITIES,
    SourceClass,
    long_absence_ns,
    make_heights,
    make_receiver,
    make_satellites,
)


class Comparisons:
    """Of one filter.  settings : its aiding sources;  model : its states;  excluded : receivers that do not aid

    satellites : the class of all receivers;  heights : that of their heights, None without a barometer
    receivers : the class of each of several receivers; empty with one
    classes : all of them; empty if the filter has no receivers
    """

    def __init__(self, settings: Filter, model: FilterModel, excluded: ExcludedReceivers) -> None:
        self._excluded = excluded
        self._long_absence_ns = long_absence_ns(settings.unit)
        self.satellites = make_satellites(settings, has_looks=bool(model.looks))
        self.heights = make_heights(settings) if settings.baro and settings.gnss else None
        self.receivers = [make_receiver(name) for name in settings.gnss] if len(settings.gnss) > 1 else []
        of_all = [self.satellites] if self.heights is None else [self.satellites, self.heights]
        self._of_all = of_all if settings.gnss else []
        self.classes = [*self._of_all, *self.receivers]
        self._ground = GroundWatch(settings) if settings.gnss and MARK[0] in model.columns else None
        self._drifts = DriftWatch(settings) if settings.gnss and model.looks else None

    @property
    def _watches(self) -> tuple[GroundWatch | DriftWatch, ...]:
        """Comparisons of satellites with the ground, and with drifts over it."""
        return tuple(watch for watch in (self._ground, self._drifts) if watch is not None)

    # ----------------------------------------------------------------------------------------------------------- update

    def set_suspects(self, devices: frozenset[str]) -> None:
        """Set the receivers that tests of one source suspect."""
        for group in self.classes:
            group.is_suspect = group is not self.heights and not devices.isdisjoint(group.devices)

    def follow(self, segment: FilterSegment, pieces: Sequence[Piece], *, is_unresolved: bool) -> None:
        """Compare at the end of a segment; remove copies of classes that cannot be compared."""
        for group in self._of_all:
            _follow(group, segment, pieces, is_usable=bool(self._excluded.aiding_devices(group)))
        for group in self.receivers:
            _follow(group, segment, pieces, is_usable=is_unresolved or self._is_bounded(group, segment.end))
        for watch in self._watches:
            watch.follow(segment, pieces)

    def _is_bounded(self, receiver: SourceClass, moment: Moment) -> bool:
        """Whether the copies without a receiver are usable: it aids, and another one aids."""
        if not self._excluded.aiding_devices(receiver) or self._is_silent(receiver.label, moment):
            return False
        others = (each.label for each in self.receivers if each.label != receiver.label)
        states = (moment.gate_states.get(f"{name}.position") for name in others)
        accepted = [state.accepted_ns for state in states if state is not None and state.accepted_ns is not None]
        return any(moment.estimate.t_ns - accepted_ns <= BOUNDED_NS for accepted_ns in accepted)

    def _is_silent(self, device: str, moment: Moment) -> bool:
        """Whether the filter has accepted no position of a receiver for the maximum age of the oldest copy.

        A copy without it then differs from the filter by rounding only, and must not contradict it.
        """
        state = moment.gate_states.get(f"{device}.position")
        if state is None or state.accepted_ns is None:
            return True
        return moment.estimate.t_ns - state.accepted_ns > self._long_absence_ns

    def clear(self) -> None:
        """Remove all copies."""
        for each in (*self.classes, *self._watches):
            each.clear()

    def continue_without_receivers(self, quantities: tuple[str, ...], finding: SourceFault) -> None:
        """The filter continues from a copy without these quantities of excluded receivers: remove wrong copies."""
        for each in (*self.classes, *self._watches):
            if each is not self.satellites:
                each.clear()
        if quantities == QUANTITIES:  # copies without satellites do not use their heights, either
            self._continue_without_receiver(finding)

    def _continue_without_receiver(self, finding: SourceFault) -> None:
        """The oldest copy without satellites is kept to test the receivers that still aid."""
        is_oldest = finding.copy is not None and finding.copy is self.satellites.monitor.copy_ring.oldest
        if is_oldest and self._excluded.aiding_devices(self.satellites):
            self.satellites.restart_from_oldest()
        else:
            self.satellites.clear()

    def continue_without_aids(self) -> None:
        """The filter continues from a copy without dead-reckoning aids; copies without satellites never use them."""
        for each in (*self.classes, *self._watches):
            if each is not self.satellites:
                each.clear()
        self.satellites.restart_from_oldest()

    # ---------------------------------------------------------------------------------------------------------- results

    @property
    def is_reacquired(self) -> bool:
        """Whether the copies are younger than the configured ages."""
        rings = (group for group in self._of_all if self._excluded.aiding_devices(group))
        return any(not group.monitor.copy_ring.is_full or group.absence.is_on_trial for group in rings)

    @property
    def is_calm(self) -> bool:
        """Whether no separation is larger than half of its limit."""
        monitors = [group.monitor for group in self.classes]
        for watch in self._watches:
            monitors += watch.monitors
        return not any(monitor.ratio > HALF_K_FA for monitor in monitors)

    @property
    def separations(self) -> dict[str, list[Separation]]:
        """Separations of the filter from the copies of each class, the oldest copy first."""
        return {group.label: group.monitor.separations for group in self.classes}

    def levels(self, t_ns: int, lag_s: float, *, is_unresolved: bool) -> list[ProtectionLevels]:
        """Protection levels of the copies, by comparison.  lag_s : age of the copies at t_ns"""
        satellites = self.satellites.levels(lag_s)
        others = [group.levels(lag_s) for group in self.classes if group is not self.satellites]
        if self._ground:
            others.append(self._ground.levels(lag_s))
        if self._drifts:
            absence = self.satellites.absence
            is_away = absence.is_on_trial or absence.is_absent(t_ns)
            if is_away and self._drifts.is_complete:
                satellites = satellites._replace(horizontal=0.0)
            if is_away or is_unresolved or not self._drifts.has_satellites:
                others.append(self._drifts.levels(lag_s))
        return [satellites, *others]

    def find_wrong_drift(self, segment: FilterSegment) -> SourceFault | None:
        """Why drifts between looks are faulty without satellites; None while they are not."""
        return self._drifts.find_wrong_drift(segment) if self._drifts else None

    def find_faulty_receivers(self, segment: FilterSegment) -> list[tuple[SourceClass, SourceFault]]:
        """Each of several receivers that is faulty at the end of a segment, and why."""
        return [(receiver, finding) for receiver in self.receivers if (finding := receiver.find(segment))]

    def find_contradiction(self, segment: FilterSegment) -> SourceFault | None:
        """The contradiction of satellites with the ground, or with drifts over it; None without one."""
        return next(filter(None, (watch.find(segment) for watch in self._watches)), None)


def _follow(group: SourceClass, segment: FilterSegment, pieces: Sequence[Piece], *, is_usable: bool) -> None:
    if is_usable:
        group.follow(segment, pieces)
    else:
        group.clear()
