"""The published ground track: legs from the intercept point outwards, straight or arcs, each tangent to the next.

In a plane with its origin in the intercept point, a back along the final course, b to its right:

    s     path length outwards from the intercept point [m]       y     offset right of the track, in flight direction
    [m] theta direction of the track outwards from the a axis: theta' = 1 / R, R > 0 in a right turn
    point of (s, y)     p(s) + y r(theta)       r = (-sin theta, cos theta)       course at s = final course - theta
    bank at s           that of the legs, rolled in and out at a constant rate over ROLL_IN_M

Behind the last leg, and beyond the intercept point, the track is straight.  A point belongs to the nearest part of the
track.  Source: plane geometry; legs as RF and TF of ARINC 424, with lengths and radii from charts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from fti.arrays import Array
from fti.config import Positive, StrictModel
from fti.config.keys import key

#: Distance over which the bank of a turn is rolled in or out [m]: 5 s at 60 m/s.
ROLL_IN_M = 300.0
#: Minimum radius of an arc [m]: a point 150 m off the track must lie clearly on this side of its centre; 25 deg of bank
#: allow no tighter turn above 37 m/s.
MIN_RADIUS_M = 300.0
#: Straight extension of the track behind its last leg and beyond the intercept point [m].
EXTENSION_M = 1e6


class TrackLeg(StrictModel):
    """``[[leg]]``: a leg of the ground track, straight or an arc; each is tangent to the one before.

    An arc needs radius_m and bank_deg; a straight leg has neither.
    """

    length_m: Annotated[Positive, key("length along the leg", "m", 2500.0)]
    radius_m: Annotated[
        Annotated[float, Field(ge=-1e5, le=1e5)] | None,
        key(
            "radius of an arc, at least 300, positive: flown to the right, negative: to the left; none: straight",
            "m",
            -2000.0,
        ),
    ] = None
    bank_deg: Annotated[
        Annotated[float, Field(gt=0, le=30)] | None,
        key("nominal bank on an arc: 10.4 for 60 m/s and 2000 m; none: straight", "deg", 10.4),
    ] = None

    @model_validator(mode="after")
    def _check_arc(self) -> TrackLeg:
        if (self.radius_m is None) != (self.bank_deg is None):
            raise ValueError("an arc needs radius_m and bank_deg, a straight leg has neither")
        if self.radius_m is not None and (
            abs(self.radius_m) < MIN_RADIUS_M or self.length_m > math.pi * abs(self.radius_m)
        ):
            raise ValueError(f"an arc must have a radius of at least {MIN_RADIUS_M:g} m, and turn by at most 180 deg")
        return self


class GroundTrack:
    """The track of legs, beginning at the intercept point."""

    def __init__(self, legs: Sequence[TrackLeg]) -> None:
        lengths = [EXTENSION_M, *(leg.length_m for leg in legs), EXTENSION_M]
        self._bends = np.array([0.0, *(1.0 / leg.radius_m if leg.radius_m else 0.0 for leg in legs), 0.0])
        self._lengths = np.array(lengths)
        self._begins = np.cumsum([-EXTENSION_M, *lengths[:-1]])
        self._thetas = np.cumsum([0.0, *(self._bends * self._lengths)[:-1]])
        banks = np.array([math.radians(leg.bank_deg or 0.0) for leg in legs])
        self._ends = self._begins[1:]
        self._bank_integral = np.concatenate(
            ([0.0], np.cumsum(np.sign(self._bends[1:-1]) * banks * self._lengths[1:-1]))
        )
        self._starts = self._chain()

    def _chain(self) -> Array:
        """Begin of each leg, shape (legs, 2)."""
        places = [np.array([-EXTENSION_M, 0.0])]
        for k in range(len(self._bends) - 1):
            places.append(self._along_leg(k, self._lengths[k], places[k]))
        return np.array(places)

    def _along_leg(self, k: int, u: Array | float, start: Array) -> Array:
        """The point u [m] along leg k."""
        theta, bend = self._thetas[k], self._bends[k]
        turned = np.asarray(bend * u / 2.0)  # the chord has the direction in its middle
        chord = np.asarray(u * np.sinc(turned / np.pi))
        direction = np.stack((np.cos(theta + turned), np.sin(theta + turned)), axis=-1)
        return np.asarray(start + chord[..., None] * direction)

    def theta(self, s: Array) -> Array:
        """Direction outwards from the final course's [rad] at path lengths s."""
        k = np.clip(np.searchsorted(self._begins, s, side="right") - 1, 0, len(self._begins) - 1)
        return np.asarray(self._thetas[k] + self._bends[k] * (s - self._begins[k]))

    def bank(self, s: Array) -> Array:
        """Nominal roll on the track [rad], right positive."""
        after, before = (np.interp(s + sign * ROLL_IN_M / 2, self._ends, self._bank_integral) for sign in (1, -1))
        return np.asarray((after - before) / ROLL_IN_M)

    def to_plane(self, s: Array, y: Array) -> tuple[Array, Array]:
        """a and b [m] of path lengths s and offsets y."""
        k = np.clip(np.searchsorted(self._begins, s, side="right") - 1, 0, len(self._begins) - 1)
        points = np.zeros((*np.shape(s), 2))
        for leg in range(len(self._begins)):
            there = k == leg
            points[there] = self._along_leg(leg, s[there] - self._begins[leg], self._starts[leg])
        theta = self.theta(s)
        return points[..., 0] - y * np.sin(theta), points[..., 1] + y * np.cos(theta)

    def to_path(self, a: Array, b: Array) -> tuple[Array, Array]:
        """s and y of points, relative to the nearest part of the track."""
        best_s, best_y, best = np.zeros_like(a), np.zeros_like(a), np.full_like(a, np.inf)
        for s, y, distance in self._project_on_legs(np.stack((a, b), axis=-1)):
            nearer = distance < best
            best_s, best_y = np.where(nearer, s, best_s), np.where(nearer, y, best_y)
            best = np.minimum(best, distance)
        known = np.isfinite(a + b)
        return np.where(known, best_s, np.nan), np.where(known, best_y, np.nan)

    def _project_on_legs(self, p: Array) -> Iterator[tuple[Array, Array, Array]]:
        """For each leg: s and y of its nearest point, and the distance to it."""
        for k, start in enumerate(self._starts):
            u = np.clip(self._project(k, p - start), 0.0, self._lengths[k])
            theta = self._thetas[k] + self._bends[k] * u
            offset = p - self._along_leg(k, u, start)
            y = offset[..., 1] * np.cos(theta) - offset[..., 0] * np.sin(theta)
            yield self._begins[k] + u, y, np.hypot(offset[..., 0], offset[..., 1])

    def _project(self, k: int, v: Array) -> Array:
        """Distance along leg k, or beyond its ends, of the foot of a point at v from the begin of the leg."""
        theta, bend = self._thetas[k], self._bends[k]
        forward = v[..., 0] * math.cos(theta) + v[..., 1] * math.sin(theta)
        right = v[..., 1] * math.cos(theta) - v[..., 0] * math.sin(theta)
        if bend == 0.0:
            return np.asarray(forward)
        return np.asarray(np.arctan2(bend * forward, 1.0 - bend * right) / bend)
