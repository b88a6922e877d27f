"""Elevation files as the layers of a terrain.

In a finer layer the outermost posts, and unknown ones, are taken from the coarser layers: no ray passes through the
seam, and the ground continues where a fine file ends.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import os
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from fti.arrays import Array
from fti.errors import ConfigError
from fti.geodesy.geoid import Geoid, load_geoid
from fti.geodesy.local import LocalFrame
from fti.terrain.file_info import NO_SOURCE
from fti.terrain.files.elevation_file import ElevationFile
from fti.terrain.files.layout import LayerPlan, make_plans, place_area
from fti.terrain.files.local_only import local_environment
from fti.terrain.files.resample import Resampler
from fti.terrain.files.resampling_error import measure_resampling
from fti.terrain.files.vertical import datum_names_by_file
from fti.terrain.layer import Layer
from fti.terrain.terrain import Terrain

#: A horizontal distance [m] over which the rise of a surface is negligible.
_EDGE_STEP = 1e-6


def open_terrain(
    paths: Sequence[str | os.PathLike[str]],
    *,
    centre: tuple[float, float] | None = None,
    radius_m: float | None = None,
    cell_m: float | None = None,
    vertical: str | Mapping[str, str] | None = None,
    progress: Callable[[float], None] | None = None,
    local_only: bool = False,
) -> Terrain:
    """A terrain from elevation files: GeoTIFF, DTED, SRTM HGT, or any format of GDAL, in any mixture.

    paths    : the files; where several overlap the finest one counts, then the first one
    centre   : latitude, longitude of the frame's origin [rad]; with radius_m [m] the area is the square around it.
               Neither: all that the files cover.  The frame lies on the ellipsoid, ``alt0`` is 0
    cell_m   : between the posts of the finest layer [m]; None: as far apart as those of the finest file
    vertical : vertical datum of files that do not state it: ``egm96``, ``egm2008`` or ``ellipsoid``; or a mapping
               from paths to these, ``*`` for the others
    progress : receives the progress, 0 to 1
    local_only : a recording names the files: only single local ones of the formats GTiff, SRTMHGT, DTED, AAIGrid
               and HFA are opened, also in a local zip; no sidecar files, no address
    Raises MissingError for a missing file or geoid grid; ConfigError for a file that is not an elevation file or
    has no coordinate system or vertical datum, if no file touches the area, and for an area too large for its cell;
    ValueError for invalid arguments.
    """
    names = [os.fspath(path) for path in paths]
    check_arguments(names, centre, radius_m, cell_m)
    words = datum_names_by_file(vertical, names)
    with contextlib.ExitStack() as stack:
        if local_only:
            stack.enter_context(local_environment())
        opened = (ElevationFile(path, words, local_only=local_only) for path in names)
        files = [stack.enter_context(contextlib.closing(file)) for file in opened]
        geoids = load_geoids(files)
        frame, area = place_area(files, centre, radius_m)
        plans = make_plans(files, frame, area, cell_m)
        layers = _build(plans, frame, geoids, progress)
        resampling = tuple(measure_resampling(plan, frame, geoids) for plan in plans)
        return Terrain(layers, frame, tuple(file.source for file in files), resampling)


def check_arguments(
    paths: Sequence[str], centre: tuple[float, float] | None, radius_m: float | None, cell_m: float | None
) -> None:
    """Raises ValueError for invalid arguments, ConfigError for more files than can be numbered."""
    if not paths:
        raise ValueError("a terrain needs at least one file")
    if len(paths) > NO_SOURCE:
        raise ConfigError(f"{len(paths)} files; must be at most {NO_SOURCE}: join tiles, for example with gdalbuildvrt")
    if (centre is None) != (radius_m is None):
        raise ValueError("centre and radius_m: must be given together, or neither for the whole coverage")
    if centre is not None and not (abs(centre[0]) <= math.pi / 2 and abs(centre[1]) <= 2 * math.pi):
        raise ValueError(f"centre = {centre}: must be latitude and longitude in radians")
    for name, value in (("radius_m", radius_m), ("cell_m", cell_m)):
        if value is not None and not 0.0 < value < math.inf:
            raise ValueError(f"{name} = {value}: must be positive")


def load_geoids(files: Sequence[ElevationFile]) -> dict[str, Geoid | None]:
    """The geoid of each vertical datum of the files, None for the ellipsoid.  Raises MissingError without its grid."""
    datums = dict.fromkeys(file.source.vertical for file in files)
    return {datum: None if datum == "ellipsoid" else load_geoid(datum) for datum in datums}


def _build(
    plans: Sequence[LayerPlan],
    frame: LocalFrame,
    geoids: Mapping[str, Geoid | None],
    progress: Callable[[float], None] | None,
) -> tuple[Layer, ...]:
    """The layers, built from the coarsest to the finest, because finer ones need the coarser ones."""
    total = sum(math.prod(plan.shape) * len(plan.mosaics) for plan in plans)
    looked_at = 0

    def done(posts: int) -> None:
        nonlocal looked_at
        looked_at += posts
        if progress:
            progress(looked_at / total)

    layers: list[Layer] = []
    for plan in reversed(plans):
        ups = np.full(plan.shape, np.nan)
        origin = np.full(plan.shape, NO_SOURCE, dtype=np.uint8)
        for mosaic in plan.mosaics:
            Resampler(frame, mosaic, geoids[mosaic.vertical]).fill(plan.places, (ups, origin), done)
        layer = Layer(ups, plan.cell_m, plan.box.east0, plan.box.north0, origin)
        if layers:
            _fill_from(layer, Terrain(tuple(layers), frame))
        layers.insert(0, layer)
    if not any(np.isfinite(layer.heights).any() for layer in layers):
        first = plans[0].mosaics[0].first.source.path
        raise ConfigError(f"{first}: no heights in the area, only holes")
    return tuple(layers)


def _move_off_holes(coarser: Terrain, east: Array, north: Array) -> tuple[Array, Array]:
    """The points [m]; those on the edge of a hole are moved slightly to the side with known ground."""
    lost = np.flatnonzero(np.isnan(coarser.up(east, north)))
    for to_east, to_north in itertools.product((-_EDGE_STEP, _EDGE_STEP), repeat=2):
        there = np.isfinite(coarser.up(east[lost] + to_east, north[lost] + to_north))
        east[lost[there]] += to_east
        north[lost[there]] += to_north
        lost = lost[~there]
    return east, north


def _fill_from(layer: Layer, coarser: Terrain) -> None:
    """Set the outermost and the unknown posts of a layer from the coarser ones."""
    wanted = np.isnan(layer.heights)
    wanted[[0, -1], :] = wanted[:, [0, -1]] = True
    rows, columns = np.nonzero(wanted)
    east, north = _move_off_holes(coarser, layer.east[columns], layer.north[rows])
    ups = coarser.up(east, north)
    new = np.isfinite(ups)
    at = rows[new], columns[new]
    layer.heights[at] = ups[new]
    if layer.origin is not None:
        layer.origin[at] = coarser.source(east[new], north[new])
