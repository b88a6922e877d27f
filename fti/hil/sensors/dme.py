"""Distance-measuring equipment: four stations about the airfield, and an interrogator that scans them.

The stations are invented: one on the airfield, three in the country about it, given by their place before and beside
the threshold.  A station answers when it is seen: over the terrain, and not below the horizon of radio waves, which
bends with four thirds of the Earth's radius,

    d <= sqrt(2 k R) (sqrt(h_1) + sqrt(h_2)),     k = 4/3

h above the runway's plane.  A station that is seen answers a share ``REPLY_PROBABILITY`` of what it is asked (as much as ICAO
Annex 10, volume I, 3.5.4.2.8.1, asks of one under load); a scanning interrogator asks each once every ``SCAN_S``.
Between replies, and for ``MEMORY_S`` after the last one, it goes on with the speed that it has found; then it is
unlocked and says so.  It has locked again when it has been answered for ``SEARCH_S``.

Error, two sigma: 0.17 NM of the interrogator and 0.1 NM of the station, 0.2 NM together, at any distance (ICAO Annex
10, volume I, 3.5.3.1.3.3; Doc 8168, volume II); most of it is slow, 15 m change from reply to reply.  Scanning, memory
and search times are assumed ones of the usual size (ARINC 709).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from fti.constants import NAUTICAL_MILE
from fti.geodesy.wgs84 import SEMI_MAJOR
from fti.hil.environment import Environment
from fti.hil.flight.trajectory import FlightState
from fti.hil.sensors.errors import gauss_markov_noise
from fti.hil.sensors.fast_messages import new_dme_range
from fti.terrain.ray_outcome import RayOutcome
from fti.types import Measurement, Stamp

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

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
    """A scanning interrogator that follows four stations, sampled at t [s]."""

    def __init__(self, state: FlightState, world: Environment, t: Array, rng: np.random.Generator) -> None:
        asked = np.arange(0.0, world.duration, SCAN_S)
        at = np.clip(np.searchsorted(asked, t, side="right") - 1, 0, None)
        there = world.state(asked)
        self._ranges = np.column_stack([_indicated_ranges(asked, *sight(there, world, s), rng)[at] for s in STATIONS_M])

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        """The four ranges of sample k; of a station that is not locked, none."""
        told = zip(STATIONS, self._ranges[k].tolist(), strict=True)
        return [
            new_dme_range(stamp=stamp, station=name, slant_range=None if math.isnan(r) else r, valid=not math.isnan(r))
            for name, r in told
        ]


def _indicated_ranges(asked: Array, distance: Array, seen: Mask, rng: np.random.Generator) -> Array:
    """What is told of a station after each interrogation [m]."""
    slowly = gauss_markov_noise(asked, STATION_SD, STATION_PERIOD_S, rng) + gauss_markov_noise(
        asked, INTERROGATOR_SD, INTERROGATOR_PERIOD_S, rng
    )
    answered = seen & (rng.uniform(size=len(asked)) < REPLY_PROBABILITY)
    answered[0] = seen[0]  # it has been followed before
    return track_range(asked, distance, distance + slowly + rng.normal(0.0, REPLY_SD, len(asked)), answered)


def sight(state: FlightState, world: Environment, station: tuple[float, float, float]) -> tuple[Array, Mask]:
    """Slant range [m] from the places of a flight to a station, and whether it is seen, shape (n,)."""
    path, frame = world.path, world.terrain.frame
    lat, lon = path.geodetic(path.x_gpi + station[0], station[1])
    level = path.airfield.threshold_alt_m
    there_l = frame.to_local(lat, lon, level + station[2])
    here_l = frame.to_local(state.lat, state.lon, state.alt)
    line = there_l - here_l
    distance = np.linalg.norm(line, axis=-1)
    met, outcome = world.terrain.trace(here_l, line, math.inf)
    hidden = (outcome == RayOutcome.HIT) & (met < distance)
    reach = np.sqrt(2.0 * HORIZON_RADIUS) * (np.sqrt(np.maximum(state.alt - level, 0.0)) + math.sqrt(station[2]))
    return distance, np.asarray(~hidden & (distance < reach))


def track_range(asked: Array, distance: Array, replies: Array, answered: Mask) -> Array:
    """The range told after each interrogation at ``asked`` [s], shape (n,) [m]; NaN while it is not locked.

    distance : true ones [m], for the speed; replies : ranges of the replies [m], where it was answered
    """
    step, n = np.arange(len(asked)), len(asked)
    last = np.maximum.accumulate(np.where(answered, step, -1))
    silent_s = asked - asked[last]
    told = replies[last] + np.gradient(distance, asked)[last] * silent_s
    before = np.concatenate([[0], last[:-1]]).clip(0)
    found_again = answered & (asked - asked[before] > MEMORY_S)
    since = np.maximum.accumulate(np.where(found_again, step, -n))
    searching = (since >= 0) & (asked - asked[since.clip(0)] < SEARCH_S)
    locked = (last >= 0) & (silent_s <= MEMORY_S) & ~searching
    return np.where(locked, told, np.nan)
