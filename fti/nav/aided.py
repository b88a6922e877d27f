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
from fti.nav.altimetry.nadir import over_ground
from fti.nav.altitude_hold import HOLD_NS, HoldMonitor
from fti.nav.carried_refusal import CarriedRefusal
from fti.nav.dead_reckoning_aids import DeadReckoningAids
from fti.nav.exclusion_events import ExclusionEvents, altitude_name, own_states
from fti.nav.filter.aiding import BaroAltitude, GnssPosition, GnssVelocity, TerrainAltitude, Vector
from fti.nav.filter.navigator import Navigator, is_known
from fti.nav.filter.states import (
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
    Model,
    own_drifts,
    receiver_drifts,
)
from fti.nav.ground import Ground
from fti.nav.inertial.errors import UNITS
from fti.nav.navigation import NavState
from fti.nav.plausibility.source import Unconfirmed
from fti.nav.protection import Compared
from fti.nav.separation.copies import Separation
from fti.nav.separation.fault_detection import FaultDetection
from fti.nav.separation.provisional import make_solution
from fti.nav.series import SECOND_NS, Series
from fti.nav.sources import LARGEST as MOST
from fti.nav.sources import AttitudeState, PositionState, ellipsoidal, level_velocity
from fti.nav.vertical.fallback import Aiding, VerticalFallback, VerticalState
from fti.nav.vertical.inertial import Place
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
BOUNDED = (
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
        self._navigator = Navigator(_model(settings))
        self._exclusions = ExclusionEvents(self._navigator, settings.altimeters)
        self._faults = FaultDetection(self._navigator, settings)
        self._dead_reckoning = DeadReckoningAids(settings)
        self._vertical = VerticalFallback()
        self._filter_hold, self._vertical_hold = HoldMonitor(), HoldMonitor()
        self._ground: Ground | None = None
        self._place: Place | None = None
        self._tilt: tuple[float, float] | None = None
        self._alts = {name: Series() for name in settings.gnss}
        self._used_ns: dict[str, int] = {}
        self._velocity_ns: dict[str, int] = {}
        self._unconfirmed_ns: dict[str, int] = {}  # of velocities that aid provisional filters alone
        self._pressure_ns: dict[str, int] = {}
        self._barometer: str | None = None
        self._climbs: dict[str, tuple[int, float | None, float | None]] = {}
        self._carrier: str | None = None
        self._told: FilterSolution | None = None  # until the filter takes anything

    def give_ground(self, ground: Ground | None) -> None:
        """Heights of altimeters above this ground aid from now on."""
        self._ground = ground

    # ---------------------------------------------------------------------------------------------------- taking

    def note(self, nav: NavState) -> None:
        """What is known at a tick: place and attitude of the inertial samples until the next one.

        The last place will do when there is none any more: gravity hardly changes with it.  An attitude that is 20 ms
        old is 0.4 deg off at 20 deg/s, and as far to the other side when the turn ends.
        """
        self._tilt = (nav.attitude.roll, nav.attitude.pitch) if nav.attitude else None
        if nav.position and _conceivable(nav.position):
            self._place = Place(nav.position.lat, nav.position.north or 0.0, nav.position.east or 0.0)
        self._note_holds(nav.t_ns)

    def _note_holds(self, t_ns: int) -> None:
        """Who holds the altitudes of the filter and of the vertical channel at a tick."""
        believed = self._navigator.believed_ns("vertical")
        own = {altitude_name(sensor): sensor for sensor in self._settings.altimeters}
        others = [then_ns for name, then_ns in believed.items() if name not in own]
        holding = [own[name] for name, then_ns in believed.items() if name in own and t_ns - then_ns <= HOLD_NS]
        self._filter_hold.update(t_ns, max(others, default=None), sorted(holding))
        taken_ns = self._vertical.taken_ns(Aiding.ALTIMETER)
        is_aided = taken_ns is not None and t_ns - taken_ns <= HOLD_NS
        holding = [sensor for sensor, then_ns in self._used_ns.items() if is_aided and t_ns - then_ns <= HOLD_NS]
        self._vertical_hold.update(t_ns, self._vertical.taken_ns(Aiding.SATELLITES), sorted(holding))

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
        self._told = None
        if isinstance(m, ImuSample) and device == settings.imu:
            self._take_imu(m, t_ns)
        elif isinstance(m, Attitude) and m.valid and m.roll is not None and m.pitch is not None:
            if abs(m.roll) <= MOST["roll"] and abs(m.pitch) <= MOST["pitch"]:
                self._navigator.take_attitude(t_ns, m.roll, m.pitch, m.heading)
        elif not _conceivable(m) or (device in self.refused and not self._navigator.is_aligned):
            return  # the filter does not begin with a receiver that contradicted it
        elif device in settings.gnss and isinstance(m, Velocity) and m.valid:
            self._take_velocity(device, m, t_ns)
        elif device in settings.gnss and isinstance(m, Position) and m.valid:
            self._take_position(device, m, t_ns)
        elif device in settings.baro and isinstance(m, PressureAltitude) and m.valid:
            self._take_pressure(device, m.alt_press, t_ns)
        elif (aiding := self._dead_reckoning.make(device, m, t_ns)) is not None:
            self._navigator.take(t_ns, aiding)

    def take_unconfirmed(self, device: str, m: Measurement, what: Unconfirmed, t_ns: int) -> None:
        """Take a measurement of an unconfirmed receiver, true at t_ns: it aids a provisional filter alone."""
        if device not in self._settings.gnss or not _conceivable(m):
            return
        aiding: GnssPosition | GnssVelocity | None = None
        if isinstance(m, Position) and m.valid:
            aiding = self._position_aiding(device, m)
        elif isinstance(m, Velocity) and m.valid:
            level = m if "height" in what.quantities else replace(m, down=None)
            aiding = self._velocity_aiding(device, level, self._lasting(self._unconfirmed_ns, device, t_ns))
        if aiding is not None and is_known(aiding):
            parts = aiding.apart() if isinstance(aiding, GnssPosition) else (aiding,)
            self._faults.take_unconfirmed(device, what, t_ns, parts)

    def _take_pressure(self, device: str, alt: float, t_ns: int) -> None:
        """One barometer aids: the first one of the list that was heard lately; each has an offset of its own."""
        self._pressure_ns[device] = t_ns
        before = self._settings.baro[: self._settings.baro.index(device)]
        if any(t_ns - self._pressure_ns[name] <= BARO_NS for name in before if name in self._pressure_ns):
            return
        is_other, self._barometer = self._barometer not in (None, device), device
        self._navigator.take(t_ns, BaroAltitude(alt, BARO_SD, altitude_name(device), is_other))

    def _take_imu(self, m: ImuSample, t_ns: int) -> None:
        if m.accel_b is None or m.gyro_b is None:
            return
        self._navigator.take_inertial(t_ns, m.accel_b, m.gyro_b)
        if self._tilt and self._place:
            self._vertical.take_imu(t_ns, m.accel_b, *self._tilt, self._place)

    def _take_velocity(self, device: str, m: Velocity, t_ns: int) -> None:
        self._climbs[device] = t_ns, -m.down if m.down is not None else None, m.sd
        if None in level_velocity(m):
            return
        if m.down is None and not self._navigator.reaches(t_ns):  # it begins with a climb, if only of the positions
            climb, sd = self._alts[device].slope(t_ns), VELOCITY_SD if m.sd is None else m.sd
            m = replace(m, down=None if climb is None else -climb, sd=max(sd, CLIMB_SD))
        aiding = self._velocity_aiding(device, m, self._lasting(self._velocity_ns, device, t_ns))
        if aiding is not None:
            self._navigator.take(t_ns, aiding)

    def _velocity_aiding(self, device: str, m: Velocity, factor: float) -> GnssVelocity | None:
        """None where it has no horizontal velocity.  factor : so many times its sigma counts"""
        north, east = level_velocity(m)
        if north is None or east is None:
            return None
        sd = factor * (VELOCITY_SD if m.sd is None else m.sd)
        return GnssVelocity(north, east, m.down, sd, self._arms[device], name=f"{device}.velocity")

    @staticmethod
    def _lasting(velocity_ns: dict[str, int], device: str, t_ns: int) -> float:
        """How many times its sigma a velocity counts, whose error hangs together with the last one's."""
        last = velocity_ns.get(device)
        velocity_ns[device] = t_ns
        apart_s = (t_ns - last) / SECOND_NS if last is not None and t_ns > last else 1.0
        return math.sqrt(max(1.0, 2.0 * VELOCITY_TAU_S / apart_s))

    def _take_position(self, device: str, m: Position, t_ns: int) -> None:
        aiding = self._position_aiding(device, m)
        if aiding is None:
            return
        refuses_height = device in self.refused_heights
        if refuses_height and not self._navigator.is_aligned:
            aiding = replace(aiding, alt=None)  # the filter does not begin with a height that contradicted it
        self._navigator.take(t_ns, aiding)
        if aiding.alt is not None and not refuses_height:
            self._alts[device].push(t_ns, aiding.alt)
            alt = aiding.alt + self._below(aiding.lever_arm_b)
            self._vertical.take_satellites(t_ns, alt, aiding.vertical_sd, *self._climb_at(device, t_ns))

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
            m.lat, m.lon, ellipsoidal(m), level, high, self._arms[device], f"{device}.position", slow, own
        )  # fmt: skip

    def _below(self, arm: Vector) -> float:
        """How far below P the antenna is [m], as the aircraft lies now."""
        row = down_row(*self._tilt) if self._tilt else (0.0, 0.0, 1.0)
        return row[0] * arm[0] + row[1] * arm[1] + row[2] * arm[2]

    def _climb_at(self, device: str, t_ns: int) -> tuple[float | None, float | None]:
        """Climb and its sigma that a receiver told with a height; an old one says nothing of now."""
        told_ns, climb, sd = self._climbs.get(device, (t_ns, None, None))
        return (climb, sd) if abs(t_ns - told_ns) <= CLIMB_NS else (None, None)

    def take_height(self, height: HeightAboveGround, nav: NavState) -> None:
        """An altimeter over known ground, judged valid; the ground is that below the position of its time."""
        if not self._counts(height) or height.t_valid_ns is None:
            return
        found = over_ground(height, self._ground, nav.position)
        if found is None or self._ground is None:
            return
        self._told = None
        t_ns, known, sd = height.t_valid_ns, found.height_agl, found.height_sd
        self._used_ns[height.sensor], self._carrier = t_ns, height.sensor
        if not self._exclusions.is_excluded(height.sensor):
            self._vertical.take_height(t_ns, known, sd, found.ground, found.ground_sd)
        slow = _at_least_once(found.ground_sd, DEM_DRIFT)  # the place is wrong for long, too
        name, own = altitude_name(height.sensor), own_states(height.sensor)
        altitude = TerrainAltitude(known + found.ground, sd or self._ground.sd, known, name, slow, *own)
        self._navigator.take(t_ns, altitude)

    def _counts(self, height: HeightAboveGround) -> bool:
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
        if self._told is None or self._told.t_ns != t_ns:
            self._told = self._protected(self._navigator.output(t_ns))
        return self._told

    def _protected(self, found: FilterSolution) -> FilterSolution:
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
            altimeter=self._carrier,
            rejected=self._vertical.altimeter_refused,
        )

    def doubt(self, devices: frozenset[str]) -> None:
        """Receivers that tests of one source suspect from now on: copies that know better are kept."""
        self._faults.doubt(devices)

    def events(self, t_ns: int) -> list[Event]:
        """Follow the filter with the tests between sources; who was excluded, or aids again, since the last call."""
        self._faults.update(t_ns)
        events = [*self._exclusions.take(t_ns), *self._faults.take_events()]
        if events:
            self._told = None
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
    def standing_sizes(self) -> dict[str, Size]:
        """Contradictions of receivers that do not aid, by device."""
        return self._faults.standing_sizes

    def confirm(self, found: Confirmation, t_ns: int) -> None:
        """An independent source agrees with a receiver that does not aid."""
        self._told = None
        self._faults.confirm(found, t_ns)

    def restore(self, refusals: Iterable[CarriedRefusal], t_ns: int) -> None:
        """Begin with refusals of before this process."""
        self._faults.restore(refusals, t_ns)

    def compared(self, t_ns: int) -> Compared | None:
        """What devices are compared with; None while the filter has no position."""
        position, told = self.position(t_ns), self.solution(t_ns)
        if position is None or told.hpl is None or told.vpl is None:
            return None
        table = ((Reason.CONTRADICTION, self._faults.is_drawn), (Reason.REACQUIRED, self._faults.is_reacquired))
        unchecked = tuple(reason for reason, holds in table if holds)
        return Compared(position, told.hpl, told.vpl, frozenset(self._settings.gnss), self.refused, unchecked)

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


