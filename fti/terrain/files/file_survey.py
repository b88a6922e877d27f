"""Contents of elevation files, and the layers of the terrain that they would make."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fti.errors import ConfigError, MissingError
from fti.geodesy.geoid import load_geoid
from fti.geodesy.local import LocalFrame
from fti.terrain.file_info import ElevationFileInfo
from fti.terrain.files.elevation_file import ElevationFile
from fti.terrain.files.layout import Box, LayerPlan, make_plans, place_area
from fti.terrain.files.open_terrain import check_arguments, load_geoids
from fti.terrain.files.resampling_error import measure_resampling
from fti.terrain.files.vertical import datum_names_by_file
from fti.terrain.resampling import ResamplingError

#: Posts that are read at a time.
_PART = 2**22


@dataclass(frozen=True, slots=True)
class FileSurvey:
    """One file: lowest and highest height above its own vertical datum [m], None without any; posts without height.

    used : whether it touches the area and is in a layer
    """

    source: ElevationFileInfo
    lowest: float | None
    highest: float | None
    holes: int
    used: bool


@dataclass(frozen=True, slots=True)
class LayerSurvey:
    """One planned layer: distance of posts [m], rows and columns, extent [m], and the numbers of its files.

    resampling : its error against the surfaces of its files; None where a geoid is missing
    """

    cell_m: float
    rows: int
    columns: int
    east_m: tuple[float, float]
    north_m: tuple[float, float]
    files: tuple[int, ...]
    resampling: ResamplingError | None


@dataclass(frozen=True, slots=True)
class TerrainSurvey:
    """Files, planned layers (empty, with the reason in ``refused``), their frame, and the grid of each geoid."""

    files: tuple[FileSurvey, ...]
    layers: tuple[LayerSurvey, ...]
    refused: str
    frame: LocalFrame
    geoids: Mapping[str, str]


def survey(
    paths: Sequence[str],
    *,
    centre: tuple[float, float] | None = None,
    radius_m: float | None = None,
    cell_m: float | None = None,
    vertical: str | Mapping[str, str] | None = None,
    progress: Callable[[float], None] | None = None,
) -> TerrainSurvey:
    """Read all posts of the files; arguments and exceptions are those of ``open_terrain``.

    A missing geoid, and an area that is too large or not touched, are reported in the result.
    """
    check_arguments(paths, centre, radius_m, cell_m)
    words = datum_names_by_file(vertical, paths)
    with contextlib.ExitStack() as stack:
        files = [stack.enter_context(contextlib.closing(ElevationFile(path, words))) for path in paths]
        frame, area = place_area(files, centre, radius_m)
        plans, refused = _plan(files, frame, area, cell_m)
        total, read = sum(f.rows * f.columns for f in files), 0

        def advance(posts: int) -> None:
            nonlocal read
            read += posts
            if progress:
                progress(read / total)

        layers = _describe_layers(plans, frame, files)
        used = {number for layer in layers for number in layer.files}
        surveys = tuple(_survey_file(file, number in used, advance) for number, file in enumerate(files))
        geoids = {f.source.vertical: _grid_of(f.source.vertical) for f in files if f.source.vertical != "ellipsoid"}
        return TerrainSurvey(surveys, layers, refused, frame, geoids)


def survey_layers(
    paths: Sequence[str],
    *,
    centre: tuple[float, float] | None = None,
    radius_m: float | None = None,
    cell_m: float | None = None,
    vertical: str | Mapping[str, str] | None = None,
) -> tuple[LayerSurvey, ...]:
    """The layers alone, for which few posts are read; arguments and exceptions are those of ``open_terrain``."""
    check_arguments(paths, centre, radius_m, cell_m)
    words = datum_names_by_file(vertical, paths)
    with contextlib.ExitStack() as stack:
        files = [stack.enter_context(contextlib.closing(ElevationFile(path, words))) for path in paths]
        frame, area = place_area(files, centre, radius_m)
        geoids = load_geoids(files)
        plans = make_plans(files, frame, area, cell_m)
        return tuple(_describe(plan, measure_resampling(plan, frame, geoids)) for plan in plans)


def _plan(
    files: Sequence[ElevationFile], frame: LocalFrame, area: Box | None, cell_m: float | None
) -> tuple[tuple[LayerPlan, ...], str]:
    try:
        return make_plans(files, frame, area, cell_m), ""
    except ConfigError as error:
        return (), str(error)


def _survey_file(file: ElevationFile, used: bool, advance: Callable[[int], None]) -> FileSurvey:
    lowest, highest, holes = math.inf, -math.inf, 0
    step = max(1, _PART // file.columns)
    for row in range(0, file.rows, step):
        heights = file.read((row, min(row + step, file.rows)), (0, file.columns))
        known = heights[np.isfinite(heights)]
        holes += heights.size - known.size
        if known.size:
            lowest, highest = min(lowest, float(known.min())), max(highest, float(known.max()))
        advance(heights.size)
    if highest < lowest:
        return FileSurvey(file.source, None, None, holes, used)
    return FileSurvey(file.source, lowest, highest, holes, used)


def _describe_layers(
    plans: Sequence[LayerPlan], frame: LocalFrame, files: Sequence[ElevationFile]
) -> tuple[LayerSurvey, ...]:
    try:
        geoids = load_geoids(files)
    except MissingError:
        return tuple(_describe(plan, None) for plan in plans)
    return tuple(_describe(plan, measure_resampling(plan, frame, geoids)) for plan in plans)


def _describe(plan: LayerPlan, resampling: ResamplingError | None) -> LayerSurvey:
    numbers = tuple(number for mosaic in plan.mosaics for number in mosaic.numbers)
    box = plan.box
    extent = (box.east0, box.east1), (box.north0, box.north1)
    return LayerSurvey(plan.cell_m, *plan.shape, *extent, numbers, resampling)


def _grid_of(model: str) -> str:
    try:
        return str(load_geoid(model).path)
    except MissingError as error:
        return f"missing: {error}"
