"""Elevation files named by a recording: only single local files of five formats are opened.

A recording may come from anyone.  GDAL follows references in paths and files: ``/vsicurl/`` loads from an address, a
VRT or an overview in a sidecar file names any other path.  Therefore the path, the format and GDAL's options are
limited here.  A user's own configuration is not limited.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import rasterio
from rasterio.errors import RasterioIOError

from fti.errors import ConfigError, MissingError

#: GDAL's names of the allowed formats.
DRIVERS = ("GTiff", "SRTMHGT", "DTED", "AAIGrid", "HFA")
ZIP = "/vsizip/"
_REMEDY = "give your own configuration with this file"
#: ``http:``, ``file:``, ``GTIFF_DIR:``: addresses and GDAL's connection strings.
_SCHEME = re.compile(r"^[A-Za-z][A-Za-z0-9+.\-_]*:")


def check_local(path: str) -> None:
    """Raises ConfigError unless it is the path of a local file or of one in a local zip, MissingError for no file."""
    file = Path(_zip_of(path) if path.startswith(ZIP) else path)
    if str(file).startswith("/vsi") or _SCHEME.match(path) or not file.is_absolute():
        raise _refusal(path, "")
    if not file.exists():
        raise MissingError(f"{file}: file not found; the recording names it; {_REMEDY}")
    if not file.is_file():
        raise _refusal(path, "not a regular file; ")


def _zip_of(path: str) -> str:
    """The zip of ``/vsizip/FOLDER/FILE.zip/MEMBER``, in GDAL's form with or without braces."""
    inside = path.removeprefix(ZIP)
    if inside.startswith("{"):
        return inside[1:].partition("}")[0]
    zips = [str(place) for place in Path(inside).parents if place.suffix.lower() == ".zip"]
    return zips[-1] if zips else ""


def open_local(path: str) -> Any:
    """Open the file in ``local_environment``.  Raises ConfigError or MissingError."""
    check_local(path)
    try:
        return rasterio.DatasetReader(path, driver=list(DRIVERS))  # rasterio.open takes one driver only
    except RasterioIOError as error:
        raise _refusal(path, f"{error}; ") from None


def _refusal(path: str, why: str) -> ConfigError:
    return ConfigError(
        f"{path}: the recording names this elevation file, and it is not opened: {why}a recording may only name local "
        f"files of the formats {', '.join(DRIVERS)}, also in a local zip ({ZIP}); {_REMEDY}"
    )


def local_environment() -> Any:
    """GDAL's options for reading such a file: no sidecar files, no addresses."""
    return rasterio.Env(
        GDAL_DISABLE_READDIR_ON_OPEN="EMPTY_DIR",
        GDAL_PAM_ENABLED="NO",
        CPL_VSIL_CURL_ALLOWED_FILENAME="none",
        CPL_VSIL_CURL_ALLOWED_EXTENSIONS=".none",
    )
