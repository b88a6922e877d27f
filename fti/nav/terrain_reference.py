"""Reference terrain of navigation: surface, accuracy and identity."""

from __future__ import annotations

import functools
import hashlib
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from fti.terrain.terrain import Terrain


@dataclass(frozen=True, eq=False)
class Ground:
    """Known elevation.

    terrain : the surface; name : its data source; files : paths of the source files
    sd      : one sigma of the heights of the source [m]; of the surface, with its resampling: ``sd_at``
    """

    terrain: Terrain
    sd: float
    name: str
    files: tuple[str, ...] = ()

    def sd_at(self, east: float, north: float) -> float:
        """One sigma of the surface [m] at a position in the terrain's frame [m]: sqrt(sd^2 + RMS of the resampling^2).

        The RMS is that of the layer at the position.  Outside all layers, and for layers without a file: sd.
        """
        for layer, resampling in zip(self.terrain.layers, self.terrain.resampling, strict=False):
            if layer.east0 <= east <= layer.east1 and layer.north0 <= north <= layer.north1:
                return math.hypot(self.sd, resampling.rms_m)
        return self.sd

    @functools.cached_property
    def digest(self) -> str:
        """SHA-256 over the frame, the layers' extents and their posts, hexadecimal: equal for the same ground."""
        frame = self.terrain.frame
        digest = hashlib.sha256(repr((frame.lat0, frame.lon0, frame.alt0)).encode())
        for layer in self.terrain.layers:
            digest.update(repr((layer.east0, layer.north0, layer.cell_m, layer.heights.shape)).encode())
            digest.update(np.ascontiguousarray(layer.heights).ravel().data)
        return digest.hexdigest()
