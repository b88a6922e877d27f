"""Uncertainty of the ground height at the nadir due to the position error."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.messages.outputs import HeightAboveGround
from fti.messages.reasons import Reason
from fti.nav.altimetry.scalar_kernels import ground_sds
from fti.nav.altimetry.sigmas import POSITION_SD_UNKNOWN, stated_sd
from fti.nav.source_interpolation import PositionState
from fti.nav.terrain_reference import Ground
from fti.terrain.terrain import Terrain


def ground_sd(terrain: Terrain, points_l: ArrayLike, horizontal_sd: float) -> Array:
    """One sigma of h(N), ndarray (n,) [m], by the position error, from the ground around N.

        s^2 = mean over 8 points of (h(N + sqrt(2) horizontal_sd r) - h(N))^2,    r unit, all round

    On a slope that is exactly (slope horizontal_sd)^2; near the edge of a wood it includes the edge.  Errors of the
    height of P and of the elevation model are not included.

    points_l      : (n, 3) or (3,) [m]  P in the terrain's frame; N straight below along its axis
    horizontal_sd : of the position against the terrain, each axis [m]
    Returns NaN where the ground at N or around it is unknown.
    """
    points = np.array(np.atleast_2d(np.asarray(points_l, dtype=np.float64)), order="C")
    return ground_sds(terrain.pyramid, points, float(horizontal_sd))


def ground_below(terrain: Terrain, position: PositionState) -> tuple[float, float] | None:
    """Height of the ground above the ellipsoid [m] at a position, and its sigma by the position error [m].

    An altimeter height plus this ground height is an altitude; on a slope its error includes that of the ground at a
    wrong position.  None where the ground at the position, or around it within the position error, is unknown.
    """
    ground = float(terrain.height(position.lat, position.lon))
    if not math.isfinite(ground):
        return None
    level = stated_sd(position.horizontal_sd, POSITION_SD_UNKNOWN)
    point_l = terrain.frame.to_local(position.lat, position.lon, ground)
    sd = float(ground_sd(terrain, point_l, level)[0])
    return (ground, sd) if math.isfinite(sd) else None


@dataclass(frozen=True, slots=True)
class AltitudeOverTerrain:
    """A height above known ground; the sum of both is an altitude.

    height_agl, height_sd : of P [m]; the sigma is None where it is not stated
    ground, ground_sd     : elevation below, above the ellipsoid [m]
    """

    height_agl: float
    height_sd: float | None
    ground: float
    ground_sd: float


def altitude_over_terrain(
    height: HeightAboveGround, ground: Ground | None, position: PositionState | None
) -> AltitudeOverTerrain | None:
    """A height of an altimeter and the ground below it; None where one of them is unknown or wrong.

    The height is the nadir height where terrain gives it; without an altitude it is the height over level ground.
    """
    known, sd = height.height_agl, height.sd if height.is_by_terrain else height.nearest_sd
    below = ground_below(ground.terrain, position) if ground and position else None
    if (
        ground is None
        or position is None
        or below is None
        or known is None
        or Reason.GROUND_CONTRADICTED in height.unchecked
    ):
        return None
    east, north, _ = ground.terrain.frame.to_local(position.lat, position.lon, below[0])
    return AltitudeOverTerrain(known, sd, below[0], math.hypot(ground.sd_at(float(east), float(north)), below[1]))
