"""A flight with each schedule, with the ground and without."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fti.arrays import Array
from fti.study.ground_flights import GroundCase, GroundRun, Satellites, displaced, fly
from fti.terrain.dem_error import DemError

SECONDS = 250.0
#: Parts of the flight with degraded or no satellites [s] (tables 7.4 and 7.5).
PARTS = ((30.0, 40.0), (80.0, 100.0), (170.0, 200.0))
DEGRADED = tuple(Satellites(*part, sds) for part, sds in zip(PARTS, ((4.0, 6.0), (5.0, 7.0), (6.0, 8.0)), strict=True))
OUTAGES = tuple(Satellites(*part, None) for part in PARTS)
#: One sigma of the displacement of the map for each axis, stated and drawn [m].
MAP_SD_M = 1.0
#: One sigma of the error of the elevation [m]: of a laser survey, and of an older map, which is flown so often.
SURVEY_SD_M, OLD_MAP_SD_M, OLD_MAP_RUNS = 0.5, 1.5, 20
#: Profiles of 10 s: three that agree are known 30 s after the alignment, as in the source.
BASE = GroundCase(seconds=SECONDS, window_s=10.0, map_sd=MAP_SD_M)
SCHEDULES = {"degraded": DEGRADED, "outages": OUTAGES}
#: From here on errors are compared with their sigma, and at these instants [s].
COMPARED_FROM_S, INSTANTS_S = 35.0, tuple(np.linspace(40.0, 245.0, 10))


@dataclass(frozen=True, eq=False)
class Track:
    """Of the filter, every second: time (n,) [s], error over sigma north and east (n, 2), distance (n,) [m].

    refusals : number of times at which a source that is sound was refused
    """

    t: Array
    ratio: Array
    distance: Array
    refusals: int = 0

    def rms(self, part: tuple[float, float]) -> float:
        """RMS of the horizontal error in a part of the flight [m]."""
        inside = (self.t >= part[0]) & (self.t < part[1])
        return float(np.sqrt(np.mean(self.distance[inside] ** 2)))


@dataclass(frozen=True, eq=False)
class Pair:
    """The same flight with the ground and without."""

    with_ground: Track
    without: Track


#: The pairs of one run by schedule and sigma of the elevation; none of the old map after ``OLD_MAP_RUNS`` runs.
Pairs = dict[tuple[str, float], Pair]


def fly_schedule(name: str, elevation_sd: float | None, seed: int, number: int) -> GroundRun:
    """One flight of a schedule.  elevation_sd : one sigma of the error of the elevation [m]; None: no ground aids"""
    if elevation_sd is None:
        return fly(replace(BASE, satellites=SCHEDULES[name], window_s=None), seed, number)
    case = replace(BASE, satellites=SCHEDULES[name], dem_error=DemError(noise_sd=elevation_sd))
    return fly(displaced(case, seed, number), seed, number)


def run(task: tuple[int, int]) -> Pairs:
    """Flight ``number`` of a seed, with each schedule and elevation."""
    seed, number = task
    sds = (SURVEY_SD_M, OLD_MAP_SD_M) if number < OLD_MAP_RUNS else (SURVEY_SD_M,)
    pairs = {}
    for name in SCHEDULES:
        without = _track(fly_schedule(name, None, seed, number))
        pairs.update({(name, sd): Pair(_track(fly_schedule(name, sd, seed, number)), without) for sd in sds})
    return pairs


def _track(run_: GroundRun) -> Track:
    error = np.array(run_.error)
    refusals = sum(event.level == "warning" for _, event in run_.events)
    return Track(np.array(run_.t), error / run_.sd, np.hypot(*error.T), refusals)
