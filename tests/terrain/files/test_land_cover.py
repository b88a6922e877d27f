"""Classes of land cover below the posts of a terrain."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyproj
import pytest

from fti.errors import ConfigError, MissingError
from fti.terrain.files.catalogue import read_catalogue
from fti.terrain.files.land_cover import check_land_cover, read_land_cover
from fti.terrain.terrain import Terrain
from tests.terrain.elevation_files import LAT, LON, from_origin, write_ground, write_tif

WOODS, CROP = 10, 40


def test_each_post_has_the_class_of_the_pixel_around_it(tmp_path: Path) -> None:
    """Woods west of the middle, crops east of it; north of 2 km the raster ends."""
    numbers = np.full((40, 40), WOODS, dtype=np.uint8)
    numbers[:, 20:] = CROP
    path = write_tif(tmp_path / "cover.tif", numbers, "EPSG:4326", from_origin(LON - 0.04, LAT + 0.018, 0.002, 0.002))
    posts = np.full((601, 41), 500.0)
    terrain = Terrain.from_array(posts, 10.0, lat0=np.radians(LAT), lon0=np.radians(LON), east0=-200.0, north0=-3000.0)
    (classes,) = read_land_cover(path, terrain)
    south = terrain.finest.north < 1900.0
    assert (classes[south][:, :20] == WOODS).all() and (classes[south][:, 21:] == CROP).all()
    assert (classes[terrain.finest.north > 2100.0] == 0).all()
    assert np.array_equal(read_land_cover(path, terrain, local_only=True)[0], classes)


def test_a_file_that_is_no_raster_of_classes_is_named(tmp_path: Path) -> None:
    terrain = Terrain.from_array(np.zeros((2, 2)), 10.0)
    heights = write_tif(tmp_path / "heights.tif", np.zeros((4, 4)), "EPSG:4326", from_origin(11.0, 48.0, 0.1, 0.1))
    with pytest.raises(ConfigError, match=r"heights\.tif: has 1 band of float32; land cover is one band of uint8"):
        read_land_cover(heights, terrain)
    with pytest.raises(ConfigError, match=r"heights\.tif: has 1 band of"):
        check_land_cover(heights, ())
    (tmp_path / "text.tif").write_text("trees")
    with pytest.raises(ConfigError, match=r"text\.tif: is not land cover that GDAL can read"):
        check_land_cover(str(tmp_path / "text.tif"), ())
    with pytest.raises(MissingError, match=r"none\.tif: file not found"):
        read_land_cover(str(tmp_path / "none.tif"), terrain)


def test_a_raster_that_overlaps_no_elevation_file_is_refused(tmp_path: Path) -> None:
    """A raster of 0.02 deg, at the elevation, and one degree beside it; the same in metres and without a place."""
    dem = write_ground(tmp_path / "dem.tif", lambda lat, lon: 500.0 + 0.0 * lat * lon, "EPSG:32632", 40, 50.0)
    files = read_catalogue([dem], "ellipsoid").files
    (middle_lat, middle_lon) = np.degrees(files[0].middle)
    numbers = np.full((20, 20), WOODS, dtype=np.uint8)
    degrees = {
        name: write_tif(tmp_path / f"{name}.tif", numbers, "EPSG:4326", from_origin(lon, lat, 0.001, 0.001))
        for name, lon, lat in (
            ("here", middle_lon, middle_lat),
            ("east", middle_lon + 1.0, middle_lat),
            ("north", middle_lon, middle_lat + 1.0),
        )
    }
    east, north = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:32632", always_xy=True).transform(
        middle_lon, middle_lat
    )
    metres = write_tif(tmp_path / "metres.tif", numbers, "EPSG:32632", from_origin(east, north, 100.0, 100.0))
    for path in (degrees["here"], metres):
        check_land_cover(path, files)
    for name in ("east", "north"):
        with pytest.raises(ConfigError, match=rf"{name}\.tif: overlaps none of the elevation files"):
            check_land_cover(degrees[name], files)
    local = write_tif(tmp_path / "local.tif", numbers, 'LOCAL_CS["x",UNIT["metre",1]]', from_origin(0.0, 9.0, 1.0, 1.0))
    with pytest.raises(ConfigError, match=r"local\.tif: cannot be read as land cover"):
        check_land_cover(local, files)
