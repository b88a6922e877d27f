"""Ray casting: this project's caster beside what a user would otherwise reach for, in one run.

    python benchmarks/raycast.py [--rays N] [--json]

Side by side, on the same rays over the demonstration scene: marching with scipy's ``map_coordinates`` (0.5 m steps,
then a linear crossing), and, where they are installed, Embree (``embreex`` through ``trimesh``) and Open3D on the
surface cut into triangles.  Exactness is the height of the hit above the bilinear surface; a triangle surface cannot
follow a twisted cell, which is part of the answer.  The brute force over all cells is in tests/terrain/test_cast.py.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.machine import machine
from fti.terrain.scenes import demo_scene, track_point
from fti.terrain.terrain import Terrain
from fti.terrain.warm import warm_up

Array = NDArray[np.float64]
Caster = Callable[[Array, Array], Array]
MAX_RANGE = 1500.0


def make_rays(terrain: Terrain, count: int) -> tuple[Array, Array]:
    """Rays of a radar altimeter on the glide path: within 20 deg of the vertical, and as many within 60 deg."""
    rng = np.random.default_rng(1)
    before = rng.uniform(300.0, 6000.0, count)
    origins = np.stack((*track_point(before, rng.uniform(-50, 50, count)), 15.24 + before * np.tan(np.radians(3))), -1)
    off = np.radians(np.where(np.arange(count) % 2, 20.0, 60.0)) * np.sqrt(rng.uniform(0, 1, count))
    around = rng.uniform(0, 2 * np.pi, count)
    rays = np.stack((np.sin(off) * np.cos(around), np.sin(off) * np.sin(around), -np.cos(off)), -1)
    return origins, rays


def marching(terrain: Terrain, step: float = 0.5, chunk: int = 500) -> Caster:
    """Sample the surface every ``step`` metres along each ray and interpolate the first crossing."""
    t = np.arange(0.0, MAX_RANGE, step)
    corner = np.array([terrain.finest.east0, terrain.finest.north0])

    def some(origins: Array, rays: Array) -> Array:
        points = origins[:, None, :] + t[None, :, None] * rays[:, None, :]
        places = (points[..., :2] - corner) / terrain.finest.cell_m
        up = map_coordinates(terrain.finest.heights, [places[..., 1], places[..., 0]], order=1, cval=np.nan)
        above = points[..., 2] - up
        first = np.argmax(above <= 0, axis=1)
        row = np.arange(len(origins))
        before, after = above[row, first - 1], above[row, first]
        return np.where(first > 0, t[first] - step * after / (after - before), np.nan)

    return lambda origins, rays: np.concatenate(
        [some(origins[i : i + chunk], rays[i : i + chunk]) for i in range(0, len(origins), chunk)]
    )


def triangles(terrain: Terrain) -> tuple[Array, NDArray[np.int64]]:
    """Posts and two triangles per cell."""
    rows, columns = terrain.finest.heights.shape
    east, north = np.meshgrid(
        terrain.finest.east0 + terrain.finest.cell_m * np.arange(columns),
        terrain.finest.north0 + terrain.finest.cell_m * np.arange(rows),
    )
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]))
    faces = np.concatenate((np.stack((a, b, d), -1), np.stack((a, d, c), -1)))
    return np.stack((east, north, terrain.finest.heights), -1).reshape(-1, 3), faces


def embree(terrain: Terrain) -> Caster:
    """Embree by way of trimesh: single precision, triangles."""
    trimesh = importlib.import_module("trimesh")
    mesh = trimesh.Trimesh(*triangles(terrain), process=False)

    def cast(origins: Array, rays: Array) -> Array:
        ranges = np.full(len(origins), np.nan)
        places, index, _ = mesh.ray.intersects_location(origins, rays, multiple_hits=False)
        ranges[index] = np.linalg.norm(places - origins[index], axis=1)
        return ranges

    return cast


def open3d(terrain: Terrain) -> Caster:
    """Open3D's raycasting scene: single precision, triangles."""
    o3d = importlib.import_module("open3d")
    posts, faces = triangles(terrain)
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(o3d.core.Tensor(posts.astype(np.float32)), o3d.core.Tensor(faces.astype(np.uint32)))

    def cast(origins: Array, rays: Array) -> Array:
        both = o3d.core.Tensor(np.concatenate((origins, rays), axis=1).astype(np.float32))
        ranges = scene.cast_rays(both, nthreads=1)["t_hit"].numpy().astype(np.float64)
        return np.where(np.isfinite(ranges), ranges, np.nan)

    return cast


def measure(name: str, cast: Caster, terrain: Terrain, origins: Array, rays: Array) -> dict[str, Any]:
    """Best of three runs, and how far the hits lie from the surface."""
    seconds = []
    for _ in range(3):
        begin = time.perf_counter()
        ranges = cast(origins, rays)
        seconds.append(time.perf_counter() - begin)
    points = origins + ranges[:, None] * rays
    miss = np.abs(points[:, 2] - terrain.up(points[:, 0], points[:, 1]))
    return {
        "name": name,
        "rays": len(origins),
        "krays_per_s": len(origins) / min(seconds) / 1e3,
        "hits": int(np.isfinite(ranges).sum()),
        "height_error_max_m": float(np.nanmax(miss)),
        "height_error_p99_m": float(np.nanpercentile(miss, 99)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rays", type=int, default=200_000)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    terrain = demo_scene()
    warm_up()
    begin = time.perf_counter()
    shape = terrain.pyramid.heights.shape
    built = time.perf_counter() - begin
    origins, rays = make_rays(terrain, args.rays)
    few = slice(0, max(args.rays // 50, 1))  # marching is slow; its rate does not depend on the number of rays
    rows = [
        measure("fti.terrain", lambda o, r: terrain.cast(o, r, MAX_RANGE), terrain, origins, rays),
        measure("scipy marching 0.5 m", marching(terrain), terrain, origins[few], rays[few]),
    ]
    absent = []
    for name, needs, make in (("embree", "embreex", embree), ("open3d", "open3d", open3d)):
        if importlib.util.find_spec(needs):
            rows.append(measure(name, make(terrain), terrain, origins, rays))
        else:
            absent.append(needs)
    for row in rows:
        row["ratio"] = rows[0]["krays_per_s"] / row["krays_per_s"]
    if args.json:
        print(json.dumps({"name": "raycast", "results": rows, "absent": absent}))
        return
    print(machine())
    print(f"{shape[0]} x {shape[1]} posts of {terrain.finest.cell_m} m, quadtree built in {built:.3f} s, one thread")
    for row in rows:
        print(
            f"{row['name']:22s} {row['krays_per_s']:9.1f} krays/s   we are {row['ratio']:7.1f} x   "
            f"hits {row['hits']}/{row['rays']}   height error p99 {row['height_error_p99_m']:.1e} m, "
            f"max {row['height_error_max_m']:.1e} m"
        )
    print(f"not installed, not measured: {', '.join(absent) or 'none'}")


if __name__ == "__main__":
    main()
