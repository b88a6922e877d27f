"""One flight of each case, and what was announced."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fti.messages.reasons import Reason
from fti.study.ground_flights import GroundCase, GroundRun, Satellites, fly
from fti.terrain.dem_error import DemError

MAP_OFF_M, MAP_SECONDS, ALONE_SECONDS, RAMP_S, ONSET = 100.0, 75.0, 150.0, 60.0, 0.02
#: Ramps [m/s], and how long a flight lasts after the begin of each [s].
RAMPS = {0.1: 400.0, 0.3: 180.0, 1.0: 110.0}
#: A position with a larger sigma may follow a displaced map [m].
MAX_SD_M = 20.0
DEM_ERROR = DemError(noise_sd=1.0)
#: Relief and duration of a profile [s] of the ramps.
GROUNDS = {"fine": ("hills", 5.0), "coarse": ("gentle", 10.0), "flat": ("flat", 10.0)}


@dataclass(frozen=True)
class Alert:
    """Time after the begin of the fault [s], infinite without one; error then, or at the end [m].

    beyond : seconds with an error beyond the protection level;  fix_sd : median sigma of the fixes [m]
    """

    after_s: float
    error_m: float
    beyond: int
    fix_sd: float


@dataclass(frozen=True)
class MapResult:
    """Of a displaced map.

    aided : fixes that aid with a sigma of the position up to ``MAX_SD_M``; aided_later : with a larger one
    """

    alert: Alert
    aided: int
    aided_later: int


@dataclass(frozen=True)
class WatchRun:
    """Of all cases.  ramps : by ground and speed"""

    map_off: MapResult
    alone: MapResult
    ramps: dict[tuple[str, float], Alert]
    nominal: Alert


def ramp_case(ground: str, speed: float) -> GroundCase:
    """A receiver that drifts to the east."""
    relief, window_s = GROUNDS[ground]
    seconds = RAMP_S + RAMPS[speed]
    return GroundCase(seconds, relief, window_s=window_s, map_sd=2.0, dem_error=DEM_ERROR, ramp=(RAMP_S, speed, ONSET))


def run(task: tuple[int, int]) -> WatchRun:
    """Flight ``number`` of a seed."""
    seed, number = task
    direction = float(np.random.default_rng([seed, number, 1]).uniform(0.0, math.tau))
    shift = MAP_OFF_M * math.sin(direction), MAP_OFF_M * math.cos(direction)
    map_off = GroundCase(MAP_SECONDS, window_s=10.0, map_sd=2.0, dem_error=DEM_ERROR, map_shift=shift)
    lost = (Satellites(3.0, ALONE_SECONDS, None),)
    alone = GroundCase(ALONE_SECONDS, window_s=10.0, map_sd=2.0, dem_error=DEM_ERROR, map_shift=shift, satellites=lost)
    nominal = GroundCase(MAP_SECONDS + RAMP_S, window_s=10.0, map_sd=2.0, dem_error=DEM_ERROR)
    ramps = {(ground, speed): ramp_case(ground, speed) for ground in GROUNDS for speed in RAMPS}
    return WatchRun(
        _map_result(fly(map_off, seed, number)),
        _map_result(fly(alone, seed, number)),
        {key: _alert(fly(case, seed, number), RAMP_S) for key, case in ramps.items()},
        _alert(fly(nominal, seed, number), 0.0),
    )


def _alert(flown: GroundRun, from_s: float) -> Alert:
    times = [t for t, event in flown.events if event.level == "warning" and t >= from_s]
    first = times[0] if times else math.inf
    at = min(int(np.searchsorted(flown.t, first)), len(flown.t) - 1)
    sds = [each.fix.north_sd for each in flown.fixes if each.fix.north_sd is not None]
    beyond = int(np.sum(flown.distance > np.array(flown.hpl)))
    return Alert(first - from_s, float(flown.distance[at]), beyond, float(np.median(sds)) if sds else math.nan)


def _map_result(flown: GroundRun) -> MapResult:
    aided = {True: 0, False: 0}
    for each in flown.fixes:
        if each.fix.valid or each.fix.reasons == (Reason.STALE,):
            mark = int(np.searchsorted(flown.t, (each.fix.t_valid_ns or 0) / 1e9))
            sd = float(np.sqrt(np.linalg.eigvalsh(flown.cov[min(mark, len(flown.cov) - 1)])[-1]))
            aided[sd <= MAX_SD_M] += 1
    return MapResult(_alert(flown, 0.0), aided[True], aided[False])
