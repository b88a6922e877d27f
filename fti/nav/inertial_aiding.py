"""Inertial navigation of our own, live: the error-state filter and the vertical channel, fed by devices.

Both take the inertial samples of one device.  The filter is aided by GNSS, pressure altitude, altimeters over known
ground, airspeed and magnetic heading, and takes the place of devices that give no position, altitude or attitude any
more; the vertical channel gives the altitude when the filter gives none either.  Heights of altimeters count once a
second: samples that follow see the same ground.  What a receiver states of its position, and what is known of the
ground, is for the most part one error that lasts: it sizes the slow state, or many fixes would average away what they
have in common; a velocity every dt counts with sigma^2 2 T / dt.  Configured by ``[nav.filter]``; without it nothing of
this runs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from typing import Any

from fti.config import Device, Filter
from fti.geodesy.rotations import down_row
from fti.nav.altimetry.nadir_height import altitude_over_terrain
from fti.nav.altitude_hold import HOLD_NS, HoldMonitor
from fti.nav.carried_refusal import CarriedRefusal
from fti.nav.dead_reckoning_aids import DeadReckoningAids
from fti.nav.exclusion_events import ExclusionEvents, altitude_name, own_states
from fti.nav.filter.aiding import BaroAltitude, GnssPosition, GnssVelocity, TerrainAltitude, Vector
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
    own_drifts,
    receiver_drifts,
)
from fti.nav.filter.navigator import InertialNavigator, is_known
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
from fti.nav.time_series import SECOND_NS, Series
from fti.nav.vertical.inertial_height import HorizontalMotion
from fti.nav.vertical.vertical_channel import HeightAiding, VerticalChannel, VerticalState
from fti.nav.witnesses import Confirmation, Size
from fti.types import (
    Airspeed,
    Attitude,
    Event,
    FilterSolution,
    HeightAboveGround,
    ImuSample,
    MagneticField,
    Measurement,
    Position,
    PressureAltitude,
    ProvisionalSolution,
    Reason,
    Velocity,
    VerticalSolution,
)

#: Sigmas of what states none: position, height [m], velocity [m/s], pressure altitude [m].
POSITION_SD, HEIGHT_SD, VELOCITY_SD, BARO_SD = 3.0, 5.0, 0.1, 1.0
#: Sigma of a climb that is the slope of positions [m/s].
CLIMB_SD = 0.5
#: Errors of a receiver's velocity hang together for so long [s].
VELOCITY_TAU_S = 5.0
#: No altitude, speed or sigma in SI units is larger.
LARGEST = 1e6
CHECKED_FIELDS = (
    "alt", "alt_msl", "alt_press", "north", "east", "down", "ground_speed", "sd", "horizontal_sd", "vertical_sd", "tas"
)  # fmt: skip
#: A climb belongs to the height of a receiver that is true within so long of it [ns].
CLIMB_NS = 500_000_000
#: A barometer that was not heard for so long makes place for the next one [ns].
BARO_NS = 2_000_000_000
#: So often a height of one altimeter aids [ns].
HEIGHT_NS = 1_000_000_000


class AidedNavigation:
    """Filter and vertical channel.  settings : which devices feed them; devices : all, by name"""

    def __init__(self, settings: Filter, devices: dict[str, Device]) -> None:
        self._settings = settings
        self._arms = {name: device.lever_arm_b for name, device in devices.items()}
        self._navigator = InertialNavigator(_model(settings))
        self._exclusions = ExclusionEvents(self._navigator, settings.altimeters)
        self._faults = FaultDetection(self._navigator, settings)
        self._dead_reckoning = DeadReckoningAids(settings)
        self._vertical = VerticalChannel()
        self._filter_hold, self._vertical_hold = HoldMonitor(), HoldMonitor()
        self._ground: Ground | None = None
        self._place: HorizontalMotion | None = None
        self._tilt: tuple[float, float] | None = None
        self._alts = {name: Series() for name in settings.gnss}
        self._used_ns: dict[str, int] = {}
        self._velocity_ns: dict[str, int] = {}
        self._unconfirmed_ns: dict[str, int] = {}  # of velocities that aid provisional filters alone
        self._pressure_ns: dict[str, int] = {}
        self._barometer: str | None = None
        self._climbs: dict[str, tuple[int, float | None, float | None]] = {}
        self._last_altimeter: str | None = None
        self._solution: FilterSolution | None = None  # until the filter takes anything

    def set_terrain(self, ground: Ground | None) -> None:
        """Heights of altimeters above this ground aid from now on."""
        self._ground = ground

    # ---------------------------------------------------------------------------------------------------- taking

    def note(self, nav: NavState) -> None:
        """What is known at a tick: place and attitude of the inertial samples until the next one.

        The last place will do when there is none any more: gravity hardly changes with it.  An attitude that is 20 ms
        old is 0.4 deg off at 20 deg/s, and as far to the other side when the turn ends.
        """
        self._tilt = (nav.attitude.roll, nav.attitude.pitch) if nav.attitude else None
        if nav.position and _is_conceivable(nav.position):
            self._place = HorizontalMotion(nav.position.lat, nav.position.north or 0.0, nav.position.east or 0.0)
        self._note_holds(nav.t_ns)

    def _note_holds(self, t_ns: int) -> None:
        """Who holds the altitudes of the filter and of the vertical channel at a tick."""
        believed = self._navigator.accepted_ns("vertical")
        own = {altitude_name(sensor): sensor for sensor in self._settings.altimeters}
        others = [then_ns for name, then_ns in believed.items() if name not in own]
        holding = [own[name] for name, then_ns in believed.items() if name in own and t_ns - then_ns <= HOLD_NS]
        self._filter_hold.update(t_ns, max(others, default=None), sorted(holding))
        last_accepted_ns = self._vertical.last_accepted_ns(HeightAiding.ALTIMETER)
        is_aided = last_accepted_ns is not None and t_ns - last_accepted_ns <= HOLD_NS
        holding = [sensor for sensor, then_ns in self._used_ns.items() if is_aided and t_ns - then_ns <= HOLD_NS]
        self._vertical_hold.update(t_ns, self._vertical.last_accepted_ns(HeightAiding.SATELLITES), sorted(holding))

    def wants(self, device: str, kind: type[Measurement]) -> bool:
        """Whether measurements of this kind of a device say anything here."""
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
        """Take a measurement that was true at t_ns."""
        settings = self._settings
        self._solution = None
        if isinstance(m, ImuSample) and device == settings.imu:
            self._feed_imu(m, t_ns)
        elif isinstance(m, Attitude) and m.valid and m.roll is not None and m.pitch is not None:
            if abs(m.roll) <= MAX_PART_VALUES["roll"] and abs(m.pitch) <= MAX_PART_VALUES["pitch"]:
                self._navigator.feed_attitude(t_ns, m.roll, m.pitch, m.heading)
        elif not _is_conceivable(m) or (device in self.refused and not self._navigator.is_aligned):
            return  # the filter does not begin with a receiver that contradicted it
        elif device in settings.gnss and isinstance(m, Velocity) and m.valid:
            self._feed_velocity(device, m, t_ns)
        elif device in settings.gnss and isinstance(m, Position) and m.valid:
            self._feed_position(device, m, t_ns)
        elif device in settings.baro and isinstance(m, PressureAltitude) and m.valid:
            self._feed_pressure(device, m.alt_press, t_ns)
        elif (aiding := self._dead_reckoning.make(device, m, t_ns)) is not None:
            self._navigator.feed_aiding(t_ns, aiding)

    def feed_unconfirmed(self, device: str, m: Measurement, what: UnconfirmedSource, t_ns: int) -> None:
        """Take a measurement of an unconfirmed receiver, true at t_ns: it aids a provisional filter alone."""
        if device not in self._settings.gnss or not _is_conceivable(m):
            return
        aiding: GnssPosition | GnssVelocity | None = None
        if isinstance(m, Position) and m.valid:
            aiding = self._position_aiding(device, m)
        elif isinstance(m, Velocity) and m.valid:
            level = m if "height" in what.quantities else replace(m, down=None)
            aiding = self._velocity_aiding(device, level, self._correlation_factor(self._unconfirmed_ns, device, t_ns))
        if aiding is not None and is_known(aiding):
            parts = aiding.split() if isinstance(aiding, GnssPosition) else (aiding,)
            self._faults.feed_unconfirmed(device, what, t_ns, parts)

    def _feed_pressure(self, device: str, alt: float, t_ns: int) -> None:
        """One barometer aids: the first one of the list that was heard lately; each has an offset of its own."""
        self._pressure_ns[device] = t_ns
        before = self._settings.baro[: self._settings.baro.index(device)]
        if any(t_ns - self._pressure_ns[name] <= BARO_NS for name in before if name in self._pressure_ns):
            return
        is_new_source, self._barometer = self._barometer not in (None, device), device
        self._navigator.feed_aiding(t_ns, BaroAltitude(alt, BARO_SD, altitude_name(device), is_new_source))

    def _feed_imu(self, m: ImuSample, t_ns: int) -> None:
        if m.accel_b is None or m.gyro_b is None:
            return
        self._navigator.feed_inertial(t_ns, m.accel_b, m.gyro_b)
        if self._tilt and self._place:
            self._vertical.feed_imu(t_ns, m.accel_b, *self._tilt, self._place)

    def _feed_velocity(self, device: str, m: Velocity, t_ns: int) -> None:
        self._climbs[device] = t_ns, -m.down if m.down is not None else None, m.sd
        if None in level_velocity(m):
            return
        if m.down is None and not self._navigator.reaches(t_ns):  # it begins with a climb, if only of the positions
            climb, sd = self._alts[device].slope(t_ns), VELOCITY_SD if m.sd is None else m.sd
            m = replace(m, down=None if climb is None else -climb, sd=max(sd, CLIMB_SD))
        aiding = self._velocity_aiding(device, m, self._correlation_factor(self._velocity_ns, device, t_ns))
        if aiding is not None:
            self._navigator.feed_aiding(t_ns, aiding)

    def _velocity_aiding(self, device: str, m: Velocity, factor: float) -> GnssVelocity | None:
        """None where it has no horizontal velocity.  factor : so many times its sigma counts"""
        north, east = level_velocity(m)
        if north is None or east is None:
            return None
        sd = factor * (VELOCITY_SD if m.sd is None else m.sd)
        return GnssVelocity(north, east, m.down, sd, self._arms[device], name=f"{device}.velocity")

    @staticmethod
    def _correlation_factor(velocity_ns: dict[str, int], device: str, t_ns: int) -> float:
        """How many times its sigma a velocity counts, whose error hangs together with the last one's."""
        last = velocity_ns.get(device)
        velocity_ns[device] = t_ns
        apart_s = (t_ns - last) / SECOND_NS if last is not None and t_ns > last else 1.0
        return math.sqrt(max(1.0, 2.0 * VELOCITY_TAU_S / apart_s))

    def _feed_position(self, device: str, m: Position, t_ns: int) -> None:
        aiding = self._position_aiding(device, m)
        if aiding is None:
            return
        refuses_height = device in self.refused_heights
        if refuses_height and not self._navigator.is_aligned:
            aiding = replace(aiding, alt=None)  # the filter does not begin with a height that contradicted it
        self._navigator.feed_aiding(t_ns, aiding)
        if aiding.alt is not None and not refuses_height:
            self._alts[device].push(t_ns, aiding.alt)
            alt = aiding.alt + self._antenna_below(aiding.lever_arm_b)
            self._vertical.feed_satellites(t_ns, alt, aiding.vertical_sd, *self._climb_at(device, t_ns))

    def _position_aiding(self, device: str, m: Position) -> GnssPosition | None:
        """None where it has no place."""
        if m.lat is None or m.lon is None:
            return None
        level = POSITION_SD if m.horizontal_sd is None else m.horizontal_sd
        high = HEIGHT_SD if m.vertical_sd is None else m.vertical_sd
        slow = (
            _at_least_once(level, GNSS_DRIFTS[Extra.GNSS_NORTH]), _at_least_once(high, GNSS_DRIFTS[Extra.GNSS_DOWN])
        )  # fmt: skip
        own = own_drifts(device) if len(self._settings.gnss) > 1 else ()
        return GnssPosition(
            m.lat, m.lon, ellipsoidal_height(m), level, high, self._arms[device], f"{device}.position", slow, own
        )  # fmt: skip

    def _antenna_below(self, arm: Vector) -> float:
        """How far below P the antenna is [m], as the aircraft lies now."""
        row = down_row(*self._tilt) if self._tilt else (0.0, 0.0, 1.0)
        return row[0] * arm[0] + row[1] * arm[1] + row[2] * arm[2]

    def _climb_at(self, device: str, t_ns: int) -> tuple[float | None, float | None]:
        """Climb and its sigma that a receiver told with a height; an old one says nothing of now."""
        told_ns, climb, sd = self._climbs.get(device, (t_ns, None, None))
        return (climb, sd) if abs(t_ns - told_ns) <= CLIMB_NS else (None, None)

    def feed_height(self, height: HeightAboveGround, nav: NavState) -> None:
        """An altimeter over known ground, judged valid; the ground is that below the position of its time."""
        if not self._is_due(height) or height.t_valid_ns is None:
            return
        found = altitude_over_terrain(height, self._ground, nav.position)
        if found is None or self._ground is None:
            return
        self._solution = None
        t_ns, known, sd = height.t_valid_ns, found.height_agl, found.height_sd
        self._used_ns[height.sensor], self._last_altimeter = t_ns, height.sensor
        if not self._exclusions.is_excluded(height.sensor):
            self._vertical.feed_height(t_ns, known, sd, found.ground, found.ground_sd)
        slow = _at_least_once(found.ground_sd, DEM_DRIFT)  # the place is wrong for long, too
        name, own = altitude_name(height.sensor), own_states(height.sensor)
        altitude = TerrainAltitude(known + found.ground, sd or self._ground.sd, known, name, slow, *own)
        self._navigator.feed_aiding(t_ns, altitude)

    def _is_due(self, height: HeightAboveGround) -> bool:
        last = self._used_ns.get(height.sensor)
        if not height.valid or height.t_valid_ns is None or height.sensor not in self._settings.altimeters:
            return False
        return last is None or abs(height.t_valid_ns - last) >= HEIGHT_NS

    # --------------------------------------------------------------------------------------------------- telling

    def is_excluded(self, altimeter: str) -> bool:
        """Whether the filter excludes an altimeter from aiding."""
        return self._exclusions.is_excluded(altimeter)

    @property
    def filter_holders(self) -> tuple[str, ...]:
        """Altimeters that hold the altitude of the filter alone."""
        return self._filter_hold.altimeters

    @property
    def vertical_holders(self) -> tuple[str, ...]:
        """Altimeters that hold the altitude of the vertical channel alone."""
        return self._vertical_hold.altimeters

    def solution(self, t_ns: int) -> FilterSolution:
        """What the filter says; of one time it is asked several times, for place, attitude and output."""
        if self._solution is None or self._solution.t_ns != t_ns:
            self._solution = self._with_protection(self._navigator.output(t_ns))
        return self._solution

    def _with_protection(self, found: FilterSolution) -> FilterSolution:
        levels = self._faults.levels(found.t_ns) if found.valid else None
        return found if levels is None else replace(found, hpl=levels.horizontal, vpl=levels.vertical)

    def provisional_solutions(self, t_ns: int) -> list[ProvisionalSolution]:
        """What the filter would give with each unconfirmed receiver; none while the filter is invalid."""
        running = self._faults.provisional(t_ns)
        here = self.solution(t_ns) if running else None
        return [make_solution(here, each) for each in running] if here is not None and here.valid else []

    def vertical_solution(self, t_ns: int) -> VerticalSolution:
        """What the vertical channel says."""
        found = self._vertical.at(t_ns)
        return VerticalSolution(
            t_ns=t_ns,
            t_valid_ns=t_ns if found.alt is not None else None,
            valid=found.valid,
            reasons=found.reasons,
            alt=found.alt,
            vertical_sd=found.alt_sd,
            vel_down=-found.climb if found.climb is not None else None,
            vel_down_sd=found.climb_sd,
            altimeter=self._last_altimeter,
            rejected=self._vertical.altimeter_refused,
        )

    def set_suspects(self, devices: frozenset[str]) -> None:
        """Receivers that tests of one source suspect from now on: copies that know better are kept."""
        self._faults.set_suspects(devices)

    def events(self, t_ns: int) -> list[Event]:
        """Follow the filter with the tests between sources; who was excluded, or aids again, since the last call."""
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
    def separations(self) -> dict[str, list[Separation]]:
        """Of the filter from its copies, by class of sources (``fti.nav.separation``), the oldest copy first."""
        return self._faults.separations

    def readmit(self, device: str, t_ns: int) -> None:
        """Let a receiver back in because the operator commands it, if it is excluded."""
        self._faults.readmit(device, t_ns)

    @property
    def refusals(self) -> list[CarriedRefusal]:
        """Receivers, and heights of receivers, that do not aid."""
        return self._faults.refusals

    @property
    def contradiction_sizes(self) -> dict[str, Size]:
        """Contradictions of receivers that do not aid, by device."""
        return self._faults.contradiction_sizes

    def confirm(self, found: Confirmation, t_ns: int) -> None:
        """An independent source agrees with a receiver that does not aid."""
        self._solution = None
        self._faults.confirm(found, t_ns)

    def restore(self, refusals: Iterable[CarriedRefusal], t_ns: int) -> None:
        """Begin with refusals of before this process."""
        self._faults.restore(refusals, t_ns)

    def compared(self, t_ns: int) -> FilterReference | None:
        """What devices are compared with; None while the filter has no position."""
        position, told = self.position(t_ns), self.solution(t_ns)
        if position is None or told.hpl is None or told.vpl is None:
            return None
        table = ((Reason.CONTRADICTION, self._faults.is_unresolved), (Reason.REACQUIRED, self._faults.is_reacquired))
        unchecked = tuple(reason for reason, holds in table if holds)
        return FilterReference(position, told.hpl, told.vpl, frozenset(self._settings.gnss), self.refused, unchecked)

    def position(self, t_ns: int) -> PositionState | None:
        """Of the filter, for who has no other; None where it is not valid."""
        told = self.solution(t_ns)
        if not told.valid or told.lat is None or told.lon is None:
            return None
        return PositionState(
            told.lat, told.lon, told.alt, told.horizontal_sd, told.vertical_sd,
            told.vel_north, told.vel_east, told.vel_down, t_ns,
        )  # fmt: skip

    def attitude(self, t_ns: int) -> AttitudeState | None:
        """Of the filter, for who has no other."""
        told = self.solution(t_ns)
        if not told.valid or told.roll is None or told.pitch is None:
            return None
        tilt_sd = told.tilt_sd
        return AttitudeState(told.roll, told.pitch, told.heading, tilt_sd, tilt_sd, tilt_sd, told.heading_sd)

    def altitude(self, t_ns: int) -> VerticalState | None:
        """Of the vertical channel, for who has no other."""
        found = self._vertical.at(t_ns)
        return found if found.valid else None


