"""A look at the ground: the points of a scan or an image, each placed with the inertial solution of its time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fti.arrays import Array


@dataclass(frozen=True, eq=False)
class Look:
    """Points of a look, in a local frame l (east, north, up) that is common to the looks that are compared.

    points_l     : ndarray, shape (n, 3) [m]   points on the ground, as the inertial solution places them
    directions_l : ndarray, shape (n, 3)       unit vectors from the sensor to the points
    t            : ndarray, shape (n,) [s]     time of each point
    range_sd     : one sigma of the noise of a range [m]
    Raises ValueError for other shapes, values that are not finite, and a sigma that is not positive.
    """

    points_l: Array
    directions_l: Array
    t: Array
    range_sd: float

    def __post_init__(self) -> None:
        n = len(self.t)
        for name, shape in (("points_l", (n, 3)), ("directions_l", (n, 3)), ("t", (n,))):
            value = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            if value.shape != shape:
                raise ValueError(f"{name} has the shape {value.shape}, must be {shape}")
            if not np.isfinite(value).all():
                raise ValueError(f"{name} has values that are not finite")
            object.__setattr__(self, name, value)
        if not 0.0 < self.range_sd < np.inf:
            raise ValueError(f"range_sd is {self.range_sd} m, must be positive")

    def __len__(self) -> int:
        return len(self.t)

    def moved(self, offset_l: Array) -> Look:
        """The same look with all points at another place; offset_l : shape (3,) or (n, 3) [m]."""
        return Look(self.points_l + offset_l, self.directions_l, self.t, self.range_sd)


def place_look(origins_l: Array, directions_l: Array, ranges: Array, t: Array, range_sd: float) -> Look:
    """The look of the rays that have a return: x = x(S) + d u.  Eq. 2.40.

    origins_l    : ndarray, shape (n, 3) or (3,) [m]   the sensor at the time of each point
    directions_l : ndarray, shape (n, 3)               unit vectors, in the attitude at the time of each point
    ranges       : ndarray, shape (n,) [m]             NaN without a return
    t            : ndarray, shape (n,) [s];  range_sd : [m]
    """
    has_return = np.isfinite(ranges)
    if not has_return.all():
        origins_l = np.broadcast_to(origins_l, directions_l.shape)[has_return]
        directions_l, ranges, t = directions_l[has_return], ranges[has_return], t[has_return]
    return Look(origins_l + ranges[:, None] * directions_l, directions_l, t, range_sd)
