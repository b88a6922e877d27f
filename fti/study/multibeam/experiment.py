"""A terrain: straight flights with each set of beams and with one chosen beam, and turns without satellites."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Rng
from fti.nav.terrain_matching.beam_choice import choose_beams, forecast, steering_angles
from fti.nav.terrain_matching.beam_profile import BeamTrack
from fti.ranging.multibeam import beam_directions
from fti.study.matching.experiment import (
    DEM_ERROR,
    INDEPENDENT_SHARE,
    real_ground,
    synthetic_ground,
)
from fti.study.multibeam.aided import AidedErrors, fly_phases
from fti.study.multibeam.flights import (
    BEAM_SETS,
    COLUMNS,
    DIRECTIONS,
    HEIGHT_SD_M,
    LASER,
    NOISE_M,
    SPEED_MPS,
    Flight,
    fix_of,
    fly,
    information_at,
    lattice_over,
    poses_along,
)
from fti.terrain.terrain import Terrain

SAMPLES, PERIOD_S = 125, 0.2
#: One sigma of the navigated position for each axis [m], and the shifts on each side [m].
POSITION_SD_M, REACH_M = 30.0, 150.0
#: The same while the position is tracked, for the choice of beams [m].
TRACKED_SD_M = 5.0
#: Amplitude [rad] and period [s] of the roll.
MAX_ROLL, ROLL_PERIOD_S = math.radians(10.0), 8.0
#: The middle of a flight is so near to that of the ground, each way [m].
MIDDLE_M = 1500.0
FLIGHTS_PER_GROUND = 4
#: Reach and step of the steered beam [rad].
STEERING = beam_directions(*np.transpose(steering_angles(math.radians(40.0), math.radians(1.0))))
SWITCHED = DIRECTIONS[COLUMNS[9]]
#: What one receiver measures with: the vertical beam, nine beams in turn, nine by forecast, any angle by forecast.
CHOICES = ("vertical", "in turn", "switched", "steered")


@dataclass(frozen=True)
class BeamResult:
    """Errors of the fixes of one set of beams over one ground, one value for each flight.

    error_2    : square of the error [m^2]
    over_bound : error^2 in units of the Cramer-Rao bound, halved
    nees       : error^2 over covariance, halved, of fixes that are not refused
    bound_2    : variance of the bound, both axes [m^2]
    """

    error_2: tuple[float, ...]
    over_bound: tuple[float, ...]
    nees: tuple[float, ...]
    bound_2: tuple[float, ...]


@dataclass(frozen=True)
class GroundResult:
    """A run: one ground.

    synthetic, real : by number of beams
    uncertain       : by number of beams, with an error of the elevation: error and sigma of each fix [m]
    chosen          : by choice of ``CHOICES``: error^2 of each flight [m^2];  tracked : the same with a position that
                      is known to ``TRACKED_SD_M``
    aided           : turns with the phases of tables 7.4 and 7.5
    """

    synthetic: dict[int, BeamResult]
    real: dict[int, BeamResult]
    uncertain: dict[int, list[tuple[float, float]]]
    chosen: dict[str, list[float]]
    tracked: dict[str, list[float]]
    aided: dict[str, AidedErrors]


def run(seed: int) -> GroundResult:
    """One run, on a ground of its own; the real ground is the same in all runs."""
    rng = np.random.default_rng([seed, 46])
    ground = synthetic_ground(seed)
    flights = [draw_flight(ground, rng, POSITION_SD_M) for _ in range(FLIGHTS_PER_GROUND)]
    tracked = [draw_flight(ground, rng, TRACKED_SD_M) for _ in range(FLIGHTS_PER_GROUND)]
    over_real = [draw_flight(real_ground(), rng, POSITION_SD_M) for _ in range(FLIGHTS_PER_GROUND)]
    return GroundResult(
        synthetic={number: _fix_all(ground, flights, number) for number in BEAM_SETS},
        real={number: _fix_all(real_ground(), over_real, number) for number in BEAM_SETS},
        uncertain=_fix_uncertain(ground, flights, rng),
        chosen=_choose(ground, flights, POSITION_SD_M),
        tracked=_choose(ground, tracked, TRACKED_SD_M),
        aided=fly_phases(ground, rng),
    )


def draw_flight(ground: Terrain, rng: Rng, position_sd: float) -> Flight:
    """A straight flight that rolls, at a constant error of the navigated position and height."""
    layer = ground.finest
    centre = np.array([0.5 * (layer.east0 + layer.east1), 0.5 * (layer.north0 + layer.north1)])
    middle, heading = centre + rng.uniform(-MIDDLE_M, MIDDLE_M, 2), float(rng.uniform(0.0, math.tau))
    t = np.asarray(PERIOD_S * np.arange(SAMPLES), dtype=np.float64)
    along = SPEED_MPS * (t - t.mean())
    roll = MAX_ROLL * np.sin(math.tau * t / ROLL_PERIOD_S + rng.uniform(0.0, math.tau))
    east, north = middle[0] + along * math.sin(heading), middle[1] + along * math.cos(heading)
    error = rng.standard_normal(3) * [position_sd, position_sd, HEIGHT_SD_M]
    return fly(ground, t, poses_along(ground, east, north, roll, np.full(SAMPLES, heading)), error, rng)


def error_of(flight: Flight) -> Array:
    """True minus navigated position of a flight with a constant error, east and north [m]."""
    return np.asarray((flight.true.origins_l - flight.navigated.origins_l)[0, :2])


def _fix_all(ground: Terrain, flights: list[Flight], number: int) -> BeamResult:
    rows, nees = [], []
    for flight in flights:
        track, error = flight.track(number), error_of(flight)
        fix, information = fix_of(ground, track, REACH_M), information_at(ground, track, error)
        off = fix.shift - error
        rows.append((off @ off, 0.5 * off @ information @ off, np.trace(np.linalg.inv(information))))
        if fix.is_usable:
            nees.append(float(0.5 * off @ np.linalg.solve(fix.cov, off)))
    error_2, over_bound, bound_2 = (tuple(map(float, column)) for column in zip(*rows, strict=True))
    return BeamResult(error_2, over_bound, tuple(nees), bound_2)


def _fix_uncertain(ground: Terrain, flights: list[Flight], rng: Rng) -> dict[int, list[tuple[float, float]]]:
    """Error and sigma of each fix that is not refused [m], with an elevation model that has errors of its own."""
    found: dict[int, list[tuple[float, float]]] = {1: [], 9: []}
    for flight in flights:
        widest = flight.track(9).profile()
        elevation = DEM_ERROR.apply(_cut(ground, widest.east, widest.north), rng)
        for number, fixes in found.items():
            track = flight.track(number)
            uncertain = BeamTrack(
                track.t, track.poses, track.directions_s, track.slant_range, NOISE_M, DEM_ERROR.noise_sd, HEIGHT_SD_M
            )
            fix = fix_of(elevation, uncertain, REACH_M, INDEPENDENT_SHARE)
            if fix.is_usable:
                error = float(np.hypot(*(fix.shift - error_of(flight))))
                fixes.append((error, float(np.sqrt(np.linalg.eigvalsh(fix.cov)[-1]))))
    return found


def _cut(ground: Terrain, east: Array, north: Array) -> Terrain:
    """The posts around places, with a margin for all shifts."""
    layer, margin = ground.finest, (lattice_over(ground, REACH_M).steps + 3) * ground.finest.cell_m
    columns, rows = (
        slice(
            max(int((places.min() - margin - first) / layer.cell_m), 0),
            int((places.max() + margin - first) / layer.cell_m),
        )
        for places, first in ((east, layer.east0), (north, layer.north0))
    )
    return Terrain.from_array(
        layer.heights[rows, columns],
        layer.cell_m,
        east0=layer.east0 + columns.start * layer.cell_m,
        north0=layer.north0 + rows.start * layer.cell_m,
    )


def choose(ground: Terrain, flight: Flight, choice: str, position_sd: float) -> BeamTrack:
    """What one receiver measures with a choice of ``CHOICES``."""
    if choice == "vertical":
        return flight.one_beam(ground, DIRECTIONS[COLUMNS[1]], np.zeros(SAMPLES, dtype=np.int64))
    if choice == "in turn":
        return flight.one_beam(ground, SWITCHED, np.arange(SAMPLES) % len(SWITCHED))
    directions = SWITCHED if choice == "switched" else STEERING
    rows = forecast(LASER, ground, flight.navigated, directions, range_sd=NOISE_M, dem_sd=0.0)
    return flight.one_beam(ground, directions, choose_beams(rows, position_sd, HEIGHT_SD_M))


def _choose(ground: Terrain, flights: list[Flight], position_sd: float) -> dict[str, list[float]]:
    """Squares of the errors of the fixes [m^2], by choice."""
    found: dict[str, list[float]] = {choice: [] for choice in CHOICES}
    for flight in flights:
        for choice, errors in found.items():
            fix = fix_of(ground, choose(ground, flight, choice, position_sd), REACH_M)
            errors.append(float(np.square(fix.shift - error_of(flight)).sum()))
    return found
