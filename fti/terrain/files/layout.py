"""Assigns files to the layers of a terrain, and determines their extent.

A layer contains the files whose posts are less than twice as far apart as its cell, the finest file first, those of
equal spacing (to 10 %) in the caller's order; a coarser file begins the next layer, with a cell that is a whole
multiple.  A layer is the rectangle around the coverage of its files, cut to the area; its edges lie on posts of the
next coarser layer, which contains it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.errors import ConfigError
from fti.geodesy.local import LocalFrame
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef
from fti.terrain.file_info import ElevationFileInfo
from fti.terrain.files.elevation_file import ElevationFile
from fti.terrain.files.mosaic import Mosaic, assemble

#: Maximum posts of all layers together: 0.5 GB, and as much again for the ray caster.
MAX_POSTS = 2**26
#: Files with a coarser spacing than this begin a new layer [cells].
_NEW_LAYER_RATIO = 2.0
#: Ratio of spacings up to which files count as equally fine and keep the caller's order.
_EQUAL_RATIO = 1.1
#: Maximum ratio of cell to file spacing: the smallest block then covers 16 million posts, 0.5 GB.
_MAX_CELL_RATIO = 256.0
#: Maximum ratio of a layer's cell to its file's spacing, for a multiple.
_MULTIPLE_RATIO = 1.02
#: Minimum ``up`` [m]: a lower point is on another side of the Earth.
_MIN_UP_M = -1e6


class Box(NamedTuple):
    """A rectangle of the local frame [m]."""

    east0: float
    north0: float
    east1: float
    north1: float

    def join(self, other: Box) -> Box:
        """The rectangle around both."""
        return Box(*np.minimum(self[:2], other[:2]).tolist(), *np.maximum(self[2:], other[2:]).tolist())

    def contains(self, east: Array, north: Array) -> NDArray[np.bool_]:
        """Whether points lie in it."""
        return (east >= self.east0) & (east <= self.east1) & (north >= self.north0) & (north <= self.north1)

    def snap(self, cell: float) -> Box:
        """The smallest rectangle around it with edges on multiples of a cell, at least one cell long."""
        east0, north0 = math.floor(self.east0 / cell + 1e-9), math.floor(self.north0 / cell + 1e-9)
        east1 = max(math.ceil(self.east1 / cell - 1e-9), east0 + 1)
        north1 = max(math.ceil(self.north1 / cell - 1e-9), north0 + 1)
        return Box(east0 * cell, north0 * cell, east1 * cell, north1 * cell)


@dataclass(frozen=True)
class LayerPlan:
    """One planned layer: its mosaics in order of preference, its cell [m] and its rectangle."""

    mosaics: tuple[Mosaic, ...]
    cell_m: float
    box: Box

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of posts."""
        rows, columns = (
            round((end - begin) / self.cell_m) + 1
            for begin, end in ((self.box.north0, self.box.north1), (self.box.east0, self.box.east1))
        )
        return rows, columns

    @property
    def places(self) -> tuple[Array, Array]:
        """East of the columns and north of the rows [m]."""
        rows, columns = self.shape
        east, north = self.cell_m * np.arange(columns), self.cell_m * np.arange(rows)
        return np.asarray(self.box.east0 + east), np.asarray(self.box.north0 + north)


def place_area(
    files: Sequence[ElevationFile], centre: tuple[float, float] | None, radius_m: float | None
) -> tuple[LocalFrame, Box | None]:
    """The local frame, and the requested square; None for the whole coverage of the files."""
    frame = LocalFrame(*(centre or _middle(files)), 0.0)
    return frame, None if radius_m is None else Box(-radius_m, -radius_m, radius_m, radius_m)


def _middle(files: Sequence[ElevationFile]) -> tuple[float, float]:
    """Latitude and longitude [rad] of the middle of the coverage."""
    points = np.concatenate([ecef_from_geodetic(*file.outline(), 0.0) for file in files])
    lat, lon, _ = geodetic_from_ecef((points.min(axis=0) + points.max(axis=0)) / 2)
    return float(lat), float(lon)


def make_plans(
    files: Sequence[ElevationFile], frame: LocalFrame, area: Box | None, cell_m: float | None
) -> tuple[LayerPlan, ...]:
    """The planned layers, the finest first; a file outside the area is in none of them.

    Raises ConfigError when no file touches the area, for too many posts, and for a cell much larger than the spacing.
    """
    covers = {n: cover for n, file in enumerate(files) if (cover := _cover(file, frame, area)) is not None}
    if not covers and area is not None:
        raise ConfigError(
            f"{files[0].source.path}: does not touch the area within {area.east1 / 1000:g} km around "
            f"{math.degrees(frame.lat0):.5f}, {math.degrees(frame.lon0):.5f}; it covers {bounds_text(files[0].source)}"
            f"{f', and none of the {len(files) - 1} other files touches it' if len(files) > 1 else ''}"
        )
    if area is None and (far := next((file for n, file in enumerate(files) if n not in covers), None)):
        raise ConfigError(f"{far.source.path}: covers {bounds_text(far.source)}: too large for one local frame")
    plans: list[LayerPlan] = []
    spacings = {n: min(files[n].source.spacing_m) for n in covers}
    left = _order(spacings)
    while left:
        spacing = min(spacings[n] for n in left)
        cell = _cell(spacing, plans[-1].cell_m if plans else None, cell_m)
        if cell > _MAX_CELL_RATIO * spacing:
            raise ConfigError(
                f"cell_m = {cell:g}: must be at most {_MAX_CELL_RATIO * spacing:.3g} m, {_MAX_CELL_RATIO:g} times the "
                f"distance between the posts of the finest file in the area"
            )
        mine = [n for n in left if spacings[n] < _NEW_LAYER_RATIO * max(cell, spacing)]
        left = [n for n in left if n not in mine]
        box = _join_boxes([covers[n] for n in mine])
        mosaics = assemble((n, files[n]) for n in mine)
        plans.append(LayerPlan(tuple(mosaics), cell, box))
    return _fit(plans)


