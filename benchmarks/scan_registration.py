"""The drift between two range images, compared with small_gicp, KISS-ICP and Open3D on the same points.

    python benchmarks/scan_registration.py [--pairs N]

Pairs of ``fti study scan-registration``: 75 x 75 points each, 1 s apart, with a drift of 3 m.  All get the points that
fti gets, in double precision and without their mean, one thread, and start from zero; the time contains all work on
the points.  The others estimate a rotation, too, which is known here.  Their error is that at the centre of the
overlap.

Each of the others has its distances chosen for each kind of ground, as those with the smallest median error in other
pairs (``TUNING_SEED``).  The error of all is the length along the directions that fti reports; pairs without one
are left out, and their number is printed.  The processor time is the mean over the pairs of the best of ``ROUNDS``
rounds.
"""

from __future__ import annotations

import argparse
import itertools
import math
import os
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

os.environ["OMP_NUM_THREADS"] = "1"  # read by Open3D when it is loaded
import numpy as np
import open3d
import small_gicp
from kiss_icp.mapping import VoxelHashMap
from kiss_icp.registration import Registration

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.machine import Targets, machine
from fti.arrays import Array
from fti.nav.scan_matching.registration import register
from fti.nav.scan_matching.triangulation import register_printed
from fti.study.scan_registration.experiment import EXPECTED_SD_M, SEARCH_M
from fti.study.scan_registration.looks import JUDGED, LookPair, draw_pair, make_ground

SEED, TUNING_SEED, ROUNDS, PAIRS_PER_GROUND, TUNING_PAIRS = 7000, 8000, 3, 4, 6
#: Largest distance of corresponding points, and the size of a cell in which points are thinned or stored [m].
DISTANCES_M, CELLS_M = (3.0, 6.0, 12.0), (0.5, 4.0)
#: Change of the rotation that ends an iteration [rad]: 3 mm at the edge.  The default, 0.1 deg, is 0.3 m.
MAX_TURN = 2e-5
#: The result of a pair: the transformation of the second points to the first ones, (4, 4), both without the mean.
Align = Callable[[Array, Array], Array]


class Found(NamedTuple):
    """Drift east, north, up [m], and the directions that are measured, shape (m, 3)."""

    drift: Array
    axes: Array = np.eye(3)


NOTHING = Found(np.zeros(3))
Way = Callable[[LookPair], Found]


def gicp(kind: str, distance: float, cell: float) -> Align:
    """small_gicp."""

    def align(first: Array, second: Array) -> Array:
        result = small_gicp.align(
            first, second, registration_type=kind, downsampling_resolution=cell,
            max_correspondence_distance=distance, num_threads=1, max_iterations=50, rotation_epsilon=MAX_TURN,
        )  # fmt: skip
        return np.asarray(result.T_target_source)

    return align


def kiss(distance: float, cell: float) -> Align:
    """KISS-ICP: points against the points of a map; the kernel is a third of the distance, as in its pipeline."""
    registration = Registration(max_num_iterations=100, convergence_criterion=1e-4, max_num_threads=1)

    def align(first: Array, second: Array) -> Array:
        stored = VoxelHashMap(voxel_size=cell, max_distance=1e4, max_points_per_voxel=20)
        stored.add_points(first)
        return np.asarray(registration.align_points_to_map(second, stored, np.eye(4), distance, distance / 3.0))

    return align


def plane_icp(distance: float, cell: float) -> Align:
    """Open3D, point to plane; normals of 20 neighbours, points not thinned below the smallest cell."""
    pipeline = open3d.pipelines.registration

    def cloud(points: Array) -> open3d.geometry.PointCloud:
        found = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points)).voxel_down_sample(cell)
        found.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(20))
        return found

    def align(first: Array, second: Array) -> Array:
        result = pipeline.registration_icp(
            cloud(second), cloud(first), distance, np.eye(4), pipeline.TransformationEstimationPointToPlane(),
            pipeline.ICPConvergenceCriteria(max_iteration=50),
        )  # fmt: skip
        return np.asarray(result.transformation)

    return align


OTHERS: dict[str, Callable[[float, float], Align]] = {
    "small_gicp GICP": partial(gicp, "GICP"),
    "small_gicp plane": partial(gicp, "PLANE_ICP"),
    "KISS-ICP": kiss,
    "Open3D plane": plane_icp,
}


def draw_pairs(kind: str, seed: int, count: int) -> list[LookPair]:
    """Pairs over grounds of a kind."""
    pairs = []
    for number in range(count):
        at = seed + number // PAIRS_PER_GROUND
        pairs.append(draw_pair(make_ground(kind, at), np.random.default_rng([at, number])))
    return pairs


