"""Runs the tests of single sources for all devices of position and attitude; refused data are invalid in navigation."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TypeVar

from msgspec.structs import replace

from fti.config import Config, Device, position_sources
from fti.constants import SECOND_NS
from fti.messages.measurements import (
    Attitude,
    Ephemeris,
    Measurement,
    Position,
    Pseudoranges,
    ReceiverClock,
    Satellites,
    Velocity,
)
from fti.messages.outputs import Event, FilterSolution, Output, SourceValidity
from fti.messages.reasons import Reason
from fti.messages.refusals import CarriedRefusal, RefusedPart
from fti.nav.plausibility.admission import Admission
from fti.nav.plausibility.attitude import AttitudeComparison
from fti.nav.plausibility.events import describe, describe_restored
from fti.nav.plausibility.filter_attitude import FilterAttitudeTest
from fti.nav.plausibility.finding import PlausibilityFinding
from fti.nav.plausibility.heading import HeadingTest, TimedVelocity
from fti.nav.plausibility.signals import HOLD_NS, SignalTest
from fti.nav.plausibility.source import SourceTests, UnconfirmedSource, UnstatedSigmas
from fti.nav.source_interpolation import level_velocity

T = TypeVar("T", Position, Velocity, Attitude)
#: Period of source validities [ns], and of their repetition without a change [periods].
COMPOSE_NS, REPEAT_SLOTS = SECOND_NS // 10, 5
#: Maximum age of a source for comparisons [ns].
SOURCE_TIMEOUT_NS = 5 * SECOND_NS
ATTITUDE, HEADING = "attitude", "heading"


class PlausibilityMonitor:
    """All sources of a configuration: roles, and sources that aid filter and radio position."""

    def __init__(self, config: Config) -> None:
        devices = {device.name: device for device in config.device}
        self._tests = {name: _make_tests(devices[name], config) for name in position_sources(config.nav)}
        self._attitudes = {name: Admission() for name in config.nav.attitude}
        self._max_age_ns = {name: round(device.max_age_ms * 1e6) for name, device in devices.items()}
        self._newest_ns: dict[str, int] = {}
        self._headings = {name: Admission() for name in config.nav.attitude}
        self._heading_tests = {name: HeadingTest(config.nav.limits.wind_mps) for name in config.nav.attitude}
        self._velocity: TimedVelocity = (0, 0.0, 0.0)  # the newest of any valid source
        self._comparison = AttitudeComparison()
        self._filter_test = FilterAttitudeTest(self._comparison)
        self._has_filter = config.nav.filter is not None
        self._signals = {name: SignalTest() for name in (config.nav.filter.gnss if config.nav.filter else ())}
        self._signs_ns = 0  # the newest time of signals and ticks
        self._events: list[Event] = []
        self._slot: int | None = None
        self._published: dict[str, SourceValidity] = {}

    def accepts(self, device: str, kind: type[Measurement]) -> bool:
        """Whether measurements of this kind of a device are tested."""
        if issubclass(kind, Attitude):
            return device in self._attitudes
        return issubclass(kind, (Position, Velocity)) and device in self._tests

    def check(self, device: str, m: Measurement, t_ns: int) -> Sequence[Measurement]:
        """The measurement with its validity after the tests: the same, invalid, or split with one invalid part."""
        self._newest_ns[device] = max(t_ns, self._newest_ns.get(device, t_ns))
        if isinstance(m, Attitude):
            return self._check_attitude(device, m, t_ns)
        if isinstance(m, Position):
            positions, events = self._tests[device].feed_position(m, t_ns)
            self._events += events
            return positions
        if isinstance(m, Velocity):
            velocities, events = self._tests[device].feed_velocity(m, t_ns)
            self._events += events
            north, east = level_velocity(m) if m.valid and self._tests[device].position.is_valid else (None, None)
            if north is not None and east is not None and math.isfinite(north + east):
                self._velocity = t_ns, north, east
            return velocities
        return [m]

    def _check_attitude(self, device: str, m: Attitude, t_ns: int) -> list[Attitude]:
        self._comparison.feed(device, m, t_ns)
        admission = self._headings[device]
        findings = self._heading_tests[device].feed(t_ns, m, self._velocity) if m.valid else None
        if findings is not None:
            changes = [admission.fail(finding) for finding in findings] or [admission.passes(t_ns)]
            self._events += [describe(t_ns, device, HEADING, admission, change) for change in changes if change]
        if not self._attitudes[device].is_valid:
            return [replace(m, valid=False)]
        if admission.is_valid or m.heading is None:
            return [m]
        heading = Attitude(stamp=m.stamp, heading=m.heading, valid=False)
        return [heading] if m.roll is None and m.pitch is None else [replace(m, heading=None), heading]

    def find_suspects(self) -> frozenset[str]:
        """Sources of position that drift by more than half of the limit, or whose signals are suspicious.

        A silent source is not included for its drift.
        """
        signs = {name for name, test in self._signals.items() if test.is_suspected(self._signs_ns)}
        drifting = {name: tests.newest_ns for name, tests in self._tests.items() if tests.is_suspected}
        current = {name for name, t_ns in drifting.items() if self._signs_ns - (t_ns or 0) <= SOURCE_TIMEOUT_NS}
        return frozenset(signs | current)

    def watches_signals(self, device: str, kind: type[Measurement]) -> bool:
        """Whether C/N0 or clock of a device, which aids the filter, are tested."""
        return device in self._signals and issubclass(kind, (Satellites, ReceiverClock))

    def feed_signals(self, device: str, m: Satellites | ReceiverClock, t_ns: int) -> list[Output | Event]:
        """Compare the signals of a receiver with earlier ones."""
        test, self._signs_ns = self._signals[device], max(self._signs_ns, t_ns)
        sign = test.feed_satellites(t_ns, m) if isinstance(m, Satellites) else test.feed_clock(t_ns, m)
        if sign is None:
            return []
        text = f"suspected for {HOLD_NS // SECOND_NS} s: {sign}; copies of the filter without it are kept"
        return [Event(t_ns=t_ns, level="info", source=device, text=text)]

    def watches_ranges(self, device: str, kind: type[Measurement]) -> bool:
        """Whether raw observations of a device are compared with its position."""
        return device in self._tests and issubclass(kind, (Pseudoranges, Ephemeris))

    def feed_ranges(self, device: str, m: Pseudoranges | Ephemeris, t_ns: int) -> None:
        """Add raw observations or an ephemeris of a receiver."""
        self._tests[device].feed_ranges(m, t_ns)

    def drain_events(self) -> list[Event]:
        """Events since the last call."""
        events, self._events = self._events, []
        return events

    def feed_filter(self, solution: FilterSolution) -> None:
        """Compare attitudes with a filter solution."""
        self._filter_test.feed(solution)

    def readmit(self, device: str, t_ns: int) -> list[Event]:
        """End the contradiction of a source by order of the operator.  Raises KeyError."""
        return self._tests[device].readmit(t_ns)

    def find_unconfirmed(self, device: str) -> UnconfirmedSource | None:
        """The unconfirmed quantities of a source that pass their tests; None: none, or not a source of position."""
        tests = self._tests.get(device)
        return tests.unconfirmed_source if tests and tests.is_unconfirmed else None

    @property
    def contradiction_sizes(self) -> dict[str, float]:
        """Sizes of standing contradictions of positions by source, where known [m]."""
        sizes = {name: tests.position_size for name, tests in self._tests.items()}
        return {name: size for name, size in sizes.items() if size is not None}

    def confirm(self, device: str, t_ns: int) -> list[Event]:
        """An independent source agrees with the position of a device."""
        return self._tests[device].confirm_position(t_ns)

    @property
    def _admissions(self) -> dict[tuple[str, RefusedPart], Admission]:
        """The admission of each part of each source."""
        admissions = {(name, RefusedPart.POSITION): tests.position for name, tests in self._tests.items()}
        admissions |= {(name, RefusedPart.ALTITUDE): tests.altitude for name, tests in self._tests.items()}
        admissions |= {(name, RefusedPart.ATTITUDE): admission for name, admission in self._attitudes.items()}
        return admissions | {(name, RefusedPart.HEADING): admission for name, admission in self._headings.items()}

    @property
    def refusals(self) -> list[CarriedRefusal]:
        """The refusals in force."""
        return [
            CarriedRefusal(name, part, admission.finding.reason, admission.finding.onset_ns, admission.is_standing)
            for (name, part), admission in self._admissions.items()
            if admission.finding
        ]

    def restore(self, refusals: Iterable[CarriedRefusal], t_ns: int) -> list[Event]:
        """Begin with refusals from before the start of this process; those of unknown sources are ignored."""
        events, admissions = [], self._admissions
        for refusal in refusals:
            admission = admissions.get((refusal.source, refusal.part))
            if admission:
                text = "before navigation was started again"
                admission.restore(PlausibilityFinding(refusal.reason, refusal.onset_ns, text, refusal.is_standing))
                events.append(describe_restored(t_ns, refusal.source, refusal.part, admission))
        return events

    # -------------------------------------------------------------------------------------------------------- output

    def tick(self, t_ns: int) -> list[Output | Event]:
        """Compare attitudes and output the validity of each source."""
        self._signs_ns = max(self._signs_ns, t_ns)
        self._compare_attitudes(t_ns)
        out: list[Output | Event] = [*self.drain_events()]
        slot = t_ns // COMPOSE_NS  # absolute periods: counted from ticks, which jitter, they would be longer
        if slot == self._slot:
            return out
        self._slot = slot
        for name in dict.fromkeys((*self._tests, *self._attitudes)):
            validity, last = self._validity(name, t_ns), self._published.get(name)
            if validity is None:
                continue
            is_same = last is not None and replace(last, t_ns=t_ns, t_valid_ns=validity.t_valid_ns) == validity
            if last is None or not is_same or slot - last.t_ns // COMPOSE_NS >= REPEAT_SLOTS:
                self._published[name] = validity
                out.append(validity)
        return out

    def _compare_attitudes(self, t_ns: int) -> None:
        changes = self._comparison.compare(t_ns)
        if changes is None:
            return
        for pair, text, began in changes:
            words = f"attitudes disagree: {text}" if began else f"attitudes of {pair[0]} and {pair[1]} agree again"
            level = "warning" if began else "info"
            self._events.append(Event(t_ns=t_ns, level=level, source="nav", text=words))
        for name in self._comparison.sources:
            admission = self._attitudes[name]
            finding = self._comparison.finding(name) or self._filter_test.finding(name)
            change = admission.fail(finding) if finding else admission.passes(t_ns)
            if change:
                self._events.append(describe(t_ns, name, ATTITUDE, admission, change))

    def _validity(self, name: str, t_ns: int) -> SourceValidity | None:
        tests, attitude = self._tests.get(name), self._attitudes.get(name)
        parts = [(tests.position, tests.altitude) if tests else (None, None), (attitude, self._headings.get(name))]
        tested = [
            part if part and (part.has_passed_once or not part.is_valid) else None for row in parts for part in row
        ]
        known = [part for part in tested if part]
        if not known:
            return None
        reasons = tuple(dict.fromkeys(reason for part in known for reason in part.all_reasons))
        refused = [part.finding for part in known if part.finding]
        newest_ns = self._newest_ns.get(name)  # None for a restored refusal without data yet
        is_stale = newest_ns is None or t_ns - newest_ns > self._max_age_ns[name]
        return SourceValidity(
            t_ns=t_ns,
            t_valid_ns=newest_ns,
            source=name,
            valid=not refused and not is_stale,
            reasons=(*reasons, Reason.STALE) if is_stale else reasons,
            unchecked=() if refused or is_stale else self._unchecked(name, t_ns),
            position_valid=_part_is_valid(tested[0]),
            altitude_valid=_part_is_valid(tested[1], tested[0]),
            attitude_valid=_part_is_valid(tested[2]),
            heading_valid=_part_is_valid(tested[3], tested[2]),
            onset_ns=min((finding.onset_ns for finding in refused), default=None),
            readmission="; ".join(dict.fromkeys(part.readmission_condition for part in known if not part.is_valid)),
        )

    def _unchecked(self, name: str, t_ns: int) -> tuple[Reason, ...]:
        """Unchecked reasons of a valid source: nothing to compare with, or a disagreeing attitude."""
        reasons = (Reason.ATTITUDES_DISAGREE,) if self._comparison.disputes_of(name) else ()
        if name not in self._tests or self._has_filter:
            return reasons
        times = (tests.newest_ns for other, tests in self._tests.items() if other != name)
        is_alone = not any(newest is not None and t_ns - newest <= SOURCE_TIMEOUT_NS for newest in times)
        return (*reasons, Reason.NOTHING_TO_COMPARE) if is_alone else reasons


def _part_is_valid(part: Admission | None, *also: Admission | None) -> bool | None:
    """Whether a part and those it depends on are valid; None where it is not given."""
    return None if part is None else part.is_valid and all(one is None or one.is_valid for one in also)


def _make_tests(device: Device, config: Config) -> SourceTests:
    unstated = config.nav.unstated_sd
    pair = unstated.inertial if device.name in config.nav.attitude else unstated.satellites
    return SourceTests(device, config.nav.limits, UnstatedSigmas(*pair))
