"""One elevation file: position of its posts, meaning of their heights, and reading a window.

GDAL represents every format as pixels whose middle is the post, also where the file itself refers to the post.  A post
without a height (no data, a mask, -32768, NaN, a block that was never written) is a hole.
"""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import rasterio
from numpy.typing import ArrayLike
from pyproj.datadir import append_data_dir, get_data_dir
from pyproj.exceptions import ProjError
from pyproj.transformer import AreaOfInterest, TransformerGroup
from rasterio._err import CPLE_BaseError
from rasterio.enums import ColorInterp
from rasterio.errors import NotGeoreferencedWarning, RasterioError
from rasterio.windows import Window

from fti.arrays import Array
from fti.errors import ConfigError, MissingError
from fti.geodesy.geoid import SYSTEM
from fti.geodesy.wgs84 import radii
from fti.terrain.file_info import ElevationFileInfo
from fti.terrain.files.local_only import open_local
from fti.terrain.files.vertical import find_datum, find_unit, split_crs

#: Limits of ground heights on Earth, with a margin for canyons and masts [m].
MIN_HEIGHT_M, MAX_HEIGHT_M = -500.0, 9000.0
#: A void, whether declared in the file or not.
VOID = -32768.0
WGS84 = "EPSG:4326"
#: Origin of a date or a sigma.
BY_FILE = "the file"
#: Sigmas of a normal error that it exceeds with a probability of 10 %.
SIGMAS_OF_90 = 1.6449
#: Maximum posts of a row, which is read as a whole: once around the Earth every 10 m.
MAX_COLUMNS = 2**22
#: Exceptions of GDAL, rasterio and PROJ for a damaged file.
READ_ERRORS = (RasterioError, CPLE_BaseError, ProjError, ValueError, LookupError, TypeError, ArithmeticError)
_EDGE_POINTS = 33

if str(SYSTEM) not in get_data_dir():  # grids of horizontal datums, as for Gauss-Krueger: 1 m instead of 3
    append_data_dir(SYSTEM)


