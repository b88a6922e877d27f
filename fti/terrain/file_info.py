"""One elevation file as a terrain remembers it."""

from __future__ import annotations

from dataclasses import dataclass

#: Number of no source: what ``Terrain.source`` says where no source says anything; ``Layer.origin`` counts below it.
NO_SOURCE = 255


@dataclass(frozen=True, slots=True, kw_only=True)
class ElevationFileInfo:
    """What an elevation file says of itself, and where its vertical datum was found.

    path, format   : of the file; the format as GDAL names it (GTiff, DTED, SRTMHGT)
    rows, columns  : posts
    crs            : the horizontal part of its coordinate system, in words
    spacing_m      : between its posts along a row and along a column, at its middle [m]
    pixel          : ``area`` or ``point``; the post is the middle of the pixel either way
    vertical       : egm96, egm2008 or ellipsoid; vertical_by : who said so
    unit_m         : metres in one unit of its heights
    date           : as the file has it, None when it has none
    accuracy_m     : of the step from its coordinates to WGS84, as PROJ states it [m]; None when unknown
    south, west, north, east : the box around its pixels [rad]; west is above east across the antimeridian
    """

    path: str
    format: str
    rows: int
    columns: int
    crs: str
    spacing_m: tuple[float, float]
    pixel: str
    vertical: str
    vertical_by: str
    unit_m: float
    date: str | None
    accuracy_m: float | None
    south: float
    west: float
    north: float
    east: float
