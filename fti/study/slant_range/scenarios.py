"""The two flights of source 003, section 2.3.3, and the ground under them.

The approach begins downwind at 8000 ft, turns onto base and the intercept, and follows a 3 deg glide path to the
threshold: three turns, the first and the last shallow, the second at the maximum bank of airliners.  The
low-level flight follows rough terrain 90 m above the highest ground ahead, with turns of 35 to 75 deg of bank, and
once rolls past the vertical as a fighter does to pull down behind a ridge.  Both are drawn about a plan for each seed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.hil.flight.leg_flight import STEP_S, CommandedTrack, FlightLeg, SampledFlight, track, turn
from fti.terrain.synthetic_landscape import synthetic_terrain
from fti.terrain.terrain import Terrain

#: Height of the end of the approach over the threshold [m].
THRESHOLD_M = 15.0
GLIDE = np.radians(3.0)
DESCENT = np.radians(-3.2)
APPROACH_EXTENT_M, LOW_EXTENT_M, CELL_M = 44_000.0, 40_000.0, 40.0
AIRLINER_ANSWER_S, FIGHTER_ANSWER_S = 6.0, 2.0
#: Low-level: clearance of the highest ground ahead and to the sides [m], and look-ahead time [s].
CLEARANCE_M, AHEAD_S = 90.0, 6.0


@dataclass(frozen=True, eq=False)
class RangingScenario:
    """A flight and the rough ground under it."""

    name: str
    flight: SampledFlight
    rough: Terrain

    def ground(self, kind: str) -> Terrain:
        """``rough``, or ``flat``: the airfield's level, or the mean height under the low-level flight."""
        if kind == "rough":
            return self.rough
        half = 0.5 * (APPROACH_EXTENT_M + 10_000.0)
        return Terrain.from_array(np.full((3, 3), self.level), half, east0=-half, north0=-half)

    @property
    def level(self) -> float:
        """Height of the flat ground [m]."""
        if self.name == "approach":
            return 0.0
        east, north, _ = self.flight.origins_l.T
        return float(np.mean(self.rough.up(east, north)))


def approach(seed: int, every_s: float) -> RangingScenario:
    """Downwind, base, intercept, localizer and glide path to a runway that leads north from the origin."""
    rng = np.random.default_rng([seed, 1])
    first, second, last = np.radians([rng.uniform(10.0, 13.0), rng.uniform(27.0, 33.0), rng.uniform(9.0, 12.0)])
    legs = [
        FlightLeg(60.0, 120.0),
        FlightLeg(165.0, 115.0, path=DESCENT),
        FlightLeg(15.0, 110.0),
        turn(np.radians(-90.0), first, 105.0),
        FlightLeg(rng.uniform(30.0, 40.0), 100.0, path=DESCENT),
        turn(np.radians(-60.0), second, 95.0),
        FlightLeg(45.0, 90.0, path=DESCENT),
        turn(np.radians(-30.0), last, 82.0),
        FlightLeg(20.0, 75.0),
        FlightLeg(rng.uniform(110.0, 120.0), 70.0, path=-GLIDE),
    ]
    commanded = track(legs, np.pi, AIRLINER_ANSWER_S)
    up = commanded.height_gain - commanded.height_gain[-1] + THRESHOLD_M
    country = synthetic_terrain("river_valley", seed, extent_m=APPROACH_EXTENT_M, cell_m=CELL_M)
    return RangingScenario("approach", commanded.flight_at(up, every_s), country)


def low_level(seed: int, every_s: float) -> RangingScenario:
    """From the east to the west, then north-west, low over broken country."""
    rng = np.random.default_rng([seed, 2])
    speed = rng.uniform(190.0, 210.0)
    banks = np.radians(rng.uniform([45.0, 60.0, 35.0, 65.0], [50.0, 65.0, 45.0, 75.0]))
    over = np.radians(rng.uniform(40.0, 50.0))
    legs = [FlightLeg(8.0, speed)]
    for change, bank in zip(np.radians([40.0, -70.0, 60.0, 45.0]), banks, strict=True):
        legs += [turn(change, bank, speed), FlightLeg(rng.uniform(8.0, 12.0), speed)]
    past = turn(np.radians(-45.0), np.radians(60.0), speed)
    legs += [FlightLeg(past.seconds, speed, past.bank, extra=-over), FlightLeg(12.0, speed)]
    commanded = track(legs, np.radians(270.0), FIGHTER_ANSWER_S, end=(-8000.0, 3000.0))
    country = synthetic_terrain("rough", seed, extent_m=LOW_EXTENT_M, cell_m=CELL_M)
    return RangingScenario(
        "low_level", commanded.flight_at(_terrain_following_heights(commanded, country), every_s), country
    )


def _terrain_following_heights(commanded: CommandedTrack, country: Terrain) -> Array:
    """Heights [m] that clear the ground within ``AHEAD_S`` by the clearance, smoothed."""
    ground = country.up(commanded.east, commanded.north)
    reach = round(AHEAD_S / STEP_S)
    padded = np.pad(ground, reach, mode="edge")[:: reach // 8]
    highest = np.lib.stride_tricks.sliding_window_view(padded, 17).max(axis=-1)
    coarse = np.interp(np.arange(len(ground)), np.arange(len(highest)) * (reach // 8), highest)
    window = np.hanning(2 * reach + 1)
    return np.asarray(CLEARANCE_M + np.convolve(np.pad(coarse, reach, mode="edge"), window / window.sum(), "valid"))