def by_fti(pair: LookPair) -> Found:
    result = register(pair.first, pair.second, EXPECTED_SD_M)
    return Found(result.axes_l.T @ result.drift, result.axes_l)


def align_pair(align: Align, pair: LookPair) -> Found:
    """Drift at the centre of the overlap."""
    mean = pair.first.points_l.mean(axis=0)
    found = align(pair.first.points_l - mean, pair.second.points_l - mean)
    centre = pair.centre_l + pair.drift_l - mean
    return Found(centre - (found[:3, :3] @ centre + found[:3, 3]))


def tune(make: Callable[[float, float], Align], pairs: Sequence[LookPair]) -> tuple[float, float]:
    """Distance and cell with the smallest median error."""

    def error(choice: tuple[float, float]) -> float:
        return float(
            np.median([np.linalg.norm(align_pair(make(*choice), pair).drift - pair.drift_l) for pair in pairs])
        )

    return min(itertools.product(DISTANCES_M, CELLS_M), key=error)


def measure(ways: dict[str, Way], pairs: Sequence[LookPair]) -> tuple[dict[str, list[Found]], dict[str, Array]]:
    """Result of each way for each pair, and its best times [s], in turn."""
    found = {name: [NOTHING] * len(pairs) for name in ways}
    best = {name: np.full(len(pairs), math.inf) for name in ways}
    for _ in range(ROUNDS):
        for number, pair in enumerate(pairs):
            for name, way in ways.items():
                begin = time.process_time()
                found[name][number] = way(pair)
                best[name][number] = min(best[name][number], time.process_time() - begin)
    return found, best


def compare(kind: str, count: int, targets: Targets) -> None:
    """Errors and times over a kind of ground."""
    chosen = {name: tune(make, draw_pairs(kind, TUNING_SEED, TUNING_PAIRS)) for name, make in OTHERS.items()}
    pairs = draw_pairs(kind, SEED, count)
    ways: dict[str, Way] = {
        "fti": by_fti,
        "fti, printed form": lambda pair: Found(register_printed(pair.first, pair.second, *SEARCH_M).drift),
        **{name: partial(align_pair, OTHERS[name](*chosen[name])) for name in OTHERS},
    }
    found, best = measure(ways, pairs)
    axes = [result.axes for result in found["fti"]]
    errors = {
        name: np.array([
            np.linalg.norm(axis @ (result.drift - pair.drift_l))
            for axis, result, pair in zip(axes, found[name], pairs, strict=True)
            if len(axis)
        ])
        for name in ways
    }  # fmt: skip
    full, some = (sum(map(test, axes)) for test in (lambda axis: len(axis) == 3, lambda axis: 0 < len(axis) < 3))
    none = count - full - some
    print(f"{kind} ground, {count} pairs: {full} with three directions, {some} with one or two, {none} with none")
    for name in ways:
        error, ms = errors[name], 1e3 * best[name].mean()
        words = "" if name not in chosen else "  distance {:g} m, cell {:g} m".format(*chosen[name])
        print(
            f"{name:18} median {np.median(error):7.3f} m  RMS {np.sqrt((error**2).mean()):7.3f} m  {ms:7.2f} ms"
            f"  {ms / (1e3 * best['fti'].mean()):5.1f} x fti{words}"
        )
    others = {name: (float(np.median(errors[name])), float(best[name].mean())) for name in OTHERS}
    least, fastest = (min(others, key=lambda name: others[name][k]) for k in range(2))
    ratio = others[least][0] / float(np.median(errors["fti"]))
    targets.check(f"{kind}: {ratio:.2f} x the error of fti by {least}, the best other; at least 1", ratio >= 1.0)
    ratio = others[fastest][1] / float(best["fti"].mean())
    targets.check(f"{kind}: {ratio:.2f} x the time of fti by {fastest}, the fastest other; at least 1", ratio >= 1.0)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=16)
    args = parser.parse_args()
    open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
    warm = draw_pairs("rough", TUNING_SEED, 1)[0]
    register(warm.first, warm.second, EXPECTED_SD_M)  # compiled
    print(machine())
    print(f"two looks of 75 x 75 points, one thread, processor time, best of {ROUNDS} rounds in turn")
    targets = Targets()
    for kind in JUDGED:
        compare(kind, args.pairs, targets)
    return targets.code


if __name__ == "__main__":
    sys.exit(main())
