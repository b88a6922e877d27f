"""T16, its vertical part: the height of GNSS and inertial navigation, with and without a laser altimeter over terrain.

    country    rough and bare: fractal relief of 40 m; ten of them in a hundred runs.  T20 and T21 treat vegetation
               and buildings
    model      elevation with a bias drawn from 1 m, 1.5 m of noise (half of its variance over 30 m, half over 300 m)
    flight     250 s round the middle of it at 55 m/s, 150 m over the highest point, turns of 25 deg
    altimeter  a ray along the boresight, 0.3 m of noise, once a second: errors of the elevation model over 30 m are
               independent then.  The filter predicts it at its own estimate, and compensates it inside H
    GNSS       2 m / 3 m, of which 1.5 m / 2.5 m are slow; in three spells 4 m / 6 m, 5 m / 7 m and 6 m / 8 m
               (``degraded``), or none at all (``outage``).  The altimeter is on from 30 s

Both filters get bit-identical measurements, except for the altimeter.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fti.arrays import Array, Rng
from fti.constants import SECOND_NS
from fti.hil.flight.trajectory import SplineFlight
from fti.hil.flight.waypoints import Waypoint, waypoint_flight
from fti.nav.altimetry.range_prediction import Prediction, Predictor
from fti.nav.filter.aiding import Aiding, SlantRange
from fti.nav.filter.error_states import GNSS_DRIFTS, Drift, Extra, FilterModel
from fti.nav.filter.estimate import Estimate
from fti.nav.filter.navigator import InertialNavigator
from fti.ranging.laser import Laser
from fti.study.filter import flights
from fti.terrain.dem_error import DemError
from fti.terrain.synthetic_landscape import synthetic_terrain
from fti.terrain.terrain import Terrain

COUNTRIES = 10
#: Intervals [s], and GNSS sigma horizontal and vertical in them [m]; otherwise [m].
SPELLS_S, SPELLS_SD = ((30.0, 40.0), (80.0, 100.0), (170.0, 200.0)), ((4.0, 6.0), (5.0, 7.0), (6.0, 8.0))
GNSS_SD, SLOW_SD = (2.0, 3.0), (1.5, 2.5)
ON_S = 30.0
DEM_BIAS_M, DEM_NOISE_M, NOISE_M, FARTHEST_M = 1.0, 1.5, 0.3, 2000.0
CORNER_M, JITTER_M, CLEARANCE_M, SPEED, BANK = 1500.0, 250.0, 150.0, 55.0, np.deg2rad(25.0)
CORNERS = 8
SHORT_SD = DEM_NOISE_M / np.sqrt(2.0)
MODEL = FilterModel(
    flights.PURE_UNIT,
    extras={
        **GNSS_DRIFTS,
        Extra.ALTIMETER: Drift(DEM_BIAS_M, period_s=3000.0),
        Extra.DEM: Drift(SHORT_SD, length_m=300.0),
    },
)


class HeightErrors(NamedTuple):
    """Truth minus estimate of the height, up, and its sigma, every second (s,) [m]."""

    error: Array
    sd: Array


@dataclass(frozen=True, eq=False)
class HeightPair:
    """One run: without and with the altimeter."""

    unaided: HeightErrors
    aided: HeightErrors


#: With degraded GNSS in the intervals, and with outages.
SCENARIOS = ("degraded", "outage")


@functools.lru_cache(maxsize=1)
def _country(seed: int, number: int) -> tuple[Terrain, Terrain]:
    """The true ground and its elevation model."""
    rng = np.random.default_rng([seed, 161, number])
    terrain = synthetic_terrain("rough", int(rng.integers(2**31)))
    error = DemError(bias=float(rng.normal(0.0, DEM_BIAS_M)), noise_sd=DEM_NOISE_M)
    return terrain, error.apply(terrain, rng)


def fly_pairs(task: tuple[int, int, int]) -> dict[str, HeightPair]:
    """Run ``number`` of a seed over its country, in both scenarios.  task : seed, country, number."""
    seed, country, number = task
    terrain, dem = _country(seed, country)
    rng = np.random.default_rng([seed, 162, number])
    flight = circuit_flight(terrain, rng)
    return {name: _fly_pair(flight, terrain, dem, name == "outage", rng) for name in SCENARIOS}


def _fly_pair(flight: SplineFlight, terrain: Terrain, dem: Terrain, outage: bool, rng: Rng) -> HeightPair:
    state = flight.state(np.arange(0.0, flights.SECONDS + flights.INERTIAL_S / 2, flights.INERTIAL_S))
    case = flights.FilterCase("terrain", MODEL, aided=True, outages=outage)
    imu_samples = np.concatenate(flights.measure_matched(case, state, rng)[:2], axis=1)
    start = flights.draw_start(flight.state(np.zeros(1)), rng)
    gnss = _gnss(flight, outage, rng)
    ranges = _ranges(Predictor(terrain, Laser(max_range=FARTHEST_M)), flight, rng)
    truth = state.alt[:: round(1.0 / flights.INERTIAL_S)]

    def run(predictor: Predictor | None) -> HeightErrors:
        navigator = InertialNavigator(MODEL)
        navigator.begin(0, start, imu_samples[0, :3], imu_samples[0, 3:])
        return _run_filter(navigator, imu_samples, gnss, ranges if predictor else [], predictor, truth)

    return HeightPair(run(None), run(Predictor(dem, Laser(max_range=FARTHEST_M))))


def circuit_flight(terrain: Terrain, rng: Rng) -> SplineFlight:
    """A level flight along corners round the origin of the terrain's frame."""
    height = CLEARANCE_M + float(np.nanmax(terrain.finest.heights))
    turned = rng.uniform(0.0, 2.0 * np.pi) + 0.5 * np.pi * np.arange(CORNERS)
    corners = np.sqrt(2.0) * CORNER_M * np.stack((np.cos(turned), np.sin(turned), np.zeros(CORNERS)), axis=1)
    corners[:, :2] += rng.uniform(-JITTER_M, JITTER_M, (CORNERS, 2))
    lat, lon, _ = terrain.frame.to_geodetic(corners)
    alt = terrain.frame.alt0 + height
    waypoints = [Waypoint(float(a), float(b), alt, SPEED) for a, b in zip(lat, lon, strict=True)]
    return waypoint_flight(waypoints, BANK, (0.0, 0.0)).section(0.0, flights.SECONDS + 1.0)


