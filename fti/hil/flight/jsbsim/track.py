"""The track of a route over the ground: straight legs and turns, in the east, north plane of a local frame."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Distance of the stations of a track [m].
STEP_M = 10.0


class RouteTrack:
    """A line with stations every STEP_M.

    corners : east, north [m], at least two; each but the first and the last is rounded with ``radius`` [m], or with as
              much as its legs have room for
    """

    def __init__(self, corners: Sequence[tuple[float, float]], radius: float) -> None:
        line = _round_corners(np.asarray(corners, dtype=float), radius)
        along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))))
        #: Distance along the track of the stations [m], shape (n,), and their places, shape (n, 2).
        self.along: Array = np.arange(0.0, along[-1], STEP_M)
        self.points: Array = np.stack([np.interp(self.along, along, line[:, i]) for i in range(2)], axis=1)
        self._east: list[float] = self.points[:, 0].tolist()
        self._north: list[float] = self.points[:, 1].tolist()

    @property
    def length(self) -> float:
        """Distance of the last station [m]."""
        return float(self.along[-1])

    def point(self, along: float) -> tuple[float, float]:
        """East, north [m] at a distance along the track [m]; beyond the ends the last leg goes on."""
        i = min(max(int(along / STEP_M), 0), len(self._east) - 2)
        u = along / STEP_M - i
        return (
            self._east[i] + u * (self._east[i + 1] - self._east[i]),
            self._north[i] + u * (self._north[i + 1] - self._north[i]),
        )

    def along_at(self, east: float, north: float, last: float) -> float:
        """Distance along the track [m] of a place [m]; ``last`` : the distance just before.

        It is looked for from ``last`` on: a track may cross itself, and nobody flies it backwards.
        """
        i = min(max(int(last / STEP_M), 0), len(self._east) - 2)
        while i + 2 < len(self._east) and self._square(i + 1, east, north) < self._square(i, east, north):
            i += 1
        ahead_east, ahead_north = self._east[i + 1] - self._east[i], self._north[i + 1] - self._north[i]
        ahead = (east - self._east[i]) * ahead_east + (north - self._north[i]) * ahead_north
        return i * STEP_M + ahead / math.hypot(ahead_east, ahead_north)

    def _square(self, i: int, east: float, north: float) -> float:
        return (self._east[i] - east) ** 2 + (self._north[i] - north) ** 2


def _round_corners(corners: Array, radius: float) -> Array:
    """The line with arcs for corners, points close together."""
    pieces = [corners[:1]]
    for before, corner, after in zip(corners[:-2], corners[1:-1], corners[2:], strict=True):
        pieces.append(_arc(before, corner, after, radius))
    return np.concatenate([*pieces, corners[-1:]])


def _arc(before: Array, corner: Array, after: Array, radius: float) -> Array:
    """Points of the arc that touches both legs of a corner."""
    came, goes = corner - before, after - corner
    room = 0.5 * min(float(np.linalg.norm(came)), float(np.linalg.norm(goes)))
    came, goes = came / np.linalg.norm(came), goes / np.linalg.norm(goes)
    turn = math.atan2(came[1] * goes[0] - came[0] * goes[1], float(came @ goes))  # right positive
    if abs(turn) < 1e-6:
        return corner[None, :]
    touch = min(radius * math.tan(abs(turn) / 2.0), room)
    right = math.copysign(1.0, turn) * np.array([came[1], -came[0]])
    r = touch / math.tan(abs(turn) / 2.0)
    angle = np.linspace(0.0, abs(turn), 2 + int(abs(turn) * r / 2.0))[:, None]
    return np.asarray(corner - touch * came + r * (np.sin(angle) * came + (1.0 - np.cos(angle)) * right))
