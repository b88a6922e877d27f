"""Diffuse reflectance of the ground at 900 nm by land cover, for lasers.

    cover      reflectance   meaning and source
    BARE          0.25       soil: the middle of dry (0.425) and wet (0.079) [1]
    GRASS, CROP   0.45       green leaves, 0.40 to 0.50 from 0.7 to 1.3 um [2]
    FOREST        0.45       the middle of deciduous (0.60) and coniferous trees (0.30) [3]
    BUILDING      0.24       smooth concrete [3]
    WATER         0.02       mirror of calm water at normal incidence, ((n - 1) / (n + 1))^2 with n = 1.33
    TARMAC        0.17       asphalt with pebbles [3]

Values scatter by a factor of two with moisture, season and age.  Water is not a diffuse reflector: straight down on a
calm surface the glint is far stronger, a few degrees off there is no return; 0.02 as a diffuse reflectance means that
water is detected at short range, if at all.

Reliability: [1] was read from the spectra, at 900 nm.  [3] was compared with copies of the table in teaching material,
not with the paper.  [2] is a quotation of the book that was not verified; a meadow is darker than its leaves.

Sources: [1] soil spectra that come with the models PROSPECT + SAIL, Jacquemoud and others 2009; [2] Lillesand, Kiefer,
Chipman, Remote Sensing and Image Interpretation, section 1.4; [3] Wehr and Lohr 1999, Airborne laser scanning: an
introduction and overview, table of reflectivities at 900 nm.  Fig. 2.7 of Spiegel 2018 shows such figures after Brooker
2009; none of it is used here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.terrain.landscape import Cover

#: Land cover everywhere, or numbers of ``Cover`` at east, north [m] (``Landscape.cover_at``).
CoverAt = Cover | Callable[[Array, Array], NDArray[np.uint8]]

REFLECTANCE: Mapping[Cover, float] = MappingProxyType(
    {
        Cover.BARE: 0.25,
        Cover.GRASS: 0.45,
        Cover.CROP: 0.45,
        Cover.FOREST: 0.45,
        Cover.BUILDING: 0.24,
        Cover.WATER: 0.02,
        Cover.TARMAC: 0.17,
    }
)
_BY_NUMBER = np.full(256, np.nan)
_BY_NUMBER[list(REFLECTANCE)] = list(REFLECTANCE.values())


def reflectance_at(cover: CoverAt, east: Array, north: Array) -> Array:
    """Diffuse reflectance at points [m] of any common shape; NaN where the land cover is unknown."""
    if isinstance(cover, Cover):
        return np.full(np.shape(east), REFLECTANCE[cover])
    return np.asarray(_BY_NUMBER[cover(east, north)])
