"""Distance-measuring equipment: four stations around the airfield, and a scanning interrogator.

The stations are fictitious: one on the airfield, three around it, at positions relative to the threshold.  A station
replies when it is in line of sight: not hidden by terrain, and above the radio horizon with four thirds of the Earth's
radius,

    d <= sqrt(2 k R) (sqrt(h_1) + sqrt(h_2)),     k = 4/3

h above the runway's plane.  The reply probability of a station in sight is ``REPLY_PROBABILITY`` (the minimum under
load of ICAO Annex 10, volume I, 3.5.4.2.8.1); the interrogator interrogates each station once every ``SCAN_S``.
Between replies, and for ``MEMORY_S`` after the last one, it extrapolates the range with the estimated speed; then it is
unlocked.  It locks again after replies for ``SEARCH_S``.

Error, two sigma: 0.17 NM of the interrogator and 0.1 NM of the station, 0.2 NM together, at any distance (ICAO Annex
10, volume I, 3.5.3.1.3.3; Doc 8168, volume II); most of it is slow, 15 m vary from reply to reply.  Scanning, memory
and search times are assumed, of usual size (ARINC 709).
"""

from __future__ import annotations

import math

import numpy as np

from fti.arrays import Array, Mask
from fti.constants import NAUTICAL_MILE
from fti.geodesy.formulas import SEMI_MAJOR
from fti.hil.environment import Environment
from fti.hil.flight.trajectory import FlightState
from fti.hil.sensors.errors import gauss_markov_noise
from fti.messages.measurements import DmeRange, Measurement, Stamp
from fti.terrain.ray_outcome import RayOutcome

#: Stations: distance before and right of the threshold, height above it [m].
STATIONS_M = (
    (-2500.0, 150.0, 15.0),
    (31_000.0, 12_000.0, 40.0),
    (-18_000.0, -44_000.0, 600.0),
    (9000.0, 71_000.0, 90.0),
)
STATIONS = tuple(f"dme_{n}" for n, _ in enumerate(STATIONS_M, 1))
STATION_SD, STATION_PERIOD_S = 0.05 * NAUTICAL_MILE, 3600.0
INTERROGATOR_SD, INTERROGATOR_PERIOD_S, REPLY_SD = 0.085 * NAUTICAL_MILE, 120.0, 15.0
REPLY_PROBABILITY, SCAN_S, MEMORY_S, SEARCH_S = 0.7, 0.1, 10.0, 1.0
HORIZON_RADIUS = 4.0 / 3.0 * SEMI_MAJOR


class Interrogator:
    """A scanning interrogator that tracks four stations, sampled at t [s]."""

    def __init__(self, state: FlightState, world: Environment, t: Array, rng: np.random.Generator) -> None:
        scan_t = np.arange(0.0, world.duration, SCAN_S)
        at = np.clip(np.searchsorted(scan_t, t, side="right") - 1, 0, None)
        states = world.state(scan_t)
        self._ranges = np.column_stack(
            [_indicated_ranges(scan_t, *sight(states, world, s), rng)[at] for s in STATIONS_M]
        )

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """The four ranges of sample k; an unlocked station has none."""
        return [
            DmeRange(stamp=stamp, station=name, slant_range=None if math.isnan(r) else r, valid=not math.isnan(r))
            for name, r in zip(STATIONS, self._ranges[k].tolist(), strict=True)
        ]


def _indicated_ranges(t: Array, distance: Array, in_sight: Mask, rng: np.random.Generator) -> Array:
    """Indicated range of a station after each interrogation at t [s], shape (n,) [m]."""
    slow_error = gauss_markov_noise(t, STATION_SD, STATION_PERIOD_S, rng) + gauss_markov_noise(
        t, INTERROGATOR_SD, INTERROGATOR_PERIOD_S, rng
    )
    has_reply = in_sight & (rng.uniform(size=len(t)) < REPLY_PROBABILITY)
    has_reply[0] = in_sight[0]  # the station was tracked before the flight
    return track_range(t, distance, distance + slow_error + rng.normal(0.0, REPLY_SD, len(t)), has_reply)


def sight(state: FlightState, world: Environment, station: tuple[float, float, float]) -> tuple[Array, Mask]:
    """Slant range [m] from the positions of a flight to a station, and whether it is in sight, shape (n,)."""
    path, frame = world.path, world.terrain.frame
    lat, lon = path.to_geodetic(path.x_gpi + station[0], station[1])
    level = path.airfield.threshold_alt_m
    aircraft_l = frame.to_local(state.lat, state.lon, state.alt)
    line = frame.to_local(lat, lon, level + station[2]) - aircraft_l
    distance = np.linalg.norm(line, axis=-1)
    hit_range, outcome = world.terrain.trace(aircraft_l, line, math.inf)
    hidden = (outcome == RayOutcome.HIT) & (hit_range < distance)
    horizon = np.sqrt(2.0 * HORIZON_RADIUS) * (np.sqrt(np.maximum(state.alt - level, 0.0)) + math.sqrt(station[2]))
    return distance, np.asarray(~hidden & (distance < horizon))


def track_range(t: Array, distance: Array, replies: Array, has_reply: Mask) -> Array:
    """The indicated range after each interrogation at t [s], shape (n,) [m]; NaN while unlocked.

    distance : true range [m], for the speed; replies : ranges of the replies [m], valid where ``has_reply``
    """
    step, n = np.arange(len(t)), len(t)
    last = np.maximum.accumulate(np.where(has_reply, step, -1))
    silent_s = t - t[last]
    indicated = replies[last] + np.gradient(distance, t)[last] * silent_s
    before = np.concatenate([[0], last[:-1]]).clip(0)
    reacquired = has_reply & (t - t[before] > MEMORY_S)
    since = np.maximum.accumulate(np.where(reacquired, step, -n))
    searching = (since >= 0) & (t - t[since.clip(0)] < SEARCH_S)
    locked = (last >= 0) & (silent_s <= MEMORY_S) & ~searching
    return np.where(locked, indicated, np.nan)
