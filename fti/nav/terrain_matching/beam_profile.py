"""The profile of an altimeter with several beams: every range becomes a sample at the measured point.

Navigated position, attitude and measured range give the point on the ground, p = x + d u with the direction u of the
beam.  An error of the navigated position moves all points by the same shift, an error of the navigated height moves all
of them up: the likelihood of a vertical profile holds unchanged, for every shift.  The error e of a range moves the
point along its beam, so that over ground with the slope s the residual is

    p_up - terrain(p_east, p_north) = e (u_up - s . u_horizontal)

Its sigma therefore depends on the slope at the measured point.  At the navigated position the slope may be wrong; a
fix with such weights is worse than one with the weights of level ground.  ``match_beams`` therefore matches twice: with
the weights of level ground, then with those of the slopes at the first fix.

For beams without width this compensation is exact.  An altimeter with a wide beam is compensated in the range domain
(``apparent_surface``).

Source: Spiegel 2018, section 4.6; eq. 2.37 to 2.40 (measured point).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.geodesy.rotations import rotate
from fti.nav.terrain_matching.fix import NO_PRIORS, USUAL_LIMITS, MatchFix, MatchLimits, MatchPriors, match
from fti.nav.terrain_matching.profile import Profile
from fti.nav.terrain_matching.reach import search_area
from fti.ranging.sensor import Poses
from fti.terrain.terrain import Terrain

#: Least error of the residual over that of the range: a beam that grazes the ground is not exact.
MIN_FACTOR = 0.3


@dataclass(frozen=True, eq=False)
class BeamTrack:
    """Ranges of B beams at K times.

    t            : times [s], shape (K,);  poses : of the sensor, navigated
    directions_s : unit vectors of the beams in the sensor frame, shape (B, 3) or, of steered beams, (K, B, 3)
    slant_range  : measured [m], shape (K, B); NaN without a return
    range_sd     : one sigma of the independent error of a range [m]
    dem_sd       : one sigma of the independent error of the elevation [m];  both: one value, or one for each time (K,)
    height_sd    : one sigma of the common error: navigated height, datum [m]
    """

    t: Array
    poses: Poses
    directions_s: Array
    slant_range: Array
    range_sd: float | Array
    dem_sd: float | Array
    height_sd: float

    def profile(self, terrain: Terrain | None = None, shift: Array | None = None) -> Profile:
        """The samples of all beams with a return, in order of time.  Raises ValueError as ``Profile``.

        terrain : for the slopes; None: level ground
        shift   : true minus navigated position, where the slopes are taken, shape (2,) [m]; None: (0, 0)
        """
        rays = rotate(self.poses.mats_ls[:, None], self.directions_s)
        has_return = np.isfinite(self.slant_range)
        points = self.poses.origins_l[:, None] + self.slant_range[..., None] * rays
        east, north, up = points[has_return].T
        slopes = np.zeros((2, len(east)))
        if terrain is not None:
            to_east, to_north = np.zeros(2) if shift is None else shift
            slopes = np.nan_to_num(terrain.gradient(east + to_east, north + to_north))  # unknown ground is level
        range_sd, dem_sd = (
            np.broadcast_to(np.reshape(sd, (-1, 1)), has_return.shape)[has_return]
            for sd in (self.range_sd, self.dem_sd)
        )
        sd = np.hypot(range_sd * noise_factor(rays[has_return], *slopes), dem_sd)
        t = np.broadcast_to(self.t[:, None], has_return.shape)[has_return]
        return Profile(t, east, north, up, sd, self.height_sd)


def noise_factor(rays: Array, slope_east: Array, slope_north: Array) -> Array:
    """Error of the residual over that of the range, (...), for rays (..., 3) and slopes of the ground (...)."""
    along_ground = slope_east * rays[..., 0] + slope_north * rays[..., 1]
    return np.asarray(np.maximum(along_ground - rays[..., 2], MIN_FACTOR))


def match_beams(
    terrain: Terrain,
    track: BeamTrack,
    reach_m: float,
    limits: MatchLimits = USUAL_LIMITS,
    priors: MatchPriors = NO_PRIORS,
) -> MatchFix:
    """The fix of all beams with shifts up to ``reach_m`` to each side.  Raises ValueError as ``Profile``."""
    level = track.profile()
    window, lattice = search_area(terrain, level, reach_m)
    first = match(window, level, lattice, limits, priors)
    if not np.isfinite(first.shift).all():
        return first
    return match(window, track.profile(terrain, first.shift), lattice, limits, priors)