class ElevationFile:
    """An open elevation file.

    words      : vertical datums by the caller, as from ``datum_names_by_file``
    local_only : a recording names the file (``fti.terrain.files.local_only``)
    source  : its metadata
    affine  : (a, b, c, d, e, f), x = a column + b row + c, y = d column + e row + f at the posts
    crs     : the horizontal part of its coordinate system
    """

    def __init__(self, path: str, words: Mapping[str, str], *, local_only: bool = False) -> None:
        self._dataset = open_raster(path, local_only)
        try:
            whole = _read_crs(path, self._dataset)
            self.crs, upright = split_crs(whole)
            a, b, c, d, e, f = self._dataset.transform[:6]
            self.affine = a, b, c + (a + b) / 2, d, e, f + (d + e) / 2
            self.rows, self.columns = self._dataset.shape
            self._transformer = _make_transformer(path, self.crs, None)
            self._transformer = _make_transformer(path, self.crs, self.outline())
            datum, by = find_datum(path, upright, self._dataset, words)
            self._unit_m = find_unit(path, self.crs, upright, self._dataset.units[0])
            self.source = self._describe(path, datum, by)
        except READ_ERRORS as error:
            self.close()
            raise ConfigError(f"{path}: cannot be used as an elevation file: {reason_text(error)}") from None
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self._dataset.close()

    def _describe(self, path: str, datum: str, by: str) -> ElevationFileInfo:
        tags = self._dataset.tags()
        lat, lon = self.outline()
        if not np.isfinite(lat + lon).all():
            raise ConfigError(f"{path}: its edges are not valid positions in {self.crs.name}")
        west, east = _sides(lon)
        accuracy, date, sd_m = self._transformer.accuracy, _date(tags), _height_sd(tags)
        return ElevationFileInfo(
            path=path,
            format=self._dataset.driver,
            rows=self.rows,
            columns=self.columns,
            crs=self.crs.name,
            spacing_m=self._spacing(),
            pixel=tags.get("AREA_OR_POINT", "Area").lower(),
            vertical=datum,
            vertical_by=by,
            unit_m=self._unit_m,
            date=date,
            date_by=date and BY_FILE,
            sd_m=sd_m,
            sd_by=None if sd_m is None else BY_FILE,
            accuracy_m=accuracy if accuracy >= 0.0 else None,
            south=float(lat.min()),
            west=west,
            north=float(lat.max()),
            east=east,
        )

    def _spacing(self) -> tuple[float, float]:
        row, column = (self.rows - 1) / 2, (self.columns - 1) / 2
        lat, lon = self.places([row, row, row + 1], [column, column + 1, column])
        r_meridian, r_normal = radii(lat[0])
        north = (lat[1:] - lat[0]) * r_meridian
        east = nearest_turn(lon[1:] - lon[0], 2 * np.pi)
        across, along = np.hypot(north, east * r_normal * math.cos(lat[0]))
        return float(across), float(along)

    @property
    def operation(self) -> str:
        """The PROJ definition of the transformation from WGS84 to its coordinates: the best one in its area."""
        return self._transformer.definition

    @property
    def turn(self) -> float:
        """A full turn in the unit of the file's longitudes."""
        return 2.0 * math.pi / float(self.crs.axis_info[0].unit_conversion_factor)

    def places(self, row: ArrayLike, column: ArrayLike) -> tuple[Array, Array]:
        """WGS84 latitude and longitude [rad] of rows and columns, counted from the first post; infinite for none."""
        a, b, c, d, e, f = self.affine
        down, across = np.asarray(row, dtype=np.float64), np.asarray(column, dtype=np.float64)
        x, y = a * across + b * down + c, d * across + e * down + f
        lon, lat = self._transformer.transform(x, y, direction="INVERSE")
        return np.radians(lat), np.radians(lon)

    def indices(self, lat: Array, lon: Array) -> tuple[Array, Array]:
        """Row and column, counted from the first post, of WGS84 positions [rad]; NaN outside the validity of the file's
        CRS."""
        a, b, c, d, e, f = self.affine
        x, y = self._transformer.transform(np.degrees(lon), np.degrees(lat))
        if self.crs.is_geographic:  # the turn nearest to the file
            middle = c + (a * (self.columns - 1) + b * (self.rows - 1)) / 2
            x = middle + nearest_turn(x - middle, self.turn)
        with np.errstate(invalid="ignore"):
            x, y = np.where(np.isfinite(x), x, np.nan) - c, np.where(np.isfinite(y), y, np.nan) - f
        determinant = a * e - b * d
        return (a * y - d * x) / determinant, (e * x - b * y) / determinant

    def outline(self) -> tuple[Array, Array]:
        """WGS84 latitude and longitude [rad] along the outer edge of the pixels, once around."""
        edge = np.linspace(0.0, 1.0, _EDGE_POINTS)[:-1]
        zero, one = np.zeros_like(edge), np.ones_like(edge)
        down = np.concatenate((zero, edge, one, 1.0 - edge))
        across = np.concatenate((edge, one, 1.0 - edge, zero))
        return self.places(down * self.rows - 0.5, across * self.columns - 0.5)

    def read(self, rows: tuple[int, int], columns: tuple[int, int]) -> Array:
        """Heights [m] of the posts from the first to before the second row and column; NaN in holes.

        Raises ConfigError for implausible heights, or when the file is truncated.
        """
        window = Window.from_slices(rows, columns)
        try:
            masked = self._dataset.read(1, window=window, masked=True)
        except (*READ_ERRORS, MemoryError) as error:
            raise ConfigError(f"{self.source.path}: cannot be read: {reason_text(error)}") from None
        raw = masked.astype(np.float64).filled(np.nan)
        raw[raw == VOID] = np.nan
        for block in self._unwritten_blocks(rows, columns):
            raw[block] = np.nan
        scale, offset = self._dataset.scales[0], self._dataset.offsets[0]
        heights = (raw * scale + offset) * self._unit_m
        with np.errstate(invalid="ignore"):
            wild = heights[(heights < MIN_HEIGHT_M) | (heights > MAX_HEIGHT_M)]
        if wild.size:
            raise ConfigError(
                f"{self.source.path}: a height of {wild[0]:g} m; must be {MIN_HEIGHT_M:g} to {MAX_HEIGHT_M:g} m; "
                f"declare voids, for example with gdal_edit.py -a_nodata"
            )
        return np.asarray(heights)

    def _unwritten_blocks(self, rows: tuple[int, int], columns: tuple[int, int]) -> Iterator[tuple[slice, slice]]:
        """The blocks of a TIFF in a window that were never written, as parts of it: GDAL reads heights of 0 there.

        Not needed with a declared void, which GDAL returns for such blocks.
        """
        if self._dataset.driver != "GTiff" or self._dataset.nodata is not None:
            return
        high, wide = self._dataset.block_shapes[0]
        down, across = _blocks(*rows, high), _blocks(*columns, wide)
        for (row, part), (column, other) in itertools.product(down, across):
            if self._dataset.get_tag_item(f"BLOCK_OFFSET_{column}_{row}", "TIFF", 1) is None:
                yield part, other


