"""The polynomials of a block against the transformations that they stand for."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from fti.geodesy.local import LocalFrame
from fti.terrain.files.elevation_file import ElevationFile
from fti.terrain.files.mosaic import Mosaic
from fti.terrain.files.tangent import HALF, PostBlock
from tests.terrain.elevation_files import LAT, LON, write_ground


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:32632", "EPSG:3413"])
@pytest.mark.parametrize("distance", [0.0, 60_000.0, 300_000.0])
def test_a_block_of_8_km_is_exact_to_a_millimetre(tmp_path: Path, crs: str, distance: float) -> None:
    """From 500 m below the ellipsoid to 9000 m above; at 300 km the Earth has fallen away by 7 km."""
    path = write_ground(tmp_path / "dem.tif", lambda lat, lon: 0.0 * lat, crs, 20, 30.0 if crs != "EPSG:4326" else 3e-4)
    frame = LocalFrame(np.radians(LAT - distance / 111_200.0), np.radians(LON), 0.0)
    side = np.linspace(-4000.0, 4000.0, 41)
    with closing(ElevationFile(path, {"*": "ellipsoid"})) as file:
        block = PostBlock(frame, Mosaic(0, file), side, distance + side)
        assert block.holds()
        for alt in (-500.0, 4000.0, 9000.0):
            ups = np.full((41, 41), alt - distance**2 / 2 / 6.38e6)
            t = (ups - block.up(np.zeros(()))) / HALF
            enu = np.stack((*np.meshgrid(side, distance + side), ups), axis=-1)
            lat, lon, height = frame.to_geodetic(enu)
            row, column = file.indices(lat, lon)
            assert max(np.abs(block.row.at(t) - row).max(), np.abs(block.column.at(t) - column).max()) < 3e-5
            assert np.abs(block.alt.at(t) - height).max() < 1e-4


def test_a_block_on_the_pole_of_a_geographic_file_does_not_hold(tmp_path: Path) -> None:
    path = write_ground(tmp_path / "dem.tif", lambda lat, lon: 0.0 * lat, "EPSG:4326", 20, 3e-4, at=(89.9, 0.0))
    side = np.linspace(-4000.0, 4000.0, 41)
    with closing(ElevationFile(path, {"*": "ellipsoid"})) as file:
        assert not PostBlock(LocalFrame(np.radians(89.999), 0.0, 0.0), Mosaic(0, file), side, side).holds()
