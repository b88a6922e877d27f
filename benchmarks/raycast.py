"""Ray casting compared with Embree and Open3D: the same surface, the same rays, one run.

    python benchmarks/raycast.py [--cells N] [--rays N]

The surfaces are rough ground of 1 m cells, N x N of them, and the demonstration scene, 5 m cells.  The others get two
triangles per cell in single precision, the only one they support.  Rays start above all but 0.5 % of the posts, 750
from each place: a beam of 60 deg to either side and slant rays 40 to 75 deg off the vertical from 100 to 400 m, grazing
ones 80 to 90 deg off it and level ones 88 to 90 deg off it from 5 to 50 m.

Rates are the best of rounds in which all casters take turns: on one thread by the processor's time, with two threads
against one by the clock, which needs an otherwise idle machine.  The error is the height of a hit above the
bilinear surface.  "False" is a hit where this project's caster, which a brute force in long double confirms to the
nanometre (tests/terrain/test_exactness.py), finds none or one more than a cell away; "missed" the reverse.  Building
and memory are those of a child process for each; memory is the growth of its peak.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import multiprocessing
import resource
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.machine import Targets, machine
from fti.terrain.demo_scene import demo_scene
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain
from tests.terrain_kernels import warm_up

Array = NDArray[np.float64]
Caster = Callable[[Array, Array, int], Array]
MAX_RANGE = 5000.0
ROUNDS = 7
BUNDLE = 750
#: Angles off the vertical [deg], and heights over the highest hills [m].
KINDS = {
    "beam": ((0.0, 60.0), (100.0, 400.0)),
    "slant": ((40.0, 75.0), (100.0, 400.0)),
    "grazing": ((80.0, 90.0), (5.0, 50.0)),
    "level": ((88.0, 90.0), (5.0, 50.0)),
}
OTHERS = {"Embree": "embreex", "Open3D": "open3d"}


def make_ground(cells: int) -> Terrain:
    """Hills of 30 m (one sigma) between 20 and 2000 m, and 0.5 m from post to post."""
    rng = np.random.default_rng(1)
    shape = (cells + 1, cells + 1)
    heights = fractal_relief(shape, 1.0, rng, sd=30.0, max_size_m=2000.0, min_size_m=20.0)
    return Terrain.from_array(heights + rng.normal(0.0, 0.5, shape), 1.0)


def make_rays(
    ground: Terrain, count: int, off_deg: tuple[float, float], over_m: tuple[float, float]
) -> tuple[Array, Array]:
    """Bundles of rays between two angles off the vertical [deg], from between two heights over the hills [m]."""
    rng, layer = np.random.default_rng(2), ground.finest
    bundles = -(-count // BUNDLE)
    south_west, north_east = np.array([layer.east0, layer.north0]), np.array([layer.east1, layer.north1])
    places = south_west + rng.uniform(0.2, 0.8, (bundles, 2)) * (north_east - south_west)
    up = np.percentile(layer.heights, 99.5) + rng.uniform(*over_m, bundles)
    origins = np.repeat(np.column_stack((places, up)), BUNDLE, axis=0)[:count]
    low, high = np.radians(off_deg)
    off = np.sqrt(rng.uniform(low**2, high**2, count))
    azimuth = rng.uniform(0.0, 2.0 * np.pi, count)
    rays = np.column_stack((np.sin(off) * np.cos(azimuth), np.sin(off) * np.sin(azimuth), -np.cos(off)))
    return np.ascontiguousarray(origins), rays


def triangles(ground: Terrain) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Posts and two triangles per cell."""
    layer = ground.finest
    rows, columns = layer.heights.shape
    posts = np.empty((rows, columns, 3), dtype=np.float32)
    posts[..., 0], posts[..., 1], posts[..., 2] = layer.east[None, :], layer.north[:, None], layer.heights
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    faces = np.stack((np.stack((a, b, d), -1), np.stack((a, d, c), -1)), axis=2).reshape(-1, 3)
    return posts.reshape(-1, 3), faces


