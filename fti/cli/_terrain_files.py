"""The elevation files of a configuration, as ``fti check`` opens and shows them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import closing
from typing import TYPE_CHECKING, Any

from fti.config import Config, TerrainFiles
from fti.errors import ConfigError, MissingError

if TYPE_CHECKING:
    from fti.terrain.file_info import ElevationFileInfo


def describe_terrain(config: Config) -> Iterator[dict[str, Any]]:
    """Open each file, and load the geoid that its heights need.  Raises ConfigError or MissingError."""
    settings = config.nav.terrain
    if settings is None or not settings.files:
        return
    from fti.terrain.files.catalogue import list_files

    for i, path in enumerate(settings.files):
        key = f"{config.path}: nav.terrain.files[{i}]"
        try:
            files = list_files([path])
        except ConfigError as error:
            raise ConfigError(f"{key} = {error}") from None
        for file in files:
            yield _describe(file, key, settings)


def _describe(file: str, key: str, settings: TerrainFiles) -> dict[str, Any]:
    from fti.geodesy.geoid import load_geoid
    from fti.terrain.files.elevation_file import ElevationFile
    from fti.terrain.files.stated_properties import stated_datums, with_stated

    try:
        with closing(ElevationFile(file, stated_datums(settings, [file]))) as opened:
            source = with_stated(settings, opened.source)
        if source.vertical != "ellipsoid":
            load_geoid(source.vertical)
    except MissingError as error:
        raise MissingError(f"{key} = {error}") from None
    except ConfigError as error:
        raise ConfigError(f"{key} = {error}") from None
    return {
        "file": file,
        "format": source.format,
        "posts": [source.rows, source.columns],
        "spacing_m": [round(spacing, 2) for spacing in source.spacing_m],
        "vertical": source.vertical,
        "vertical_by": source.vertical_by,
        "date": source.date,
        "date_by": source.date_by,
        "sd_m": settings.sd_m if source.sd_m is None else source.sd_m,
        "sd_by": source.sd_by or "nav.terrain.sd_m",
    }


def describe_layers(config: Config) -> Iterator[dict[str, Any]]:
    """Each layer of the terrain with its largest sigma and the parts of it [m].  Raises ConfigError or MissingError.

    With ``memory_mb``: of the square around the middle of the finest file, where squares are smallest.
    """
    settings = config.nav.terrain
    if settings is None or not settings.files:
        return
    from fti.terrain.files.catalogue import list_files, read_catalogue
    from fti.terrain.files.file_survey import survey_layers
    from fti.terrain.files.stated_properties import check_paths, stated_datums, with_stated

    area = None
    files, centre, radius_m = list_files(settings.files), None, settings.radius_m
    if settings.centre_deg:
        centre = (math.radians(settings.centre_deg[0]), math.radians(settings.centre_deg[1]))
    try:
        check_paths(settings, files)
    except ConfigError as error:
        raise ConfigError(f"{config.path}: {error}") from None
    try:
        catalogue = read_catalogue(files, stated_datums(settings, files))
        if settings.square_mb is not None:
            area = catalogue.area_around(*catalogue.finest.middle, settings.square_mb, settings.cell_m)
            files, centre, radius_m = area.files, (area.lat, area.lon), area.radius_m
        layers = survey_layers(
            files,
            centre=centre,
            radius_m=radius_m,
            cell_m=settings.cell_m,
            vertical=stated_datums(settings, files),
        )
    except ConfigError as error:
        raise ConfigError(f"{config.path}: nav.terrain: {error}") from None
    _check_land_cover(config, settings, catalogue.files)
    stated = {source.path: with_stated(settings, source).sd_m or settings.sd_m for source in catalogue.files}
    for layer in layers:
        sd_m = max(stated[files[number]] for number in layer.files)
        assert layer.resampling is not None  # geoids are available
        yield {
            "cell_m": layer.cell_m,
            "sigma_m": round(math.hypot(sd_m, layer.resampling.rms_m), 3),
            "sd_m": sd_m,
            "resampling_rms_m": round(layer.resampling.rms_m, 3),
            "resampling_max_m": round(layer.resampling.max_m, 2),
            "square_m": None if area is None else 2.0 * area.radius_m,
        }


def _check_land_cover(config: Config, settings: TerrainFiles, files: Sequence[ElevationFileInfo]) -> None:
    from fti.terrain.files.land_cover import check_land_cover

    if settings.land_cover is None:
        return
    try:
        check_land_cover(settings.land_cover, files)
    except (ConfigError, MissingError) as error:
        raise type(error)(f"{config.path}: nav.terrain.land_cover = {error}") from None


def layer_cells(layer: dict[str, Any]) -> tuple[str, ...]:
    """The sigma of one layer and its parts as text."""
    parts = f"{layer['sd_m']:g} m of the files and {layer['resampling_rms_m']:.2f} m RMS of resampling"
    square = f"in squares of {layer['square_m'] / 1000:.1f} km, " if layer["square_m"] else ""
    return (
        f"{square}posts {layer['cell_m']:g} m apart",
        f"sigma {layer['sigma_m']:.2f} m: {parts}, {layer['resampling_max_m']:.1f} m at most",
    )


def terrain_cells(file: dict[str, Any]) -> tuple[str, ...]:
    """One file as text: name, format, posts, spacing, vertical datum, date, sigma."""
    posts, spacing = (" x ".join(f"{value:g}" for value in file[key]) for key in ("posts", "spacing_m"))
    datum = f"{file['vertical']} (from {file['vertical_by']})"
    date = f"date {file['date']} (from {file['date_by']})" if file["date"] else "no date"
    sigma = f"sigma {file['sd_m']:.3g} m (from {file['sd_by']})"
    return (file["file"], file["format"], f"{posts} posts", f"{spacing} m apart", datum, date, sigma)
