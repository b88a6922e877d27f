"""All tests of one source; returns its measurements, invalid where a test has refused their quantity.

Position and altitude are refused separately, but a refused position makes the altitude of the device invalid, too:
findings of latitude, longitude, horizontal velocity and time refuse the position; findings of height, vertical velocity
and undulation refuse the altitude.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from msgspec.structs import replace

from fti.config import Device, SourceLimits
from fti.constants import SECOND_NS
from fti.geodesy.formulas import metres_per_radian
from fti.messages.measurements import Ephemeris, Position, Pseudoranges, Stamp, TimeScale, Velocity
from fti.messages.outputs import Event
from fti.nav.plausibility.admission import Admission, AdmissionChange
from fti.nav.plausibility.axis import AxisFix, AxisTests
from fti.nav.plausibility.device_time import DeviceTimeTest
from fti.nav.plausibility.events import describe
from fti.nav.plausibility.finding import PlausibilityFinding
from fti.nav.plausibility.motion import MotionTest
from fti.nav.plausibility.range_test import RangeTest, StatedFix
from fti.nav.plausibility.resolution import ResolutionEstimator
from fti.nav.plausibility.sigmas import (
    ARRIVAL_SD_S,
    CLOCK_SD_S,
    MAX_SIGMA,
    MIN_HORIZONTAL_M,
    MIN_VELOCITY,
    MIN_VERTICAL_M,
    UNSTATED_VELOCITY,
    FixSigma,
)
from fti.nav.plausibility.undulation import UndulationTest
from fti.nav.plausibility.velocity_integral import MIN_STEP_NS
from fti.nav.source_interpolation import MAX_PART_VALUES, ellipsoidal_height, level_velocity

#: Maximum time between ground speed and track of different messages for a velocity [ns].
MAX_PAIRING_NS = SECOND_NS // 2
#: Maximum age of a velocity that moves a fix [ns].
MAX_VELOCITY_AGE_NS = 2 * SECOND_NS
#: Maximum latitude for tests of the longitude [rad].
MAX_LAT = math.radians(89.0)
#: Fields and their limits.
POSITION_LIMITS = [(name, MAX_PART_VALUES[name]) for name in ("lat", "lon", "alt")]
VELOCITY_LIMITS = [(name, MAX_PART_VALUES[name]) for name in ("north", "east", "down", "ground_speed", "track")]
POSITION, ALTITUDE = "position", "altitude"
Findings = list[PlausibilityFinding]
#: Reference of a height; a device may alternate between both (MAVLink does).
ELLIPSOID, SEA = "ellipsoid", "sea"


class UnconfirmedSource(NamedTuple):
    """A source whose contradiction persists while its tests pass again.

    quantities : position, height, velocity, unless refused otherwise;  readmission : condition that would end it
    """

    quantities: tuple[str, ...]
    readmission: str


@dataclass(frozen=True, slots=True)
class UnstatedSigmas:
    """Sigma of a position that states none [m]."""

    horizontal: float
    vertical: float


class SourceTests:
    """One device.  newest_ns : time of its newest position"""

    def __init__(self, device: Device, limits: SourceLimits, unstated: UnstatedSigmas) -> None:
        self.name = device.name
        self.position, self.altitude = Admission(may_be_confirmed=True), Admission()
        self.newest_ns: int | None = None
        self._latency_ns = round(device.latency_ms * 1e6)
        self._arm = math.hypot(*device.lever_arm_b)
        self._unstated = unstated
        self._north = AxisTests("north", limits, limits.speed_mps, is_angle=False)
        self._east = AxisTests("east", limits, limits.speed_mps, is_angle=True)
        self._ups = {kind: AxisTests("up", limits, limits.climb_mps, is_angle=False) for kind in (ELLIPSOID, SEA)}
        self._motion = MotionTest(limits)
        self._undulation = UndulationTest(limits.undulation_m)
        self._ranges = RangeTest(limits.speed_mps)
        self._velocity: tuple[int, float, float] | None = None
        self._times: dict[TimeScale, DeviceTimeTest] = {}
        self._lat: float | None = None
        self._alt = 0.0
        self._time_sd = ARRIVAL_SD_S
        self._velocity_sd = UNSTATED_VELOCITY
        self._velocity_ns: int | None = None
        self._polar: dict[str, tuple[int, float]] = {}
        self._polar_step = {"ground_speed": ResolutionEstimator(), "track": ResolutionEstimator()}

    # ------------------------------------------------------------------------------------------------------- taking

    def feed_position(self, m: Position, t_ns: int) -> tuple[list[Position], list[Event]]:
        """Test a position valid at t_ns."""
        events = self._test_time(m.stamp)
        if m.valid and _is_conceivable(m, POSITION_LIMITS):
            if m.lat is not None:
                self.newest_ns = t_ns
            if self._is_due(m, t_ns):
                events += self._test_ranges(m, t_ns) + self._test_position(m, t_ns)
        return self._admit_position(m), events

    def feed_ranges(self, m: Pseudoranges | Ephemeris, t_ns: int) -> None:
        """Add raw observations, or an ephemeris; the next position is compared with them."""
        if isinstance(m, Ephemeris):
            self._ranges.feed_ephemeris(t_ns, m)
        else:
            self._ranges.feed_ranges(t_ns, m)

    def _is_due(self, m: Position, t_ns: int) -> bool:
        """Whether any axis evaluates a fix of this time: frequent fixes are skipped."""
        height, kind = _height_of(m)
        return (
            (m.lat is not None and self._north.is_due(t_ns, m.lat))
            or (m.lon is not None and self._east.is_due(t_ns, m.lon))
            or (height is not None and self._ups[kind].is_due(t_ns, height))
        )

    def feed_velocity(self, m: Velocity, t_ns: int) -> tuple[list[Velocity], list[Event]]:
        """Test a velocity valid at t_ns."""
        events = self._test_time(m.stamp)
        is_next = m.north is None or self._velocity_ns is None or t_ns - self._velocity_ns >= MIN_STEP_NS
        if is_next and m.valid and _is_conceivable(m, VELOCITY_LIMITS):
            self._velocity_ns = t_ns if m.north is not None else self._velocity_ns
            events += self._test_velocity(m, t_ns)
        return self._admit_velocity(m), events

    def readmit(self, t_ns: int) -> list[Event]:
        """End the contradiction by order of the operator."""
        if self._ranges.release():
            text = "findings of its pseudoranges are dismissed"
            released = [Event(t_ns=t_ns, level="info", source=self.name, text=text)]
            return released + (self.readmit(t_ns) if self.is_unconfirmed else [])
        if not self.is_unconfirmed:
            text = "nothing to readmit: it has no contradiction"
            return [Event(t_ns=t_ns, level="info", source=self.name, text=text)]
        for axis in (self._north, self._east, *self._ups.values()):
            axis.readmit()
        return self._close(t_ns, POSITION, self.position) + self._close(t_ns, ALTITUDE, self.altitude)

    @property
    def position_size(self) -> float | None:
        """Horizontal size of the standing contradiction of the position [m]; None: none, or unknown."""
        if not self.position.is_standing or self.position.is_restored:
            return None
        sizes = [axis.contradiction.size for axis in (self._north, self._east) if axis.contradiction]
        known = [size for size in sizes if size is not None]
        return math.hypot(*known) if known and len(known) == len(sizes) else None

    def confirm_position(self, t_ns: int) -> list[Event]:
        """End the contradiction of the position: an independent source agrees with it."""
        if not self.position.is_standing:
            return []
        for axis in (self._north, self._east):
            axis.readmit()
        return self._close(t_ns, POSITION, self.position)

    @property
    def is_unconfirmed(self) -> bool:
        """Whether a contradiction persists."""
        return self.position.is_standing or self.altitude.is_standing

    @property
    def unconfirmed_source(self) -> UnconfirmedSource | None:
        """Its unconfirmed quantities that have passed their tests for 30 s; None: none."""
        if self.position.is_unconfirmed:
            is_high = self.altitude.is_valid or self.altitude.is_unconfirmed
            return UnconfirmedSource(
                ("position", "velocity", "height")[: 2 + is_high], self.position.readmission_condition
            )
        if self.position.is_valid and self.altitude.is_unconfirmed:
            return UnconfirmedSource(("height",), self.altitude.readmission_condition)
        return None

    @property
    def is_suspected(self) -> bool:
        """Whether its position drifts against its velocity by more than half of the limit."""
        return self._north.is_suspected or self._east.is_suspected

    # ------------------------------------------------------------------------------------------------------- testing

    def _test_time(self, stamp: Stamp) -> list[Event]:
        if stamp.t_dev_ns is None or stamp.time_scale is None:
            return []
        test = self._times.get(stamp.time_scale)
        if test is None:
            test = self._times[stamp.time_scale] = DeviceTimeTest(stamp.time_scale)
        return self._fail(stamp.t_rx_ns, POSITION, self.position, test.update(stamp))

    def _test_position(self, m: Position, t_ns: int) -> list[Event]:
        by_clock = m.stamp.t_dev_ns is not None and t_ns != m.stamp.t_rx_ns - self._latency_ns
        time_sd, self._time_sd = self._time_sd, CLOCK_SD_S if by_clock else ARRIVAL_SD_S
        time_sd = max(time_sd, self._time_sd)
        self._lat = m.lat if m.lat is not None else self._lat
        if self._lat is None:
            return []
        return self._test_level(m, t_ns, time_sd) + self._test_altitude(m, t_ns, time_sd)

    def _test_ranges(self, m: Position, t_ns: int) -> list[Event]:
        if m.lat is None or m.lon is None or not self._ranges.is_useful:
            return []
        known = self._velocity if self._velocity and abs(t_ns - self._velocity[0]) <= MAX_VELOCITY_AGE_NS else None
        sd = _bounded_sigma(m.horizontal_sd, self._unstated.horizontal, MIN_HORIZONTAL_M)
        fix = StatedFix(t_ns, m.stamp, m.lat, m.lon, sd, known[1:] if known else None)
        return self._fail(t_ns, POSITION, self.position, self._ranges.feed_fix(fix))

    def _test_level(self, m: Position, t_ns: int, time_sd: float) -> list[Event]:
        assert self._lat is not None
        metres = metres_per_radian(self._lat, self._alt)
        sd = _bounded_sigma(m.horizontal_sd, self._unstated.horizontal, MIN_HORIZONTAL_M)
        is_polar = abs(self._lat) > MAX_LAT
        if is_polar:
            self._east.invalidate()
        events: list[Event] = []
        for axis, value, unit in ((self._north, m.lat, metres[0]), (self._east, m.lon, metres[1])):
            if value is not None and not (is_polar and axis is self._east):
                findings = axis.feed_fix(AxisFix(t_ns, value, unit, self._sigma(sd, axis, time_sd)))
                events += self._conclude(t_ns, POSITION, self.position, axis, findings)
        return events

    def _test_altitude(self, m: Position, t_ns: int, time_sd: float) -> list[Event]:
        value, kind = _height_of(m)
        if value is None or not math.isfinite(value) or abs(value) > MAX_PART_VALUES["alt"]:
            return []
        self._alt, up = value, self._ups[kind]
        sd = _bounded_sigma(m.vertical_sd, self._unstated.vertical, MIN_VERTICAL_M)
        findings = up.feed_fix(AxisFix(t_ns, value, 1.0, self._sigma(sd, up, time_sd)))
        undulation = self._undulation.update(t_ns, m)
        if undulation:
            findings = [*(findings or ()), *undulation]
        return self._conclude(t_ns, ALTITUDE, self.altitude, up, findings)

    def _sigma(self, sd: float, axis: AxisTests, time_sd: float) -> FixSigma:
        step = 0.0 if axis.name == "up" else self._polar_resolution()
        return FixSigma(sd, self._velocity_sd, time_sd, 0.0, max(step, axis.velocity.step), self._arm)

    def _polar_resolution(self) -> float:
        """Resolution of a velocity that is stated as ground speed and track [m/s]."""
        speed = self._polar.get("ground_speed")
        if speed is None:
            return 0.0
        steps = self._polar_step
        return math.hypot(steps["ground_speed"].step or 0.0, speed[1] * (steps["track"].step or 0.0))

    def _test_velocity(self, m: Velocity, t_ns: int) -> list[Event]:
        self._velocity_sd = _bounded_sigma(m.sd, UNSTATED_VELOCITY, MIN_VELOCITY)
        events: list[Event] = []
        north, east = self._level_velocity(m, t_ns)
        if north is not None and east is not None:
            self._velocity = t_ns, north, east
            events += self._fail(
                t_ns, POSITION, self.position, self._motion.update_level(t_ns, north, east, self._velocity_sd)
            )
            for axis, speed in ((self._north, north), (self._east, east)):
                findings = axis.feed_velocity(t_ns, speed)
                events += self._conclude(t_ns, POSITION, self.position, axis, findings)
        if m.down is not None:
            vertical = self._motion.update_vertical(t_ns, m.down, self._velocity_sd)
            events += self._fail(t_ns, ALTITUDE, self.altitude, vertical)
            for up in self._ups.values():
                events += self._conclude(t_ns, ALTITUDE, self.altitude, up, up.feed_velocity(t_ns, -m.down))
        return events

    def _level_velocity(self, m: Velocity, t_ns: int) -> tuple[float | None, float | None]:
        for name in ("ground_speed", "track"):
            value = getattr(m, name)
            if value is not None:
                self._polar[name] = t_ns, value
                self._polar_step[name].update(value)
        north, east = level_velocity(m)
        if (north is None or east is None) and len(self._polar) == 2:
            (speed_ns, speed), (track_ns, track) = self._polar["ground_speed"], self._polar["track"]
            if max(speed_ns, track_ns) == t_ns and abs(speed_ns - track_ns) <= MAX_PAIRING_NS:
                return speed * math.cos(track), speed * math.sin(track)
        return north, east

    # ----------------------------------------------------------------------------------------------------- concluding

    def _conclude(
        self, t_ns: int, quantity: str, admission: Admission, axis: AxisTests, findings: Findings | None
    ) -> list[Event]:
        """Apply findings of one axis; None: nothing was evaluated."""
        if findings is None:
            return []
        events = self._fail(t_ns, quantity, admission, findings)
        if axis.is_closed and not self._has_contradiction(quantity):
            axis.is_closed = False
            admission.reset_passed()
            if not admission.is_restored:  # the step does not cancel a restored contradiction
                events += self._close(t_ns, quantity, admission)
        if not findings and axis is not self._east:  # one pass a fix
            events += self._report(t_ns, quantity, admission, admission.passes(t_ns))
        return events

    def _has_contradiction(self, quantity: str) -> bool:
        return any(axis.contradiction for axis in self._axes(quantity))

    def _axes(self, quantity: str) -> tuple[AxisTests, ...]:
        return tuple(self._ups.values()) if quantity == ALTITUDE else (self._north, self._east)

    def _fail(
        self, t_ns: int, quantity: str, admission: Admission, findings: Iterable[PlausibilityFinding]
    ) -> list[Event]:
        events: list[Event] = []
        for finding in findings:
            events += self._report(t_ns, quantity, admission, admission.fail(finding))
            if not admission.is_standing:
                for axis in self._axes(quantity):
                    axis.contradiction = None
        return events

    def _close(self, t_ns: int, quantity: str, admission: Admission) -> list[Event]:
        return self._report(t_ns, quantity, admission, admission.close())

    def _report(self, t_ns: int, quantity: str, admission: Admission, change: AdmissionChange | None) -> list[Event]:
        return [describe(t_ns, self.name, quantity, admission, change)] if change else []

    # ------------------------------------------------------------------------------------------------------ admitting

    def _admit_position(self, m: Position) -> list[Position]:
        if not self.position.is_valid:
            return [replace(m, valid=False)]
        if self.altitude.is_valid or (m.alt is None and m.alt_msl is None):
            return [m]
        height = replace(m, lat=None, lon=None, valid=False)
        return [height] if m.lat is None and m.lon is None else [replace(m, alt=None, alt_msl=None), height]

    def _admit_velocity(self, m: Velocity) -> list[Velocity]:
        if not self.position.is_valid:
            return [replace(m, valid=False)]
        if self.altitude.is_valid or m.down is None:
            return [m]
        vertical = Velocity(stamp=m.stamp, down=m.down, valid=False)
        level = replace(m, down=None)
        is_level = any(value is not None for value in (m.north, m.east, m.ground_speed, m.track))
        return [level, vertical] if is_level else [vertical]


def _height_of(m: Position) -> tuple[float | None, str]:
    """Height above the ellipsoid, else above the sea [m], and its kind; only heights of one kind are compared."""
    alt = ellipsoidal_height(m)
    return (alt, ELLIPSOID) if alt is not None else (m.alt_msl, SEA)


def _bounded_sigma(stated: float | None, unstated: float, floor: float) -> float:
    """A positive stated sigma, at least the floor; else the default.  Its square is finite."""
    if stated is None or not 0.0 < stated < math.inf:
        return max(unstated, floor)
    return min(max(stated, floor), MAX_SIGMA)


def _is_conceivable(m: Position | Velocity, limits: Iterable[tuple[str, float]]) -> bool:
    """Whether all numbers are plausible for an aircraft."""
    for name, limit in limits:
        value = getattr(m, name)
        if value is not None and not abs(value) <= limit:
            return False
    return True
