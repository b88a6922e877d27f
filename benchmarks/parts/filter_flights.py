"""Flights for the benchmark of particle filters, with their measurement at many positions computed by numpy.

HeightFlight   height of the ground straight below, over posts of 10 m, ten samples a second
RangeFlight    range of an interferometric altimeter, as ``fti study ira-particle-filter``: model ``proposed``
MappedFlight   the same; the range is interpolated in a map of predicted ranges around the particles
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from fti.arrays import Array
from fti.nav.interferometric import strip_range
from fti.nav.terrain_filters.drift_model import DriftModel
from fti.nav.terrain_filters.height_sample import HeightSample
from fti.nav.terrain_matching.window import TerrainWindow, finest_window
from fti.study.ira_particle_filter import experiment
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

CELL_M, POSTS, SPEED_MPS, NOISE_M, HEIGHT_M = 10.0, 800, 60.0, 1.5, 1.0
#: Positions that numpy searches at a time: their arrays stay in the cache.
CHUNK = 1000
SHARES = np.array([-1.0, 1.0, *strip_range.BETWEEN])[:, None]
EDGES = slice(0, 2)

Ranges = Callable[[TerrainWindow, Array, Array], Array]


class Flight:
    """model : of the errors;  shift : true minus navigated position [m];  max_off_m : largest error at the end"""

    model: DriftModel
    period_s: float
    max_off_m: float
    window: TerrainWindow
    samples: list[HeightSample]
    shift = (12.0, -8.0)

    def heights(self, sample: HeightSample, east: Array, north: Array) -> Array:
        """What shifts predict for a sample."""
        raise NotImplementedError


class HeightFlight(Flight):
    """Samples of rough ground."""

    model = DriftModel(position_sd=20.0, height_sd=2.0, position_walk=1.0, height_walk=0.05)
    period_s, max_off_m = 0.1, 15.0

    def __init__(self) -> None:
        relief = fractal_relief(
            (POSTS, POSTS), CELL_M, np.random.default_rng(1), sd=40.0, max_size_m=3000.0, min_size_m=60.0
        )
        ground = Terrain.from_array(relief, CELL_M)
        self.window = finest_window(ground)
        along = 1000.0 + self.period_s * SPEED_MPS * np.arange(800)
        noise = HEIGHT_M + NOISE_M * np.random.default_rng(2).standard_normal(len(along))
        up = ground.up(along + self.shift[0], along + self.shift[1]) + noise
        self.samples = [HeightSample(x, x, z, NOISE_M) for x, z in zip(along.tolist(), up.tolist(), strict=True)]

    def heights(self, sample: HeightSample, east: Array, north: Array) -> Array:
        return look_up(self.window, *self.window.places(sample.east + east, sample.north + north))


class RangeFlight(Flight):
    """Samples of a kind of ground of the study; the height is the altitude minus the range."""

    model = DriftModel(experiment.STARTS_M[0], experiment.HEIGHT_ERROR_SD_M, experiment.INCREMENT_SD_M)
    period_s, max_off_m = experiment.PERIOD_S, 75.0
    strip = experiment.STRIP

    def __init__(self, kind: str) -> None:
        ground = experiment.make_ground(kind, 0)
        self.window = ground.posts
        found = experiment.measure(ground.terrain, np.random.default_rng(2), experiment.ELEVATION_SD_M)
        self.samples = [
            HeightSample(east, north, up, experiment.IRA_SD_M)
            for (east, north), up in zip((found.true - self.shift).tolist(), found.apparent.tolist(), strict=True)
        ]

    def heights(self, sample: HeightSample, east: Array, north: Array) -> Array:
        return experiment.HEIGHT_M - numpy_ranges(self.window, sample.east + east, sample.north + north)


class MappedFlight(RangeFlight):
    """As ``RangeFlight``."""

    def heights(self, sample: HeightSample, east: Array, north: Array) -> Array:
        apparent = map_heights(self.window, sample, east, north, numpy_ranges)
        return look_up(apparent, *apparent.places(sample.east + east, sample.north + north))


def map_heights(
    window: TerrainWindow, sample: HeightSample, east: Array, north: Array, ranges: Ranges
) -> TerrainWindow:
    """Altitude minus predicted range, on nodes around all shifts."""
    node = experiment.RELIEFS["rough"].node
    axes = [
        node * np.arange(math.floor((at + off.min()) / node), math.floor((at + off.max()) / node) + 2)
        for at, off in ((sample.east, east), (sample.north, north))
    ]
    grid = np.meshgrid(*axes)
    apparent = experiment.HEIGHT_M - ranges(window, grid[0].ravel(), grid[1].ravel()).reshape(grid[0].shape)
    return TerrainWindow(apparent, node, float(axes[0][0]), float(axes[1][0]))


def fti_ranges(window: TerrainWindow, east: Array, north: Array) -> Array:
    """Predicted ranges by the compiled search."""
    positions = np.column_stack((east, north, np.full(len(east), experiment.HEIGHT_M)))
    return strip_range.strip_ranges(window, positions, RangeFlight.strip)


def look_up(window: TerrainWindow, column: Array, row: Array) -> Array:
    """The bilinear surface."""
    j, i = column.astype(np.intp), row.astype(np.intp)
    u, v, z = column - j, row - i, window.heights
    south, upper = z[i, j] * (1.0 - u) + z[i, j + 1] * u, z[i + 1, j] * (1.0 - u) + z[i + 1, j + 1] * u
    return np.asarray(south * (1.0 - v) + upper * v)


def numpy_ranges(window: TerrainWindow, east: Array, north: Array) -> Array:
    """Predicted ranges by numpy: the points of ``strip_range``, for level flight to the north."""
    columns, rows = window.places(east, north)
    parts = [slice(begin, begin + CHUNK) for begin in range(0, len(columns), CHUNK)]
    return np.concatenate([_search(window, columns[part], rows[part]) for part in parts])


def _search(window: TerrainWindow, column: Array, row: Array) -> Array:
    """Steps outwards, for the positions whose nearest point may be farther out."""
    found, at, highest = np.full(len(column), np.inf), np.arange(len(column)), float(window.heights.max())
    drops = np.full((2, len(SHARES), len(column)), experiment.HEIGHT_M - 0.5 * (highest + float(window.heights.min())))
    step = 0
    while len(at):
        times = strip_range.FIRST_ITERATIONS if step == 0 else strip_range.ITERATIONS
        for side in range(1 if step == 0 else 2):
            across = (1 - 2 * side) * step * strip_range.STEP_M
            nearest = _try_points(window, column, row, across, drops[side], times)
            found[at] = np.minimum(found[at], nearest)
        if step == 0:
            drops[1] = drops[0]
        step += 1
        is_active = np.hypot(step * strip_range.STEP_M, experiment.HEIGHT_M - highest) < found[at]
        if not is_active.all():
            at, column, row, drops = at[is_active], column[is_active], row[is_active], drops[..., is_active]
    return found


def _try_points(window: TerrainWindow, column: Array, row: Array, across: float, drops: Array, times: int) -> Array:
    """Distance of the nearest point of the lines; their drops, shape (lines, n), are replaced."""
    swath, view = math.sin(RangeFlight.strip.half_swath), math.sin(RangeFlight.strip.half_view)
    along = np.zeros_like(drops)
    for lines in (slice(None), *(EDGES,) * (times - 1)):
        along[lines] = swath * SHARES[lines] * np.sqrt(across**2 + along[lines] ** 2 + drops[lines] ** 2)
        columns = np.broadcast_to(column + across / window.cell_m, along[lines].shape)
        drops[lines] = experiment.HEIGHT_M - look_up(window, columns, row + along[lines] / window.cell_m)
    distance = np.sqrt(across**2 + along**2 + drops**2)
    return np.asarray(np.where(abs(across) <= view * distance, distance, np.inf).min(axis=0))
