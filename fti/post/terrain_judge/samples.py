"""Measured ranges of an altimeter, and where it was and pointed, at any time of the flight.

Source: the derived outputs of navigation.  The position is that of a device: a position that navigation computes itself
may depend on the altimeter and on the map.
"""

from __future__ import annotations

import functools
from collections import defaultdict
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fti.arrays import Array, Ints, Mask
from fti.config import Device
from fti.geodesy.local import LocalFrame
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.approach_reference.fit_samples import (
    COMPUTED_ALTITUDES,
    HEIGHT,
    MAX_SOLUTION_GAP_S,
    SOLUTION,
    poses_of,
    values_of,
)
from fti.logger.reading.json_message import parse_table, using_message
from fti.logger.reading.recording import Recording
from fti.nav.altimetry.compensation import Mounting, mounting_of

#: Largest lag that is searched, either way [s].
MAX_LAG_S = 1.0
#: A block is at least so long; errors of elevation of 300 m length are then nearly independent from block to block.
BLOCK_M, BLOCK_S = 500.0, 5.0
#: Fewer groups of samples have no covariance.
MIN_GROUPS = 10
#: Half the interval over which a velocity is computed [s].
VELOCITY_S = 0.1


@dataclass(frozen=True, eq=False)
class SensorTrack:
    """The altimeter at the times of the navigated solutions, in the frame of the terrain.

    t : ascending (m,) [s];  origins : (m, 3) [m] east, north, up;  axes : unit vectors along the beam (m, 3)
    """

    t: Array
    origins: Array
    axes: Array

    def at(self, t: Array) -> tuple[Array, Array]:
        """Origins and axes at times (n,), interpolated; shape (n, 3) each."""
        origins, axes = (
            np.column_stack([np.interp(t, self.t, column) for column in columns.T])
            for columns in (self.origins, self.axes)
        )
        return origins, axes / np.linalg.norm(axes, axis=1, keepdims=True)

    def velocities(self, t: Array) -> Array:
        """Velocity east and north (n, 2) [m/s]."""
        moved = self.at(t + VELOCITY_S)[0] - self.at(t - VELOCITY_S)[0]
        return np.asarray(moved[:, :2] / (2.0 * VELOCITY_S))

    def covers(self, t: Array) -> Mask:
        """Whether solutions without a gap surround a time, also if it is wrong by ``MAX_LAG_S``."""
        around_s = MAX_LAG_S + 2.0 * VELOCITY_S
        gaps = np.concatenate(([0], np.cumsum(np.diff(self.t) > MAX_SOLUTION_GAP_S)))
        before, after = (np.searchsorted(self.t, t + offset) for offset in (-around_s, around_s))
        inside = (before > 0) & (after < len(self.t))
        last = len(self.t) - 1
        return np.asarray(inside & (gaps[np.maximum(before - 1, 0)] == gaps[np.minimum(after, last)]))


@dataclass(frozen=True, eq=False)
class RangeSamples:
    """Ranges of one altimeter.

    t : stated times of validity, ascending (n,) [s];  ranges : corrected for configured bias and scale (n,) [m]
    half_beam : half the width of a radar's beam [rad]; 0: the beam is narrow
    blocks    : number of the block of each sample (n,), ascending from 0
    """

    t: Array
    ranges: Array
    track: SensorTrack
    half_beam: float
    blocks: Ints

    @classmethod
    def of_track(cls, t: Array, ranges: Array, track: SensorTrack, half_beam: float) -> RangeSamples:
        """The samples that the track covers, divided into blocks."""
        known = track.covers(t)
        return cls(t[known], ranges[known], track, half_beam, block_numbers(t[known], track))

    def __len__(self) -> int:
        return len(self.t)

    @property
    def block_count(self) -> int:
        """Number of blocks."""
        return int(self.blocks[-1]) + 1 if len(self) else 0

    @property
    def length_m(self) -> float:
        """Distance over ground from sample to sample, without the gaps between blocks."""
        steps = np.hypot(*np.diff(self.track.at(self.t)[0][:, :2], axis=0).T)
        return float(steps[np.diff(self.blocks) == 0].sum())

    @functools.cached_property
    def time_groups(self) -> tuple[Ints, ...]:
        """Numbers of the group of each sample (n,): blocks, then joined in pairs, fours, ...

        Each has ``MIN_GROUPS`` groups at least; none in a short flight.
        """
        return _coarser_groups(self.blocks[:, None])

    @functools.cached_property
    def ground_groups(self) -> tuple[Ints, ...]:
        """The same with squares of the ground of ``BLOCK_M``, then of twice the edge, ...

        Errors of elevation are correlated also where legs cross or are flown twice.
        """
        return _coarser_groups(np.floor(self.measured(0.0)[:, :2] / BLOCK_M).astype(np.int64))

    def measured(self, lag: float, index: Ints | slice = slice(None)) -> Array:
        """Measured points (n, 3) [m] if the ranges are late by ``lag`` [s].

        Of a wide beam: the apparent ground, altitude minus range, below the altimeter.
        """
        origins, axes = self.track.at(self.t[index] - lag)
        along = axes if self.half_beam == 0.0 else np.array([0.0, 0.0, -1.0])
        return np.asarray(origins + self.ranges[index, None] * along)


