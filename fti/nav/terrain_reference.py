"""Reference terrain of navigation: surface, accuracy and identity."""

from __future__ import annotations

import functools
import hashlib
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.terrain.file_info import NO_SOURCE
from fti.terrain.surface import nearest_posts

if TYPE_CHECKING:
    from fti.terrain.terrain import Terrain

#: Value of an unknown post in a checksum [m].
_UNKNOWN_M = -9999.0
#: Checksums of the same posts differ by less [m]: last bits depend on software version and processor.
CHECKSUM_TOLERANCE_M = 0.1


@dataclass(frozen=True, eq=False)
class Ground:
    """Known elevation.

    terrain : the surface; name : its data source; files : paths of the source files
    radius_m : half the side of the loaded square around the frame's origin [m]; None: all is loaded
    sensed : of some kinds of altimeters, the surface that they measure (``fti.nav.land_cover``)
    cover_sds : of such a surface: one sigma of its height above the elevation, of the posts of each layer [m]
    sd      : one sigma of the heights of files that do not state it [m]; of the surface, with its resampling: ``sd_at``
    """

    terrain: Terrain
    sd: float
    name: str
    files: tuple[str, ...] = ()
    radius_m: float | None = None
    sensed: Mapping[str, Ground] = field(default_factory=dict)
    cover_sds: tuple[Array, ...] = ()

    def sensed_by(self, kind: str) -> Ground:
        """The surface that a kind of altimeter measures."""
        return self.sensed.get(kind, self)

    def sd_at(self, east: float, north: float) -> float:
        """One sigma of the surface [m] at a position in the terrain's frame [m]: sqrt(sd^2 + RMS of the resampling^2).

        The sigma is that of the file of the nearest post, if the file states it; the RMS that of the layer at the
        position.  Outside all layers, and for layers without a file: sd.
        """
        sd = math.hypot(self._source_sd(east, north), self._cover_sd(east, north))
        for layer, resampling in zip(self.terrain.layers, self.terrain.resampling, strict=False):
            if layer.east0 <= east <= layer.east1 and layer.north0 <= north <= layer.north1:
                return math.hypot(sd, resampling.rms_m)
        return sd

    def place_of_return(self, origin: Array, radius_m: float) -> tuple[float, float]:
        """Where a beam straight down probably meets the surface first: east, north of the nearest post [m].

        origin : of the beam, in the terrain's frame (3,) [m];  radius_m : of the beam on the ground
        Without land cover the sigma is nearly the same everywhere in the beam: then straight below.
        """
        east, north, up = map(float, origin)
        below = self._nearest_post(east, north) if self.cover_sds else None
        if below is None:
            return east, north
        layer = self.terrain.layers[below[0]]
        reach = math.ceil(radius_m / layer.cell_m)
        row, column = divmod(below[1], layer.heights.shape[1])
        rows, columns = (slice(max(middle - reach, 0), middle + reach + 1) for middle in (row, column))
        aside = np.hypot(layer.east[columns][None, :] - east, layer.north[rows][:, None] - north)
        distance = np.where(aside <= radius_m, np.hypot(aside, up - layer.heights[rows, columns]), np.inf)
        if not np.isfinite(distance).any():
            return east, north
        i, j = np.unravel_index(int(np.nanargmin(distance)), distance.shape)
        return float(layer.east[columns][j]), float(layer.north[rows][i])

    def _cover_sd(self, east: float, north: float) -> float:
        post = self._nearest_post(east, north) if self.cover_sds else None
        return 0.0 if post is None else float(self.cover_sds[post[0]].ravel()[post[1]])

    def _nearest_post(self, east: float, north: float) -> tuple[int, int] | None:
        """Layer and number of the nearest post; None outside all layers."""
        of_layer, posts = nearest_posts(self.terrain.posts, np.array([east]), np.array([north]))
        return None if of_layer[0] < 0 else (int(of_layer[0]), int(posts[0]))

    def _source_sd(self, east: float, north: float) -> float:
        sds = self._sds_of_files
        number = int(self.terrain.source(east, north)) if sds else NO_SOURCE
        return self.sd if number == NO_SOURCE else sds[number]

    @functools.cached_property
    def _sds_of_files(self) -> tuple[float, ...]:
        """One sigma of each source; none if no source states it."""
        stated = [source.sd_m for source in self.terrain.sources]
        return tuple(self.sd if sd is None else sd for sd in stated) if any(stated) else ()

    @functools.cached_property
    def digest(self) -> str:
        """SHA-256 over the frame, the layers' extents and their posts, hexadecimal: equal for the same ground."""
        frame = self.terrain.frame
        digest = hashlib.sha256(repr((frame.lat0, frame.lon0, frame.alt0)).encode())
        for layer in self.terrain.layers:
            digest.update(repr((layer.east0, layer.north0, layer.cell_m, layer.heights.shape)).encode())
            digest.update(np.ascontiguousarray(layer.heights).ravel().data)
        return digest.hexdigest()

    @functools.cached_property
    def checksums(self) -> tuple[float, ...]:
        """The sum of the posts of each layer, and of the sigmas of its cover, with random signs [m].

        The hash changes with the last bits of the posts, which depend on the processor.  This sum changes by the change
        of a post, at most: sums within ``CHECKSUM_TOLERANCE_M`` belong to the same terrain.
        """
        sensed = (number for _, ground in sorted(self.sensed.items()) for number in ground.checksums)
        posts = (*(layer.heights for layer in self.terrain.layers), *self.cover_sds)
        return (*map(_signed_sum, posts), *sensed)

    def has_checksums(self, checksums: Sequence[float]) -> bool:
        """Whether these are the checksums of the same posts."""
        pairs = itertools.zip_longest(checksums, self.checksums, fillvalue=math.inf)
        return all(abs(a - b) < CHECKSUM_TOLERANCE_M for a, b in pairs)


def _signed_sum(heights: NDArray[np.floating[Any]]) -> float:
    random, total = np.random.PCG64(0), 0.0
    for row in heights:
        signs = 1.0 - 2.0 * (random.random_raw(len(row)) & 1)
        total += float(signs @ np.nan_to_num(row, nan=_UNKNOWN_M))
    return total
