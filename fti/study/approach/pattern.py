"""A light aircraft's traffic pattern at an airfield in a river valley, and its radar altimeter.

Downwind at a constant height, base, a steep final that leads 30 deg askew to the runway, and the turn onto it before
the threshold, because of hills on both sides (source 003, section 7.2.1; its elevation and its flight are not public).
The pattern lies west or east of the field; its legs, banks and the country depend on the seed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Rng
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.flight.leg_flight import FlightLeg, SampledFlight, track, turn
from fti.nav.altimetry.range_prediction import Prediction, Predictor
from fti.ranging.error_model import RangeError
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import Antenna
from fti.ranging.radar.dome import random_turn
from fti.terrain.synthetic_landscape import synthetic_landscape
from fti.terrain.terrain import Terrain

#: Between two measurements [s].
EVERY_S = 1.0
GLIDE, THRESHOLD_M, ANSWER_S = np.radians(4.0), 15.0, 3.0
EXTENT_M, CELL_M = 14_000.0, 10.0
#: Rays of the truth (8101) and of the model (2051), noise of the instrument [m].
TRUTH_ORDER, MODEL_ORDER, NOISE_M = 40, 20, 0.5


@dataclass(frozen=True, eq=False)
class Pattern:
    """A flight, the surface under it, and the true height over the surface straight below (n,) [m]."""

    flight: SampledFlight
    surface: Terrain
    nadir: Array

    def predict(self, known: Terrain, model: RadarAltimeter) -> Prediction:
        """Predicted radar measurements along the flight over a known surface."""
        flight = self.flight
        vel_n = flight.vels_l[:, [1, 0, 2]] * [1.0, 1.0, -1.0]
        mats_nb = mat_from_rpy(flight.roll, flight.pitch, flight.heading)
        return Predictor(known, model).predict_local(flight.origins_l, mats_nb, vel_n=vel_n)


def make_pattern(seed: int, every_s: float = EVERY_S) -> Pattern:
    """The flight and the country of that seed."""
    rng = np.random.default_rng([seed, 13])
    commanded = track(_legs(rng), np.pi, ANSWER_S)
    flight = commanded.flight_at(commanded.height_gain - commanded.height_gain[-1] + THRESHOLD_M, every_s)
    surface = synthetic_landscape("river_valley", seed, extent_m=EXTENT_M, cell_m=CELL_M).surface
    east, north, up = flight.origins_l.T
    return Pattern(flight, surface, up - surface.up(east, north))


def _legs(rng: Rng) -> list[FlightLeg]:
    side = rng.choice([-1.0, 1.0])
    base, final, last = np.radians(rng.uniform([17.0, 17.0, 10.0], [23.0, 23.0, 14.0]))
    down = {"path": -GLIDE}
    return [
        FlightLeg(rng.uniform(60.0, 80.0), 45.0),
        turn(side * np.radians(90.0), base, 45.0),
        FlightLeg(rng.uniform(20.0, 30.0), 45.0, **down),
        turn(side * np.radians(60.0), final, 42.0, **down),
        FlightLeg(rng.uniform(75.0, 85.0), 40.0, **down),
        turn(side * np.radians(30.0), last, 38.0, **down),
        FlightLeg(14.0, 36.0, **down),
    ]


def instrument(antenna: Antenna, rng: Rng) -> RadarAltimeter:
    """The true radar: 8101 rays of a dome rotated at random, 0.5 m of noise, no steps."""
    noise = RangeError(noise_sd=NOISE_M)
    return RadarAltimeter(antenna=antenna, order=TRUTH_ORDER, turn=random_turn(rng), error=noise)
