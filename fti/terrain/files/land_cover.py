"""Classes of land cover of the posts of a terrain, from a raster of bytes such as ESA WorldCover."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pyproj
from rasterio.windows import Window

from fti.arrays import Array, Codes
from fti.errors import ConfigError
from fti.geodesy.local import LocalFrame
from fti.terrain.file_info import ElevationFileInfo
from fti.terrain.files.elevation_file import READ_ERRORS, WGS84, open_raster, reason_text
from fti.terrain.files.local_only import local_environment
from fti.terrain.layer import Layer
from fti.terrain.terrain import Terrain

#: Rows of posts that are read at a time.
ROWS = 256
#: Class where the raster has none.
UNKNOWN = 0


def read_land_cover(path: str, terrain: Terrain, *, local_only: bool = False) -> tuple[Codes, ...]:
    """The class below each post, of each layer; ``UNKNOWN`` outside the raster.

    Raises MissingError for a missing file, ConfigError for one that is no raster of classes.
    """
    environment = local_environment() if local_only else contextlib.nullcontext()
    with environment, _open(path, local_only) as (dataset, to_raster):
        return tuple(_of_layer(dataset, to_raster, layer, terrain.frame) for layer in terrain.layers)


def land_cover_at(path: str, lat: Array, lon: Array) -> Codes:
    """The class at places [rad]; ``UNKNOWN`` outside the raster.  Raises as ``read_land_cover``."""
    with _open(path, False) as (dataset, to_raster):
        return _classes_at(dataset, to_raster, lat, lon)


def check_land_cover(path: str, files: Sequence[ElevationFileInfo]) -> None:
    """Raises as ``read_land_cover``, without reading the classes, and where it overlaps none of the elevation files."""
    with _open(path, False) as (dataset, to_raster):
        if not any(_overlaps(dataset, to_raster, file) for file in files):
            raise ConfigError(f"{path}: overlaps none of the elevation files")


@contextlib.contextmanager
def _open(path: str, local_only: bool) -> Iterator[tuple[Any, pyproj.Transformer]]:
    """The raster and the step from WGS84 to its coordinates; errors of reading become ConfigError."""
    with contextlib.closing(open_raster(path, local_only, "land cover")) as dataset:
        try:
            yield dataset, _transformer(path, dataset)
        except READ_ERRORS as error:
            raise ConfigError(f"{path}: cannot be read as land cover: {reason_text(error)}") from None


def _transformer(path: str, dataset: Any) -> pyproj.Transformer:
    if dataset.count != 1 or dataset.dtypes[0] != "uint8":
        bands = "1 band" if dataset.count == 1 else f"{dataset.count} bands"
        raise ConfigError(f"{path}: has {bands} of {dataset.dtypes[0]}; land cover is one band of uint8")
    if dataset.crs is None or dataset.transform.is_identity:
        raise ConfigError(f"{path}: has no coordinate system: its position on Earth is unknown")
    return pyproj.Transformer.from_crs(WGS84, pyproj.CRS.from_wkt(dataset.crs.to_wkt()), always_xy=True)


def _overlaps(dataset: Any, to_raster: pyproj.Transformer, file: ElevationFileInfo) -> bool:
    """Whether the boxes around raster and file touch; west is above east across the antimeridian."""
    sides = np.degrees((file.west, file.south, file.east, file.north)).tolist()
    west, south, east, north = to_raster.transform_bounds(*sides)
    box = dataset.bounds
    low, high = sorted((box.bottom, box.top))
    return bool(south <= high and north >= low and (west > east or (west <= box.right and east >= box.left)))


def _of_layer(dataset: Any, to_raster: pyproj.Transformer, layer: Layer, frame: LocalFrame) -> Codes:
    classes = np.full(layer.heights.shape, UNKNOWN, dtype=np.uint8)
    for begin in range(0, len(classes), ROWS):
        rows = slice(begin, begin + ROWS)
        up = np.nan_to_num(layer.heights[rows])
        east, north = np.broadcast_arrays(layer.east[None, :], layer.north[rows, None])
        lat, lon, _ = frame.to_geodetic(np.stack((east, north, up), axis=-1))
        classes[rows] = _classes_at(dataset, to_raster, lat, lon)
    return classes


def _classes_at(dataset: Any, to_raster: pyproj.Transformer, lat: Array, lon: Array) -> Codes:
    """The class at places [rad]."""
    classes = np.full(lat.shape, UNKNOWN, dtype=np.uint8)
    x, y = to_raster.transform(np.degrees(lon), np.degrees(lat))
    a, b, c, d, e, f = (~dataset.transform)[:6]
    column, row = np.floor(a * x + b * y + c), np.floor(d * x + e * y + f)
    _read_pixels(dataset, row, column, classes)
    return classes


def _read_pixels(dataset: Any, row: Array, column: Array, classes: Codes) -> None:
    """Set the classes at rows and columns of the raster."""
    inside = (row >= 0) & (row < dataset.height) & (column >= 0) & (column < dataset.width)
    if not inside.any():
        return
    rows, columns = row[inside].astype(np.intp), column[inside].astype(np.intp)
    top, left = rows.min(), columns.min()
    window = Window.from_slices((top, rows.max() + 1), (left, columns.max() + 1))
    classes[inside] = dataset.read(1, window=window)[rows - top, columns - left]
