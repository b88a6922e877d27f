"""What the heights of an elevation file are counted from, and in which unit: its own word, its format's, the caller's.

The caller's one word is for the files that do not say it themselves; where a file says something else, that is an error
and not a matter of rank, because either may be wrong by 47 m.  A word for one file by its name wins over all.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import pyproj

from fti.constants import FOOT
from fti.errors import ConfigError
from fti.geodesy.wgs84 import SEMI_MAJOR, SEMI_MINOR

#: What ``vertical`` may be.
DATUM_NAMES = ("egm96", "egm2008", "ellipsoid")
#: The key of ``vertical`` that stands for the files without one of their own.
OTHER_FILES = "*"

_MODELS = {5773: "egm96", 3855: "egm2008"}
_FORMATS = {"DTED": "egm96", "SRTMHGT": "egm96"}
#: Vertical datums of a DTED header that mean EGM96 (MIL-PRF-89020B).
_DTED_DATUMS = ("MSL", "E96")
_SURVEY_FOOT = 1200.0 / 3937.0
#: GDAL calls both feet a foot here and there; they differ by 2e-6 of a height, 1.8 cm on the highest ground.
_SAME_UNIT = 1e-4
_UNITS = {
    **dict.fromkeys(("m", "metre", "meter", "metres", "meters"), 1.0),
    **dict.fromkeys(("ft", "foot", "feet", "international foot"), FOOT),
    **dict.fromkeys(("us survey foot", "us-ft", "ftus", "foot_us", "us feet"), _SURVEY_FOOT),
}


def datum_names_by_file(vertical: str | Mapping[str, str] | None, paths: Collection[str]) -> Mapping[str, str]:
    """The caller's words by file, ``OTHER_FILES`` for those without one of their own.

    Raises ConfigError for a word that is none of WORDS, and for a file that is not among the paths.
    """
    words = {OTHER_FILES: vertical} if isinstance(vertical, str) else dict(vertical or {})
    for file, word in words.items():
        if word not in DATUM_NAMES:
            raise ConfigError(f"vertical = {word!r}: must be one of {', '.join(DATUM_NAMES)}")
        if file != OTHER_FILES and file not in paths:
            raise ConfigError(f"vertical: {file!r} is none of the files, which are named as they are opened")
    return words


def split_crs(crs: pyproj.CRS) -> tuple[pyproj.CRS, pyproj.CRS | None]:
    """The horizontal part, and the one that holds the third axis (None without)."""
    if crs.is_compound:
        return crs.sub_crs_list[0], crs.sub_crs_list[1]
    return (crs.to_2d(), crs) if len(crs.axis_info) == 3 else (crs, None)


def find_datum(path: str, upright: pyproj.CRS | None, dataset: Any, words: Mapping[str, str]) -> tuple[str, str]:
    """The vertical datum of a file and who says so.

    path     : the file, as the caller named it; upright : the part of its coordinate system with the third axis
    dataset  : the file, open; words : the caller's, by file
    Raises ConfigError where nobody says it, where it is none of WORDS, where two contradict each other, and for depths.
    """
    if upright is not None and upright.axis_info[-1].direction == "down":
        raise ConfigError(
            f"{path}: its coordinate system has depths, {upright.name!r}: must be heights, counted upwards"
        )
    if path in words:
        return words[path], "the caller, for this file"
    said, by = _file_datum(path, upright, dataset)
    if said is None:
        if OTHER_FILES not in words:
            raise ConfigError(
                f"{path}: nothing says what its heights are counted from; say vertical = one of {', '.join(DATUM_NAMES)}"
            )
        return words[OTHER_FILES], "the caller"
    if said not in DATUM_NAMES:
        raise ConfigError(
            f"{path}: its heights are counted from {said}, which is none of {', '.join(DATUM_NAMES)}; "
            f"say for this file which of them to take"
        )
    if words.get(OTHER_FILES, said) != said:
        raise ConfigError(
            f"{path}: {by} says {said} and vertical says {words[OTHER_FILES]!r}; say it for this file by name"
        )
    return said, by


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
    """Whether it has the size of WGS84's, as GRS 1980 has to 0.1 mm; Bessel's is 740 m smaller."""
    sizes = (ellipsoid.semi_major_metre, SEMI_MAJOR), (ellipsoid.semi_minor_metre, SEMI_MINOR)
    return all(abs(size - wanted) < 1e-3 for size, wanted in sizes)


def find_unit(path: str, flat: pyproj.CRS, upright: pyproj.CRS | None, unit: str | None) -> float:
    """Metres in one unit of a file's heights.

    flat, upright : the parts of its coordinate system; unit : what the file says of its values, None for nothing
    Raises ConfigError for a unit that is not known, for two that contradict each other, and where feet on the ground
    leave open what the heights are in.
    """
    if unit and unit.lower() not in _UNITS:
        raise ConfigError(f"{path}: the unit of its heights is {unit!r}; must be metre, foot or US survey foot")
    said = _UNITS[unit.lower()] if unit else None
    if upright is not None:
        axis = upright.axis_info[-1]
        if said is not None and abs(said / axis.unit_conversion_factor - 1.0) > _SAME_UNIT:
            raise ConfigError(
                f"{path}: its coordinate system has heights in {axis.unit_name} and its values are in {unit}; "
                f"correct the file, as gdal_edit.py -units does"
            )
        return float(axis.unit_conversion_factor)
    if said is not None:
        return said
    if flat.is_projected and flat.axis_info[0].unit_conversion_factor != 1.0:
        raise ConfigError(
            f"{path}: its places are in {flat.axis_info[0].unit_name} and nothing says the unit of its heights; "
            f"write it into the file, as gdal_edit.py -units does"
        )
    return 1.0