def _conceivable(m: Measurement | PositionState) -> bool:
    """No number that no aircraft has: squares of the largest ones are no numbers any more."""
    kind: Any = type(m)
    for name in _bounded_of(kind):
        value = getattr(m, name)
        if value is not None and not abs(value) <= LARGEST:
            return False
    return True


@cache
def _bounded_of(kind: Any) -> tuple[str, ...]:
    return tuple(name for name in BOUNDED if hasattr(kind, name))


def _at_least_once(sd: float, drift: Drift) -> float:
    """How many times a slow error counts where a source states a sigma."""
    return max(1.0, sd / drift.sd)


def _model(settings: Filter) -> Model:
    extras = receiver_drifts(settings.gnss)
    if settings.baro:
        extras |= {Extra.BARO: BARO_DRIFT, Extra.BARO_SCALE: BARO_SCALE_DRIFT}
    if settings.altimeters:
        extras[Extra.DEM] = DEM_DRIFT
    for sensor in settings.altimeters:
        extras |= dict(zip(own_states(sensor), (ALTIMETER_BIAS, ALTIMETER_SCALE), strict=True))
    extras |= AIRSPEED_DRIFTS if settings.airspeed else {}
    extras |= HEADING_DRIFTS if settings.heading else {}
    return Model(UNITS[settings.unit], settings.states == 15, extras)
