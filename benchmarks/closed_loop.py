"""Closed-loop compensation of slant range and beam: the predicted-range map, and the model at each shift, in one run.

    python benchmarks/closed_loop.py [--fixes N]

125 samples at 25 Hz of a radar altimeter with a beam of 70 x 52 deg, 110 to 200 m above rough ground with posts of 5 m,
rolling by 10 deg.  The navigated position is wrong by up to 25 m on each axis.  The truth has 8101 rays, rotated at
random for each fix, and 0.3 m of noise; the model casts all 2051 rays of its dome.  One thread, processor times.

    predicted-range map    ranges at nodes of 6 m along the track, then all shifts of +-50 m at 1 m
    the same, 1243 rays    with the beam of the product, without rays 40 dB under the strongest
    literal, five points   the source's form: the model for each sample and shift, 100 m to 1 m (eq. 4.28 as corrected)
    exact search           chi-square by the model for each sample and shift: 21 x 21 shifts of 3 m, then to 0.2 m
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.machine import Targets, machine
from fti.arrays import Array
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy
from fti.nav.five_point_search import five_point_search
from fti.nav.terrain_matching.apparent_surface import RangeTrack, apparent_surface
from fti.nav.terrain_matching.fix import match
from fti.nav.terrain_matching.search import Lattice
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import WIDE
from fti.ranging.radar.beam import make_beam
from fti.ranging.radar.dome import half_dome, random_turn
from fti.ranging.sensor import Poses
from fti.study.ppsan.exact import ExactLikelihood, FootprintMetric, search_grids, shifted_poses
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

SAMPLES, PERIOD_S, SPEEDS_MPS, ORDER = 125, 0.04, (60.0, 170.0), 20
CELL_M, POSTS, CLEARANCE_M, ROLL, ROLL_PERIOD_S = 5.0, 800, 110.0, math.radians(10.0), 8.0
NODE_M, REACH_M, ERROR_M, NOISE_M, SD_M, HEIGHT_SD_M = 6.0, 50, 25.0, 0.3, 1.0, 5.0
#: Posts around the shifted samples that a fix uses [m].
MARGIN_M = 1.0
EXACT_GRIDS = ((10, 3.0), (2, 1.0), (3, 0.2))
MIN_REAL_TIME, MIN_RATIO = {60.0: 15.0, 170.0: 5.0}, 20.0

Way = Callable[[Terrain, RangeTrack], Array]


def make_radars() -> tuple[RadarAltimeter, RadarAltimeter]:
    """With all rays of the dome, and with those that the product casts."""
    whole, usual = RadarAltimeter(order=ORDER), RadarAltimeter(order=ORDER)
    beam = make_beam(WIDE, half_dome(ORDER), whole.waveform.wavelength, -400.0)
    object.__setattr__(whole, "beam", beam)
    return whole, usual


def make_flight(ground: Terrain, speed: float, rng: np.random.Generator) -> tuple[RangeTrack, Array]:
    """A measured track, and the true shift [m]."""
    heading, middle = rng.uniform(0.0, math.tau), 0.5 * CELL_M * POSTS + rng.uniform(-300.0, 300.0, 2)
    t = np.asarray(PERIOD_S * np.arange(SAMPLES), np.float64)
    ahead, along = np.array([math.sin(heading), math.cos(heading)]), speed * (t - t.mean())
    east, north = middle[:, None] + ahead[:, None] * along
    up = np.full(SAMPLES, ground.up(east, north).max() + CLEARANCE_M)
    roll = ROLL * np.sin(math.tau * t / ROLL_PERIOD_S + rng.uniform(0.0, math.tau))
    mats = MAT_ENU_NED @ mat_from_rpy(roll, np.zeros(SAMPLES), np.full(SAMPLES, heading))
    vels = np.broadcast_to(np.append(speed * ahead, 0.0), (SAMPLES, 3))
    poses, error = Poses(np.column_stack((east, north, up)), mats, vels), rng.uniform(-ERROR_M, ERROR_M, 2)
    truth = RadarAltimeter(order=2 * ORDER, turn=random_turn(rng))
    ranges = truth.measure(ground, shifted_poses(poses, error)).slant_range + NOISE_M * rng.standard_normal(SAMPLES)
    known = np.isfinite(ranges)
    poses = Poses(poses.origins_l[known], poses.mats_ls[known], poses.vels_l[known])
    return RangeTrack(t[known], poses, ranges[known], np.full(np.count_nonzero(known), SD_M), HEIGHT_SD_M), error


def by_map(sensor: RadarAltimeter) -> Way:
    """All shifts of the predicted-range map."""

    def find(ground: Terrain, track: RangeTrack) -> Array:
        surface = apparent_surface(sensor, ground, track.poses, NODE_M, REACH_M + MARGIN_M)
        return match(surface.refine(int(NODE_M)), track.profile, Lattice(REACH_M)).shift

    return find


def by_five_points(sensor: RadarAltimeter) -> Way:
    """The literal form."""
    return lambda ground, track: five_point_search(FootprintMetric(sensor, ground, track), 2.0 * REACH_M, 1.0)[0]


def by_exact_search(sensor: RadarAltimeter) -> Way:
    """The model at each shift of a grid."""
    return lambda ground, track: search_grids(
        ExactLikelihood(sensor, ground, track).chi_square, np.zeros(2), EXACT_GRIDS
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--fixes", type=int, default=30)
    fixes = parser.parse_args().fixes
    whole, usual = make_radars()
    slow, fast = SPEEDS_MPS
    ways: dict[tuple[str, float], Way] = {
        ("predicted-range map", slow): by_map(whole),
        ("predicted-range map", fast): by_map(whole),
        (f"the same, {len(usual.beam)} rays", slow): by_map(usual),
        ("literal, five points", slow): by_five_points(whole),
        ("exact search", slow): by_exact_search(whole),
    }
    seconds = dict.fromkeys(ways, 0.0)
    errors: dict[tuple[str, float], list[float]] = {way: [] for way in ways}
    rng = np.random.default_rng(45)
    relief = fractal_relief((POSTS, POSTS), CELL_M, rng, sd=40.0, max_size_m=3000.0, min_size_m=30.0)
    ground = Terrain.from_array(relief, CELL_M)
    ways["predicted-range map", slow](ground, make_flight(ground, slow, rng)[0])  # compiled
    for _ in range(fixes):
        flights = {speed: make_flight(ground, speed, rng) for speed in SPEEDS_MPS}
        for way, find in ways.items():
            track, error = flights[way[1]]
            begin = time.process_time()
            found = find(ground, track)
            seconds[way] += (time.process_time() - begin) / fixes
            errors[way].append(float(np.hypot(*(found - error))))
    print(machine())
    print(f"{fixes} fixes, {len(whole.beam)} rays, {SAMPLES} samples in {SAMPLES * PERIOD_S:g} s, one thread")
    print(f"{'':24}{'m/s':>5} {'s a fix':>9} {'x real time':>12} {'median error':>13} {'p95':>8}")
    for way, each in seconds.items():
        middle, high = np.quantile(errors[way], [0.5, 0.95])
        real_time = SAMPLES * PERIOD_S / each
        print(f"{way[0]:24}{way[1]:5.0f} {each:9.3f} {real_time:12.1f} {middle:11.2f} m {high:6.2f} m")
    targets = Targets()
    for speed, minimum in MIN_REAL_TIME.items():
        real_time = SAMPLES * PERIOD_S / seconds["predicted-range map", speed]
        targets.check(f"{real_time:.1f} x real time at {speed:.0f} m/s; at least {minimum:g}", real_time >= minimum)
    ratio = seconds["literal, five points", slow] / seconds["predicted-range map", slow]
    targets.check(f"{ratio:.1f} x as fast as the literal form; at least {MIN_RATIO:g}", ratio >= MIN_RATIO)
    ours, exact = (float(np.median(errors[name, slow])) for name in ("predicted-range map", "exact search"))
    targets.check(f"median error {ours:.2f} m; at most that of the exact search, {exact:.2f} m", ours <= exact)
    return targets.code


if __name__ == "__main__":
    sys.exit(main())