def make_ours(ground: Terrain, _mesh: Any) -> Caster:
    assert ground.pyramid.addresses.n_layers == 1
    pool = ThreadPoolExecutor(2)
    return lambda origins, rays, threads: ground.cast(origins, rays, MAX_RANGE, pool if threads > 1 else None)


def make_embree(_ground: Terrain, mesh: Any) -> Caster:
    scenes = importlib.import_module("embreex.rtcore_scene")
    meshes = importlib.import_module("embreex.mesh_construction")
    scene = scenes.EmbreeScene()
    shape = meshes.TriangleMesh(scene, *mesh)

    def cast(origins: Array, rays: Array, _threads: int) -> Array:
        assert shape is not None  # held as long as the scene
        ranges = scene.run(origins.astype(np.float32), rays.astype(np.float32), query="DISTANCE").astype(np.float64)
        return np.where(ranges < MAX_RANGE, ranges, np.nan)

    cast(np.array([[0.0, 0.0, 1e3]]), np.array([[0.0, 0.0, -1.0]]), 1)  # it builds when the first ray is cast
    return cast


def make_open3d(_ground: Terrain, mesh: Any) -> Caster:
    o3d = importlib.import_module("open3d")
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor(mesh[0]), o3d.core.Tensor(mesh[1].astype(np.uint32)))

    def cast(origins: Array, rays: Array, threads: int) -> Array:
        both = o3d.core.Tensor(np.concatenate((origins, rays), axis=1).astype(np.float32))
        ranges = scene.cast_rays(both, nthreads=threads)["t_hit"].numpy().astype(np.float64)
        return np.where(ranges < MAX_RANGE, ranges, np.nan)

    cast(np.array([[0.0, 0.0, 1e3]]), np.array([[0.0, 0.0, -1.0]]), 1)
    return cast


MAKERS: dict[str, Callable[[Terrain, Any], Caster]] = {
    "fti.terrain": make_ours,
    "Embree": make_embree,
    "Open3D": make_open3d,
}


def _build_in_child(cells: int, name: str, pipe: Connection) -> None:
    """In a child process: seconds to build, and growth of the peak of memory [MB]."""
    ground = make_ground(cells)
    mesh = None if name == "fti.terrain" else triangles(ground)
    if name in OTHERS:
        importlib.import_module(OTHERS[name])
    warm_up()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    hold = np.ones((before - _resident_kb()) * 128 if before > _resident_kb() else 1)  # up to the peak, so growth shows
    begin = time.perf_counter()
    MAKERS[name](ground, mesh)
    seconds = time.perf_counter() - begin
    pipe.send((seconds, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024 + 0.0 * hold[0]))


def _resident_kb() -> int:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() // 1024


def measure_build(cells: int, name: str) -> tuple[float, float]:
    """Seconds and MB of building a caster, in a process of its own."""
    ours, theirs = multiprocessing.Pipe()
    child = multiprocessing.get_context("spawn").Process(target=_build_in_child, args=(cells, name, theirs))
    child.start()
    theirs.close()
    seconds, megabytes = ours.recv()
    child.join()
    return seconds, megabytes


def rates(
    casters: dict[str, Caster], origins: Array, rays: Array, threads: int, clock: Callable[[], float]
) -> dict[str, float]:
    """Million rays per second: the best of rounds over all casters."""
    best = dict.fromkeys(casters, float("inf"))
    for _ in range(ROUNDS):
        for name, cast in casters.items():
            begin = clock()
            cast(origins, rays, threads)
            best[name] = min(best[name], clock() - begin)
    return {name: len(rays) / seconds / 1e6 for name, seconds in best.items()}


