"""The elevation files of a configuration, as ``fti check`` opens and shows them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from typing import Any

from fti.config import Config
from fti.errors import ConfigError, MissingError


def describe_terrain(config: Config) -> Iterator[dict[str, Any]]:
    """Each file, opened; the geoid that its heights need is there, too.  Raises ConfigError or MissingError."""
    if config.nav.terrain is None or not config.nav.terrain.files:
        return
    from fti.geodesy.geoid import load_geoid
    from fti.terrain.files.elevation_file import ElevationFile
    from fti.terrain.files.vertical import OTHERS

    vertical = config.nav.terrain.vertical
    assert vertical is not None  # files need it
    for i, file in enumerate(config.nav.terrain.files):
        key = f"{config.path}: nav.terrain.files[{i}]"
        try:
            with closing(ElevationFile(file, {OTHERS: vertical})) as opened:
                source = opened.source
            if source.vertical != "ellipsoid":
                load_geoid(source.vertical)
        except MissingError as error:
            raise MissingError(f"{key} = {error}") from None
        except ConfigError as error:
            raise ConfigError(f"{key} = {error}") from None
        yield {
            "file": file,
            "format": source.format,
            "posts": [source.rows, source.columns],
            "spacing_m": [round(spacing, 2) for spacing in source.spacing_m],
            "vertical": source.vertical,
            "vertical_by": source.vertical_by,
        }


def terrain_cells(file: dict[str, Any]) -> tuple[str, ...]:
    """One file for people: name, format, posts, distance between them, vertical datum."""
    posts, spacing = (" x ".join(f"{value:g}" for value in file[key]) for key in ("posts", "spacing_m"))
    datum = f"{file['vertical']}, says {file['vertical_by']}"
    return (file["file"], file["format"], f"{posts} posts", f"{spacing} m apart", datum)