def _sides(lon: Array) -> tuple[float, float]:
    """The westernmost and easternmost of longitudes once around a file [rad]; half a turn each where it goes around."""
    unwrapped = np.unwrap(lon)
    if np.ptp(unwrapped) > 2 * np.pi - 1e-9:
        return -math.pi, math.pi
    west, east = (float(nearest_turn(side, 2 * np.pi)) for side in (unwrapped.min(), unwrapped.max()))
    return west, east


def _blocks(begin: int, end: int, size: int) -> list[tuple[int, slice]]:
    """Numbers of the blocks of a row of posts, and the part of each."""
    numbers = range(begin // size, -(-end // size))
    return [(n, slice(max(n * size - begin, 0), (n + 1) * size - begin)) for n in numbers]


def nearest_turn(x: ArrayLike, turn: float) -> Array:
    """A difference of longitudes, reduced to half a turn."""
    return np.asarray(np.remainder(np.asarray(x) + turn / 2, turn) - turn / 2)


def open_raster(path: str, local_only: bool, content: str = "an elevation file") -> Any:
    """Open a file with GDAL.  content : what it must be.  Raises MissingError or ConfigError."""
    if local_only:
        return _open_without_warnings(open_local, path)
    if not path.startswith("/vsi") and not Path(path).exists():
        raise MissingError(f"{path}: file not found")
    try:
        return _open_without_warnings(rasterio.open, path)
    except READ_ERRORS as error:
        raise ConfigError(f"{path}: is not {content} that GDAL can read: {reason_text(error)}") from None


def reason_text(error: Exception) -> str:
    """The message of a library error, as one line."""
    return " ".join(str(error.__cause__ or error).split())[:300] or type(error).__name__


def _open_without_warnings(opener: Callable[[str], Any], path: str) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)  # reported by _read_crs
        return opener(path)


def _read_crs(path: str, dataset: Any) -> pyproj.CRS:
    if dataset.count != 1:
        raise ConfigError(f"{path}: has {dataset.count} bands; must have one")
    if dataset.dtypes[0].startswith("complex") or dataset.colorinterp[0] is ColorInterp.palette:
        raise ConfigError(f"{path}: its values are complex or colour indices; must be heights")
    if dataset.shape[1] > MAX_COLUMNS:
        raise ConfigError(f"{path}: has {dataset.shape[1]} posts in a row; must be at most {MAX_COLUMNS}")
    if min(dataset.shape) < 2:
        raise ConfigError(f"{path}: has {dataset.shape[0]} x {dataset.shape[1]} posts; must be at least 2 x 2")
    if dataset.crs is None:
        raise ConfigError(f"{path}: has no coordinate system: its position on Earth is unknown")
    crs = pyproj.CRS.from_wkt(dataset.crs.to_wkt())
    if not (crs.is_geographic or crs.is_projected):
        raise ConfigError(f"{path}: its coordinate system {crs.name!r} must be geographic or projected")
    if dataset.transform.is_identity or dataset.transform.determinant == 0.0:
        raise ConfigError(f"{path}: has no position of its first post: its position on Earth is unknown")
    return crs


def _make_transformer(path: str, crs: pyproj.CRS, outline: tuple[Array, Array] | None) -> pyproj.Transformer:
    """WGS84 to the file's coordinates: the best operation in the outline [rad], without ballpark ones."""
    area = None
    if outline is not None and np.isfinite(outline).all():
        (south, north), (west, east) = (np.degrees((side.min(), side.max())) for side in outline)
        area = AreaOfInterest(west, south, east, north)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # for a better one without its grid; the accuracy is reported
        group = TransformerGroup(WGS84, crs, always_xy=True, area_of_interest=area, allow_ballpark=False)
    if not group.transformers:
        raise ConfigError(f"{path}: PROJ has no transformation from WGS84 to {crs.name!r} in the area of the file")
    return group.transformers[0]


def _height_sd(tags: Mapping[str, str]) -> float | None:
    """1-sigma [m] from the vertical accuracy of a DTED file, in whole metres with a probability of 90 %."""
    value = tags.get("DTED_VerticalAccuracy_ACC", "").strip()
    return float(value) / SIGMAS_OF_90 if value.isdigit() and value.strip("0") else None


def _date(tags: Mapping[str, str]) -> str | None:
    for key in ("TIFFTAG_DATETIME", "DTED_CompilationDate", "DTED_MaintenanceDate"):
        value = tags.get(key, "").strip()
        if value.strip("0"):
            return value
    return None
