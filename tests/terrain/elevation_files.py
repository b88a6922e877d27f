"""Small elevation files that tests write, and an independent way from a terrain back to them."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import rasterio
from numpy.typing import NDArray
from rasterio.errors import NotGeoreferencedWarning
from rasterio.transform import Affine

from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]
Ground = Callable[[Array, Array], Array]

#: The middle of most of them [deg]; south-east of Munich.
LAT, LON = 47.9, 11.8


def write_tif(path: Path, heights: NDArray[Any], crs: str | None, transform: Affine, **more: Any) -> str:
    """A GeoTIFF with one band, single precision unless the heights are whole numbers; more : profile, units, tags."""
    tags, units = more.pop("tags", {}), more.pop("units", None)
    kind = heights.dtype if heights.dtype.kind in "iu" else np.dtype(np.float32)
    rows, columns = heights.shape
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        profile = {"driver": "GTiff", "width": columns, "height": rows, "count": 1, "dtype": kind, **more}
        with rasterio.open(path, "w", crs=crs, transform=transform, **profile) as file:
            file.write(heights.astype(profile["dtype"]), 1)
            file.update_tags(**tags)
            if units:
                file.units = (units,)
    return os.fspath(path)


def from_origin(west: float, north: float, across: float, down: float) -> Affine:
    """Pixels from the outer corner in the north-west on; rasterio's own function warns of its library."""
    return Affine(across, 0.0, west, 0.0, -down, north)


def move(transform: Affine, column: Any, row: Any) -> tuple[Any, Any]:
    """x and y of a place in pixels."""
    a, b, c, d, e, f = transform[:6]
    return a * column + b * row + c, d * column + e * row + f


def posts_of(transform: Affine, shape: tuple[int, int]) -> tuple[Array, Array]:
    """x and y of the middles of the pixels."""
    column, row = np.meshgrid(np.arange(shape[1]) + 0.5, np.arange(shape[0]) + 0.5)
    return move(transform, column, row)


def write_ground(
    path: Path, ground: Ground, crs: str, size: int, step: float, at: tuple[float, float] = (LAT, LON), **more: Any
) -> str:
    """A GeoTIFF of size x size posts ``step`` apart around a place [deg], of a ground that is given by lat, lon."""
    horizontal = pyproj.CRS(crs).sub_crs_list[0] if pyproj.CRS(crs).is_compound else pyproj.CRS(crs).to_2d()
    to_file = pyproj.Transformer.from_crs("EPSG:4326", horizontal, always_xy=True)
    x, y = to_file.transform(at[1], at[0])
    transform = more.pop("transform", from_origin(x - size / 2 * step, y + size / 2 * step, step, step))
    lon, lat = to_file.transform(*posts_of(transform, (size, size)), direction="INVERSE")
    return write_tif(path, ground(lat, lon), crs, transform, **more)


def write_hgt(folder: Path, ground: Ground, south: int = 47, west: int = 11) -> str:
    """One SRTM tile of 3 arc seconds."""
    lat, lon = south + 1 - np.arange(1201.0) / 1200, west + np.arange(1201.0) / 1200
    heights = np.rint(ground(lat[:, None], lon[None, :])).astype(np.int16)
    corner = from_origin(west - 0.5 / 1200, south + 1 + 0.5 / 1200, 1 / 1200, 1 / 1200)
    path = folder / f"N{south:02d}E{west:03d}.hgt"
    return write_tif(path, heights, "EPSG:4326", corner, driver="SRTMHGT")


def write_dted(folder: Path, ground: Ground, south: int = 47, west: int = 11, **more: Any) -> str:
    """One DTED cell of level 0: 30 arc seconds."""
    lat, lon = south + 1 - np.arange(121.0) / 120, west + np.arange(121.0) / 120
    heights = np.rint(ground(lat[:, None], lon[None, :])).astype(np.int16)
    corner = from_origin(west - 0.5 / 120, south + 1 + 0.5 / 120, 1 / 120, 1 / 120)
    return write_tif(folder / f"n{south:02d}.dt0", heights, "EPSG:4326", corner, driver="DTED", nodata=-32767, **more)


def back_to_earth(terrain: Terrain, east: Array, north: Array, up: Array) -> tuple[Array, Array, Array]:
    """lat, lon [deg], alt [m] of places of the terrain's frame, by PROJ alone."""
    frame = terrain.frame
    from_local = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +inv +proj=topocentric +ellps=WGS84 "
        f"+lat_0={np.degrees(frame.lat0):.17g} +lon_0={np.degrees(frame.lon0):.17g} +h_0={frame.alt0} "
        "+step +inv +proj=cart +ellps=WGS84"
    )
    lon, lat, alt = from_local.transform(east, north, up)
    return lat, lon, alt


def bilinear_in(path: str, lat: Array, lon: Array) -> Array:
    """A file's bilinear surface at places [deg], from what rasterio's ``sample`` says at the posts around.

    NaN beyond the outermost posts.
    """
    with rasterio.open(path) as file:
        crs = pyproj.CRS.from_wkt(file.crs.to_wkt())
        horizontal = crs.sub_crs_list[0] if crs.is_compound else crs.to_2d()
        to_file = pyproj.Transformer.from_crs("EPSG:4326", horizontal, always_xy=True)
        column, row = move(~file.transform, *to_file.transform(lon, lat))
        i, j = np.floor(row - 0.5), np.floor(column - 0.5)
        inside = (i >= 0) & (i <= file.height - 2) & (j >= 0) & (j <= file.width - 2)
        total = np.where(inside, 0.0, np.nan)
        for di, dj in ((0, 0), (0, 1), (1, 0), (1, 1)):
            x, y = move(file.transform, j + dj + 0.5, i + di + 0.5)
            posts = np.array([value[0] for value in file.sample(zip(x, y, strict=True))], dtype=np.float64)
            posts[posts == file.nodata] = np.nan
            total += posts * np.abs(row - 0.5 - i - (1 - di)) * np.abs(column - 0.5 - j - (1 - dj))
        return total
