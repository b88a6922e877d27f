"""Position and height from what radio gives live: a receiver's fix with its satellites, DME ranges, a radio altimeter.

The receiver's fix stands for its satellites: with the covariance sigma_G^2 (H_G^T H_G)^-1 of the satellites that it
used it weighs as much as their pseudoranges would, of which no one tells the satellites' places; but where the receiver
itself says that it is worse (jammed, mirrored, without satellites for a while), it is no better than that.  A receiver
with fewer than four satellites has no fix, and what it says of its sky counts for nothing here.

Ranges of the last seconds are moved on with the velocity, and their sigma grows with what that does not know: a
manoeuvre of ``MANOEUVRE`` since it was true, any flight at all when there is none.  The sigma of the height is
predicted with satellites and stations, and with the altimeter (over known ground); where the altimeter's is the
smaller, its height becomes one more observation, else it is left out.  Without satellites it is nearly always taken:
stations are on the ground, and ranges to them say little of the height.

What disagrees is refused (``agreement``); where nobody can tell what is wrong, the position is not valid.  Of the two
solutions of two stations the one nearer to the last position is given, as long as that is not older than
``last_age_s`` and the other side is far away; else none.  Two wrong ranges may agree with each other: a solution
farther from the last one than anybody flies in the time is refused, for no longer than ``jump_age_s``.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef
from fti.nav.least_squares import (
    AltitudeObservation,
    Array,
    FixObservation,
    LeastSquaresSolution,
    PositionObservation,
    RangeObservation,
)
from fti.nav.radio.altitude_accuracy import (
    AltitudeSource,
    altimeter_sd,
    choose_altitude,
    fix_covariance,
    inflate_to_stated,
)
from fti.nav.radio.observation_consistency import (
    FIX,
    MAX_TEST,
    MIN_STATIONS,
    height_sd,
    is_mirror_ambiguous,
    solve_consistent,
)
from fti.nav.time_series import SECOND_NS
from fti.types import Reason

#: No height, range or sigma [m] is larger, nor a speed [m/s].
MAX_LENGTH_M, MAX_SPEED_MPS = 1e6, 1e4
#: A sigma that is smaller [m] is none.
MIN_SD = 1e-3
HEIGHT = "altimeter"
#: One sigma of a velocity [m/s], of what becomes of it [m/s^2], and of one that nobody knows [m/s].
VELOCITY_SD, MANOEUVRE, SPEED_UNKNOWN = 0.2, 2.0, 60.0


class GeodeticPoint(NamedTuple):
    """Where a DME station stands: lat, lon [rad], alt above the ellipsoid [m]."""

    lat: float
    lon: float
    alt: float


@dataclass(frozen=True, slots=True)
class RadioSettings:
    """One sigma of a pseudorange and of a DME range [m].

    ..._age_s : how old a fix, a range, a height, a velocity and a last position may be [s], and how far from a fix
                in time its satellites: receivers tell them every second to every fifth
    jump_age_s : for so long after the last solution one elsewhere is refused [s]
    """

    satellite_sd: float = 3.0
    dme_sd: float = 222.0
    fix_age_s: float = 1.5
    dme_age_s: float = 3.0
    height_age_s: float = 0.5
    velocity_age_s: float = 10.0
    last_age_s: float = 30.0
    jump_age_s: float = 10.0
    sky_age_s: float = 10.0


@dataclass(frozen=True, slots=True)
class RadioState:
    """Where radio says that P is.

    lat, lon [rad], alt above the ellipsoid [m]; horizontal_sd of each axis, vertical_sd [m]: None without a solution
    source                   : what the height comes from
    ranges_sd, altimeter_sd  : sigma of the height that each of the two would have [m]; None where it has none
    used, refused            : names of stations, ``satellites``, ``altimeter``
    """

    t_ns: int
    valid: bool
    reasons: tuple[Reason, ...]
    lat: float | None = None
    lon: float | None = None
    alt: float | None = None
    horizontal_sd: float | None = None
    vertical_sd: float | None = None
    source: AltitudeSource | None = None
    ranges_sd: float | None = None
    altimeter_sd: float | None = None
    used: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()


class _Range(NamedTuple):
    t_ns: int
    metres: float


class _Fix(NamedTuple):
    t_ns: int
    pos_e: Array
    cov_n: Array


class _Height(NamedTuple):
    t_ns: int
    alt: float
    sd: float


class _LastSolution(NamedTuple):
    t_ns: int
    pos_e: Array
    sd: float


class RadioNavigator:
    """Takes what comes, in any order of time, and solves when asked.  stations : those that may be heard, by name."""

    def __init__(self, stations: Mapping[str, GeodeticPoint], settings: RadioSettings | None = None) -> None:
        self._stations_e = {name: ecef_from_geodetic(*station) for name, station in stations.items()}
        self._settings = settings or RadioSettings()
        self._ranges: dict[str, _Range] = {}
        self._sky: tuple[int, Array | None] | None = None
        self._fix: _Fix | None = None
        self._height: _Height | None = None
        self._velocity: tuple[int, Array] | None = None
        self._last: _LastSolution | None = None

    # ----------------------------------------------------------------------------------------------------- taking

    def feed_satellites(self, t_ns: int, azimuth: Array, elevation: Array) -> None:
        """Directions of the satellites that the receiver uses at t_ns, shapes (n,) [rad], for the fixes after them."""
        known = np.isfinite(azimuth) & np.isfinite(elevation)
        self._sky = t_ns, fix_covariance(azimuth[known], elevation[known], self._settings.satellite_sd)

    def feed_fix(self, t_ns: int, place: GeodeticPoint, horizontal_sd: float | None, vertical_sd: float | None) -> None:
        """A receiver's position, true at t_ns, and its sigmas, which count where its satellites are not known, or where
        they are the larger ones.
        """
        level, high = _usable_sd(horizontal_sd), _usable_sd(vertical_sd)
        told_ns, cov_n = self._sky or (t_ns, None)
        if abs(t_ns - told_ns) > self._settings.sky_age_s * SECOND_NS:  # others are used by now
            cov_n = None
        if cov_n is not None:
            cov_n = inflate_to_stated(cov_n, (level, level, high))
        elif level and high:
            cov_n = np.diag(np.square([level, level, high]))
        newer = self._fix is None or t_ns > self._fix.t_ns
        somewhere = abs(place.lat) <= math.pi / 2 and abs(place.lon) <= 2.0 * math.pi and abs(place.alt) < MAX_LENGTH_M
        if newer and cov_n is not None and somewhere:
            self._fix = _Fix(t_ns, ecef_from_geodetic(*place), cov_n)

    def feed_velocity(self, t_ns: int, north: float, east: float, down: float) -> None:
        """Velocity [m/s], true at t_ns."""
        newer = self._velocity is None or t_ns > self._velocity[0]
        if newer and all(abs(component) < MAX_SPEED_MPS for component in (north, east, down)):
            self._velocity = t_ns, np.array([north, east, down])

    def feed_dme(self, t_ns: int, station: str, slant_range: float | None) -> None:
        """A range [m] to a station, true at t_ns; of a station that is not known, or without a range, nothing."""
        last = self._ranges.get(station)
        newer = station in self._stations_e and (last is None or t_ns > last.t_ns)
        if newer and slant_range is not None and 0.0 <= slant_range < MAX_LENGTH_M:
            self._ranges[station] = _Range(t_ns, slant_range)

    def feed_height(self, t_ns: int, height_agl: float, sd: float | None, ground: float, ground_sd: float) -> None:
        """Height of P above ground [m], true at t_ns, and of the ground there above the ellipsoid [m].

        sd : None takes that of the data sheet (``accuracy.HG9550``)
        """
        own = float(altimeter_sd(height_agl)) if sd is None else sd
        entry = _Height(t_ns, height_agl + ground, math.hypot(own, ground_sd))
        newer = self._height is None or t_ns > self._height.t_ns
        if newer and abs(entry.alt) < MAX_LENGTH_M and MIN_SD <= entry.sd < MAX_LENGTH_M:
            self._height = entry

    # ------------------------------------------------------------------------------------------------------ telling

    def at(self, t_ns: int) -> RadioState:
        """The position at t_ns from what is fresh then."""
        observed = self._observations(t_ns)
        start_e = self._start(t_ns, observed)
        if start_e is None:
            missing = self._missing(observed)
            return RadioState(t_ns, valid=False, reasons=(*missing, Reason.GEOMETRY) if observed else missing)
        height = self._height if _is_fresh(self._height, t_ns, self._settings.height_age_s) else None
        sds = height_sd(observed, start_e), height.sd if height else None
        chosen = choose_altitude(*sds)
        source = chosen[0] if chosen else None
        if height and source is AltitudeSource.ALTIMETER:
            observed[HEIGHT] = AltitudeObservation(height.alt, height.sd)
        solution, refused, agreed = solve_consistent(observed, start_e)
        if solution is None or (agreed and is_mirror_ambiguous(observed, solution)):
            reasons = *self._missing(observed), Reason.GEOMETRY
            return RadioState(t_ns, valid=False, reasons=reasons, ranges_sd=sds[0], altimeter_sd=sds[1])
        agreed = agreed and not self._jumps(t_ns, solution)
        if agreed:
            self._last = _LastSolution(t_ns, solution.x[:3], _spread(solution))
        return dataclasses.replace(
            _state(t_ns, solution, agreed), ranges_sd=sds[0], altimeter_sd=sds[1], used=tuple(observed),
            source=source if HEIGHT in observed else AltitudeSource.RANGES, refused=refused,
        )  # fmt: skip

    def _observations(self, t_ns: int) -> dict[str, FixObservation]:
        """What is fresh, without the altimeter, moved to t_ns."""
        s = self._settings
        observed: dict[str, FixObservation] = {}
        if self._fix and _is_fresh(self._fix, t_ns, s.fix_age_s):
            lat, lon, _ = geodetic_from_ecef(self._fix.pos_e)
            turn = mat_en(lat, lon)
            cov_n = self._fix.cov_n + self._growth(self._fix.t_ns, t_ns) ** 2 * np.eye(3)
            observed[FIX] = PositionObservation(
                self._fix.pos_e + self._displacement(self._fix.t_ns, t_ns, turn), turn @ cov_n @ turn.T
            )
        for name, entry in sorted(self._ranges.items()):
            if _is_fresh(entry, t_ns, s.dme_age_s):
                moved = self._stations_e[name] + self._displacement(entry.t_ns, t_ns, self._turn())
                sd = math.hypot(s.dme_sd, self._growth(entry.t_ns, t_ns))
                observed[name] = RangeObservation(moved[None], np.array([entry.metres]), np.array([sd]), clock=False)
        return observed

    def _start(self, t_ns: int, observed: Mapping[str, FixObservation]) -> Array | None:
        """Where the iteration begins: the last position, the fix, or amid three stations and more."""
        place = observed.get(FIX)
        if isinstance(place, PositionObservation):
            return place.pos_e
        if not observed:
            return None
        if self._last and abs(t_ns - self._last.t_ns) <= self._settings.last_age_s * SECOND_NS:
            return self._last.pos_e + self._displacement(self._last.t_ns, t_ns, self._turn())
        points = [o.points_e[0] for o in observed.values() if isinstance(o, RangeObservation)]
        return np.asarray(np.mean(points, axis=0)) if len(points) >= MIN_STATIONS else None

    def _jumps(self, t_ns: int, solution: LeastSquaresSolution) -> bool:
        """Whether nobody comes in the time from the last solution to this one."""
        last = self._last
        if last is None or abs(t_ns - last.t_ns) > self._settings.jump_age_s * SECOND_NS:
            return False
        way = solution.x[:3] - last.pos_e - self._displacement(last.t_ns, t_ns, self._turn())
        most = MAX_TEST * math.hypot(last.sd, _spread(solution), self._growth(last.t_ns, t_ns))
        return not float(np.linalg.norm(way)) <= most

    def _turn(self) -> Array:
        """n to e, about here: a degree of latitude off turns the velocity of a few seconds by metres."""
        near = self._last.pos_e if self._last else next(iter(self._stations_e.values()), np.array([1.0, 0.0, 0.0]))
        lat, lon, _ = geodetic_from_ecef(near)
        return mat_en(lat, lon)

    def _displacement(self, then_ns: int, t_ns: int, turn: Array) -> Array:
        """How far one has come since then [m], e frame; nothing when the velocity is unknown."""
        if self._velocity is None or not self._knows_velocity(t_ns):
            return np.zeros(3)
        return np.asarray(turn @ self._velocity[1] * ((t_ns - then_ns) / SECOND_NS))

    def _growth(self, then_ns: int, t_ns: int) -> float:
        """One sigma of what ``_displacement`` does not know of the way since then [m]."""
        speed = SPEED_UNKNOWN
        if self._velocity and self._knows_velocity(t_ns):
            speed = VELOCITY_SD + MANOEUVRE * abs(t_ns - self._velocity[0]) / SECOND_NS
        return speed * abs(t_ns - then_ns) / SECOND_NS

    def _knows_velocity(self, t_ns: int) -> bool:
        age_ns = self._settings.velocity_age_s * SECOND_NS
        return self._velocity is not None and abs(t_ns - self._velocity[0]) <= age_ns

    def _missing(self, observed: Mapping[str, FixObservation]) -> tuple[Reason, ...]:
        stations = any(isinstance(o, RangeObservation) for o in observed.values())
        table = ((Reason.NO_SATELLITES, FIX not in observed), (Reason.NO_DME, not stations))
        return tuple(reason for reason, so in table if so)


def _spread(solution: LeastSquaresSolution) -> float:
    """One sigma of a place, its three axes together [m]."""
    return math.sqrt(float(np.trace(solution.cov[:3, :3])))


def _usable_sd(sd: float | None) -> float:
    """A sigma, or 0 for what is none."""
    return sd if sd is not None and MIN_SD <= sd < MAX_LENGTH_M else 0.0


def _is_fresh(entry: _Range | _Fix | _Height | None, t_ns: int, age_s: float) -> bool:
    return entry is not None and abs(t_ns - entry.t_ns) <= age_s * SECOND_NS


def _state(t_ns: int, solution: LeastSquaresSolution, agreed: bool) -> RadioState:
    """A solution as it is told; it is valid when what it rests on agrees."""
    lat, lon, alt = map(float, solution.geodetic())
    north, east, down = np.diag(solution.cov_n()).tolist()
    return RadioState(
        t_ns, valid=agreed, reasons=() if agreed else (Reason.REJECTED,),
        lat=lat, lon=lon, alt=alt, horizontal_sd=math.sqrt(0.5 * (north + east)), vertical_sd=math.sqrt(down),
    )  # fmt: skip