def block_numbers(t: Array, track: SensorTrack) -> Ints:
    """Blocks of ``BLOCK_M`` and ``BLOCK_S`` at least; a gap of ``BLOCK_S`` begins a new one."""
    numbers = np.zeros(len(t), dtype=np.int64)
    if not len(t):
        return numbers
    steps = np.hypot(*np.diff(track.at(t)[0][:, :2], axis=0).T)
    number, length, begin = 0, 0.0, t[0]
    for i, step in enumerate(steps, start=1):
        length += step
        if (length >= BLOCK_M and t[i] - begin >= BLOCK_S) or t[i] - t[i - 1] > BLOCK_S:
            number, length, begin = number + 1, 0.0, t[i]
        numbers[i] = number
    return numbers


def _coarser_groups(finest: Ints) -> tuple[Ints, ...]:
    """finest : indices (n, d)"""
    found, size = list[Ints](), 1
    while True:
        _, numbers = np.unique(finest // size, axis=0, return_inverse=True)
        if numbers.max(initial=-1) + 1 < MIN_GROUPS:
            return tuple(found)
        found.append(numbers.reshape(-1).astype(np.int64))
        size *= 2


class FlightRecord(NamedTuple):
    """What a session has of its altimeters.

    values : time of validity [ns] and value [m] of each altimeter, (n, 2) in order of time
    poses  : time [ns], lat, lon [rad], alt [m], roll, pitch, heading [rad] of P, (m, 7) in order of time
    position_sources : names of devices
    """

    values: dict[str, Array]
    poses: Array
    position_sources: tuple[str, ...]

    @property
    def begin_ns(self) -> float:
        """Time of the first pose [ns]."""
        return float(self.poses[0, 0])

    def samples(self, device: Device, frame: LocalFrame) -> RangeSamples:
        """The ranges of an altimeter in the frame of a terrain."""
        assert device.altimeter is not None  # read_flight has checked it
        mounting = mounting_of(device)
        values = self.values[device.name]
        t = (values[:, 0] - self.begin_ns) * 1e-9
        ranges = device.altimeter.corrected_range_m(values[:, 1])
        return RangeSamples.of_track(t, ranges, self.track(mounting, frame), mounting.half_beam)

    def track(self, mounting: Mounting, frame: LocalFrame) -> SensorTrack:
        """Where an altimeter was."""
        t_ns, lat, lon, alt, roll, pitch, heading = self.poses.T
        mats = frame.mat_ln(lat, lon) @ mat_from_rpy(roll, pitch, heading)
        origins = frame.to_local(lat, lon, alt) + mats @ np.array(mounting.lever_arm_b)
        return SensorTrack((t_ns - self.begin_ns) * 1e-9, origins, mats @ np.array(mounting.boresight_b))


def read_flight(recording: Recording) -> FlightRecord:
    """The heights and the navigated poses of a session; without any where it has none."""
    values, poses, sources = defaultdict[str, list[Any]](list), list[tuple[float, ...]](), set[str]()
    for topic, t_ns, _, _, data in recording.messages("/nav/"):
        with using_message(topic, t_ns):
            if topic.startswith(HEIGHT):
                values[topic.removeprefix(HEIGHT)] += values_of(parse_table(data))
            elif topic == SOLUTION:
                output = parse_table(data)
                source = output.get("position_source")
                if source not in COMPUTED_ALTITUDES and (pose := [*poses_of(output)]):
                    poses += [row[:7] for row in pose]
                    sources.add(str(source))
    table = np.array(sorted(poses)).reshape(-1, 7)
    if len(table):
        table = table[np.concatenate(([True], np.diff(table[:, 0]) > 0.0))]
    return FlightRecord(
        {name: np.array(sorted(rows)) for name, rows in sorted(values.items()) if rows}, table, tuple(sorted(sources))
    )
