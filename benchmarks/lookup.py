"""Heights at random places compared with scipy's ``map_coordinates`` and rasterio's ``sample``, in one run.

    python benchmarks/lookup.py [--cells N] [--places N]

The surface is rough ground of 1 m cells, N x N of them; rasterio reads it from a GeoTIFF in memory and returns the
nearest post, as ``sample`` does.  Rates are the best of rounds in which all run in turn; the error is
against the bilinear surface in long double.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio.transform import Affine
from scipy.ndimage import map_coordinates

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.machine import Targets, machine
from fti.terrain.terrain import Terrain
from tests.terrain_kernels import warm_up

Array = NDArray[np.float64]
ROUNDS = 5
FEW = 100  # sample is slow: it gets every hundredth place


def make_ground(cells: int) -> Terrain:
    """Rough ground, its corner at the frame's origin."""
    heights = np.random.default_rng(1).normal(0.0, 10.0, (cells + 1, cells + 1))
    return Terrain.from_array(heights, 1.0, lat0=0.83, lon0=0.2)


def long_double(ground: Terrain, east: Array, north: Array) -> Array:
    """The bilinear surface, by its weights."""
    z, column, row = ground.finest.heights, east.astype(int), north.astype(int)
    u, v = (east - column).astype(np.longdouble), (north - row).astype(np.longdouble)
    south = z[row, column] * (1 - u) + z[row, column + 1] * u
    return np.asarray(south * (1 - v) + (z[row + 1, column] * (1 - u) + z[row + 1, column + 1] * u) * v, np.float64)


def geotiff(ground: Terrain) -> rasterio.io.DatasetReader:
    """The posts as a file in memory, north up, posts in the middle of pixels."""
    heights = ground.finest.heights[::-1]
    rows, columns = heights.shape
    place = Affine(1.0, 0.0, -0.5, 0.0, -1.0, rows - 0.5)
    shape = {"height": rows, "width": columns, "count": 1, "dtype": "float64"}
    file = rasterio.MemoryFile()
    with file.open(driver="GTiff", tiled=True, transform=place, crs="EPSG:32632", **shape) as dataset:
        dataset.write(heights, 1)
    return file.open()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=4000)
    parser.add_argument("--places", type=int, default=1_000_000)
    args = parser.parse_args()
    warm_up()
    ground = make_ground(args.cells)
    east, north = np.random.default_rng(2).uniform(0.0, args.cells, (2, args.places))
    lat, lon, _ = ground.frame.to_geodetic(np.stack((east, north, np.zeros_like(east)), axis=-1))
    file, few = geotiff(ground), slice(0, max(args.places // FEW, 1))
    pairs = list(zip(east[few].tolist(), north[few].tolist(), strict=True))
    ways: dict[str, tuple[Callable[[], Array], int]] = {
        "Terrain.up": (lambda: ground.up(east, north), args.places),
        "Terrain.height": (lambda: ground.height(lat, lon), args.places),
        "map_coordinates": (lambda: map_coordinates(ground.finest.heights, [north, east], order=1), args.places),
        "rasterio sample": (lambda: np.array([value[0] for value in file.sample(pairs)]), len(pairs)),
    }
    best = dict.fromkeys(ways, float("inf"))
    found = {}
    for _ in range(ROUNDS):
        for name, (ask, count) in ways.items():
            begin = time.perf_counter()
            found[name] = ask()
            best[name] = min(best[name], (time.perf_counter() - begin) / count)
    print(machine())
    print(f"{args.places} random places on {args.cells} x {args.cells} cells, one thread, best of {ROUNDS} rounds")
    truth = long_double(ground, east, north)
    for name, seconds in best.items():
        error = (
            ""
            if name == "Terrain.height"
            else f"   error at most {np.abs(found[name] - truth[: len(found[name])]).max():.1e} m"
        )
        print(f"{name:18} {1e9 * seconds:9.1f} ns each   {seconds / best['Terrain.up']:8.2f} x Terrain.up{error}")
    targets = Targets()
    ratio, slow = best["map_coordinates"] / best["Terrain.up"], best["rasterio sample"] / best["Terrain.height"]
    targets.check(f"Terrain.up: {ratio:.1f} x as fast as map_coordinates; at least 2", ratio >= 2.0)
    targets.check(f"Terrain.height from lat, lon: {slow:.0f} x as fast as rasterio's sample; at least 5", slow >= 5.0)
    return targets.code


if __name__ == "__main__":
    sys.exit(main())
