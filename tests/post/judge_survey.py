"""Simulated surveys for the judge of maps: ranges of a laser over relief, with legs in given directions.

The errors are drawn here: the elevation model has errors of 30 and 300 m length, the position one that lasts 10 s, the
ranges have noise and returns from trees.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array, Rng
from fti.post.terrain_judge.samples import RangeSamples, SensorTrack
from fti.terrain.dem_error import correlated_noise
from fti.terrain.synthetic import fractal_relief
from fti.terrain.terrain import Terrain

POSTS, CELL_M = 401, 20.0
HALF_M = 0.5 * (POSTS - 1) * CELL_M
SPEED_MPS, HEIGHT_M, LEG_S, BREAK_S = 60.0, 400.0, 100.0, 30.0
POSE_S, RANGE_S = 0.1, 0.2
#: Sigma of the relief, of the elevation's two errors, of the position (each axis), of the ranges [m].
RELIEF_M, SHORT_M, LONG_M, POSITION_M, RANGE_M = 30.0, 0.4, 0.4, 0.5, 0.15
#: Measured ground minus map [m]; share of the ranges that meet a tree.
BIAS_M, TREES = 1.5, 0.02


@dataclass(frozen=True, eq=False)
class Survey:
    """Legs through the middle of the ground, some hundred metres beside it.

    t : [s] (m,);  origins : true positions (m, 3) [m];  roll, heading : (m,) [rad]
    """

    t: Array
    origins: Array
    roll: Array
    heading: Array

    @property
    def axes(self) -> Array:
        """Downwards along the body's z axis, (m, 3)."""
        across = np.sin(self.roll)
        return np.column_stack((-across * np.cos(self.heading), across * np.sin(self.heading), -np.cos(self.roll)))

    @property
    def track(self) -> SensorTrack:
        """Without errors."""
        return SensorTrack(self.t, self.origins, self.axes)


def ground(seed: int) -> Terrain:
    """True relief, 8 x 8 km around the origin of the frame."""
    rng = np.random.default_rng(seed)
    shape = (POSTS, POSTS)
    return at_middle(fractal_relief(shape, CELL_M, rng, sd=RELIEF_M, max_size_m=3000.0, min_size_m=120.0))


def at_middle(heights: Array) -> Terrain:
    """Heights on the posts of the ground."""
    return Terrain.from_array(heights, CELL_M, lat0=0.82, lon0=0.15, east0=-HALF_M, north0=-HALF_M)


def displaced(terrain: Terrain, shift: Sequence[float] | Array, rng: Rng | None) -> Terrain:
    """The map: each hill is so far too far east and north [m], and without ``rng`` exact otherwise."""
    axis = CELL_M * np.arange(POSTS) - HALF_M
    heights = terrain.up(*np.meshgrid(axis - shift[0], axis - shift[1]))
    if rng is not None:
        for sd, length in ((SHORT_M, 30.0), (LONG_M, 300.0)):
            heights = heights + sd * correlated_noise(heights.shape, CELL_M, rng, length)
    return at_middle(heights)


def fly(headings_deg: Sequence[float], rng: Rng) -> Survey:
    """Legs with these headings, in this order."""
    parts = []
    for k, heading in enumerate(np.radians(headings_deg)):
        t = np.arange(0.0, LEG_S, POSE_S)
        along, across = SPEED_MPS * (t - 0.5 * LEG_S), 300.0 * rng.standard_normal()
        east = along * np.sin(heading) + across * np.cos(heading)
        north = along * np.cos(heading) - across * np.sin(heading)
        up = HEIGHT_M + 10.0 * np.sin(t / 8.0)
        roll = math.radians(3.0) * np.sin(2.0 * math.pi * t / 7.0)
        parts.append((t + k * (LEG_S + BREAK_S), east, north, up, roll, np.full(len(t), heading)))
    t, east, north, up, roll, heading = (np.concatenate(each) for each in zip(*parts, strict=True))
    return Survey(t, np.column_stack((east, north, up)), roll, heading)


def measure(terrain: Terrain, flight: Survey, lag_s: float, rng: Rng) -> tuple[Array, Array]:
    """Stated times [s] and ranges [m] of a laser that is late."""
    begins = flight.t[:: round(LEG_S / POSE_S)]
    at = np.concatenate([np.arange(begin + 2.0, begin + LEG_S - 2.0, RANGE_S) for begin in begins])
    ranges = terrain.cast(*flight.track.at(at - lag_s), 3000.0) + RANGE_M * rng.standard_normal(len(at)) - BIAS_M
    return at, ranges - np.where(rng.random(len(at)) < TREES, rng.uniform(3.0, 20.0, len(at)), 0.0)


def navigated(flight: Survey, rng: Rng) -> Array:
    """Positions of the source, (m, 3) [m]."""
    keep = math.exp(-POSE_S / 10.0)
    error = rng.standard_normal((len(flight.t), 2)) * math.sqrt(1.0 - keep**2)
    error[0] = rng.standard_normal(2)
    for i in range(1, len(error)):
        error[i] += keep * error[i - 1]
    return flight.origins + POSITION_M * np.column_stack((error, np.zeros(len(error))))


def samples(terrain: Terrain, headings_deg: Sequence[float], lag_s: float, rng: Rng) -> RangeSamples:
    """The ranges of a survey, as the judge gets them."""
    flight = fly(headings_deg, rng)
    at, ranges = measure(terrain, flight, lag_s, rng)
    return RangeSamples.of_track(at, ranges, SensorTrack(flight.t, navigated(flight, rng), flight.axes), 0.0)
