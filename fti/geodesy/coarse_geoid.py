"""Undulation of the geoid EGM96 from a coarse grid in the package, for plausibility checks only.

Heights are converted with ``fti.geodesy.geoid``, which needs a grid of the system.  This one has posts every 30 arc
minutes, rounded to 0.1 m: every second post of ``egm96_15.gtx`` (PROJ, package proj-data), which is the grid of 15 arc
minutes of NGA and NASA.  It is bilinear between the posts.  At the omitted posts its error is up to 3.9 m (trenches and
island arcs), below 1.3 m at 99.9 %, 0.13 m RMS.

Source: Lemoine et al. 1998, NASA/TP-1998-206861; a work of the US government, in the public domain.
"""

from __future__ import annotations

import functools
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fti.geodesy.formulas import Corners, bilinear

FILE = Path(__file__).with_name("egm96_30min.npz")
#: Posts per degree; rows from the south pole, columns from 180 degrees west.
PER_DEGREE = 2


@functools.cache
def _posts() -> NDArray[np.int16]:
    """shape (361, 720) [dm]; the file holds each row as differences."""
    with np.load(FILE) as file:
        posts: NDArray[np.int16] = np.cumsum(file["decimetres"], axis=1, dtype=np.int16)
    return posts


@functools.lru_cache(maxsize=256)
def _corners(i: int, j: int) -> Corners:
    """Posts around a cell [dm]; whole degrees east may be 360."""
    posts = _posts()
    west, east = j % posts.shape[1], (j + 1) % posts.shape[1]
    return float(posts[i, west]), float(posts[i, east]), float(posts[i + 1, west]), float(posts[i + 1, east])


def undulation(lat: float, lon: float) -> float:
    """Height of the geoid above the ellipsoid [m] at lat, lon [rad].  Raises ValueError for an invalid position."""
    if not abs(lat) <= math.pi / 2 or not math.isfinite(lon):
        raise ValueError(f"invalid position: latitude {lat} rad, longitude {lon} rad")
    row = (math.degrees(lat) + 90.0) * PER_DEGREE
    column = ((math.degrees(lon) + 180.0) % 360.0) * PER_DEGREE
    i, j = min(int(row), 180 * PER_DEGREE - 1), int(column)
    return bilinear(_corners(i, j), column - j, row - i)[0] / 10.0
