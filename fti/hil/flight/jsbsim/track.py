"""The ground track of a route: straight legs and turns, in the east, north plane of a local frame."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from fti.arrays import Array

#: Distance of the stations of a track [m].
STEP_M = 10.0


class RouteTrack:
    """A line with stations every STEP_M.

    corners : east, north [m], at least two; each except the first and the last is rounded with ``radius`` [m], or with
              the largest radius that fits its legs
    """

    def __init__(self, corners: Sequence[tuple[float, float]], radius: float) -> None:
        line = _round_corners(np.asarray(corners, dtype=float), radius)
        along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))))
        #: Distance along the track of the stations [m], shape (n,), and their positions, shape (n, 2).
        self.along: Array = np.arange(0.0, along[-1], STEP_M)
        self.points: Array = np.stack([np.interp(self.along, along, line[:, i]) for i in range(2)], axis=1)
        self._east: list[float] = self.points[:, 0].tolist()
        self._north: list[float] = self.points[:, 1].tolist()

    @property
    def length(self) -> float:
        """Distance of the last station [m]."""
        return float(self.along[-1])

    def point(self, along: float) -> tuple[float, float]:
        """East, north [m] at a distance along the track [m]; the end legs are extended."""
        i = min(max(int(along / STEP_M), 0), len(self._east) - 2)
        u = along / STEP_M - i
        return (
            self._east[i] + u * (self._east[i + 1] - self._east[i]),
            self._north[i] + u * (self._north[i + 1] - self._north[i]),
        )

    def along_at(self, east: float, north: float, last: float) -> float:
        """Distance along the track [m] of a point [m]; ``last`` : the previous distance.

        The search begins at ``last``, because a track may cross itself and is never flown backwards.
        """
        i = min(max(int(last / STEP_M), 0), len(self._east) - 2)
        while i + 2 < len(self._east) and self._square(i + 1, east, north) < self._square(i, east, north):
            i += 1
        leg_east, leg_north = self._east[i + 1] - self._east[i], self._north[i + 1] - self._north[i]
        along = (east - self._east[i]) * leg_east + (north - self._north[i]) * leg_north
        return i * STEP_M + along / math.hypot(leg_east, leg_north)

    def _square(self, i: int, east: float, north: float) -> float:
        return (self._east[i] - east) ** 2 + (self._north[i] - north) ** 2


def _round_corners(corners: Array, radius: float) -> Array:
    """The line with its corners replaced by arcs of closely spaced points."""
    pieces = [corners[:1]]
    for before, corner, after in zip(corners[:-2], corners[1:-1], corners[2:], strict=True):
        pieces.append(_arc(before, corner, after, radius))
    return np.concatenate([*pieces, corners[-1:]])


def _arc(before: Array, corner: Array, after: Array, radius: float) -> Array:
    """Points of the arc tangent to both legs of a corner."""
    inbound, outbound = corner - before, after - corner
    max_lead = 0.5 * min(float(np.linalg.norm(inbound)), float(np.linalg.norm(outbound)))
    inbound, outbound = inbound / np.linalg.norm(inbound), outbound / np.linalg.norm(outbound)
    turn = math.atan2(inbound[1] * outbound[0] - inbound[0] * outbound[1], float(inbound @ outbound))  # right positive
    if abs(turn) < 1e-6:
        return corner[None, :]
    lead = min(radius * math.tan(abs(turn) / 2.0), max_lead)
    right = math.copysign(1.0, turn) * np.array([inbound[1], -inbound[0]])
    r = lead / math.tan(abs(turn) / 2.0)
    angle = np.linspace(0.0, abs(turn), 2 + int(abs(turn) * r / 2.0))[:, None]
    return np.asarray(corner - lead * inbound + r * (np.sin(angle) * inbound + (1.0 - np.cos(angle)) * right))
