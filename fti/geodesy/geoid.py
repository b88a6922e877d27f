"""Undulation of the geoid: the height of mean sea level above the WGS84 ellipsoid, from PROJ's grids.

    alt = alt_msl + undulation(lat, lon)

PROJ silently applies no shift if it does not find a grid: an error of 47 m in central Europe.  Therefore this module
searches the grid, gives its path to PROJ, and raises an error if it is missing.  Nothing is downloaded.

The undulation is bilinear between the posts of the grid: for EGM96 with 15 arc minutes up to a few centimetres off the
model in rough terrain (4 cm at the test points of NGA, whose own program uses splines).

Source: Lemoine et al. 1998, NASA/TP-1998-206861 (EGM96); Pavlis et al. 2012 (EGM2008).
"""

from __future__ import annotations

import functools
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyproj
from numpy.typing import ArrayLike
from pyproj.datadir import get_data_dir, get_user_data_dir  # type: ignore[attr-defined]  # public in its documents
from pyproj.network import set_network_enabled  # type: ignore[attr-defined]  # as above

from fti.arrays import Array
from fti.errors import MissingError

set_network_enabled(False)  # overrides PROJ_NETWORK

#: Possible files of each model, and how to get one.
GRIDS = {
    "egm96": (("egm96_15.gtx", "us_nga_egm96_15.tif"), "install the Debian package proj-data: apt install proj-data"),
    "egm2008": (("us_nga_egm08_25.tif", "egm08_25.gtx"), "download it with PROJ: projsync --file us_nga_egm08_25.tif"),
}
#: Grid directory of the Debian package.
SYSTEM = Path("/usr/share/proj")


def grid_directories() -> tuple[Path, ...]:
    """Search path of grids: $PROJ_DATA, the directories of the user, of pyproj and of the system."""
    named = os.environ.get("PROJ_DATA", "").split(os.pathsep)
    places = [*filter(None, named), get_user_data_dir(), *get_data_dir().split(os.pathsep), str(SYSTEM)]
    return tuple(map(Path, dict.fromkeys(places)))


def find_grid(model: str, directories: Sequence[Path]) -> Path:
    """The file of a model's grid.  Raises ValueError for an unknown model, MissingError without a file."""
    if model not in GRIDS:
        raise ValueError(f"unknown geoid {model!r}; must be one of {', '.join(GRIDS)}")
    names, remedy = GRIDS[model]
    for path in (directory / name for name in names for directory in directories):
        if path.is_file():
            return path
    searched = ", ".join(map(str, directories)) or "no directory"
    raise MissingError(f"the geoid grid of {model} ({' or '.join(names)}) is not in {searched}; {remedy}")


class Geoid:
    """One geoid model.

    model : egm96 or egm2008; path : the file of its grid
    """

    def __init__(self, model: str, path: Path) -> None:
        self.model = model
        self.path = path
        try:  # a pipeline that names its grid by path fails without it
            self._shift = pyproj.Transformer.from_pipeline(f'+proj=vgridshift +grids="{path}" +multiplier=1')
        except pyproj.exceptions.ProjError as error:
            raise MissingError(f"{path}: PROJ cannot read this geoid grid: {error}") from None

    def undulation(self, lat: ArrayLike, lon: ArrayLike) -> Array:
        """Height of the geoid above the ellipsoid [m] at lat, lon [rad], shapes broadcast; NaN off the grid."""
        to_lat, to_lon = np.broadcast_arrays(np.asarray(lat, dtype=np.float64), np.asarray(lon, dtype=np.float64))
        flat = to_lon.ravel(), to_lat.ravel(), np.zeros(to_lat.size)
        _, _, shift = self._shift.transform(*flat, radians=True)
        return np.where(np.isfinite(shift), shift, np.nan).reshape(to_lat.shape)


@functools.cache
def load_geoid(model: str) -> Geoid:
    """The geoid of a model (egm96, egm2008) from the grids of this machine.  Raises ValueError or MissingError."""
    return Geoid(model, find_grid(model, grid_directories()))