def faults(ground: Terrain, origins: Array, rays: Array, truth: Array, found: Array) -> str:
    """How far hits lie off the surface, and how many are false or missed."""
    points = origins + found[:, None] * rays
    off = np.abs(points[:, 2] - ground.up(points[:, 0], points[:, 1]))
    with np.errstate(invalid="ignore"):
        elsewhere = np.abs(found - truth) > 1.5
    false = int((np.isfinite(found) & (np.isnan(truth) | elsewhere)).sum())
    missed = int((np.isnan(found) & np.isfinite(truth)).sum())
    off = off[np.isfinite(off)]
    return f"{np.percentile(off, 99):9.1e} {off.max():9.1e} m  {false:6} {missed:6}"


def compare(name: str, ground: Terrain, there: list[str], count: int) -> tuple[dict[str, float], list[float]]:
    """Print the rates over a ground; our rate over Embree's by row, and that with two threads over one of each kind."""
    mesh = triangles(ground) if len(there) > 1 else None
    casters = {caster: MAKERS[caster](ground, mesh) for caster in there}
    able = {caster: cast for caster, cast in casters.items() if caster != "Embree"}  # its Python binding has one thread
    ratios, scaling = {}, []
    for kind, (off_deg, over_m) in KINDS.items():
        origins, rays = make_rays(ground, count, off_deg, over_m)
        alone = rates(casters, origins, rays, 1, time.process_time)
        single = rates(able, origins, rays, 1, time.perf_counter)
        shared = rates(able, origins, rays, 2, time.perf_counter)
        truth = casters["fti.terrain"](origins, rays, 1)
        scaling.append(shared["fti.terrain"] / single["fti.terrain"])
        if "Embree" in there:
            ratios[f"{name}, {kind}"] = alone["fti.terrain"] / alone["Embree"]
        hit = np.isfinite(truth).mean()
        print(f"{name}, {kind}: {hit:.0%} hit")
        for caster, cast in casters.items():
            two = f"{shared[caster] / single[caster]:9.2f} x" if caster in shared else 11 * " "
            what = faults(ground, origins, rays, truth, cast(origins, rays, 1))
            we = alone["fti.terrain"] / alone[caster]
            print(f"  {caster:11} {alone[caster]:6.2f} {we:6.2f} x {two}   {what}", flush=True)
    return ratios, scaling


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=4000)
    parser.add_argument("--rays", type=int, default=300_000)
    args = parser.parse_args()
    there = ["fti.terrain", *(name for name, needs in OTHERS.items() if importlib.util.find_spec(needs))]
    print(machine())
    print(f"{args.cells} x {args.cells} cells of 1 m, {args.rays} rays of each kind, best of {ROUNDS} rounds")
    warm_up()
    costs = {name: measure_build(args.cells, name) for name in there}  # first: a child inherits the peak of its parent
    targets = Targets()
    ratios: dict[str, float] = {}
    scaling: list[float] = []
    print("             Mrays/s  we are  two threads  off the surface: p99, most    false missed")
    scene = demo_scene()
    demo = Terrain((scene.finest,), scene.frame)
    for name, ground in (("rough ground", make_ground(args.cells)), ("demonstration", demo)):
        of_ground, of_threads = compare(name, ground, there, args.rays)
        ratios.update(of_ground)
        scaling += of_threads
    print("building     seconds      MB beyond the surface itself")
    for name, (seconds, megabytes) in costs.items():
        print(f"  {name:11} {seconds:7.2f} {megabytes:7.0f}")
    for row, ratio in ratios.items():
        targets.check(f"{row}: {ratio:.2f} x the rays of Embree on one thread; at least 1.3", ratio >= 1.3)
    targets.check(f"two threads: {min(scaling):.2f} x one; at least 1.8", min(scaling) >= 1.8)
    if "Embree" in costs:
        faster, share = costs["Embree"][0] / costs["fti.terrain"][0], costs["fti.terrain"][1] / costs["Embree"][1]
        targets.check(f"building: {faster:.0f} x as fast as Embree; at least 10", faster >= 10.0)
        targets.check(f"memory: {share:.3f} of Embree's; at most 0.25", share <= 0.25)
    for name in OTHERS.keys() - set(there):
        targets.check(f"{name} is not installed (make bench installs it)", False)
    return targets.code


if __name__ == "__main__":
    sys.exit(main())
