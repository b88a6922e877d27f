"""Flights of 1000 s with an outage of 500 s, by grade of the inertial unit and aid."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from fti.arrays import Array
from fti.study.ground_flights import GroundCase, GroundRun, LaserPosition, MakePosition, Satellites, displaced, fly
from fti.study.long_endurance.beams import BeamPosition
from fti.terrain.dem_error import DemError

SECONDS, OUTAGE_S = 1000.0, (250.0, 750.0)
#: Duration of the first and of the last stretch of the outage that are compared [s].
STRETCH_S = 100.0
#: Times since the begin of the outage in the error table [s].
INSTANTS_S = (100.0, 250.0, 500.0)
UNITS = ("navigation", "tactical", "mems")
#: Unit of the targets, of the picture and of the hour; the others are flown so often for the error table.
UNIT, OTHER_UNITS_RUNS = "tactical", 10
#: Aids during the outage beside the barometer, and what gives their positions.
AIDS: dict[str, MakePosition | None] = {"baro": None, "1": LaserPosition, "9": partial(BeamPosition, 9)}
NAMES = {"baro": "barometer alone", "1": "1 beam", "9": "9 beams"}
#: Flight ``number`` is over the ground ``number`` modulo this.
GROUNDS = 20
#: One sigma of the displacement of the map for each axis, stated and drawn [m].
MAP_SD_M = 1.0
BASE = GroundCase(window_s=10.0, map_sd=MAP_SD_M, dem_error=DemError(noise_sd=1.5))
#: An hour without satellites after the first minute [s].
HOUR_S, HOUR_FROM_S = 3600.0, 60.0


@dataclass(frozen=True, eq=False)
class Track:
    """Of the filter, every second while its position is valid.

    t : (n,) [s];  distance, sd : horizontal error and its sigma, both axes together (n,) [m]
    ratio : error over sigma, north and east (n, 2)
    """

    t: Array
    distance: Array
    sd: Array
    ratio: Array

    def inside(self, from_s: float, until_s: float) -> Array:
        """Mask of a part of the flight."""
        return np.asarray((self.t >= from_s) & (self.t < until_s))

    def over_sigma(self, from_s: float, until_s: float) -> float:
        """Mean of the horizontal error over its sigma in a part of the flight."""
        inside = self.inside(from_s, until_s)
        return float(np.mean(self.distance[inside] / self.sd[inside]))

    def rms(self, from_s: float, until_s: float) -> float:
        """RMS of the horizontal error in a part of the flight [m]."""
        return float(np.sqrt(np.mean(self.distance[self.inside(from_s, until_s)] ** 2)))

    def at(self, t: float) -> float:
        """Horizontal error at a time [m]; infinite where the filter has no valid position within a second."""
        nearest = int(np.argmin(np.abs(self.t - t)))
        return float(self.distance[nearest]) if abs(self.t[nearest] - t) <= 1.0 else np.inf


#: The tracks of one run by unit and aid; without the other units after ``OTHER_UNITS_RUNS`` runs.
Tracks = dict[tuple[str, str], Track]


def fly_with(unit: str, aid: str, seed: int, number: int) -> GroundRun:
    """One flight; all units and aids have the same random numbers."""
    return _fly(replace(BASE, seconds=SECONDS, satellites=(Satellites(*OUTAGE_S, None),), unit=unit), aid, seed, number)


def _fly(case: GroundCase, aid: str, seed: int, number: int) -> GroundRun:
    make = AIDS[aid]
    case = displaced(replace(case, ground=number % GROUNDS), seed, number)
    return fly(replace(case, window_s=None), seed, number) if make is None else fly(case, seed, number, make)


def run(task: tuple[int, int]) -> Tracks:
    """Flight ``number`` of a seed with each unit and aid."""
    seed, number = task
    units = UNITS if number < OTHER_UNITS_RUNS else (UNIT,)
    return {(unit, aid): _track(fly_with(unit, aid, seed, number)) for unit in units for aid in AIDS}


def run_hour(task: tuple[int, int]) -> Track:
    """An hour with one beam and the barometer alone."""
    seed, number = task
    satellites = (Satellites(HOUR_FROM_S, HOUR_S, None),)
    return _track(_fly(replace(BASE, seconds=HOUR_S, satellites=satellites, unit=UNIT), "1", seed, number))


def _track(flown: GroundRun) -> Track:
    sd = flown.sd
    return Track(np.array(flown.t), flown.distance, np.hypot(*sd.T), np.array(flown.error) / sd)
