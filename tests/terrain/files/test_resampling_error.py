"""The error of resampling: against the closed form for a sine surface on posts that are not square.

The file's surface is piecewise linear along the wave: at each post its slope changes by

    D sin(phase),    D = 4 (A / s) sin^2(k s / 2),    s : between the posts; k = 2 pi / wavelength; A : amplitude

Straight lines between terrain posts c <= s apart, which lie anywhere against those of the file, leave out one such
corner per cell at most.  At the fraction f of a cell the corner is cut by D c f (1 - f) |sin|, the triangle around it
has a third of its square as its mean square, and f and the phase are uniform: E[f^2 (1 - f)^2] = 1 / 30, E[sin^2] = 1/2

    RMS = D sqrt(c^3 / (180 s)),    at most D c / 4
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rasterio.transform import Affine

from fti.terrain.files.file_survey import survey
from fti.terrain.files.open_terrain import open_terrain
from tests.terrain.elevation_files import LAT, LON, Array, from_origin, posts_of, write_ground, write_tif

AMPLITUDE_M = 80.0
#: Posts to one wave; no whole number, so that all phases come up.
POSTS = 6.3
ACROSS_M, DOWN_M = 600.0, 927.0
CENTRE = math.radians(LAT), math.radians(LON)
#: Where the meridian is turned against the grid of UTM by 2 degrees: the posts lie anywhere against each other.
CORNER = from_origin(680_000.0, 5_350_000.0, ACROSS_M, DOWN_M)


def write_wave(path: Path, transform: Affine, along_rows: bool) -> str:
    """A sine along the rows or the columns, POSTS to a wave, 100 x 100 posts."""
    x, y = posts_of(transform, (100, 100))
    place, step = (x, ACROSS_M) if along_rows else (y, DOWN_M)
    heights = 700.0 + AMPLITUDE_M * np.sin(2.0 * np.pi * place / (POSTS * step))
    return write_tif(path, heights, "EPSG:32632", transform)


def closed_form(spacing: float, cell: float) -> tuple[float, float]:
    """RMS and the most [m]."""
    corner = 4.0 * AMPLITUDE_M / spacing * math.sin(math.pi / POSTS) ** 2
    return corner * math.sqrt(cell**3 / (180.0 * spacing)), corner * cell / 4.0


@pytest.mark.parametrize(
    ("along_rows", "spacing", "cell"),
    [(True, ACROSS_M, None), (False, DOWN_M, None), (False, DOWN_M, 300.0), (True, ACROSS_M, 150.0)],
)
def test_the_error_on_a_sine_matches_its_closed_form(
    tmp_path: Path, along_rows: bool, spacing: float, cell: float | None
) -> None:
    """The file of 600 x 927 m; 600 m is what opening it with defaults makes of it."""
    path = write_wave(tmp_path / "wave.tif", CORNER, along_rows)
    terrain = open_terrain([path], vertical="ellipsoid", cell_m=cell)
    (found,) = terrain.resampling
    rms, most = closed_form(spacing, terrain.finest.cell_m)
    assert terrain.finest.cell_m == (cell or 600.0)
    assert found.rms_m == pytest.approx(rms, rel=0.06)
    assert 0.9 * most < found.max_m < 1.02 * most
    assert found.samples > 5000


def test_posts_that_are_left_out_cost_the_whole_wave(tmp_path: Path) -> None:
    """A cell of many waves: what remains of a sine is its own RMS, and chance that the posts happen to have."""
    path = write_wave(tmp_path / "wave.tif", CORNER, along_rows=True)
    (found,) = open_terrain([path], vertical="ellipsoid", cell_m=10_000.0).resampling
    assert 0.7 * AMPLITUDE_M < found.rms_m < 1.3 * AMPLITUDE_M
    assert 1.4 * AMPLITUDE_M < found.max_m < 2.02 * AMPLITUDE_M


def test_a_plane_costs_nothing_but_the_curvature_of_the_earth(tmp_path: Path) -> None:
    def plane(lat: Array, lon: Array) -> Array:
        return np.asarray(600.0 + (lat - LAT) * 5000.0 + (lon - LON) * 3000.0)

    path = write_ground(tmp_path / "plane.tif", plane, "EPSG:4326", 100, 3e-4)
    (found,) = open_terrain([path], vertical="ellipsoid").resampling
    assert found.max_m < 2e-3
    assert found.rms_m < 1e-3


def test_the_same_files_give_the_same_error_opened_or_only_surveyed(tmp_path: Path) -> None:
    path = write_wave(tmp_path / "wave.tif", CORNER, along_rows=True)
    area: dict[str, Any] = {"vertical": "ellipsoid", "centre": CENTRE, "radius_m": 15_000.0}
    terrain = open_terrain([path], **area)
    assert open_terrain([path], **area).resampling == terrain.resampling
    assert tuple(layer.resampling for layer in survey([path], **area).layers) == terrain.resampling


def test_each_layer_has_an_error_of_its_own(tmp_path: Path) -> None:
    def fine_ground(lat: Array, lon: Array) -> Array:
        return np.full(np.broadcast_shapes(lat.shape, lon.shape), 700.0)

    coarse = write_wave(tmp_path / "coarse.tif", CORNER, along_rows=True)
    fine = write_ground(tmp_path / "fine.tif", fine_ground, "EPSG:32632", 100, 30.0)
    first, second = open_terrain([coarse, fine], vertical="ellipsoid").resampling
    assert first.max_m < 1e-2
    assert second.rms_m > 1.0


def test_holes_are_no_error(tmp_path: Path) -> None:
    def half(lat: Array, lon: Array) -> Array:
        return np.where(lon > LON, np.nan, 640.0 + 0.0 * lat)

    path = write_ground(tmp_path / "half.tif", half, "EPSG:32632", 100, 30.0)
    (found,) = open_terrain([path], vertical="ellipsoid").resampling
    assert found.max_m < 1e-3
    assert found.samples > 1000
