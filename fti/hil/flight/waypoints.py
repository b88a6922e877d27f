"""A flight along waypoints: straight legs, and turns of a bank limit that begin before each waypoint (fly-by).

    radius = speed^2 / (g tan bank)          the turn touches both legs  radius tan(turn / 2)  from the waypoint

Legs are great circles between positions on the ellipsoid; height and speed change linearly between waypoints.  Lines
and arcs alone would give steps of the bank angle, so positions are averaged over ``SMOOTH_S`` (a raised cosine): the
aeroplane rolls and pitches over that time, flies inside its turns by acceleration times 0.033 SMOOTH_S^2 / 2, 3 m at
25 deg of bank, and keeps the bank limit.  The limit holds in still air and without vertical acceleration: pushing over
a crest in a turn needs more bank.
Source: Spiegel 2018, 7.1; ICAO Doc 8168, volume II, part I, section 2, chapter 3 (fly-by turns).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.constants import STANDARD_GRAVITY
from fti.geodesy.local import LocalFrame
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef
from fti.hil.flight.coordinated_flight import coordinated_flight
from fti.hil.flight.trajectory import PositionTrack, SplineFlight
from fti.hil.tables.flights import MAX_DURATION_S
from fti.nav.integrity.approach import EARTH_RADIUS

#: Averaging time of positions, and knot interval of the spline [s].
SMOOTH_S, KNOT_S = 6.0, 0.5
#: Step of the averaged path [s] and of the legs [m].
STEP_S, STEP_M = 0.125, 10.0
#: Extension of the legs beyond both ends [s]: half of the averaging time, and some knots.
MARGIN_S = 6.0
#: Smaller changes of direction are ignored [rad]; smaller distances between waypoints are an error [m].
MIN_TURN_RAD, MIN_DISTANCE_M = 1e-4, 1.0


@dataclass(frozen=True, slots=True)
class Waypoint:
    """lat, lon [rad], alt above the ellipsoid [m], speed over the ground [m/s]."""

    lat: float
    lon: float
    alt: float
    speed: float

    @property
    def normal_e(self) -> Array:
        """Normal of the ellipsoid, which defines the horizontal position."""
        return np.array(
            [np.cos(self.lat) * np.cos(self.lon), np.cos(self.lat) * np.sin(self.lon), np.sin(self.lat)]
        )  # fmt: skip


def waypoint_flight(waypoints: Sequence[Waypoint], bank: float, wind_n: tuple[float, float]) -> SplineFlight:
    """The flight from the first waypoint (t = 0) to the last one.

    bank   : in turns in still air [rad]; wind_n : velocity of the air, north and east [m/s]
    Raises ValueError with the index of the waypoint when turns do not fit into the legs or two waypoints coincide, and
    for a flight of more than ``MAX_DURATION_S``.
    """
    turns = _route(waypoints, bank)
    first = _extrapolated_waypoint(waypoints[1], waypoints[0])
    last = _extrapolated_waypoint(waypoints[-2], waypoints[-1])
    t, positions_e, end = _time_path([first, *waypoints, last], turns)
    if not end <= MAX_DURATION_S:
        raise ValueError(
            f"waypoint: {end:.0f} s from the first to the last; at most {MAX_DURATION_S:.0f} s are allowed"
        )
    fine = np.arange(-MARGIN_S, end + MARGIN_S, STEP_S)
    path_e = np.stack([np.interp(fine, t, axis) for axis in positions_e.T], axis=1)
    weights = np.hanning(round(SMOOTH_S / STEP_S) + 1)
    offsets = (path_e - path_e[0]).T
    averaged = np.stack([np.convolve(axis, weights / weights.sum(), mode="valid") for axis in offsets], axis=1)
    half, every = len(weights) // 2, round(KNOT_S / STEP_S)
    track = PositionTrack.from_positions(fine[half:-half][::every], *geodetic_from_ecef(path_e[0] + averaged[::every]))
    trim_speed = float(np.mean([w.speed for w in waypoints]))
    return coordinated_flight(track, wind_n, trim_speed).section(0.0, end)


@dataclass(frozen=True, eq=False)
class _Turn:
    """Turn at one waypoint: normals of its points from leg to leg, shape (k, 3); lead distance on each leg [m]."""

    normals_e: Array
    lead: float


def _route(waypoints: Sequence[Waypoint], bank: float) -> list[_Turn]:
    lengths = [EARTH_RADIUS * _angle(a.normal_e, b.normal_e) for a, b in itertools.pairwise(waypoints)]
    if min(lengths) < MIN_DISTANCE_M:
        k = int(np.argmin(lengths))
        raise ValueError(f"waypoint[{k}] and waypoint[{k + 1}] are at the same position")
    turns = [_Turn(waypoints[0].normal_e[None], 0.0)]
    turns += [_turn(*three, bank) for three in zip(waypoints, waypoints[1:], waypoints[2:], strict=False)]
    turns.append(_Turn(waypoints[-1].normal_e[None], 0.0))
    for i, (before, after) in enumerate(itertools.pairwise(turns)):
        if lengths[i] <= before.lead + after.lead:
            raise ValueError(
                f"waypoint[{i}] and waypoint[{i + 1}] are {lengths[i]:.0f} m apart, their turns need "
                f"{before.lead:.0f} m + {after.lead:.0f} m: fly slower, bank more, or move them"
            )
    return turns


def _turn(before: Waypoint, here: Waypoint, after: Waypoint, bank: float) -> _Turn:
    """The arc tangent to both legs, in the tangent plane of the Earth at the waypoint."""
    frame = LocalFrame(here.lat, here.lon, 0.0)
    inwards, outwards = -_course(frame, here, before), _course(frame, here, after)
    turn = np.arctan2(inwards[0] * outwards[1] - inwards[1] * outwards[0], inwards @ outwards)  # left positive
    if abs(turn) < MIN_TURN_RAD:
        return _Turn(here.normal_e[None], 0.0)
    radius = here.speed**2 / (STANDARD_GRAVITY * np.tan(bank))
    lead = radius * np.tan(abs(turn) / 2.0)
    along = np.linspace(0.0, abs(turn), int(np.ceil(abs(turn) * radius / STEP_M)) + 2)
    lateral = np.sign(turn) * np.array([-inwards[1], inwards[0]])
    points = (radius * np.sin(along) - lead)[:, None] * inwards + (radius * (1.0 - np.cos(along)))[:, None] * lateral
    up = -np.sum(points**2, axis=1) / (2.0 * EARTH_RADIUS)
    lat, lon, _ = frame.to_geodetic(np.column_stack((points, up)))
    level = np.cos(lat)
    return _Turn(np.stack((level * np.cos(lon), level * np.sin(lon), np.sin(lat)), axis=1), float(lead))


def _course(frame: LocalFrame, here: Waypoint, there: Waypoint) -> Array:
    """Initial direction of the great circle to another waypoint: unit vector, east and north."""
    east, north, _ = frame.mat_le @ there.normal_e
    length = np.hypot(east, north)
    return np.asarray((east / length, north / length))


def _angle(a: Array, b: Array) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def _extrapolated_waypoint(before: Waypoint, last: Waypoint) -> Waypoint:
    """The point 1.5 margins beyond the last waypoint on the extended leg."""
    angle = _angle(before.normal_e, last.normal_e)
    share = 1.0 + 1.5 * MARGIN_S * last.speed / EARTH_RADIUS / angle
    x, y, z = _interpolate_normals(before.normal_e, last.normal_e, share)
    alt = before.alt + share * (last.alt - before.alt)
    return Waypoint(float(np.arctan2(z, np.hypot(x, y))), float(np.arctan2(y, x)), alt, last.speed)


def _time_path(waypoints: Sequence[Waypoint], turns: Sequence[_Turn]) -> tuple[Array, Array, float]:
    """Times [s] and positions, shape (m, 3) [m], along the whole path, and the time at the last waypoint [s].

    waypoints : with margins; turns : of the waypoints between
    """
    arcs = [waypoints[0].normal_e[None], *(turn.normals_e for turn in turns), waypoints[-1].normal_e[None]]
    pieces = [arcs[0]]
    for before, arc in itertools.pairwise(arcs):
        pieces += [_leg(before[-1], arc[0]), arc]
    normals_e = np.concatenate(pieces)
    begins = np.cumsum([0, *map(len, pieces)])[:-1:2]
    index = [begin + len(arc) // 2 for begin, arc in zip(begins, arcs, strict=True)]
    level_e = _at_height(normals_e, np.zeros(len(normals_e)))
    way = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(level_e, axis=0), axis=1))))
    alt = np.interp(way, way[index], [w.alt for w in waypoints])
    speed = np.interp(way, way[index], [w.speed for w in waypoints])
    t = np.concatenate(([0.0], np.cumsum(2.0 * np.diff(way) / (speed[1:] + speed[:-1]))))
    t -= t[index[1]]
    return t, _at_height(normals_e, alt), float(t[index[-2]])


def _leg(start: Array, end: Array) -> Array:
    """Normals strictly between two, along the great circle, at most ``STEP_M`` apart."""
    steps = max(2, int(np.ceil(_angle(start, end) * EARTH_RADIUS / STEP_M)))
    return _interpolate_normals(start, end, np.linspace(0.0, 1.0, steps + 1)[1:-1, None])


def _interpolate_normals(start: Array, end: Array, share: float | Array) -> Array:
    """Normals at shares of the great circle from one to another; beyond them for shares outside 0 to 1."""
    angle = _angle(start, end)
    return np.asarray((np.sin((1.0 - share) * angle) * start + np.sin(share * angle) * end) / np.sin(angle))


def _at_height(normals_e: Array, alt: Array) -> Array:
    x, y, z = normals_e.T
    return ecef_from_geodetic(np.arctan2(z, np.hypot(x, y)), np.arctan2(y, x), alt)
