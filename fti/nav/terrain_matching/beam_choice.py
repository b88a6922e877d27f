"""Which beam to measure with next: a measurement forecast, for a sensor that measures one beam at a time.

The forecast predicts with terrain and navigated pose where each candidate beam will meet the ground.  With the slope
(s_e, s_n) there and the sigma of the residual, a sample of this beam has the row

    a = (s_e, s_n, 1) / sigma                    of the states (shift east, shift north, error of the navigated height)

The best candidate lowers the trace of the covariance of the shift most.  For the covariance P of the states, that
already contains all samples so far, the trace falls by

    |(P a)_1,2|^2 / (1 + a P a)

so a beam over the same slope as all samples before is worth little: its slope cannot be separated from the height
error, or only repeats a direction that is already known.

Beam switching has the fixed beams of the sensor as candidates, beam steering all angles in its reach
(``steering_angles``).

Source: Spiegel 2018, section 4.6.1: beams are chosen by the slope of the predicted measurement alone.  Here the
information of the samples so far and the unknown height are taken into account.
"""

from __future__ import annotations

import numpy as np

from fti.arrays import Array, Ints
from fti.geodesy.rotations import rotate
from fti.nav.terrain_matching.beam_profile import noise_factor
from fti.ranging.laser import Laser
from fti.ranging.sensor import Poses
from fti.terrain.terrain import Terrain

#: Chosen beam where no beam is predicted to have a return over known ground.
NO_BEAM = -1


def steering_angles(reach: float, step: float) -> tuple[tuple[float, float], ...]:
    """Angles along and across [rad] of a beam that is steered across the track up to ``reach`` on both sides."""
    half = int(np.floor(reach / step * (1.0 + 1e-12)))
    return tuple((0.0, float(step * k)) for k in range(-half, half + 1))


def forecast(
    laser: Laser, terrain: Terrain, poses: Poses, directions_s: Array, *, range_sd: float, dem_sd: float
) -> Array:
    """The rows of B candidate beams at K navigated poses, shape (K, B, 3); NaN without a predicted return.

    directions_s : unit vectors in the sensor frame, shape (B, 3);  range_sd, dem_sd : see ``BeamTrack`` [m]
    """
    rays = rotate(poses.mats_ls[:, None], directions_s)
    ranges = laser.measure_directions(terrain, poses.origins_l[:, None], rays, directions_s).slant_range
    points = poses.origins_l[:, None] + ranges[..., None] * rays
    slopes = terrain.gradient(points[..., 0], points[..., 1])
    sd = np.hypot(range_sd * noise_factor(rays, *slopes), dem_sd)
    return np.stack((*slopes, np.ones_like(sd)), axis=-1) / sd[..., None]


def choose_beam(rows: Array, cov: Array) -> int:
    """The candidate that lowers the variance of the shift most; ``NO_BEAM`` if none has a forecast.

    rows : of the candidates, shape (B, 3);  cov : of the states, shape (3, 3) [m^2]
    """
    moved = rows @ cov
    gain = np.square(moved[:, :2]).sum(axis=1) / (1.0 + np.einsum("ij,ij->i", moved, rows))
    return NO_BEAM if np.isnan(gain).all() else int(np.nanargmax(gain))


def after_sample(cov: Array, row: Array) -> Array:
    """The covariance of the states after a sample with this row, shape (3, 3)."""
    moved = cov @ row
    return np.asarray(cov - np.outer(moved, moved) / (1.0 + row @ moved))


def choose_beams(rows: Array, position_sd: float, height_sd: float) -> Ints:
    """The beam at each of K times, one after the other, shape (K,); ``NO_BEAM`` where none has a forecast.

    rows : (K, B, 3);  position_sd : of the navigated position for each axis [m];  height_sd : of its height [m]
    """
    cov = np.diag(np.square([position_sd, position_sd, height_sd]))
    chosen = np.full(len(rows), NO_BEAM)
    for k, candidates in enumerate(rows):
        chosen[k] = choose_beam(candidates, cov)
        if chosen[k] != NO_BEAM:
            cov = after_sample(cov, candidates[chosen[k]])
    return chosen