def _is_conceivable(m: Measurement | PositionState) -> bool:
    """No number that no aircraft has: squares of the largest ones are no numbers any more."""
    kind: Any = type(m)
    for name in _checked_fields_of(kind):
        value = getattr(m, name)
        if value is not None and not abs(value) <= LARGEST:
            return False
    return True


@cache
def _checked_fields_of(kind: Any) -> tuple[str, ...]:
    return tuple(name for name in CHECKED_FIELDS if hasattr(kind, name))


def _at_least_once(sd: float, drift: Drift) -> float:
    """How many times a slow error counts where a source states a sigma."""
    return max(1.0, sd / drift.sd)


def _model(settings: Filter) -> FilterModel:
    extras = receiver_drifts(settings.gnss)
    if settings.baro:
        extras |= {Extra.BARO: BARO_DRIFT, Extra.BARO_SCALE: BARO_SCALE_DRIFT}
    if settings.altimeters:
        extras[Extra.DEM] = DEM_DRIFT
    for sensor in settings.altimeters:
        extras |= dict(zip(own_states(sensor), (ALTIMETER_BIAS, ALTIMETER_SCALE), strict=True))
    extras |= AIRSPEED_DRIFTS if settings.airspeed else {}
    extras |= HEADING_DRIFTS if settings.heading else {}
    return FilterModel(IMU_ERROR_MODELS[settings.unit], settings.states == 15, extras)
