"""Datum, sigma and date of elevation files by ``[[nav.terrain.file]]``; they have precedence over those in a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any

from fti.config import TerrainFiles, TerrainFileTable
from fti.errors import ConfigError
from fti.terrain.file_info import ElevationFileInfo
from fti.terrain.files.vertical import OTHER_FILES


def check_paths(settings: TerrainFiles, files: Sequence[str]) -> None:
    """Raises ConfigError for a table without a file.  files : all elevation files of the configuration"""
    for i, table in enumerate(settings.file):
        if not any(_is_match(table, file) for file in files):
            raise ConfigError(
                f"nav.terrain.file[{i}].path = {table.path!r}: is none of the {len(files)} elevation files; "
                "allowed: a path or folder of nav.terrain.files, or a pattern"
            )


def stated_datums(settings: TerrainFiles, files: Sequence[str]) -> dict[str, str]:
    """The argument ``vertical`` of ``open_terrain``: the datums of the tables by file, and that of the others."""
    by_file = {file: _stated(settings, file, "vertical")[0] for file in files}
    others = {OTHER_FILES: settings.vertical} if settings.vertical else {}
    return {**others, **{file: datum for file, datum in by_file.items() if datum}}


def with_stated(settings: TerrainFiles, info: ElevationFileInfo) -> ElevationFileInfo:
    """The metadata of a file with the sigma and the date of the tables, and the origin of the datum."""
    sd_m, sd_by = _stated(settings, info.path, "sd_m")
    date, date_by = _stated(settings, info.path, "date")
    _, vertical_by = _stated(settings, info.path, "vertical")
    return replace(
        info,
        vertical_by=vertical_by or info.vertical_by,
        sd_m=info.sd_m if sd_m is None else sd_m,
        sd_by=sd_by or info.sd_by,
        date=date or info.date,
        date_by=date_by or info.date_by,
    )


def _stated(settings: TerrainFiles, file: str, name: str) -> tuple[Any, str | None]:
    """A property of a file and the table that states it; None for both without."""
    for i, table in enumerate(settings.file):
        if getattr(table, name) is not None and _is_match(table, file):
            return getattr(table, name), f"nav.terrain.file[{i}]"
    return None, None


def _is_match(table: TerrainFileTable, file: str) -> bool:
    return file == table.path or file.startswith(f"{table.path}/") or fnmatchcase(file, table.path)