def _gnss(flight: SplineFlight, outage: bool, rng: Rng) -> list[tuple[float, Aiding]]:
    t = flights.sample_times(1.0, 0.013)
    sd = np.broadcast_to(GNSS_SD, (len(t), 2)).copy()
    hidden = np.zeros(len(t), dtype=bool)
    for (begin, end), worse in zip(SPELLS_S, SPELLS_SD, strict=True):
        within = (t >= begin) & (t < end)
        sd[within] = worse
        hidden |= within & outage
    white = np.sqrt(sd**2 - np.square(SLOW_SD))
    slow = [
        flights.gauss_markov(GNSS_DRIFTS[e], t, 0.0 * t, rng)
        for e in (Extra.GNSS_NORTH, Extra.GNSS_EAST, Extra.GNSS_DOWN)
    ]
    state = flight.state(t)
    offset = np.stack(slow, axis=1) + white[:, [0, 0, 1]] * rng.standard_normal((len(t), 3))
    sds = np.column_stack((white, np.full(len(t), flights.VELOCITY_SD)))
    fixes = flights.gnss_fixes(state, offset, rng.normal(0.0, flights.VELOCITY_SD, (len(t), 3)), sds)
    return [(float(t[k]), aiding) for k in np.flatnonzero(~hidden) for aiding in fixes[k]]


def _ranges(truth: Predictor, flight: SplineFlight, rng: Rng) -> list[tuple[float, float]]:
    """Time and range of each altimeter measurement [s, m]."""
    t = flights.sample_times(1.0, 0.021)
    t = t[t >= ON_S]
    state = flight.state(t)
    exact = truth.at(state.lat, state.lon, state.alt, state.roll, state.pitch, state.heading).slant_range
    ranges = exact + rng.normal(0.0, NOISE_M, len(t))
    return [(at, d) for at, d in zip(t.tolist(), ranges.tolist(), strict=True) if np.isfinite(d)]


def _run_filter(  # noqa: PLR0917
    navigator: InertialNavigator,
    imu_samples: Array,
    gnss: list[tuple[float, Aiding]],
    ranges: list[tuple[float, float]],
    predictor: Predictor | None,
    truth: Array,
) -> HeightErrors:
    fixes, echoes, errors, sds = list(reversed(gnss)), list(reversed(ranges)), list[float](), list[float]()
    every = round(1.0 / flights.INERTIAL_S)
    for k in range(len(imu_samples)):
        t = k * flights.INERTIAL_S
        if k:
            navigator.feed_inertial(round(t * SECOND_NS), imu_samples[k, :3], imu_samples[k, 3:])
        while fixes and fixes[-1][0] < t:
            at, aiding = fixes.pop()
            navigator.feed_aiding(round(at * SECOND_NS), aiding)
        while predictor and echoes and echoes[-1][0] < t:
            _take_range(navigator, predictor, *echoes.pop())
        if k % every == 0:
            here = navigator.at(round(t * SECOND_NS))
            assert here is not None
            errors.append(float(truth[k // every]) - here.geodetic[2])
            sds.append(float(here.sd_n[2]))
    return HeightErrors(np.array(errors), np.array(sds))


def _take_range(navigator: InertialNavigator, predictor: Predictor, at: float, measured: float) -> None:
    here = navigator.at(round(at * SECOND_NS))
    assert here is not None
    expected = predictor.at(*here.geodetic, *here.rpy)
    if expected.valid[0]:
        navigator.feed_aiding(round(at * SECOND_NS), slant_range_aiding(here, expected, measured))


def slant_range_aiding(here: Estimate, expected: Prediction, measured: float) -> SlantRange:
    """Altitude from a range, predicted at an estimate; the short-range part of the elevation error counts as white."""
    u, n = expected.direction_n[0], expected.normal_n[0]
    white = float(np.hypot(NOISE_M, SHORT_SD * n[2] / (n @ u)))
    ray, normal = (tuple(v.tolist()) for v in (u, n))
    return SlantRange(measured, white, float(expected.slant_range[0]), *here.geodetic, ray, normal)


def spell_rms(heights: list[HeightErrors], spell: tuple[float, float]) -> Array:
    """RMS of the height error in an interval, by run [m]."""
    rows = slice(round(spell[0]), round(spell[1]) + 1)
    return np.array([np.sqrt(np.mean(h.error[rows] ** 2)) for h in heights])
