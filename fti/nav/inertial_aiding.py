"""Live aided inertial navigation: the error-state filter and the vertical channel, with measurements of devices.

Both use the inertial samples of one device.  The filter is aided by GNSS, pressure altitude, altimeters over known
ground, airspeed, magnetic heading and drifts over the ground, and replaces devices that no longer give position,
altitude or attitude.  The vertical channel gives the altitude if the filter does not, either.  Heights of altimeters
are used once a second, because consecutive samples are from the same ground.  Stated sigmas of positions and of the
ground are mostly slow errors: they scale the slow state, so that many fixes do not average out a common error.  A
velocity every dt has the variance sigma^2 2 T / dt.  Configured by ``[nav.filter]``; without it nothing runs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

from msgspec import structs

from fti.config import Device, Filter, ScanDriftTable
from fti.constants import SECOND_NS
from fti.geodesy.formulas import Vector, down_row
from fti.messages.measurements import (
    Airspeed,
    Attitude,
    ImuSample,
    MagneticField,
    Measurement,
    Position,
    PressureAltitude,
    Velocity,
)
from fti.messages.outputs import Event, FilterSolution, HeightAboveGround, ProvisionalSolution, VerticalSolution
from fti.messages.reasons import Reason
from fti.messages.refusals import CarriedRefusal
from fti.nav.altimetry.nadir_height import altitude_over_terrain
from fti.nav.altitude_hold import HOLD_NS, HoldMonitor
from fti.nav.confirmation import Confirmation, Size
from fti.nav.dead_reckoning_aids import DeadReckoningAids
from fti.nav.exclusion_events import ExclusionEvents, altitude_name, own_states
from fti.nav.filter.aiding import BaroAltitude, GnssPosition, GnssVelocity, TerrainAltitude
from fti.nav.filter.delayed_measurements import HORIZON_NS
from fti.nav.filter.error_states import (
    AIRSPEED_DRIFTS,
    ALTIMETER_BIAS,
    ALTIMETER_SCALE,
    BARO_DRIFT,
    BARO_SCALE_DRIFT,
    DEM_DRIFT,
    GNSS_DRIFTS,
    HEADING_DRIFTS,
    Drift,
    Extra,
    FilterModel,
    outage_model,
    own_drifts,
    receiver_drifts,
)
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.innovation_gate import GateStates
from fti.nav.filter.look_mark import LookDrift, LookMark, SensorReset, look_drifts
from fti.nav.filter.navigator import InertialNavigator, is_known
from fti.nav.filter.position_mark import MarkedPosition, PositionMark, mark_drifts
from fti.nav.inertial.ins_error_model import IMU_ERROR_MODELS
from fti.nav.navigation import NavState
from fti.nav.plausibility.source import UnconfirmedSource
from fti.nav.protection import FilterReference
from fti.nav.separation.copies import Separation
from fti.nav.separation.fault_detection import FaultDetection
from fti.nav.separation.provisional import make_solution
from fti.nav.source_interpolation import (
    MAX_PART_VALUES,
    AttitudeState,
    PositionState,
    ellipsoidal_height,
    level_velocity,
)
from fti.nav.terrain_reference import Ground
from fti.nav.time_series import Series
from fti.nav.vertical.inertial_height import HorizontalMotion
from fti.nav.vertical.vertical_channel import HeightAiding, VerticalChannel, VerticalState

#: Sigmas if none is stated: position, height [m], velocity [m/s], pressure altitude [m].
POSITION_SD, HEIGHT_SD, VELOCITY_SD, BARO_SD = 3.0, 5.0, 0.1, 1.0
#: Sigma of a climb that is the slope of positions [m/s].
CLIMB_SD = 0.5
#: Sigma of a climb over the stated sigma of a velocity, which is the root mean square of three axes.  Positions have
#: 95 % errors of 8 m horizontally and 13 m vertically (GPS SPS Performance Standard, 5th edition, table 3.8-3): one
#: sigma of 3.27 m on each horizontal axis and 6.63 m vertically.  Range rates have the same geometry.
CLIMB_FACTOR = 1.42
#: Correlation time of errors of a receiver's velocity [s].
VELOCITY_TAU_S = 5.0
#: Limit of plausible altitude, speed and sigma in SI units.
MAX_VALUE = 1e6
CHECKED_FIELDS = (
    "alt", "alt_msl", "alt_press", "north", "east", "down", "ground_speed", "sd", "horizontal_sd", "vertical_sd", "tas"
)  # fmt: skip
#: Maximum time between a climb and a height of a receiver that belong together [ns].
CLIMB_NS = 500_000_000
#: A barometer that is silent for so long is replaced by the next one [ns].
BARO_NS = 2_000_000_000
#: Period of heights of one altimeter that aid [ns].
HEIGHT_NS = 1_000_000_000
#: Satellites that were accepted within so long verify the map [ns].
SATELLITES_NS = 10_000_000_000
#: Looks at the ground that are states: those of one pair.
LOOKS = 2


class AidedNavigation:
    """Filter and vertical channel.

    settings : which devices feed them; devices : all, by name
    map_sd   : horizontal sigma of the elevation if positions from the ground aid [m]; None: they do not
    looks    : settings of the drift between looks at the ground if it aids
    """

    def __init__(
        self,
        settings: Filter,
        devices: dict[str, Device],
        map_sd: float | None = None,
        looks: ScanDriftTable | None = None,
    ) -> None:
        self._settings = settings
        self._arms = {name: device.lever_arm_b for name, device in devices.items()}
        exposure_ns = round(looks.exposure_s * SECOND_NS) if looks else 0  # a look is placed after its last point
        self._navigator = InertialNavigator(_model(settings, map_sd, looks), HORIZON_NS + exposure_ns)
        self._exclusions = ExclusionEvents(self._navigator, settings.altimeters)
        self._faults = FaultDetection(self._navigator, settings)
        self._dead_reckoning = DeadReckoningAids(settings)
        self._vertical = VerticalChannel()
        self._filter_hold, self._vertical_hold = HoldMonitor(), HoldMonitor()
        self._sensor_of = {altitude_name(sensor): sensor for sensor in settings.altimeters}
        self._gate_states: GateStates = {}
        self._heights_ns: tuple[int | None, dict[str, int]] = (None, {})  # of others and of altimeters, by these states
        self._ground: Ground | None = None
        self._motion: HorizontalMotion | None = None
        self._tilt: tuple[float, float] | None = None
        self._alts = {name: Series() for name in settings.gnss}
        self._used_ns: dict[str, int] = {}
        self._velocity_ns: dict[str, int] = {}
        self._unconfirmed_ns: dict[str, int] = {}  # of velocities that aid provisional filters only
        self._pressure_ns: dict[str, int] = {}
        self._barometer: str | None = None
        self._climbs: dict[str, tuple[int, float | None, float | None]] = {}
        self._last_altimeter: str | None = None
        self._is_ground_contradicting = False
        self._solution: FilterSolution | None = None  # valid until the next input of the filter

    def set_terrain(self, ground: Ground | None) -> None:
        """Set the ground; heights of altimeters above it aid."""
        self._ground = ground

    # ----------------------------------------------------------------------------------------------------------- inputs

    def set_nav_state(self, nav: NavState) -> None:
        """Set position and attitude for the inertial samples until the next tick.

        Without a new position the last one is kept: gravity hardly changes with it.  An attitude that is 20 ms old has
        an error of 0.4 deg at 20 deg/s, which cancels when the turn ends.
        """
        self._tilt = (nav.attitude.roll, nav.attitude.pitch) if nav.attitude else None
        if nav.position and _is_conceivable(nav.position):
            self._motion = HorizontalMotion(nav.position.lat, nav.position.north or 0.0, nav.position.east or 0.0)
        self._update_holds(nav.t_ns)

    def _update_holds(self, t_ns: int) -> None:
        """Update which altimeters alone bound the altitudes of the filter and of the vertical channel."""
        states = self._navigator.gate_states
        if states is not self._gate_states:
            bounding = {name: s.accepted_ns for name, s in states.items() if "vertical" in s.bounds}
            accepted = {name: t for name, t in bounding.items() if t is not None}
            own_ns = {sensor: accepted.pop(name) for name, sensor in self._sensor_of.items() if name in accepted}
            self._gate_states, self._heights_ns = states, (max(accepted.values(), default=None), own_ns)
        self._filter_hold.update(t_ns, *self._heights_ns)
        last_accepted_ns = self._vertical.last_accepted_ns(HeightAiding.ALTIMETER)
        is_aided = last_accepted_ns is not None and t_ns - last_accepted_ns <= HOLD_NS
        last_satellites_ns = self._vertical.last_accepted_ns(HeightAiding.SATELLITES)
        self._vertical_hold.update(t_ns, last_satellites_ns, self._used_ns if is_aided else {})

    def accepts(self, device: str, kind: type[Measurement]) -> bool:
        """Whether measurements of this kind of a device are used here."""
        settings = self._settings
        fed = {
            ImuSample: (settings.imu,),
            Velocity: settings.gnss,
            Position: settings.gnss,
            PressureAltitude: settings.baro,
            Airspeed: (settings.airspeed,),
            MagneticField: (settings.heading,),
        }
        return issubclass(kind, Attitude) or any(issubclass(kind, of) and device in by for of, by in fed.items())

    def feed(self, device: str, m: Measurement, t_ns: int) -> None:
        """Take a measurement that is valid at t_ns."""
        settings = self._settings
        self._solution = None
        if isinstance(m, ImuSample) and device == settings.imu:
            self._feed_imu(m, t_ns)
        elif isinstance(m, Attitude) and m.valid and m.roll is not None and m.pitch is not None:
            if abs(m.roll) <= MAX_PART_VALUES["roll"] and abs(m.pitch) <= MAX_PART_VALUES["pitch"]:
                self._navigator.feed_attitude(t_ns, m.roll, m.pitch, m.heading)
        elif not _is_conceivable(m) or (device in self.refused and not self._navigator.is_aligned):
            return  # the filter does not start with a receiver that contradicted it
        elif device in settings.gnss and isinstance(m, Velocity) and m.valid:
            self._feed_velocity(device, m, t_ns)
        elif device in settings.gnss and isinstance(m, Position) and m.valid:
            self._feed_position(device, m, t_ns)
        elif device in settings.baro and isinstance(m, PressureAltitude) and m.valid:
            self._feed_pressure(device, m.alt_press, t_ns)
        elif (aiding := self._dead_reckoning.make(device, m, t_ns)) is not None:
            self._navigator.feed_aiding(t_ns, aiding)

    def feed_unconfirmed(self, device: str, m: Measurement, unconfirmed: UnconfirmedSource, t_ns: int) -> None:
        """Take a measurement of an unconfirmed receiver, valid at t_ns: it aids a provisional filter only."""
        if device not in self._settings.gnss or not _is_conceivable(m):
            return
        aiding: GnssPosition | GnssVelocity | None = None
        if isinstance(m, Position) and m.valid:
            aiding = self._position_aiding(device, m)
        elif isinstance(m, Velocity) and m.valid:
            m = m if "height" in unconfirmed.quantities else structs.replace(m, down=None)
            aiding = self._velocity_aiding(device, m, self._correlation_factor(self._unconfirmed_ns, device, t_ns))
        if aiding is not None and is_known(aiding):
            parts = aiding.split() if isinstance(aiding, GnssPosition) else (aiding,)
            self._faults.feed_unconfirmed(device, unconfirmed, t_ns, parts)

    def _feed_pressure(self, device: str, alt: float, t_ns: int) -> None:
        """One barometer aids: the first one of the list that is not silent; each has an offset of its own."""
        self._pressure_ns[device] = t_ns
        preferred = self._settings.baro[: self._settings.baro.index(device)]
        if any(t_ns - self._pressure_ns[name] <= BARO_NS for name in preferred if name in self._pressure_ns):
            return
        is_new_source, self._barometer = self._barometer not in (None, device), device
        self._navigator.feed_aiding(t_ns, BaroAltitude(alt, BARO_SD, altitude_name(device), is_new_source))

    def _feed_imu(self, m: ImuSample, t_ns: int) -> None:
        if m.accel_b is None or m.gyro_b is None:
            return
        self._navigator.feed_inertial(t_ns, m.accel_b, m.gyro_b)
        if self._tilt and self._motion:
            self._vertical.feed_imu(t_ns, m.accel_b, *self._tilt, self._motion)

    def _feed_velocity(self, device: str, m: Velocity, t_ns: int) -> None:
        climb_sd = None if m.sd is None else CLIMB_FACTOR * m.sd
        self._climbs[device] = t_ns, -m.down if m.down is not None else None, climb_sd
        if None in level_velocity(m):
            return
        if m.down is None and not self._navigator.reaches(t_ns):  # the alignment needs a climb, at least from positions
            climb, sd = self._alts[device].slope(t_ns), VELOCITY_SD if m.sd is None else m.sd
            m = structs.replace(m, down=None if climb is None else -climb, sd=max(sd, CLIMB_SD))
        aiding = self._velocity_aiding(device, m, self._correlation_factor(self._velocity_ns, device, t_ns))
        if aiding is not None:
            self._navigator.feed_aiding(t_ns, aiding)

    def _velocity_aiding(self, device: str, m: Velocity, factor: float) -> GnssVelocity | None:
        """None if it has no horizontal velocity.  factor : of its sigma"""
        north, east = level_velocity(m)
        if north is None or east is None:
            return None
        sd = factor * (VELOCITY_SD if m.sd is None else m.sd)
        return GnssVelocity(north, east, m.down, sd, self._arms[device], name=f"{device}.velocity")

    @staticmethod
    def _correlation_factor(velocity_ns: dict[str, int], device: str, t_ns: int) -> float:
        """Factor of the sigma of a velocity, whose error is correlated with the last one's."""
        last = velocity_ns.get(device)
        velocity_ns[device] = t_ns
        interval_s = (t_ns - last) / SECOND_NS if last is not None and t_ns > last else 1.0
        return math.sqrt(max(1.0, 2.0 * VELOCITY_TAU_S / interval_s))

    def _feed_position(self, device: str, m: Position, t_ns: int) -> None:
        aiding = self._position_aiding(device, m)
        if aiding is None:
            return
        refuses_height = device in self.refused_heights
        if refuses_height and not self._navigator.is_aligned:
            aiding = replace(aiding, alt=None)  # the filter does not start with a height that contradicted it
        self._navigator.feed_aiding(t_ns, aiding)
        if aiding.alt is not None and not refuses_height:
            self._alts[device].push(t_ns, aiding.alt)
            alt = aiding.alt + self._antenna_below(aiding.lever_arm_b)
            self._vertical.feed_satellites(t_ns, alt, aiding.vertical_sd, *self._climb_at(device, t_ns))

    def _position_aiding(self, device: str, m: Position) -> GnssPosition | None:
        """None if it has no horizontal position."""
        if m.lat is None or m.lon is None:
            return None
        horizontal = POSITION_SD if m.horizontal_sd is None else m.horizontal_sd
        vertical = HEIGHT_SD if m.vertical_sd is None else m.vertical_sd
        north, down = GNSS_DRIFTS[Extra.GNSS_NORTH], GNSS_DRIFTS[Extra.GNSS_DOWN]
        slow, sds = (_drift_factor(horizontal, north), _drift_factor(vertical, down)), (horizontal, vertical)
        own = own_drifts(device) if len(self._settings.gnss) > 1 else ()
        return GnssPosition(
            m.lat, m.lon, ellipsoidal_height(m), *sds, self._arms[device], f"{device}.position", slow, own
        )  # fmt: skip

    def _antenna_below(self, arm: Vector) -> float:
        """Distance of the antenna below P [m], with the present attitude."""
        row = down_row(*self._tilt) if self._tilt else (0.0, 0.0, 1.0)
        return row[0] * arm[0] + row[1] * arm[1] + row[2] * arm[2]

    def _climb_at(self, device: str, t_ns: int) -> tuple[float | None, float | None]:
        """Climb of a receiver and its sigma for a height at t_ns; None if it is too old."""
        climb_ns, climb, sd = self._climbs.get(device, (t_ns, None, None))
        return (climb, sd) if abs(t_ns - climb_ns) <= CLIMB_NS else (None, None)

    def feed_height(self, height: HeightAboveGround, nav: NavState) -> bool:
        """A valid height of an altimeter over known ground; the ground is that below the position of its time.

        Returns whether it aids the altitude.
        """
        if not self._is_due(height) or height.t_valid_ns is None:
            return False
        known = altitude_over_terrain(height, self._ground, nav.position)
        if known is None or self._ground is None:
            return False
        self._solution = None
        t_ns, height_agl, sd = height.t_valid_ns, known.height_agl, known.height_sd
        self._used_ns[height.sensor], self._last_altimeter = t_ns, height.sensor
        if not self._exclusions.is_excluded(height.sensor):
            self._vertical.feed_height(t_ns, height_agl, sd, known.ground, known.ground_sd)
        slow = _drift_factor(known.ground_sd, DEM_DRIFT)  # position errors last long, too
        name, own = altitude_name(height.sensor), own_states(height.sensor)
        altitude = TerrainAltitude(height_agl + known.ground, sd or self._ground.sd, height_agl, name, slow, *own)
        self._navigator.feed_aiding(t_ns, altitude)
        return True

    def _is_due(self, height: HeightAboveGround) -> bool:
        last = self._used_ns.get(height.sensor)
        if not height.valid or height.t_valid_ns is None or height.sensor not in self._settings.altimeters:
            return False
        return last is None or abs(height.t_valid_ns - last) >= HEIGHT_NS

    def feed_terrain_fix(self, t_ns: int, aiding: PositionMark | MarkedPosition) -> None:
        """A mark of the position, or a position from the ground at a mark (``fti.nav.terrain_positioning``)."""
        self._solution = None
        self._navigator.feed_aiding(t_ns, aiding)

    def feed_look(self, t_ns: int, aiding: LookMark | LookDrift | SensorReset) -> None:
        """A mark of a look at the ground, a drift between two looks, or a reset (``fti.nav.ground_drift``)."""
        self._solution = None
        self._navigator.feed_aiding(t_ns, aiding)

    # ---------------------------------------------------------------------------------------------------------- outputs

    @property
    def newest_ns(self) -> int | None:
        """Time of the newest inertial sample; None before the first one."""
        return self._navigator.newest_ns

    def estimate(self, t_ns: int) -> Estimate | None:
        """State and covariance of the filter; None while it is not aligned, and where it does not reach."""
        return self._navigator.at(t_ns) if self._navigator.is_aligned else None

    def path(self, times_ns: Sequence[int]) -> list[Estimate] | None:
        """Estimates at ascending times, from the first one on by the inertial samples alone; None as ``estimate``."""
        return self._navigator.path(times_ns) if self._navigator.is_aligned else None

    def is_accepted(self, name: str, t_ns: int) -> bool | None:
        """Whether the filter has accepted a measurement of a source at t_ns; None before the next inertial sample."""
        newest_ns = self._navigator.newest_ns
        if newest_ns is None or newest_ns <= t_ns:
            return None
        return (self._last_accepted_ns(name) or 0) >= t_ns

    def has_satellites(self, t_ns: int, within_ns: int = SATELLITES_NS) -> bool:
        """Whether the filter has accepted a position of a receiver within so long."""
        accepted = (self._last_accepted_ns(f"{device}.position") for device in self._settings.gnss)
        return any(accepted_ns is not None and t_ns - accepted_ns <= within_ns for accepted_ns in accepted)

    def _last_accepted_ns(self, name: str) -> int | None:
        state = self._navigator.gate_states.get(name)
        return None if state is None else state.accepted_ns

    def is_excluded(self, altimeter: str) -> bool:
        """Whether the filter excludes an altimeter from aiding."""
        return self._exclusions.is_excluded(altimeter)

    @property
    def filter_holders(self) -> tuple[str, ...]:
        """Altimeters that alone bound the altitude of the filter."""
        return self._filter_hold.altimeters

    @property
    def vertical_holders(self) -> tuple[str, ...]:
        """Altimeters that alone bound the altitude of the vertical channel."""
        return self._vertical_hold.altimeters

    def solution(self, t_ns: int) -> FilterSolution:
        """Solution of the filter; cached, because position, attitude and output need it at the same time."""
        if self._solution is None or self._solution.t_ns != t_ns:
            self._solution = self._with_protection(self._navigator.output(t_ns))
        return self._solution

    def _with_protection(self, solution: FilterSolution) -> FilterSolution:
        levels = self._faults.levels(solution.t_ns) if solution.valid else None
        if levels is None:
            return solution
        reasons = (*solution.reasons, Reason.CONTRADICTION) if self.is_unresolved else solution.reasons
        return structs.replace(solution, hpl=levels.horizontal, vpl=levels.vertical, reasons=reasons)

    def provisional_solutions(self, t_ns: int) -> list[ProvisionalSolution]:
        """Solutions of the filter with each unconfirmed receiver; none while the filter is invalid."""
        running = self._faults.provisional(t_ns)
        solution = self.solution(t_ns) if running else None
        return [make_solution(solution, each) for each in running] if solution is not None and solution.valid else []

    def vertical_solution(self, t_ns: int) -> VerticalSolution:
        """Solution of the vertical channel."""
        state = self._vertical.at(t_ns)
        return VerticalSolution(
            t_ns=t_ns,
            t_valid_ns=t_ns if state.alt is not None else None,
            valid=state.valid,
            reasons=state.reasons,
            alt=state.alt,
            vertical_sd=state.alt_sd,
            vel_down=-state.climb if state.climb is not None else None,
            vel_down_sd=state.climb_sd,
            altimeter=self._last_altimeter,
            rejected=self._vertical.altimeter_refused,
        )

    def set_suspects(self, devices: frozenset[str]) -> None:
        """Set the receivers that tests of one source suspect: their older copies are kept."""
        self._faults.set_suspects(devices)

    def events(self, t_ns: int) -> list[Event]:
        """Run the tests between sources; events of exclusions and readmissions since the last call."""
        self._faults.update(t_ns)
        events = [*self._exclusions.drain_events(t_ns), *self._faults.drain_events()]
        if events:
            self._solution = None
        return events

    @property
    def refused(self) -> frozenset[str]:
        """Receivers that the tests between sources exclude."""
        return frozenset(self._faults.refused)

    @property
    def refused_heights(self) -> frozenset[str]:
        """Receivers whose heights the tests between sources exclude."""
        return self._faults.refused_heights

    @property
    def is_unresolved(self) -> bool:
        """Whether sources contradict each other, and it is unknown which is wrong."""
        return self._faults.is_unresolved or self._is_ground_contradicting

    def set_ground_contradicting(self, is_contradicting: bool) -> None:
        """Set whether positions from the ground contradict the filter."""
        self._is_ground_contradicting = is_contradicting

    @property
    def separations(self) -> dict[str, list[Separation]]:
        """Of the filter from its copies, by class of sources (``fti.nav.separation``), the oldest copy first."""
        return self._faults.separations

    def readmit(self, device: str, t_ns: int) -> None:
        """Readmit a receiver on the operator's command, if it is excluded."""
        self._faults.readmit(device, t_ns)

    @property
    def refusals(self) -> list[CarriedRefusal]:
        """Receivers, and heights of receivers, that do not aid."""
        return self._faults.refusals

    @property
    def contradiction_sizes(self) -> dict[str, Size]:
        """Contradictions of receivers that do not aid, by device."""
        return self._faults.contradiction_sizes

    def confirm(self, confirmation: Confirmation, t_ns: int) -> None:
        """An independent source agrees with a receiver that does not aid."""
        self._solution = None
        self._faults.confirm(confirmation, t_ns)

    def restore(self, refusals: Iterable[CarriedRefusal], t_ns: int) -> None:
        """Start with refusals from before this process."""
        self._faults.restore(refusals, t_ns)

    def filter_reference(self, t_ns: int) -> FilterReference | None:
        """Reference for the comparison of devices; None while the filter has no position."""
        position, output = self.position(t_ns), self.solution(t_ns)
        if position is None or output.hpl is None or output.vpl is None:
            return None
        table = ((Reason.CONTRADICTION, self.is_unresolved), (Reason.REACQUIRED, self._faults.is_reacquired))
        unchecked = tuple(reason for reason, holds in table if holds)
        return FilterReference(
            position, output.hpl, output.vpl, frozenset(self._settings.gnss), self.refused, unchecked
        )

    def position(self, t_ns: int) -> PositionState | None:
        """Position of the filter; None if it is not valid."""
        output = self.solution(t_ns)
        if not output.valid or output.lat is None or output.lon is None:
            return None
        return PositionState(
            output.lat, output.lon, output.alt, output.horizontal_sd, output.vertical_sd,
            output.vel_north, output.vel_east, output.vel_down, t_ns,
        )  # fmt: skip

    def attitude(self, t_ns: int) -> AttitudeState | None:
        """Attitude of the filter; None if it is not valid."""
        output = self.solution(t_ns)
        if not output.valid or output.roll is None or output.pitch is None:
            return None
        tilt_sd = output.tilt_sd
        return AttitudeState(output.roll, output.pitch, output.heading, tilt_sd, tilt_sd, tilt_sd, output.heading_sd)

    def altitude(self, t_ns: int) -> VerticalState | None:
        """State of the vertical channel; None if it is not valid."""
        state = self._vertical.at(t_ns)
        return state if state.valid else None


