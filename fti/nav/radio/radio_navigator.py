"""Live position and height from a receiver's fix with its satellites, DME ranges, and a radio altimeter.

The receiver's fix represents its satellites: its covariance is sigma_G^2 (H_G^T H_G)^-1 of the satellites used, so it
has the weight of their pseudoranges, which receivers do not report with satellite positions.  If the receiver states a
larger sigma (jamming, reflections, satellites lost for a while), that one is used.  A receiver with fewer than four
satellites has no fix, and its satellite directions are not used.

Ranges of the last seconds are extrapolated with the velocity.  Their sigma grows for a manoeuvre of ``MANOEUVRE`` since
the velocity was valid, or for any motion if there is no velocity.  The sigma of the height is predicted for satellites
and stations, and for the altimeter over known ground.  If the altimeter's is smaller, its height is one more
observation.  Without satellites it is nearly always used: ranges to ground stations hardly determine the height.

Inconsistent observations are refused (``observation_consistency``); if the faulty one cannot be identified, the
position is not valid.  Two stations have two solutions: the one nearer to the last position is used, if that is not
older than ``last_age_s`` and the other side is far away; otherwise none.  Two wrong ranges may be consistent: a
solution that cannot be reached from the last one in the time is refused, for at most ``jump_age_s``.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.constants import SECOND_NS
from fti.geodesy.rotations import mat_en
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef
from fti.messages.reasons import Reason
from fti.nav.least_squares import (
    AltitudeObservation,
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

#: Limits of plausible height, range and sigma [m], and of speed [m/s].
MAX_LENGTH_M, MAX_SPEED_MPS = 1e6, 1e4
#: Smaller sigmas are ignored [m].
MIN_SD = 1e-3
HEIGHT = "altimeter"
#: One sigma of a velocity [m/s], of its change [m/s^2], and of an unknown velocity [m/s].
VELOCITY_SD, MANOEUVRE, SPEED_UNKNOWN = 0.2, 2.0, 60.0


class GeodeticPoint(NamedTuple):
    """Geodetic position of a DME station or a fix: lat, lon [rad], alt above the ellipsoid [m]."""

    lat: float
    lon: float
    alt: float


@dataclass(frozen=True, slots=True)
class RadioSettings:
    """One sigma of a pseudorange and of a DME range [m].

    ..._age_s : maximum age of a fix, a range, a height, a velocity and a last position [s]
    sky_age_s : maximum time between a fix and its satellite directions, which come every 1 s to 5 s [s]
    jump_age_s : for so long after the last solution, one that cannot be reached from it is refused [s]
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
    """Position of P from radio observations.

    lat, lon [rad], alt above the ellipsoid [m]; horizontal_sd of each axis, vertical_sd [m]: None without a solution
    source                   : source of the height
    ranges_sd, altimeter_sd  : predicted sigma of the height from each of the two [m]; None if unknown
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
    """Takes observations in any order of time, and solves on demand.  stations : receivable ones, by name"""

    def __init__(self, stations: Mapping[str, GeodeticPoint], settings: RadioSettings | None = None) -> None:
        self._stations_e = {name: ecef_from_geodetic(*station) for name, station in stations.items()}
        self._settings = settings or RadioSettings()
        self._ranges: dict[str, _Range] = {}
        self._sky: tuple[int, Array | None] | None = None
        self._fix: _Fix | None = None
        self._height: _Height | None = None
        self._velocity: tuple[int, Array] | None = None
        self._last: _LastSolution | None = None

    # ----------------------------------------------------------------------------------------------------------- inputs

    def feed_satellites(self, t_ns: int, azimuth: Array, elevation: Array) -> None:
        """Directions of the satellites that the receiver uses at t_ns, shapes (n,) [rad], for the next fixes."""
        known = np.isfinite(azimuth) & np.isfinite(elevation)
        self._sky = t_ns, fix_covariance(azimuth[known], elevation[known], self._settings.satellite_sd)

    def feed_fix(self, t_ns: int, point: GeodeticPoint, horizontal_sd: float | None, vertical_sd: float | None) -> None:
        """A receiver's position, valid at t_ns.  The sigmas are used if larger, or if its satellites are unknown."""
        horizontal, vertical = _usable_sd(horizontal_sd), _usable_sd(vertical_sd)
        sky_ns, cov_n = self._sky or (t_ns, None)
        if abs(t_ns - sky_ns) > self._settings.sky_age_s * SECOND_NS:  # other satellites are used by now
            cov_n = None
        if cov_n is not None:
            cov_n = inflate_to_stated(cov_n, (horizontal, horizontal, vertical))
        elif horizontal and vertical:
            cov_n = np.diag(np.square([horizontal, horizontal, vertical]))
        newer = self._fix is None or t_ns > self._fix.t_ns
        is_valid = abs(point.lat) <= math.pi / 2 and abs(point.lon) <= 2.0 * math.pi and abs(point.alt) < MAX_LENGTH_M
        if newer and cov_n is not None and is_valid:
            self._fix = _Fix(t_ns, ecef_from_geodetic(*point), cov_n)

    def feed_velocity(self, t_ns: int, north: float, east: float, down: float) -> None:
        """Velocity [m/s], valid at t_ns."""
        newer = self._velocity is None or t_ns > self._velocity[0]
        if newer and all(abs(component) < MAX_SPEED_MPS for component in (north, east, down)):
            self._velocity = t_ns, np.array([north, east, down])

    def feed_dme(self, t_ns: int, station: str, slant_range: float | None) -> None:
        """A range [m] to a station, valid at t_ns; unknown stations and missing ranges are ignored."""
        last = self._ranges.get(station)
        newer = station in self._stations_e and (last is None or t_ns > last.t_ns)
        if newer and slant_range is not None and 0.0 <= slant_range < MAX_LENGTH_M:
            self._ranges[station] = _Range(t_ns, slant_range)

    def feed_height(self, t_ns: int, height_agl: float, sd: float | None, ground: float, ground_sd: float) -> None:
        """Height of P above ground [m], valid at t_ns, and ground elevation there above the ellipsoid [m].

        sd : None: that of the data sheet (``altitude_accuracy.HG9550``)
        """
        own = float(altimeter_sd(height_agl)) if sd is None else sd
        entry = _Height(t_ns, height_agl + ground, math.hypot(own, ground_sd))
        newer = self._height is None or t_ns > self._height.t_ns
        if newer and abs(entry.alt) < MAX_LENGTH_M and MIN_SD <= entry.sd < MAX_LENGTH_M:
            self._height = entry

    # ---------------------------------------------------------------------------------------------------------- outputs

    def at(self, t_ns: int) -> RadioState:
        """The position at t_ns from all fresh observations."""
        observations = self._observations(t_ns)
        start_e = self._start(t_ns, observations)
        if start_e is None:
            missing = self._missing(observations)
            return RadioState(t_ns, valid=False, reasons=(*missing, Reason.GEOMETRY) if observations else missing)
        height = self._height if _is_fresh(self._height, t_ns, self._settings.height_age_s) else None
        sds = height_sd(observations, start_e), height.sd if height else None
        chosen = choose_altitude(*sds)
        source = chosen[0] if chosen else None
        if height and source is AltitudeSource.ALTIMETER:
            observations[HEIGHT] = AltitudeObservation(height.alt, height.sd)
        solution, refused, is_consistent = solve_consistent(observations, start_e)
        if solution is None or (is_consistent and is_mirror_ambiguous(observations, solution)):
            reasons = *self._missing(observations), Reason.GEOMETRY
            return RadioState(t_ns, valid=False, reasons=reasons, ranges_sd=sds[0], altimeter_sd=sds[1])
        is_consistent = is_consistent and not self._jumps(t_ns, solution)
        if is_consistent:
            self._last = _LastSolution(t_ns, solution.x[:3], _spread(solution))
        return dataclasses.replace(
            _state(t_ns, solution, is_consistent), ranges_sd=sds[0], altimeter_sd=sds[1], used=tuple(observations),
            source=source if HEIGHT in observations else AltitudeSource.RANGES, refused=refused,
        )  # fmt: skip

    def _observations(self, t_ns: int) -> dict[str, FixObservation]:
        """Fresh observations without the altimeter, extrapolated to t_ns."""
        s = self._settings
        observations: dict[str, FixObservation] = {}
        if self._fix and _is_fresh(self._fix, t_ns, s.fix_age_s):
            lat, lon, _ = geodetic_from_ecef(self._fix.pos_e)
            turn = mat_en(lat, lon)
            cov_n = self._fix.cov_n + self._growth(self._fix.t_ns, t_ns) ** 2 * np.eye(3)
            observations[FIX] = PositionObservation(
                self._fix.pos_e + self._displacement(self._fix.t_ns, t_ns, turn), turn @ cov_n @ turn.T
            )
        for name, entry in sorted(self._ranges.items()):
            if _is_fresh(entry, t_ns, s.dme_age_s):
                moved = self._stations_e[name] + self._displacement(entry.t_ns, t_ns, self._turn())
                sd = math.hypot(s.dme_sd, self._growth(entry.t_ns, t_ns))
                observations[name] = RangeObservation(
                    moved[None], np.array([entry.metres]), np.array([sd]), clock=False
                )
        return observations

    def _start(self, t_ns: int, observations: Mapping[str, FixObservation]) -> Array | None:
        """Start of the iteration: the fix, the last position, or the mean of three or more stations."""
        fix = observations.get(FIX)
        if isinstance(fix, PositionObservation):
            return fix.pos_e
        if not observations:
            return None
        if self._last and abs(t_ns - self._last.t_ns) <= self._settings.last_age_s * SECOND_NS:
            return self._last.pos_e + self._displacement(self._last.t_ns, t_ns, self._turn())
        points = [o.points_e[0] for o in observations.values() if isinstance(o, RangeObservation)]
        return np.asarray(np.mean(points, axis=0)) if len(points) >= MIN_STATIONS else None

    def _jumps(self, t_ns: int, solution: LeastSquaresSolution) -> bool:
        """Whether no aircraft can fly from the last solution to this one in the time."""
        last = self._last
        if last is None or abs(t_ns - last.t_ns) > self._settings.jump_age_s * SECOND_NS:
            return False
        displacement = solution.x[:3] - last.pos_e - self._displacement(last.t_ns, t_ns, self._turn())
        limit = MAX_TEST * math.hypot(last.sd, _spread(solution), self._growth(last.t_ns, t_ns))
        return not float(np.linalg.norm(displacement)) <= limit

    def _turn(self) -> Array:
        """n to e, approximately here: one degree of latitude rotates the displacement of a few seconds by metres."""
        near = self._last.pos_e if self._last else next(iter(self._stations_e.values()), np.array([1.0, 0.0, 0.0]))
        lat, lon, _ = geodetic_from_ecef(near)
        return mat_en(lat, lon)

    def _displacement(self, from_ns: int, t_ns: int, turn: Array) -> Array:
        """Displacement since ``from_ns`` [m], e frame; zero if the velocity is unknown."""
        if self._velocity is None or not self._knows_velocity(t_ns):
            return np.zeros(3)
        return np.asarray(turn @ self._velocity[1] * ((t_ns - from_ns) / SECOND_NS))

    def _growth(self, from_ns: int, t_ns: int) -> float:
        """One sigma of the error of ``_displacement`` [m]."""
        speed = SPEED_UNKNOWN
        if self._velocity and self._knows_velocity(t_ns):
            speed = VELOCITY_SD + MANOEUVRE * abs(t_ns - self._velocity[0]) / SECOND_NS
        return speed * abs(t_ns - from_ns) / SECOND_NS

    def _knows_velocity(self, t_ns: int) -> bool:
        age_ns = self._settings.velocity_age_s * SECOND_NS
        return self._velocity is not None and abs(t_ns - self._velocity[0]) <= age_ns

    def _missing(self, observations: Mapping[str, FixObservation]) -> tuple[Reason, ...]:
        stations = any(isinstance(o, RangeObservation) for o in observations.values())
        table = ((Reason.NO_SATELLITES, FIX not in observations), (Reason.NO_DME, not stations))
        return tuple(reason for reason, holds in table if holds)


def _spread(solution: LeastSquaresSolution) -> float:
    """One sigma of a position, root sum square of three axes [m]."""
    return math.sqrt(float(np.trace(solution.cov[:3, :3])))


def _usable_sd(sd: float | None) -> float:
    """The sigma, or 0 if it is not usable."""
    return sd if sd is not None and MIN_SD <= sd < MAX_LENGTH_M else 0.0


def _is_fresh(entry: _Range | _Fix | _Height | None, t_ns: int, age_s: float) -> bool:
    return entry is not None and abs(t_ns - entry.t_ns) <= age_s * SECOND_NS


def _state(t_ns: int, solution: LeastSquaresSolution, is_consistent: bool) -> RadioState:
    """The state of a solution; it is valid if the observations are consistent."""
    lat, lon, alt = map(float, solution.geodetic())
    north, east, down = np.diag(solution.cov_n()).tolist()
    return RadioState(
        t_ns, valid=is_consistent, reasons=() if is_consistent else (Reason.REJECTED,),
        lat=lat, lon=lon, alt=alt, horizontal_sd=math.sqrt(0.5 * (north + east)), vertical_sd=math.sqrt(down),
    )  # fmt: skip
