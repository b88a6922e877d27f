"""Vertical datum and unit of the heights of an elevation file: from the file, its format, or the caller.

The caller's general datum is for files that do not state it.  A file that states another one is an error, because
either may be wrong by 47 m.  A datum for one file by its name has precedence.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import pyproj

from fti.constants import FOOT
from fti.errors import ConfigError
from fti.geodesy.formulas import SEMI_MAJOR, SEMI_MINOR

#: Allowed values of ``vertical``.
DATUM_NAMES = ("egm96", "egm2008", "ellipsoid")
#: The key of ``vertical`` for files without their own entry.
OTHER_FILES = "*"

_MODELS = {5773: "egm96", 3855: "egm2008"}
_FORMATS = {"DTED": "egm96", "SRTMHGT": "egm96"}
#: Vertical datums of a DTED header that mean EGM96 (MIL-PRF-89020B).
_DTED_DATUMS = ("MSL", "E96")
_SURVEY_FOOT = 1200.0 / 3937.0
#: GDAL sometimes calls both feet a foot; they differ by 2e-6 of a height, 1.8 cm on the highest ground.
_SAME_UNIT = 1e-4
_UNITS = {
    **dict.fromkeys(("m", "metre", "meter", "metres", "meters"), 1.0),
    **dict.fromkeys(("ft", "foot", "feet", "international foot"), FOOT),
    **dict.fromkeys(("us survey foot", "us-ft", "ftus", "foot_us", "us feet"), _SURVEY_FOOT),
}


def datum_names_by_file(vertical: str | Mapping[str, str] | None, paths: Collection[str]) -> Mapping[str, str]:
    """The caller's datums by file, ``OTHER_FILES`` for those without their own entry.

    Raises ConfigError for a value that is not in DATUM_NAMES, and for a file that is not among the paths.
    """
    words = {OTHER_FILES: vertical} if isinstance(vertical, str) else dict(vertical or {})
    for file, word in words.items():
        if word not in DATUM_NAMES:
            raise ConfigError(f"vertical = {word!r}: must be one of {', '.join(DATUM_NAMES)}")
        if file != OTHER_FILES and file not in paths:
            raise ConfigError(f"vertical: {file!r}: not one of the files; use the same path")
    return words


def datums_of(words: Mapping[str, str], paths: Collection[str]) -> dict[str, str]:
    """The caller's datums without those of other files than ``paths``."""
    return {file: datum for file, datum in words.items() if file == OTHER_FILES or file in paths}


def split_crs(crs: pyproj.CRS) -> tuple[pyproj.CRS, pyproj.CRS | None]:
    """The horizontal part, and the part with the third axis (None without)."""
    if crs.is_compound:
        return crs.sub_crs_list[0], crs.sub_crs_list[1]
    return (crs.to_2d(), crs) if len(crs.axis_info) == 3 else (crs, None)


def find_datum(path: str, upright: pyproj.CRS | None, dataset: Any, words: Mapping[str, str]) -> tuple[str, str]:
    """The vertical datum of a file and its origin.

    path     : the file, as the caller named it; upright : the part of its coordinate system with the third axis
    dataset  : the file, open; words : the caller's datums, by file
    Raises ConfigError where it is unknown, not in DATUM_NAMES or contradictory, and for depths.
    """
    if upright is not None and upright.axis_info[-1].direction == "down":
        raise ConfigError(
            f"{path}: its coordinate system has depths, {upright.name!r}: must be heights, counted upwards"
        )
    if path in words:
        return words[path], "the caller, for this file"
    datum, by = _file_datum(path, upright, dataset)
    if datum is None:
        if OTHER_FILES not in words:
            names = ", ".join(DATUM_NAMES)
            raise ConfigError(f"{path}: its vertical datum is unknown; set vertical (or --vertical) to one of {names}")
        return words[OTHER_FILES], "the caller"
    if datum not in DATUM_NAMES:
        raise ConfigError(
            f"{path}: its vertical datum is {datum}; must be one of {', '.join(DATUM_NAMES)}; "
            f"set vertical for this file"
        )
    if words.get(OTHER_FILES, datum) != datum:
        raise ConfigError(
            f"{path}: {by} states {datum}, but vertical is {words[OTHER_FILES]!r}; set vertical for this file"
        )
    return datum, by


def _file_datum(path: str, upright: pyproj.CRS | None, dataset: Any) -> tuple[str | None, str]:
    if upright is not None:
        return _datum_of(upright), "its coordinate system"
    if dataset.driver == "DTED":
        datum = dataset.tags().get("DTED_VerticalDatum", "MSL").strip()
        if datum not in _DTED_DATUMS:
            return f"the datum {datum}", "its header"
    return _FORMATS.get(dataset.driver), "its format"


def _datum_of(upright: pyproj.CRS) -> str:
    if not upright.is_vertical:
        ellipsoid: Any = upright.ellipsoid
        return "ellipsoid" if _is_wgs84(ellipsoid) else f"the ellipsoid {ellipsoid.name!r}"
    name = upright.name
    by_name = next((model for model in _MODELS.values() if name.lower().startswith(model)), f"{name!r}")
    return _MODELS.get(upright.to_epsg() or 0, by_name)


def _is_wgs84(ellipsoid: Any) -> bool:
    """Whether it has the size of WGS84, like GRS 1980 to 0.1 mm; that of Bessel is 740 m smaller."""
    sizes = (ellipsoid.semi_major_metre, SEMI_MAJOR), (ellipsoid.semi_minor_metre, SEMI_MINOR)
    return all(abs(size - wanted) < 1e-3 for size, wanted in sizes)


def find_unit(path: str, flat: pyproj.CRS, upright: pyproj.CRS | None, unit: str | None) -> float:
    """Metres in one unit of a file's heights.

    flat, upright : the parts of its coordinate system; unit : of its values in the file, None if not stated
    Raises ConfigError for an unknown unit, for two contradictory ones, and for horizontal feet without a unit of the
    heights.
    """
    if unit and unit.lower() not in _UNITS:
        raise ConfigError(f"{path}: the unit of its heights is {unit!r}; must be metre, foot or US survey foot")
    factor = _UNITS[unit.lower()] if unit else None
    if upright is not None:
        axis = upright.axis_info[-1]
        if factor is not None and abs(factor / axis.unit_conversion_factor - 1.0) > _SAME_UNIT:
            raise ConfigError(
                f"{path}: its coordinate system has heights in {axis.unit_name}, but its values are in {unit}; "
                f"correct the file, for example with gdal_edit.py -units"
            )
        return float(axis.unit_conversion_factor)
    if factor is not None:
        return factor
    if flat.is_projected and flat.axis_info[0].unit_conversion_factor != 1.0:
        raise ConfigError(
            f"{path}: its coordinates are in {flat.axis_info[0].unit_name}, but the unit of its heights is unknown; "
            f"set it in the file, for example with gdal_edit.py -units"
        )
    return 1.0
