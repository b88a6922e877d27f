"""Chi-square of a profile for every shift of a lattice, compared with SciPy, rasterio and numpy, in one run.

    python benchmarks/matching.py [--samples K] [--steps N]

125 samples and 101 x 101 shifts of one cell, over rough ground with posts of 5 m, one thread, best of rounds in which
all run in turn:

    map_coordinates   all shifted positions at once, bilinear; then the sums over the samples
    numpy, positions  the same with fancy indices
    numpy, rows       sample by sample with constant weights over a rectangle of posts: the lattice of fti in numpy
    rasterio sample   the nearest post of every hundredth shifted position; its time is multiplied by a hundred
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rasterio
from rasterio.transform import Affine
from scipy.ndimage import map_coordinates

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.parts.machine import Targets, machine
from fti.arrays import Array
from fti.nav.terrain_matching.profile import Profile
from fti.nav.terrain_matching.search import Lattice, search_lattice
from fti.nav.terrain_matching.window import TerrainWindow, cut_window
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

ROUNDS, CELL_M, SPEED_MPS, PERIOD_S = 7, 5.0, 60.0, 0.2
FEW = 100
MIN_RATIO = 10.0


def make_case(samples: int, steps: int) -> tuple[TerrainWindow, Profile]:
    """Rough ground, and a profile whose position is 60 m off."""
    rng = np.random.default_rng(1)
    size = 700
    relief = fractal_relief((size, size), CELL_M, rng, sd=40.0, max_size_m=3000.0, min_size_m=30.0)
    ground = Terrain.from_array(relief, CELL_M)
    t = PERIOD_S * np.linspace(0.0, samples - 1.0, samples)
    along = SPEED_MPS * (t - t.mean())
    east, north = 0.5 * CELL_M * size + along * math.sin(0.7), 0.5 * CELL_M * size + along * math.cos(0.7)
    noise = 1.5 * rng.standard_normal(samples)
    profile = Profile(t, east, north, ground.up(east + 31.0, north - 52.0) + noise, np.full(samples, 1.5), 5.0)
    return cut_window(ground, profile, CELL_M * (steps + 1)), profile


class Others:
    """The same chi-square by other means."""

    def __init__(self, window: TerrainWindow, profile: Profile, steps: int) -> None:
        self.window, self.profile = window, profile
        self.column, self.row = window.places(profile.east, profile.north)
        self.offsets = np.arange(-steps, steps + 1)

    def _positions(self) -> tuple[Array, Array]:
        shape = (len(self.profile), len(self.offsets), len(self.offsets))
        column = np.broadcast_to(self.column[:, None, None] + self.offsets, shape)
        row = np.broadcast_to(self.row[:, None, None] + self.offsets[:, None], shape)
        return column, row

    def _chi_square(self, up: Array) -> Array:
        residual = self.profile.ground[:, None, None] - up
        weight = self.profile.weight
        sums = np.tensordot(weight, residual, 1)
        return np.asarray(np.tensordot(weight, residual**2, 1) - sums**2 / self.profile.total_weight)

    def map_coordinates(self) -> Array:
        column, row = self._positions()
        return self._chi_square(map_coordinates(self.window.heights, [row, column], order=1))

    def positions(self) -> Array:
        column, row = self._positions()
        j, i = column.astype(np.intp), row.astype(np.intp)
        u, v, z = column - j, row - i, self.window.heights
        south, north = z[i, j] * (1 - u) + z[i, j + 1] * u, z[i + 1, j] * (1 - u) + z[i + 1, j + 1] * u
        return self._chi_square(south * (1 - v) + north * v)

    def rows(self) -> Array:
        size, first = len(self.offsets), self.offsets[0]
        sums, squares = np.zeros((2, size, size))
        for x, y, ground, weight in zip(
            self.column + first, self.row + first, self.profile.ground, self.profile.weight, strict=True
        ):
            j, i = int(x), int(y)
            posts = self.window.heights[i : i + size + 1, j : j + size + 1]
            between = posts[:-1] + (y - i) * (posts[1:] - posts[:-1])
            residual = ground - (between[:, :-1] + (x - j) * (between[:, 1:] - between[:, :-1]))
            sums += weight * residual
            squares += weight * residual**2
        return np.asarray(squares - sums**2 / self.profile.total_weight)


class Rasterio:
    """Every hundredth height, from a file in memory."""

    def __init__(self, others: Others) -> None:
        heights = others.window.heights
        rows, columns = heights.shape
        shape = {"height": rows, "width": columns, "count": 1, "dtype": "float64"}
        memory = rasterio.MemoryFile()
        with memory.open(
            driver="GTiff", tiled=True, transform=Affine(1, 0, -0.5, 0, 1, -0.5), crs="EPSG:32632", **shape
        ) as dataset:
            dataset.write(heights, 1)
        self._file = memory.open()
        column, row = others._positions()
        self._pairs = list(zip(column.ravel()[::FEW].tolist(), row.ravel()[::FEW].tolist(), strict=True))

    def sample(self) -> Array:
        return np.array([value[0] for value in self._file.sample(self._pairs)])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=125)
    parser.add_argument("--steps", type=int, default=50)
    args = parser.parse_args()
    window, profile = make_case(args.samples, args.steps)
    others, lattice = Others(window, profile, args.steps), Lattice(args.steps)
    ways: dict[str, tuple[Callable[[], Array], int]] = {
        "fti": (lambda: search_lattice(window, profile, lattice), 1),
        "numpy, rows": (others.rows, 1),
        "numpy, positions": (others.positions, 1),
        "map_coordinates": (others.map_coordinates, 1),
        "rasterio sample": (Rasterio(others).sample, FEW),
    }
    search_lattice(window, profile, lattice)  # compiled
    best, found = dict.fromkeys(ways, math.inf), {}
    for _ in range(ROUNDS):
        for name, (compute, factor) in ways.items():
            begin = time.perf_counter()
            found[name] = compute()
            best[name] = min(best[name], factor * (time.perf_counter() - begin))
    size = 2 * args.steps + 1
    print(machine())
    print(f"{args.samples} samples, {size} x {size} shifts, one thread, best of {ROUNDS} rounds")
    for name, seconds in best.items():
        each = 1e9 * seconds / (args.samples * size**2)
        print(f"{name:18} {1e3 * seconds:9.2f} ms   {each:8.2f} ns a height   {seconds / best['fti']:8.1f} x fti")
    targets = Targets()
    same = all(np.allclose(found[name], found["fti"], rtol=1e-9) for name in ways if name != "rasterio sample")
    targets.check("chi-square is the same within 1e-9 by all but the nearest posts", same)
    for name in ("numpy, positions", "map_coordinates", "rasterio sample"):
        ratio = best[name] / best["fti"]
        targets.check(f"{ratio:.0f} x as fast as {name}; at least {MIN_RATIO:g}", ratio >= MIN_RATIO)
    return targets.code


if __name__ == "__main__":
    sys.exit(main())