def _is_conceivable(m: Measurement | PositionState) -> bool:
    """Whether all values are plausible; squares of larger ones could overflow."""
    kind: Any = type(m)
    for name in _checked_fields_of(kind):
        value = getattr(m, name)
        if value is not None and not abs(value) <= MAX_VALUE:
            return False
    return True


@cache
def _checked_fields_of(kind: Any) -> tuple[str, ...]:
    return tuple(name for name in CHECKED_FIELDS if hasattr(kind, name))


def _drift_factor(sd: float, drift: Drift) -> float:
    """Factor of a slow error for the stated sigma of a source; at least 1."""
    return max(1.0, sd / drift.sd)


def _model(settings: Filter, map_sd: float | None, looks: ScanDriftTable | None) -> FilterModel:
    extras = receiver_drifts(settings.gnss)
    if settings.baro:
        extras |= {Extra.BARO: BARO_DRIFT, Extra.BARO_SCALE: BARO_SCALE_DRIFT}
    if settings.altimeters:
        extras[Extra.DEM] = DEM_DRIFT
    for sensor in settings.altimeters:
        extras |= dict(zip(own_states(sensor), (ALTIMETER_BIAS, ALTIMETER_SCALE), strict=True))
    extras |= AIRSPEED_DRIFTS if settings.airspeed else {}
    extras |= HEADING_DRIFTS if settings.heading else {}
    extras |= mark_drifts(map_sd) if map_sd is not None else {}
    extras |= look_drifts(LOOKS, has_second_scanner=looks.second_device is not None) if looks else {}
    unit, biased = IMU_ERROR_MODELS[settings.unit], settings.states == 15
    return outage_model(unit, extras, biased=biased) if looks else FilterModel(unit, biased, extras)