def _order(spacings: Mapping[int, float]) -> list[int]:
    """Numbers of files, the finest first; those of about equal spacing in the caller's order."""
    left, order = dict(spacings), list[int]()
    while left:
        finest = min(left.values())
        order += sorted(n for n, spacing in left.items() if spacing < _EQUAL_RATIO * finest)
        left = {n: spacing for n, spacing in left.items() if n not in order}
    return order


def _cell(spacing: float, finer: float | None, wanted: float | None) -> float:
    """The cell of a layer [m]: three digits of the spacing, or the wanted one, or a multiple of the finer cell."""
    if finer is not None:
        return finer * max(1, math.floor(_MULTIPLE_RATIO * spacing / finer))
    return wanted or float(f"{spacing:.3g}")


def _join_boxes(boxes: Sequence[Box]) -> Box:
    box = boxes[0]
    for other in boxes[1:]:
        box = box.join(other)
    return box


def _fit(plans: Sequence[LayerPlan]) -> tuple[LayerPlan, ...]:
    """The layers with edges on posts of the next coarser one, each inside it; checks the number of posts."""
    cells = [plan.cell_m for plan in plans]
    fitted: list[LayerPlan] = []
    for number, plan in enumerate(plans):
        box = plan.box if not fitted else plan.box.join(fitted[-1].box)
        coarser = cells[number + 1] if number + 1 < len(cells) else plan.cell_m
        fitted.append(LayerPlan(plan.mosaics, plan.cell_m, box.snap(coarser)))
    posts = sum(math.prod(plan.shape) for plan in fitted)
    if posts > MAX_POSTS:
        worst = max(fitted, key=lambda plan: math.prod(plan.shape))
        wide, high = worst.box.east1 - worst.box.east0, worst.box.north1 - worst.box.north0
        raise ConfigError(
            f"{posts / 1e6:.0f} million posts, most of them {worst.cell_m:g} m apart over {wide / 1000:.1f} x "
            f"{high / 1000:.1f} km; must be at most {MAX_POSTS / 1e6:.0f} million: "
            f"use a larger cell_m or a smaller area (centre, radius_m)"
        )
    return tuple(fitted)


def _cover(file: ElevationFile, frame: LocalFrame, area: Box | None) -> Box | None:
    """The rectangle around the part of the area that a file covers; None where it does not touch it."""
    east, north = _local_outline(file, frame)
    if area is None:
        inside = np.isfinite(east)
        if not inside.all():
            return None
    else:
        corner_east, corner_north = np.meshgrid((area.east0, 0.0, area.east1), (area.north0, 0.0, area.north1))
        covered = _coverage(file, frame, corner_east, corner_north)
        east, north = np.append(east, corner_east[covered]), np.append(north, corner_north[covered])
        inside = area.contains(east, north)
    if not inside.any():
        return None
    return Box(*(float(f(side[inside])) for f in (np.min, np.max) for side in (east, north)))


def _local_outline(file: ElevationFile, frame: LocalFrame) -> tuple[Array, Array]:
    """East and north [m] of closely spaced points around a file; NaN where the Earth is between."""
    enu = frame.to_local(*file.outline(), 0.0)
    enu = np.where(enu[:, 2:] > _MIN_UP_M, enu, np.nan)
    closed = np.vstack((enu, enu[:1]))
    at = np.arange(len(enu) * 64) / 64
    east, north = (np.interp(at, np.arange(len(closed)), closed[:, k]) for k in (0, 1))
    return east, north


def _coverage(file: ElevationFile, frame: LocalFrame, east: Array, north: Array) -> NDArray[np.bool_]:
    """Whether points of the frame lie on a file's pixels."""
    lat, lon, _ = frame.to_geodetic(np.stack((east, north, np.zeros_like(east)), axis=-1))
    row, column = file.indices(lat, lon)
    on_rows = np.abs(row - (file.rows - 1) / 2) <= file.rows / 2
    return np.asarray(on_rows & (np.abs(column - (file.columns - 1) / 2) <= file.columns / 2))


def bounds_text(source: ElevationFileInfo) -> str:
    """Text of the coverage of a file: latitudes and longitudes [deg]."""
    south, north, west, east = (math.degrees(side) for side in (source.south, source.north, source.west, source.east))
    return f"{south:.5f} to {north:.5f} deg north, {west:.5f} to {east:.5f} deg east"
