"""The ground as navigation knows it: a terrain, how good it is, and which one it was."""

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

    terrain : the surface; name : what it was made from; files : where they lay
    sd      : one sigma of the heights of what it was made from [m]; of the surface, with its change of posts: ``sd_at``
    """

    terrain: Terrain
    sd: float
    name: str
    files: tuple[str, ...] = ()

    def sd_at(self, east: float, north: float) -> float:
        """One sigma of the surface [m] at a place of the terrain's frame [m]: sqrt(sd^2 + RMS of the resampling^2).

        The RMS is that of the layer which counts there.  Beside all layers, and where the posts came from no file: sd.
        """
        for layer, found in zip(self.terrain.layers, self.terrain.resampling, strict=False):
            if layer.east0 <= east <= layer.east1 and layer.north0 <= north <= layer.north1:
                return math.hypot(self.sd, found.rms_m)
        return self.sd

    @functools.cached_property
    def digest(self) -> str:
        """SHA-256 over the frame, the layers' places and their posts: equal for the same ground, hexadecimal."""
        frame = self.terrain.frame
        found = hashlib.sha256(repr((frame.lat0, frame.lon0, frame.alt0)).encode())
        for layer in self.terrain.layers:
            found.update(repr((layer.east0, layer.north0, layer.cell_m, layer.heights.shape)).encode())
            found.update(np.ascontiguousarray(layer.heights).ravel().data)
        return found.hexdigest()
