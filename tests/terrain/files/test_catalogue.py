"""Elevation files larger than the memory: which files and which square of them are loaded."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fti.errors import ConfigError
from fti.terrain.files import resampling_error
from fti.terrain.files.catalogue import (
    BYTES_PER_POST,
    RADII_M,
    TerrainCatalogue,
    list_files,
    read_catalogue,
)
from fti.terrain.files.open_terrain import open_terrain
from tests.terrain.elevation_files import LAT, LON, Array, from_origin, write_dted, write_ground, write_tif

CENTRE = math.radians(LAT), math.radians(LON)


def slope(lat: Array, lon: Array) -> Array:
    return 600.0 + 1000.0 * (lat - LAT) + 0.0 * lon


@pytest.fixture(scope="module")
def tiles(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Nine tiles of 0.1 deg, 100 posts each way, some 111 m and 75 m apart, and one of 10 m in the middle."""
    folder = tmp_path_factory.mktemp("tiles")
    for row in range(3):
        for column in range(3):
            heights = np.full((100, 100), 100.0 * row + column)
            corner = from_origin(LON - 0.15 + 0.1 * column, LAT + 0.15 - 0.1 * row, 0.001, 0.001)
            write_tif(folder / f"t{row}{column}.tif", heights, "EPSG:4326", corner)
    write_ground(folder / "fine.TIF", slope, "EPSG:32632", 200, 10.0)
    (folder / "readme.txt").write_text("no elevation")
    return folder


def test_a_folder_is_its_elevation_files(tiles: Path, tmp_path: Path) -> None:
    names = [Path(file).name for file in list_files([str(tiles), str(tiles / "t00.tif")])]
    assert names == sorted(names) and len(names) == 10 and "readme.txt" not in names
    assert list_files(["/no/such.tif"]) == ("/no/such.tif",)
    with pytest.raises(ConfigError, match="contains no elevation files"):
        list_files([str(tmp_path)])


@pytest.mark.parametrize("memory_mb", [3.0, 20.0])
def test_the_square_is_the_largest_that_needs_half_of_the_memory(
    tiles: Path, memory_mb: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(resampling_error, "_BLOCKS", 4)  # which takes most of the time
    catalogue = read_catalogue([str(tiles)], "ellipsoid")
    area = catalogue.area_around(*CENTRE, memory_mb)

    def needed_mb(radius_m: float) -> float:
        files = catalogue.files_near(*CENTRE, radius_m)
        terrain = open_terrain(files, centre=CENTRE, radius_m=radius_m, vertical="ellipsoid")
        return 2.0 * BYTES_PER_POST / 2**20 * sum(layer.heights.size for layer in terrain.layers)

    assert needed_mb(area.radius_m) <= memory_mb
    number = RADII_M.index(area.radius_m)
    assert number == 0 or needed_mb(RADII_M[number - 1]) > memory_mb
    assert memory_mb != 3.0 or 0 < number < len(RADII_M) - 1


def test_the_square_of_a_place_contains_the_files_there_and_not_those_far_away(tiles: Path) -> None:
    catalogue = read_catalogue([str(tiles)], "ellipsoid")
    south_west = math.radians(LAT - 0.14), math.radians(LON - 0.14)
    names = {Path(file).name for file in catalogue.files_near(*south_west, 2000.0)}
    assert names == {"t20.tif"}
    whole = open_terrain([str(tiles / "t20.tif")], centre=south_west, radius_m=1000.0, vertical="ellipsoid")
    part = open_terrain(
        catalogue.files_near(*south_west, 1000.0), centre=south_west, radius_m=1000.0, vertical="ellipsoid"
    )
    assert np.array_equal(part.finest.heights, whole.finest.heights, equal_nan=True)


@pytest.mark.parametrize(
    ("memory_mb", "offset_deg", "message"),
    [
        (0.1, 0.0, r"memory_mb = 0.1: 1.1 km around 47.9000, 11.8000 need 2 MiB"),
        (100.0, 5.0, "no elevation file within 50.0 km around 52.9000, 11.8000"),
    ],
)
def test_too_little_memory_and_a_place_without_files_are_errors(
    tiles: Path, memory_mb: float, offset_deg: float, message: str
) -> None:
    catalogue = read_catalogue([str(tiles)], "ellipsoid")
    with pytest.raises(ConfigError, match=message):
        catalogue.area_around(CENTRE[0] + math.radians(offset_deg), CENTRE[1], memory_mb)


def test_more_files_than_a_terrain_can_number(tiles: Path) -> None:
    """400 tiles around the Earth at the equator, across the antimeridian: each place has its own and neighbours."""
    one = read_catalogue([str(tiles / "t00.tif")], "ellipsoid").files[0]
    wide = math.tau / 400
    files = []
    for number in range(400):
        west, east = (((number + k) * wide + 0.003 + math.pi) % math.tau - math.pi for k in (0, 1))
        files.append(replace(one, path=str(number), south=-0.01, north=0.01, west=west, east=east))
    catalogue = TerrainCatalogue(tuple(files), "ellipsoid")
    for number in range(400):
        middle = ((number + 0.5) * wide + 0.003 + math.pi) % math.tau - math.pi
        assert catalogue.files_near(0.0, middle, 5000.0) == (str(number),)
        edge = (number * wide + 0.003 + math.pi) % math.tau - math.pi
        assert set(catalogue.files_near(0.0, edge, 5000.0)) == {str(number), str((number - 1) % 400)}
    around = replace(one, path="all", south=-1.5, north=1.5, west=-math.pi, east=math.pi)
    assert TerrainCatalogue((around,), None).files_near(*CENTRE, 1000.0) == ("all",)


def test_a_file_that_states_its_accuracy_has_its_own_sigma(tmp_path: Path) -> None:
    """DTED: 10 m with 90 % are 6.08 m.  A file without has none."""
    with_accuracy = write_dted(tmp_path, slope, tags={"DTED_VerticalAccuracy_ACC": "0010"})
    without = write_ground(tmp_path / "fine.tif", slope, "EPSG:32632", 200, 10.0)
    stated, unstated = read_catalogue([with_accuracy, without], "egm96").files
    assert stated.sd_m == pytest.approx(6.08, abs=0.01) and unstated.sd_m is None
