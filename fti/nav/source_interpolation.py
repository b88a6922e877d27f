"""Interpolation of the quantities of one device to position, velocity and attitude at one time of validity.

A device may send roll, pitch and heading, or latitude and longitude, in separate messages (as in ARINC 429); each
quantity has its own history.  Between two entries it is interpolated.  After the newest entry a position is
extrapolated with the velocity of the same device (otherwise the error at 60 m/s and 10 Hz is 6 m), and an attitude is
held with a growing sigma.  Without a velocity the rate of the last second of positions is used.  The maximum age is
the device's ``max_age_ms``.
"""

from __future__ import annotations

import math
from math import inf

from msgspec import Struct

from fti.config import Device
from fti.constants import SECOND_NS
from fti.geodesy.formulas import dot, down_row, mat_nb, metres_per_radian, rotate, wrap_half_turn
from fti.messages.measurements import Attitude, Position, Velocity
from fti.nav.time_series import Series, Value

#: Limits of plausible values [rad, m, m/s]: some devices send larger ones if they are unknown, or after line errors.
#: Angles in single precision exceed their limit by up to 2e-7.
ROUNDING_MARGIN = 1e-6
MAX_SPEED_MPS = 2000.0
MAX_PART_VALUES = {
    "roll": math.pi + ROUNDING_MARGIN,
    "pitch": math.pi / 2 + ROUNDING_MARGIN,
    "heading": 2 * math.pi + ROUNDING_MARGIN,
    "lat": math.pi / 2,
    "lon": 2 * math.pi,
    "alt": 1e5,
    "track": 2 * math.pi + ROUNDING_MARGIN,
    **dict.fromkeys(("north", "east", "down", "ground_speed"), MAX_SPEED_MPS),
}
#: One sigma of a velocity for extrapolation if the source states none [m/s].
VELOCITY_SD_UNKNOWN = 1.0
#: Assumed sigma of an unknown rate of roll and pitch [rad/s]: 30 deg/s are three sigma.
RATE_SD = math.radians(10.0)
#: Held roll, pitch and heading are assumed to rotate at the rate of so long before [ns].
RATE_SPAN_NS = SECOND_NS // 4
#: An attitude that is held for at most one interval of 50 Hz, or interpolated over at most MAX_BETWEEN_NS, keeps its
#: stated sigma.  The interpolation error at 60 deg/s^2 is 0.08 deg, a_max T^2 / 8 [ns].
MAX_HELD_NS, MAX_BETWEEN_NS = SECOND_NS // 50, SECOND_NS // 10
#: One sigma of a roll or pitch if the source states none [rad], as of a small MEMS unit.
ATTITUDE_SD_UNKNOWN = math.radians(0.5)


class AttitudeState(Struct, frozen=True, gc=False):
    """Attitude at one time [rad]; heading may be unknown.

    roll_sd, pitch_sd   : one sigma, grown by the age
    tilt_sd, heading_sd : as stated by the source, the larger one of roll and pitch; None if not stated
    """

    roll: float
    pitch: float
    heading: float | None
    roll_sd: float | None
    pitch_sd: float | None
    tilt_sd: float | None = None
    heading_sd: float | None = None


class PositionState(Struct, frozen=True, gc=False):
    """Position of the reference point P at one time; alt is None if the source gives a mean-sea-level height only.

    newest_ns : time of validity of its newest entry
    """

    lat: float
    lon: float
    alt: float | None
    horizontal_sd: float | None
    vertical_sd: float | None
    north: float | None
    east: float | None
    down: float | None
    newest_ns: int


