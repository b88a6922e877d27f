"""Classes of sources that aid the filter, and the copies of the filter without each class.

    satellites  positions and velocities of all receivers: a ring of copies, because nothing else bounds the position
    heights     heights of all receivers, if a barometer bounds the altitude without them
    receivers   each of several receivers: one copy that is never replaced, while another receiver bounds it

Copies of the first two do not use altimeters, either: altimeters are tested against satellites by their own states
(``fti.nav.filter.exclusion``), and a copy with a wrong altimeter would contradict the satellites instead.  For the same
reason copies without satellites do not use the barometer, whose errors tilt them, airspeed, magnetic heading and drifts
between looks at the ground.
Source: the specification in docs/fault-detection.md.
Checked against: tests/nav/test_fault_detection.py.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from fti.config import Filter
from fti.constants import SECOND_NS
from fti.nav.dead_reckoning_aids import dead_reckoning_names
from fti.nav.exclusion_events import altitude_name
from fti.nav.filter.look_mark import SCAN_DRIFT
from fti.nav.filter.segment import FilterSegment, Moment, Piece
from fti.nav.separation.absence import AbsenceMonitor
from fti.nav.separation.copy_ring import CopyRing, RingSettings
from fti.nav.separation.monitor import (
    ALL_AXES,
    DOWN_AXIS,
    HORIZONTAL_AXES,
    K_FA_SATELLITES,
    Refusals,
    SeparationMonitor,
    SourceFault,
)
from fti.nav.separation.protection import ProtectionLevels, copy_levels

#: Age of a copy of each grade of inertial unit when the next one begins [ns]; four of them.  Of the heights two.
STEPS_NS = {"navigation": 15 * SECOND_NS, "tactical": 7 * SECOND_NS, "mems": 2 * SECOND_NS}
#: The same with several receivers: a single wrong one is found by comparison with the others, independent of these.
STEPS_OF_SEVERAL_NS = {"navigation": 9 * SECOND_NS, "tactical": 3 * SECOND_NS, "mems": SECOND_NS}
COPIES = 4
HEIGHT_RING = RingSettings(copies=2, step_ns=30 * SECOND_NS)
RECEIVER_RING = RingSettings(copies=1, step_ns=None)
#: A receiver that was accepted within so long bounds the filter without another one [ns].
BOUNDED_NS = 2 * SECOND_NS
#: Labels of the classes of all receivers.
HEIGHTS, SATELLITES = "heights", "satellites"
QUANTITIES, LEVEL, HEIGHT = ("position", "height", "velocity"), ("position", "velocity"), ("height",)


def receiver_names(device: str, quantities: Iterable[str] = QUANTITIES) -> frozenset[str]:
    """Names of the measurements of a receiver in the filter."""
    return frozenset(f"{device}.{quantity}" for quantity in quantities)


def names_of(receivers: Iterable[str], quantities: Iterable[str]) -> frozenset[str]:
    """``receiver_names`` of several."""
    return frozenset[str]().union(*(receiver_names(receiver, quantities) for receiver in receivers))


@dataclass(slots=True)
class SourceClass:
    """A class: its monitor; label for texts; uninterrupted refusals by the filter.

    long_absence_ns : after a longer absence it is on trial; None: never
    is_suspect : tests of one source suspect a receiver of it
    has_returned : in the last segment it returned from a long absence
    dead_reckoning : names of aids that the filter uses without the class, and the copies never
    """

    label: str
    devices: tuple[str, ...]
    quantities: tuple[str, ...]
    monitor: SeparationMonitor
    long_absence_ns: int | None = None
    dead_reckoning: frozenset[str] = frozenset()
    refusals: Refusals = field(default_factory=Refusals)
    is_suspect: bool = False
    has_returned: bool = False
    absence: AbsenceMonitor = field(init=False)

    def __post_init__(self) -> None:
        names = names_of(self.devices, self.quantities[:1])
        self.absence = AbsenceMonitor(names, self.long_absence_ns)

    @property
    def tested_names(self) -> frozenset[str]:
        """Names of the sources that are tested against the filter and the oldest copy."""
        return self.monitor.copy_ring.tested_names

    def follow(self, segment: FilterSegment, pieces: Sequence[Piece]) -> None:
        """Compare the filter with the copies at the end of a segment."""
        self.monitor.copy_ring.advance(pieces)
        self.refusals.follow(segment, self.tested_names)
        is_quiet = self.refusals.first_ns is None and not self.is_suspect
        self._follow_absence(segment, is_quiet)
        self.monitor.follow(
            segment.end,
            may_renew=is_quiet and is_recently_accepted(segment.end, self.tested_names),
            is_comparable=not self.dead_reckoning or is_recently_accepted(segment.end, self.absence.names),
            keep_oldest=self.absence.is_on_trial,
        )

    def _follow_absence(self, segment: FilterSegment, is_quiet: bool) -> None:
        """After a long absence the class is on trial, as after an alignment."""
        self.has_returned = self.absence.follow(segment)
        if not is_quiet or self.monitor.is_suspected:
            self.absence.disturb(segment.end.estimate.t_ns)
        elif (trial_ns := self.absence.end_trial()) is not None:
            self.monitor.copy_ring.drop_before(trial_ns)

    def levels(self, lag_s: float) -> ProtectionLevels:
        """Protection levels of its copies, on the axes that it tests; zeros on others.  lag_s : their age"""
        levels = copy_levels(self.monitor.separations, lag_s)
        return ProtectionLevels(
            *(level if axis in self.monitor.axes else 0.0 for level, axis in zip(levels, (0, 2), strict=True))
        )

    def find(self, segment: FilterSegment) -> SourceFault | None:
        """Why the class is faulty at the end of a segment; None while it is not."""
        return self.monitor.find(segment.end.estimate.t_ns, self.refusals)

    def was_misled(self, finding: SourceFault, t_ns: int) -> bool:
        """Whether the filter refuses the class after an absence, and the copy from before the absence does not.

        Then the aids that the filter used meanwhile are wrong.
        """
        has_come_back = self.absence.is_on_trial or self.absence.is_absent(t_ns)
        return has_come_back and finding.refused and finding.copy is not None and finding.copy.outside_ns is None

    def restart_from_oldest(self) -> None:
        """The filter continues from the oldest copy: remove younger ones, which are copies of its former state."""
        self.monitor.copy_ring.keep_oldest()
        self.refusals = Refusals()

    def clear(self) -> None:
        """Reset."""
        self.monitor.clear()
        self.refusals = Refusals()
        self.absence.clear()
        self.has_returned = False


def long_absence_ns(unit: str) -> int:
    """Limit of a long absence of satellites [ns]: maximum age of the oldest copy of one receiver."""
    return COPIES * STEPS_NS[unit]


def make_satellites(settings: Filter, *, has_looks: bool = False) -> SourceClass:
    """The class of all receivers that aid.  has_looks : drifts between looks aid, too"""
    receivers, steps_ns = settings.gnss, STEPS_OF_SEVERAL_NS if len(settings.gnss) > 1 else STEPS_NS
    tested, axes = (LEVEL, HORIZONTAL_AXES) if settings.baro else (QUANTITIES, ALL_AXES)
    aids = dead_reckoning_names(settings) | (frozenset({SCAN_DRIFT}) if has_looks else frozenset())
    removed = names_of(receivers, QUANTITIES) | names_beside_satellites(settings) | aids
    copy_ring = CopyRing(removed, names_of(receivers, tested), RingSettings(COPIES, steps_ns[settings.unit]))
    monitor = SeparationMonitor(copy_ring, axes, K_FA_SATELLITES)
    return SourceClass(SATELLITES, receivers, QUANTITIES, monitor, long_absence_ns(settings.unit), aids)


def make_heights(settings: Filter) -> SourceClass:
    """The class of the heights of all receivers that aid, if a barometer bounds the altitude without them."""
    names = names_of(settings.gnss, HEIGHT)
    copy_ring = CopyRing(names | _altimeter_names(settings), names, HEIGHT_RING)
    monitor = SeparationMonitor(copy_ring, DOWN_AXIS)
    return SourceClass(HEIGHTS, settings.gnss, HEIGHT, monitor, HEIGHT_RING.max_age_ns)


def make_receiver(name: str) -> SourceClass:
    """The class of one of several receivers that aid."""
    copy_ring = CopyRing(receiver_names(name), receiver_names(name), RECEIVER_RING)
    return SourceClass(name, (name,), QUANTITIES, SeparationMonitor(copy_ring, ALL_AXES))


def names_beside_satellites(settings: Filter) -> frozenset[str]:
    """Names of the aids that copies without satellites do not use, but for drifts between looks."""
    barometers = frozenset(altitude_name(device) for device in settings.baro)
    return _altimeter_names(settings) | barometers | dead_reckoning_names(settings)


def _altimeter_names(settings: Filter) -> frozenset[str]:
    return frozenset(altitude_name(sensor) for sensor in settings.altimeters)


def is_recently_accepted(moment: Moment, names: Iterable[str]) -> bool:
    """Whether the filter has accepted one of these sources within BOUNDED_NS.

    If the tests of one source refuse it after the filter has followed it, older copies must be kept.
    """
    accepted = [moment.gate_states[name].accepted_ns for name in names if name in moment.gate_states]
    return any(accepted_ns is not None and moment.estimate.t_ns - accepted_ns <= BOUNDED_NS for accepted_ns in accepted)
