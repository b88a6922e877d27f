"""Description of one elevation file of a terrain."""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Value of ``Terrain.source`` where there is no source; ``Layer.origin`` has smaller numbers.
NO_SOURCE = 255


@dataclass(frozen=True, slots=True, kw_only=True)
class ElevationFileInfo:
    """Metadata of an elevation file, and the origin of its vertical datum.

    path, format   : of the file; the format as GDAL names it (GTiff, DTED, SRTMHGT)
    rows, columns  : posts
    crs            : name of the horizontal part of its coordinate system
    spacing_m      : between its posts along a row and along a column, at its middle [m]
    pixel          : ``area`` or ``point``; the post is the middle of the pixel either way
    vertical       : egm96, egm2008 or ellipsoid; vertical_by : the origin of this
    unit_m         : metres in one unit of its heights
    date           : of the survey, or as in the file; None if unknown;  date_by : the origin of this
    sd_m           : 1-sigma of its heights [m]; None if it is not stated;  sd_by : the origin of this
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
    sd_m: float | None
    accuracy_m: float | None
    south: float
    west: float
    north: float
    east: float
    date_by: str | None = None
    sd_by: str | None = None

    @property
    def middle(self) -> tuple[float, float]:
        """Latitude and longitude of the middle of the box [rad]."""
        width = self.east - self.west + (math.tau if self.east < self.west else 0.0)
        return (self.south + self.north) / 2.0, math.remainder(self.west + width / 2.0, math.tau)