class NavSource:
    """Position, velocity and attitude of one device."""

    PARTS = ("roll", "pitch", "heading", "lat", "lon", "alt", "north", "east", "down", "ground_speed", "track")
    ANGLES = frozenset({"roll", "pitch", "heading", "lon", "track"})

    def __init__(self, device: Device) -> None:
        self.name = device.name
        self._max_age_ns = round(device.max_age_ms * 1e6)
        self._lever_arm_b = device.lever_arm_b
        self._velocity_sd = VELOCITY_SD_UNKNOWN
        self._parts = {name: Series(angle=name in self.ANGLES) for name in self.PARTS}

    # ----------------------------------------------------------------------------------------------------------- inputs

    def push_attitude(self, m: Attitude, t_ns: int) -> None:
        """Add the parts of an attitude."""
        parts = (("roll", m.roll, m.roll_sd), ("pitch", m.pitch, m.pitch_sd), ("heading", m.heading, m.heading_sd))
        self._push(t_ns, m.valid, parts)

    def push_position(self, m: Position, t_ns: int) -> None:
        """Add the parts of a position; the ellipsoidal height from the undulation of the same message if necessary."""
        alt = ellipsoidal_height(m)
        parts = (("lat", m.lat, m.horizontal_sd), ("lon", m.lon, m.horizontal_sd), ("alt", alt, m.vertical_sd))
        self._push(t_ns, m.valid, parts)

    def push_velocity(self, m: Velocity, t_ns: int) -> None:
        """Add the parts of a velocity; ground speed and track of one message become north and east."""
        north, east = level_velocity(m)
        parts = (("north", north, m.sd), ("east", east, m.sd), ("down", m.down, m.sd))
        polar = (("ground_speed", m.ground_speed, m.sd), ("track", m.track, None))
        self._push(t_ns, m.valid, parts + polar)
        has_sd = m.sd is not None and math.isfinite(m.sd) and m.sd > 0.0
        self._velocity_sd = m.sd if has_sd and m.sd is not None else VELOCITY_SD_UNKNOWN

    def _push(self, t_ns: int, valid: bool, parts: tuple[tuple[str, float | None, float | None], ...]) -> None:
        silent = not valid and all(value is None for _, value, _ in parts)
        for name, value, sd in parts:
            if value is None and not silent:
                continue
            known = valid and value is not None and abs(value) <= MAX_PART_VALUES[name]
            has_sd = sd is not None and 0.0 < sd < inf
            self._parts[name].push(t_ns, value if known else None, sd if has_sd else None)

    # ---------------------------------------------------------------------------------------------------- interpolation

    def _at(self, part: str, t_ns: int, rate: float = 0.0) -> Value | None:
        return self._parts[part].at(t_ns, self._max_age_ns, rate)

    def attitude(self, t_ns: int) -> AttitudeState | None:
        """Attitude at t_ns; None unless roll and pitch are both known."""
        roll, pitch = self._at("roll", t_ns), self._at("pitch", t_ns)
        if roll is None or pitch is None:
            return None
        heading = self._at("heading", t_ns)
        azimuth = heading.value % (2 * math.pi) if heading else None
        # between two entries near 180 deg it may be more
        bank = roll.value if abs(roll.value) <= math.pi else wrap_half_turn(roll.value)
        tilt_sd = None if roll.sd is None or pitch.sd is None else max(roll.sd, pitch.sd)
        heading_sd = heading.sd if heading else None
        return AttitudeState(bank, pitch.value, azimuth, _held_sd(roll), _held_sd(pitch), tilt_sd, heading_sd)

    def rotation_since(self, t_ns: int) -> tuple[float, float]:
        """Possible rotation of tilt and heading since their newest entries [rad], not negative."""
        return math.hypot(self._rotation_of("roll", t_ns), self._rotation_of("pitch", t_ns)), self._rotation_of(
            "heading", t_ns
        )

    def _rotation_of(self, part: str, t_ns: int) -> float:
        """With the rate of the last RATE_SPAN_NS; with RATE_SD if it contains fewer than two entries."""
        series = self._parts[part]
        newest_ns = series.newest_ns
        if newest_ns is None or newest_ns >= t_ns:
            return 0.0
        rate = series.slope(newest_ns, RATE_SPAN_NS, 1)
        return (RATE_SD if rate is None else abs(rate)) * (t_ns - newest_ns) / SECOND_NS

    def position(self, t_ns: int, attitude: AttitudeState | None) -> PositionState | None:
        """Position of P at t_ns; None unless latitude and longitude are both known."""
        latitude = self._at("lat", t_ns)
        if latitude is None:
            return None
        north, east, down = self._velocity(t_ns)
        altitude = self._at("alt", t_ns, -(down or 0.0))
        meridian, parallel = metres_per_radian(latitude.value, altitude.value if altitude else 0.0)
        lat = self._at("lat", t_ns, (north or 0.0) / meridian)
        lon = self._at("lon", t_ns, (east or 0.0) / parallel)
        if lat is None or lon is None:
            return None
        arm_n, arm_e, arm_d = self._lever_arm_n(attitude)
        place = _on_earth(lat.value - arm_n / meridian, lon.value - arm_e / parallel)
        return PositionState(
            *place,
            alt=altitude.value + arm_d if altitude else None,
            horizontal_sd=self._inflated_sd(lat),
            vertical_sd=self._inflated_sd(altitude) if altitude else None,
            north=north,
            east=east,
            down=down,
            newest_ns=self._parts["lat"].newest_ns or t_ns,
        )

    def _velocity(self, t_ns: int) -> tuple[float | None, float | None, float | None]:
        north, east, down = self._at("north", t_ns), self._at("east", t_ns), self._at("down", t_ns)
        climb = None if down else _plausible_speed(self._parts["alt"].slope(t_ns))
        vertical = down.value if down else -climb if climb is not None else None
        if north and east:
            return north.value, east.value, vertical
        speed, track = self._at("ground_speed", t_ns), self._at("track", t_ns)
        if speed and track:
            return speed.value * math.cos(track.value), speed.value * math.sin(track.value), vertical
        return *self._horizontal_slope(t_ns), vertical

    def _horizontal_slope(self, t_ns: int) -> tuple[float | None, float | None]:
        lat = self._at("lat", t_ns)
        by_lat, by_lon = self._parts["lat"].slope(t_ns), self._parts["lon"].slope(t_ns)
        if lat is None or by_lat is None or by_lon is None:
            return None, None
        meridian, parallel = metres_per_radian(lat.value, 0.0)
        north, east = _plausible_speed(by_lat * meridian), _plausible_speed(by_lon * parallel)
        return (north, east) if north is not None and east is not None else (None, None)

    def _lever_arm_n(self, attitude: AttitudeState | None) -> tuple[float, float, float]:
        """The sensor's lever arm in north, east, down [m]; components are zero if the attitude is unknown."""
        if attitude is None or self._lever_arm_b == (0.0, 0.0, 0.0):
            return 0.0, 0.0, 0.0
        if attitude.heading is None:
            return 0.0, 0.0, dot(down_row(attitude.roll, attitude.pitch), self._lever_arm_b)
        return rotate(mat_nb(attitude.roll, attitude.pitch, attitude.heading), self._lever_arm_b)

    def _inflated_sd(self, value: Value) -> float | None:
        """Sigma of a value that was extrapolated over its age with a velocity."""
        if value.sd is None:
            return None
        return math.hypot(value.sd, self._velocity_sd * value.age_ns / SECOND_NS)


