"""The shift between two strips of an airborne laser scanner over the same ground, from LAS or LAZ files.

The points are georeferenced: their shift is the drift of the navigation of one flight against that of the other one, or
within one flight.  It is found as between two looks in flight (``fti.nav.scan_matching``), with a sigma of its own and
with refusals where the ground does not determine it.

The files state neither the sensor nor its rays: these are taken as vertical, which matters for points far from nadir.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from pyproj.exceptions import CRSError

from fti.arrays import Array
from fti.errors import ConfigError, MissingError
from fti.nav.scan_matching.look import Look
from fti.nav.scan_matching.registration import ScanDrift, register
from fti.nav.scan_matching.thinning import one_per_cell

if TYPE_CHECKING:
    import laspy

#: Points of a strip that are compared; of more, one of each cell of the ground is kept.
MAX_POINTS = 100_000
#: Classes of points that are noise (ASPRS LAS specification 1.4 R15, table 17).
NOISE = (7, 18)
#: Border around the common ground [m].
MARGIN_M = 5.0
DOWN = (0.0, 0.0, -1.0)


@dataclass(frozen=True, eq=False)
class Strip:
    """Points of a file: last returns, without noise.

    points : ndarray, shape (n, 3) [m]  east, north, up of the coordinate system of the file
    t      : ndarray, shape (n,) [s]    time of each point; 0 where the file has no times
    unit_m : length of the unit of the file [m];  crs : name of its coordinate system, "" if it states none
    """

    path: Path
    points: Array
    t: Array
    unit_m: float
    crs: str


def read_strip(path: Path, unit_m: float | None = None) -> Strip:
    """Read a LAS or LAZ file.

    unit_m : length of its unit [m]; None: as its coordinate system states, metres without one
    Raises MissingError for a file that cannot be read, ConfigError for coordinates that are not on a map.
    """
    try:
        import laspy  # noqa: PLC0415 - an extra
    except ImportError:
        raise MissingError('LAS and LAZ files need laspy: pip install "fti[las]"') from None
    try:
        file = laspy.read(path)
    except OSError as error:
        raise MissingError(f"{path}: cannot be read: {error.strerror or error}") from None
    except Exception as error:
        raise MissingError(f"{path}: is not a complete LAS or LAZ file: {error}") from None
    if len(file.points) != file.header.point_count:
        raise MissingError(f"{path}: is cut off: {len(file.points)} of {file.header.point_count} points can be read")
    crs, stated_m = _coordinate_system(file, path)
    unit_m = unit_m or stated_m
    chosen = _last_returns(file)
    points = unit_m * np.column_stack([np.asarray(axis)[chosen] for axis in (file.x, file.y, file.z)])
    has_times = "gps_time" in file.point_format.dimension_names
    t = np.asarray(file.gps_time, dtype=np.float64)[chosen] if has_times else np.zeros(len(points))
    return Strip(path, points, np.nan_to_num(t), unit_m, crs)


def _coordinate_system(file: laspy.LasData, path: Path) -> tuple[str, float]:
    """Name of the coordinate system and length of its unit [m]; "" and 1 m if the file states none."""
    try:
        crs = file.header.parse_crs()
    except CRSError as error:
        raise ConfigError(f"{path}: states an invalid coordinate system: {str(error)[:200]}") from None
    if crs is None:
        return "", 1.0
    if crs.is_geographic:
        raise ConfigError(f"{path}: has angles as coordinates ({crs.name}); project it to a map, such as UTM, first")
    return str(crs.name), float(crs.axis_info[0].unit_conversion_factor)


def _last_returns(file: laspy.LasData) -> Any:
    """The last return of each pulse, which is nearest to the ground, without noise and withheld points."""
    chosen = np.asarray(file.return_number) == np.asarray(file.number_of_returns)
    chosen &= ~np.isin(np.asarray(file.classification), NOISE)
    if "withheld" in file.point_format.dimension_names:
        chosen &= np.asarray(file.withheld) == 0
    return chosen


@dataclass(frozen=True, eq=False)
class StripShift:
    """Result of a comparison.

    found  : second strip minus first strip, axes east, north, up
    counts : points of each strip that were compared
    """

    first: Strip
    second: Strip
    counts: tuple[int, int]
    found: ScanDrift

    @property
    def is_complete(self) -> bool:
        """Are all three directions determined?"""
        return len(self.found.drift) == len(DOWN)

    def enu(self) -> tuple[Array, Array]:
        """Shift east, north, up [m] and its sigmas [m]; of a complete result."""
        axes = self.found.axes_l
        return axes.T @ self.found.drift, np.sqrt(np.diag(axes.T @ self.found.cov @ axes))


def compare_strips(first: Strip, second: Strip, range_sd: float, expected_sd: float) -> StripShift:
    """The shift of the second strip against the first one.

    range_sd    : one sigma of the noise of a range [m]
    expected_sd : one sigma of the expected horizontal shift [m]; limits the search
    Raises ConfigError when the strips have no ground in common.
    """
    low = np.maximum(first.points.min(axis=0), second.points.min(axis=0))[:2] - MARGIN_M - 3.0 * expected_sd
    high = np.minimum(first.points.max(axis=0), second.points.max(axis=0))[:2] + MARGIN_M + 3.0 * expected_sd
    if not (low < high).all():
        raise ConfigError(f"{first.path}, {second.path}: have no ground in common; are both in one coordinate system?")
    origin = np.append(np.floor(low), 0.0)
    looks = [_look(strip, low, high, origin, range_sd) for strip in (first, second)]
    return StripShift(first, second, (len(looks[0]), len(looks[1])), register(looks[0], looks[1], expected_sd))


def _look(strip: Strip, low: Array, high: Array, origin: Array, range_sd: float) -> Look:
    """The points in a rectangle, thinned."""
    inside = ((strip.points[:, :2] >= low) & (strip.points[:, :2] <= high)).all(axis=1)
    points, t = strip.points[inside] - origin, strip.t[inside]
    if len(points) > MAX_POINTS:
        side = math.sqrt(float(np.prod(np.ptp(points[:, :2], axis=0))) / MAX_POINTS)
        kept = one_per_cell(points, side)
        points, t = points[kept], t[kept]
    return Look(points, np.tile(DOWN, (len(points), 1)), t, range_sd)
