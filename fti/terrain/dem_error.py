"""Errors of an elevation model: height, horizontal shift, sensed surface, and age.

    h_dem(x) = h(x - shift) + bias + noise(x) + outlier(x)

To first order in the shift the error at a point is  -grad h . shift + bias + noise + outlier:  a horizontal error
becomes a vertical one on a slope (eq. 2.49).  The noise is Gaussian, the sum of two stationary parts with the
autocorrelation exp(-distance / length): one as short as the smoothing of a survey, one as long as its strips.

The surface h is that of the day of the survey and of its sensor (``survey``).
Source: Spiegel 2018, section 2.2.1 and eq. 2.49; lengths, shares and sizes are chosen, not measured.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array, Rng
from fti.terrain.landscape import Cover, Landscape, SensedSurface
from fti.terrain.synthetic import fft_shape, forest
from fti.terrain.terrain import Terrain

_FAR = 6.0  # margin in lengths, so that both sides of the field are uncorrelated: exp(-6) is 0.25 %


def correlated_noise(shape: tuple[int, int], cell_m: float, rng: Rng, length_m: float) -> Array:
    """Gaussian noise of mean 0 and variance 1 with the autocorrelation exp(-distance / length_m) on a grid.

    By circulant embedding: exact except 0.25 % at large distances and negative eigenvalues, which are set to zero.
    Source: Dietrich and Newsam 1997.
    """
    margin = int(_FAR * length_m / cell_m)
    rows, columns = fft_shape((shape[0] + margin, shape[1] + margin))
    north, east = (np.minimum(np.arange(size), size - np.arange(size)) * cell_m for size in (rows, columns))
    correlation = np.exp(-np.hypot(north[:, None], east[None, :]) / length_m)
    spectrum = np.maximum(np.fft.rfft2(correlation).real, 0.0)
    white = np.fft.rfft2(rng.standard_normal((rows, columns)))
    noise = np.fft.irfft2(white * np.sqrt(spectrum), s=(rows, columns))
    return np.ascontiguousarray(noise[: shape[0], : shape[1]])


def _check_not_negative(value: object, *names: str, maximum: float = np.inf) -> None:
    for name in names:
        if not 0.0 <= getattr(value, name) <= maximum:
            limits = "not be negative" if np.isinf(maximum) else f"lie in [0, {maximum:g}]"
            raise ValueError(f"{name} is {getattr(value, name)}, must {limits}")


@dataclass(frozen=True, slots=True)
class Changes:
    """Changes of a landscape since its survey, which are not in the elevation model.

    growth         : growth of trees [m]; lower trees did not exist then
    cleared_forest : share of the ground that is open now (bare, grass, crop) and had trees then, 10 to 25 m high
    new_forest     : share of the present forest that was open then
    new_buildings  : share of the present buildings that did not exist then
    Raises ValueError for a negative growth and for a share outside [0, 1].
    """

    growth: float = 0.0
    cleared_forest: float = 0.0
    new_forest: float = 0.0
    new_buildings: float = 0.0

    def __post_init__(self) -> None:
        _check_not_negative(self, "growth")
        _check_not_negative(self, "cleared_forest", "new_forest", "new_buildings", maximum=1.0)

    def revert(self, now: Landscape, rng: Rng) -> Landscape:
        """The landscape on the day of the survey; changes whole stands and buildings, not single posts.

        Roofs of equal height count as one building.
        """
        canopy, cover = now.canopy.copy(), now.cover.copy()
        trees = cover == Cover.FOREST
        canopy[trees] = np.maximum(canopy[trees] - self.growth, 0.0)
        removed = trees & (_stands(now, rng, trees, self.new_forest)[0] | (canopy == 0.0))
        built = cover == Cover.BUILDING
        roofs = np.unique(canopy[built])
        removed |= built & np.isin(canopy, roofs[rng.random(len(roofs)) < self.new_buildings])
        open_now = np.isin(cover, [Cover.BARE, Cover.GRASS, Cover.CROP])
        cleared_forest, heights = _stands(now, rng, open_now, self.cleared_forest)
        canopy[removed], cover[removed] = 0.0, Cover.GRASS
        canopy[cleared_forest], cover[cleared_forest] = heights[cleared_forest], Cover.FOREST
        return Landscape(now.ground, canopy, cover)


def _stands(landscape: Landscape, rng: Rng, within: NDArray[np.bool_], share: float) -> tuple[NDArray[np.bool_], Array]:
    """Stands on a share of the posts ``within``, and the heights of their trees [m]."""
    heights = forest(within.shape, landscape.ground.finest.cell_m, rng, cover=share) if share > 0.0 else np.zeros(1)
    heights = np.broadcast_to(heights, within.shape)
    return within & (heights > 0.0), heights


@dataclass(frozen=True, slots=True)
class DemError:
    """Errors of an elevation model.

    bias                    : added everywhere [m]
    noise_sd                : of the correlated noise, both parts together [m]
    short_m, long_m         : distances at which the autocorrelation of the parts has fallen to 1/e [m]
    short_share             : share of the noise's variance that is in the short part
    shift_east, shift_north : horizontal offset of the model from the truth [m]
    outlier_share           : share of the posts, independent
    outlier_sd              : of their additional error [m]
    Raises ValueError for a figure that is not finite, a negative sd, a share outside [0, 1] or a length of 0.
    """

    bias: float = 0.0
    noise_sd: float = 0.0
    short_m: float = 30.0
    long_m: float = 300.0
    short_share: float = 0.5
    shift_east: float = 0.0
    shift_north: float = 0.0
    outlier_share: float = 0.0
    outlier_sd: float = 15.0

    def __post_init__(self) -> None:
        for field in fields(self):
            if not np.isfinite(getattr(self, field.name)):
                raise ValueError(f"{field.name} is {getattr(self, field.name)}, must be finite")
        _check_not_negative(self, "noise_sd", "outlier_sd")
        _check_not_negative(self, "short_share", "outlier_share", maximum=1.0)
        if not min(self.short_m, self.long_m) > 0.0:
            raise ValueError(f"short_m is {self.short_m}, long_m {self.long_m}: must be positive")

    def apply(self, terrain: Terrain, rng: Rng) -> Terrain:
        """An elevation model of the terrain: the same posts with errors of position and height; holes remain.

        Raises ValueError for a terrain of several layers: each is a separate model with separate errors.
        """
        if len(terrain.layers) != 1:
            raise ValueError(f"the terrain has {len(terrain.layers)} layers, must have one: apply errors to each one")
        layer = terrain.finest
        heights = layer.heights + self._height_errors(layer.heights.shape, layer.cell_m, rng)
        east0, north0 = layer.east0 + self.shift_east, layer.north0 + self.shift_north
        return replace(terrain, layers=(replace(layer, heights=heights, east0=east0, north0=north0),))

    def _height_errors(self, shape: tuple[int, int], cell_m: float, rng: Rng) -> Array:
        errors = np.full(shape, self.bias)
        for length, share in ((self.short_m, self.short_share), (self.long_m, 1.0 - self.short_share)):
            if self.noise_sd > 0.0 and share > 0.0:
                errors += self.noise_sd * np.sqrt(share) * correlated_noise(shape, cell_m, rng, length)
        outliers = rng.random(shape) < self.outlier_share
        errors[outliers] += self.outlier_sd * rng.standard_normal(np.count_nonzero(outliers))
        return errors

    def survey(self, now: Landscape, rng: Rng, *, sensed: SensedSurface, changes: Changes | None = None) -> Terrain:
        """The elevation model of a landscape, surveyed before the ``changes``, of the ``sensed`` surface.

        Its difference to ``now.surface_for`` is the total error of the model, including canopy and age.
        """
        before = now if changes is None else changes.revert(now, rng)
        return self.apply(before.surface_for(sensed), rng)