def _held_sd(angle: Value) -> float | None:
    """Sigma of a roll or pitch [rad], grown by a possible rotation since."""
    is_near = angle.age_ns <= MAX_HELD_NS if angle.between_ns is None else angle.between_ns <= MAX_BETWEEN_NS
    if is_near:
        return angle.sd
    return math.hypot(ATTITUDE_SD_UNKNOWN if angle.sd is None else angle.sd, RATE_SD * angle.age_ns / SECOND_NS)


def ellipsoidal_height(m: Position) -> float | None:
    """Height above the ellipsoid [m], with the undulation of the same message if necessary; None if unknown."""
    if m.alt is None and m.alt_msl is not None and m.undulation is not None:
        return m.alt_msl + m.undulation
    return m.alt


def level_velocity(m: Velocity) -> tuple[float | None, float | None]:
    """North and east [m/s], from ground speed and track of the same message if necessary."""
    if m.north is None and m.ground_speed is not None and m.track is not None and math.isfinite(m.track):
        return m.ground_speed * math.cos(m.track), m.ground_speed * math.sin(m.track)
    return m.north, m.east


def _plausible_speed(speed: float | None) -> float | None:
    """The speed between positions, if it is plausible, else None: a position may be wrong by a large distance."""
    return speed if speed is not None and abs(speed) <= MAX_SPEED_MPS else None


def _on_earth(lat: float, lon: float) -> tuple[float, float]:
    """The same position with lat in [-pi/2, pi/2], lon in [-pi, pi), also after an extrapolation over a pole."""
    if abs(lat) > math.pi / 2:
        return math.copysign(math.pi, lat) - lat, wrap_half_turn(lon + math.pi)
    return lat, wrap_half_turn(lon)
