"""The ground as navigation knows it: a terrain, how good it is, and which one it was."""

from __future__ import annotations

import functools
import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from fti.terrain.terrain import Terrain


@dataclass(frozen=True, eq=False)
class Ground:
    """Known elevation.

    terrain : the surface; sd : one sigma of its heights [m]; name : what it was made from; files : where they lay
    """

    terrain: Terrain
    sd: float
    name: str
    files: tuple[str, ...] = ()

    @functools.cached_property
    def digest(self) -> str:
        """SHA-256 over the frame, the layers' places and their posts: equal for the same ground, hexadecimal."""
        frame = self.terrain.frame
        found = hashlib.sha256(repr((frame.lat0, frame.lon0, frame.alt0)).encode())
        for layer in self.terrain.layers:
            found.update(repr((layer.east0, layer.north0, layer.cell_m, layer.heights.shape)).encode())
            found.update(np.ascontiguousarray(layer.heights).ravel().data)
        return found.hexdigest()
