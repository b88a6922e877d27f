"""How well the ground straight below is known where the place is not known exactly."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.nav.altimetry.sigmas import POSITION_SD_UNKNOWN, stated_sd
from fti.nav.source_interpolation import PositionState
from fti.nav.terrain_reference import Ground
from fti.terrain.terrain import Terrain
from fti.types import HeightAboveGround, Reason

Array = NDArray[np.float64]

#: Directions around N.
N_DIRECTIONS = 8


def ground_sd(terrain: Terrain, points_l: ArrayLike, horizontal_sd: float) -> Array:
    """One sigma of h(N), ndarray (n,) [m], by the error of the place: what the ground around N looks like.

        s^2 = mean over 8 points of (h(N + sqrt(2) horizontal_sd r) - h(N))^2,    r unit, all round

    On a slope that is (slope horizontal_sd)^2, exactly; at the edge of a wood it sees the edge.  What the height of P
    and the elevation add everywhere is not in it.

    points_l      : (n, 3) or (3,) [m]  P in the terrain's frame; N straight below along its axis
    horizontal_sd : of the place against the terrain, each axis [m]
    Returns NaN where the ground at N or around it is not known.
    """
    east, north, _ = np.moveaxis(np.atleast_2d(np.asarray(points_l, dtype=np.float64)), -1, 0)
    turn = 2.0 * np.pi * np.arange(N_DIRECTIONS)[:, None] / N_DIRECTIONS
    radius = np.sqrt(2.0) * horizontal_sd
    around = terrain.up(east + radius * np.sin(turn), north + radius * np.cos(turn))
    return np.asarray(np.sqrt(np.mean((around - terrain.up(east, north)) ** 2, axis=0)))


def ground_below(terrain: Terrain, position: PositionState) -> tuple[float, float] | None:
    """Height of the ground above the ellipsoid [m] at a position, and one sigma of it by the error of the place [m].

    A height of an altimeter plus that of the ground is an altitude: on a slope it is wrong by as much as the ground is
    that was looked up elsewhere.  None where the ground there, or around as far as the place may be wrong, is unknown.
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
    """A height above known ground: added up, an altitude.

    height_agl, height_sd : of P [m]; the sigma is None where nobody states one
    ground, ground_sd     : elevation below, above the ellipsoid [m]
    """

    height_agl: float
    height_sd: float | None
    ground: float
    ground_sd: float


def altitude_over_terrain(
    height: HeightAboveGround, ground: Ground | None, position: PositionState | None
) -> AltitudeOverTerrain | None:
    """A height of an altimeter and the ground that it stands on; None where one of them is not known or is wrong.

    Straight down where the ground tells that height; without an altitude nothing is predicted: as over level ground.
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
