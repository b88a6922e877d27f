"""Output of ``fti terrain info``: files and their layers, as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fti.config import TerrainFiles
from fti.terrain.files.file_survey import FileSurvey, LayerSurvey, TerrainSurvey
from fti.terrain.files.layout import bounds_text
from fti.terrain.resampling import ResamplingError

_ANGLES = ("south", "west", "north", "east")


def as_text(survey: TerrainSurvey) -> Iterator[str]:
    """Lines of text."""
    for number, file in enumerate(survey.files):
        yield from _file(number, file)
        yield ""
    yield "terrain"
    lat, lon = math.degrees(survey.frame.lat0), math.degrees(survey.frame.lon0)
    yield f"  frame        east, north, up at {lat:.5f}, {lon:.5f} deg on the WGS84 ellipsoid"
    if survey.refused:
        yield f"  none         {survey.refused}"
    for number, layer in enumerate(survey.layers):
        yield from _layer(number, layer, survey)
    for model, grid in survey.geoids.items():
        yield f"  geoid        {model}: {grid}"
    if not survey.geoids:
        yield "  geoid        none required"


def _file(number: int, file: FileSurvey) -> Iterator[str]:
    source = file.source
    across, along = source.spacing_m
    posts = source.rows * source.columns
    yield f"{number}  {source.path}"
    yield f"  format       {source.format}, {source.rows} x {source.columns} posts, a pixel is {_PIXELS[source.pixel]}"
    accuracy = "unknown" if source.accuracy_m is None else f"{source.accuracy_m:g} m"
    yield f"  coordinates  {source.crs}; to WGS84 with an accuracy of {accuracy}"
    yield f"  spacing      {across:.2f} m along a row, {along:.2f} m along a column"
    unit = "" if source.unit_m == 1.0 else f"; the file's unit is {source.unit_m:.9g} m"
    yield f"  vertical     {source.vertical} (from {source.vertical_by}){unit}"
    if file.lowest is None or file.highest is None:
        yield "  heights      none"
    else:
        yield f"  heights      {file.lowest:.2f} to {file.highest:.2f} m above {_DATUMS[source.vertical]}"
    yield f"  holes        {f'{file.holes} posts, {100.0 * file.holes / posts:.2g} %' if file.holes else 'none'}"
    yield f"  covers       {bounds_text(source)}{'' if file.used else '; in no layer'}"
    yield f"  date         {source.date or 'the file states none'}"
    if source.sd_m is None:
        yield "  sigma        the file states none"
    else:
        yield f"  sigma        {source.sd_m:.1f} m, from the accuracy that the file states"


_PIXELS = {"area": "an area around its post", "point": "a post"}
_DATUMS = {"ellipsoid": "the ellipsoid", "egm96": "mean sea level (EGM96)", "egm2008": "mean sea level (EGM2008)"}


def _layer(number: int, layer: LayerSurvey, survey: TerrainSurvey) -> Iterator[str]:
    size = " x ".join(f"{(end - begin) / 1000.0:.2f}" for begin, end in (layer.east_m, layer.north_m))
    files = ", ".join(Path(survey.files[n].source.path).name for n in layer.files)
    yield f"  layer {number}      {layer.cell_m:g} m, {layer.rows} x {layer.columns} posts, {size} km: {files}"
    yield f"  resampling   {_resampling(layer.resampling)}"
    if number + 1 < len(survey.layers):
        (west, east), (south, north) = layer.east_m, layer.north_m
        yield (
            f"  seam         at east {west:g} and {east:g} m, north {south:g} and {north:g} m, "
            f"on posts of layer {number + 1}"
        )


def _resampling(error: ResamplingError | None) -> str:
    """The error of resampling, and the sigma of the layer with the default of ``nav.terrain.sd_m``."""
    if error is None or not error.samples:
        return "unknown: no point could be compared" if error else "unknown without the geoid"
    stated: float = TerrainFiles.model_fields["sd_m"].default
    return (
        f"{error.rms_m:.2f} m RMS, {error.max_m:.1f} m at most at {error.samples} points, against the files' own "
        f"surface; sigma of the layer {math.hypot(stated, error.rms_m):.2f} m with sd_m = {stated:g} m of the files"
    )


def as_json(survey: TerrainSurvey) -> dict[str, Any]:
    """The same as JSON; angles in degrees."""
    return {
        "files": [_file_json(file) for file in survey.files],
        "frame": {"lat_deg": math.degrees(survey.frame.lat0), "lon_deg": math.degrees(survey.frame.lon0), "alt_m": 0.0},
        "layers": [asdict(layer) for layer in survey.layers],
        "refused": survey.refused or None,
        "geoids": dict(survey.geoids),
    }


def _file_json(file: FileSurvey) -> dict[str, Any]:
    table = asdict(file.source)
    bounds = {f"{side}_deg": math.degrees(table.pop(side)) for side in _ANGLES}
    heights = {"lowest_m": file.lowest, "highest_m": file.highest, "holes": file.holes, "used": file.used}
    return {**table, **bounds, **heights}
