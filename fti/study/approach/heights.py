"""Height of an inertial system on the pattern: GNSS alone, with the raw radar, with the compensated radar.

Source 003, fig. 7.8.  One filter of nine states and biases, three times with the same inertial data and the same GNSS
(2 m / 3 m, of which 1.5 m / 2.5 m are slow); the altimeter aids once a second:

    raw          the range is used as the height straight below, with the noise that the maker states
    compensated  for attitude, terrain and beam, predicted at the filter's own estimate with another beam of 2051 rays,
                 with a sigma from the local relief (``sampled_height_variance``)

The elevation is the surface itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fti.arrays import Array, Rng
from fti.constants import SECOND_NS
from fti.hil.flight.trajectory import FlightSamples, FlightState, SplineFlight
from fti.nav.altimetry.compensation import height_over_ground
from fti.nav.altimetry.range_prediction import Predictor
from fti.nav.altimetry.variance import ErrorModel, sampled_height_variance
from fti.nav.filter.aiding import GnssPosition, GnssVelocity, TerrainAltitude
from fti.nav.filter.error_states import ALTIMETER_DRIFT, GNSS_DRIFTS, Extra, FilterModel
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.navigator import InertialNavigator
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import WIDE
from fti.study.approach.pattern import MODEL_ORDER, NOISE_M, Pattern
from fti.study.filter import flights
from fti.terrain.terrain import Terrain

WHITE_SD = (np.sqrt(2.0**2 - 1.5**2), np.sqrt(3.0**2 - 2.5**2))
#: Measurements until the filter settles.
SETTLE = 10
WAYS = ("GNSS alone", "radar, raw", "radar, compensated")


class HeightChannel(NamedTuple):
    """Estimate minus truth of the height, up, and its sigma, at the times of the measurements (n,) [m]."""

    error: Array
    sd: Array

    def mean_squares(self) -> tuple[float, float]:
        """Of the error [m^2], and of error over sigma, without the first ``SETTLE``."""
        error, sd = self.error[SETTLE:], self.sd[SETTLE:]
        return float(np.mean(error**2)), float(np.mean((error / sd) ** 2))


def channels(pattern: Pattern, ranges: Array, seed: int) -> dict[str, HeightChannel]:
    """Height errors by way of aiding.  ranges : of the radar on the pattern (n,) [m], NaN without a return"""
    flight, surface = _flight(pattern), pattern.surface
    model = FilterModel(flights.PURE_UNIT, extras={**GNSS_DRIFTS, Extra.ALTIMETER: ALTIMETER_DRIFT})
    rng = np.random.default_rng([seed, 78])
    t = np.arange(flight.begin, flight.end - flights.INERTIAL_S, flights.INERTIAL_S)
    state, fixes = flight.state(t), flight.state(pattern.flight.t[1:-1])
    imu_samples = np.concatenate(
        flights.measure_matched(flights.FilterCase("approach", model, aided=True, outages=False), state, rng)[:2],
        axis=1,
    )
    start, gnss = flights.draw_start(flight.state(t[:1]), rng), _gnss(fixes, rng)
    predictor = Predictor(surface, RadarAltimeter(antenna=WIDE, order=MODEL_ORDER))

    def aiding(way: str, here: Estimate, value: float) -> TerrainAltitude | None:
        if way == WAYS[0] or not np.isfinite(value):
            return None
        return _raw_altitude(surface, here, value) if way == WAYS[1] else _compensated_altitude(predictor, here, value)

    found: dict[str, HeightChannel] = {}
    for way in WAYS:
        navigator = InertialNavigator(model)
        navigator.begin(_ns(t[0]), start, imu_samples[0, :3], imu_samples[0, 3:])
        heights, k = list[tuple[float, float]](), 1
        for i, at in enumerate(fixes.t.tolist()):
            while k < len(t) and t[k] <= at + flights.INERTIAL_S:
                navigator.feed_inertial(_ns(t[k]), imu_samples[k, :3], imu_samples[k, 3:])
                k += 1
            for one in gnss[i]:
                navigator.feed_aiding(_ns(at), one)
            here = navigator.at(_ns(at))
            assert here is not None
            if height := aiding(way, here, float(ranges[i + 1])):
                navigator.feed_aiding(_ns(at), height)
                here = navigator.at(_ns(at))
                assert here is not None
            heights.append((here.geodetic[2] - float(fixes.alt[i]), float(here.sd_n[2])))
        found[way] = HeightChannel(*np.array(heights).T)
    return found


def _ns(t: float) -> int:
    return round(t * SECOND_NS)


def _flight(pattern: Pattern) -> SplineFlight:
    """The flight of the pattern in geodetic coordinates, for inertial sensors."""
    flight = pattern.flight
    lat, lon, alt = pattern.surface.frame.to_geodetic(flight.origins_l)
    return SplineFlight.from_samples(FlightSamples(flight.t, lat, lon, alt, flight.roll, flight.pitch, flight.heading))


def _gnss(state: FlightState, rng: Rng) -> list[tuple[GnssPosition, GnssVelocity]]:
    n = len(state.t)
    slow = [flights.gauss_markov(drift, state.t, np.zeros(n), rng) for drift in GNSS_DRIFTS.values()]
    level, high = WHITE_SD
    offset = np.stack(slow, axis=1) + rng.normal(0.0, (level, level, high), (n, 3))
    return flights.gnss_fixes(
        state, offset, rng.normal(0.0, flights.VELOCITY_SD, (n, 3)), (level, high, flights.VELOCITY_SD)
    )


def _raw_altitude(surface: Terrain, here: Estimate, value: float) -> TerrainAltitude | None:
    ground = float(surface.height(*here.geodetic[:2]))
    return TerrainAltitude(value + ground, NOISE_M, value) if np.isfinite(ground) else None


def _compensated_altitude(predictor: Predictor, here: Estimate, value: float) -> TerrainAltitude | None:
    prediction = predictor.at(*here.geodetic, *here.rpy, here.vel_n)
    pose = here.cov_n[np.ix_([0, 1, 2, 6, 7, 8], [0, 1, 2, 6, 7, 8])]
    errors = ErrorModel(pose, NOISE_M)
    height = float(height_over_ground(value, prediction)[0])
    sd = float(np.sqrt(sampled_height_variance(predictor.terrain, prediction, errors, nearest=True)[0]))
    alt = height + float(predictor.terrain.height(*here.geodetic[:2]))
    return TerrainAltitude(alt, sd, height) if np.isfinite(alt + sd) else None
