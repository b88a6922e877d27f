"""Predicted ranges of the receivers of one family at the poses of a flight, as a table over their parameters.

    laser              no parameter
    radar, "nearest"   beam width of the cone
    radar, "beam"      half-power beam width, and threshold of the leading edge against the peak [dB]

The sensor models are those of the live prediction (``fti.nav.altimetry.expected_range``).  A table is interpolated
linearly: its steps are small compared with the resolution of a sample.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.config import Device
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.approach_reference.fit_samples import FitSamples
from fti.ranging.laser import Laser
from fti.ranging.nearest import NearestReturn
from fti.ranging.radar.altimeter import RadarAltimeter
from fti.ranging.radar.antenna import cosine_antenna
from fti.ranging.radar.beam import trace_beam
from fti.ranging.radar.edge import edge_at
from fti.ranging.sensor import Poses, RangingSensor, Validity, sensor_poses
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.terrain import Terrain

Advance = Callable[[], None]

#: Maximum predicted range, relative to that of the altimeter: as in the live prediction.
RANGE_MARGIN = 1.5
#: Maximum gain-weighted share of a beam over unknown terrain.
UNKNOWN_SHARE = 0.01
_UNKNOWN = (RayOutcome.HOLE, RayOutcome.OUTSIDE, RayOutcome.UNKNOWN, RayOutcome.BURIED)
_CHUNK = 16


@dataclass(frozen=True, eq=False)
class RangeTable:
    """Ranges (*len of each axis, n) [m] of n samples; NaN without a return.  names, axes : the parameters."""

    names: tuple[str, ...]
    axes: tuple[Array, ...]
    ranges: Array

    def at(self, parameters: Array) -> Array:
        """Ranges (n,) at parameters inside the axes, linearly interpolated."""
        corners: list[list[tuple[int, float]]] = []
        for value, axis in zip(parameters, self.axes, strict=True):
            k = int(np.clip(np.searchsorted(axis, value) - 1, 0, len(axis) - 2))
            share = (value - axis[k]) / (axis[k + 1] - axis[k])
            corners.append([(k, 1.0 - share), (k + 1, share)])
        values = np.zeros(self.ranges.shape[-1])
        for corner in itertools.product(*corners):
            weight = math.prod(share for _, share in corner)
            if weight:
                values = values + weight * self.ranges[tuple(k for k, _ in corner)]
        return values

    def slope(self, parameters: Array, number: int) -> Array:
        """Derivative (n,) by one parameter: central difference over one step of its axis, limited to the axis."""
        axis, points = self.axes[number], []
        step = float(np.min(np.diff(axis)))
        for sign in (-1.0, 1.0):
            moved = parameters.copy()
            moved[number] = np.clip(moved[number] + sign * step, axis[0], axis[-1])
            points.append((moved[number], self.at(moved)))
        (low, lower), (high, upper) = points
        return np.asarray((upper - lower) / (high - low))


@dataclass(frozen=True, eq=False)
class RangeTableBuilder:
    """Makes tables for the samples of one device over one terrain."""

    device: Device
    terrain: Terrain
    samples: FitSamples

    @property
    def max_range_m(self) -> float:
        """Maximum length of the rays [m]."""
        assert self.device.altimeter is not None
        return RANGE_MARGIN * self.device.altimeter.range_m[1]

    def laser(self) -> RangeTable:
        """Pencil beam along the mounting axis."""
        return RangeTable((), (), self._measure(Laser(max_range=self.max_range_m)))

    def nearest(self, beams_deg: Sequence[float], advance: Advance) -> RangeTable:
        """The nearest return in a cone of a full width; ``advance`` is called after each width."""
        found = []
        for beam in beams_deg:
            found.append(self._measure(NearestReturn(beam_width=math.radians(beam), max_range=self.max_range_m)))
            advance()
        return RangeTable(("beam_deg",), (np.asarray(beams_deg, dtype=np.float64),), np.array(found))

    def beam(self, beams_deg: Sequence[float], thresholds_db: Sequence[float], advance: Advance) -> RangeTable:
        """Antenna, radar equation and leading edge."""
        found = []
        for beam in beams_deg:
            found.append(self._edges(math.radians(beam), thresholds_db))
            advance()
        axes = np.asarray(beams_deg, dtype=np.float64), np.asarray(thresholds_db, dtype=np.float64)
        return RangeTable(("beam_deg", "threshold_db"), axes, np.array(found))

    def configured_ranges(self) -> Array:
        """Ranges (n,) of the receiver that the configuration describes, before its scale and bias."""
        limits = self.device.altimeter
        assert limits is not None
        if limits.kind == "laser":
            return self._measure(Laser(max_range=self.max_range_m))
        width = math.radians(limits.beam_deg)
        if limits.model == "nearest":
            return self._measure(NearestReturn(beam_width=width, max_range=self.max_range_m))
        return np.asarray(self._edges(width, [limits.threshold_db])[0])

    def _poses(self) -> Poses:
        s, d = self.samples, self.device
        mat_bs = mat_from_rpy(*(math.radians(angle) for angle in d.rpy_bs_deg))
        position, rpy = (s.lat, s.lon, s.alt), (s.roll, s.pitch, s.heading)
        return sensor_poses(self.terrain.frame, position, rpy, d.lever_arm_b, mat_bs, s.vel_n)

    def _measure(self, sensor: RangingSensor) -> Array:
        returns = sensor.measure(self.terrain, self._poses())
        return np.where(returns.valid, returns.slant_range, np.nan)

    def _edges(self, width: float, thresholds_db: Sequence[float | None]) -> Array:
        """Ranges (thresholds, n): the rays are cast once for all thresholds."""
        sensor = RadarAltimeter(antenna=cosine_antenna(width, width), max_range=self.max_range_m)
        edges, poses = [edge_at(threshold) for threshold in thresholds_db], self._poses()
        parts = []
        for begin in range(0, len(poses), _CHUNK):
            some = slice(begin, begin + _CHUNK)
            part = Poses(poses.origins_l[some], poses.mats_ls[some], poses.vels_l[some])
            echoes = trace_beam(self.terrain, part, sensor.beam, sensor.ground, sensor.reach)
            spectra = sensor.spectra(echoes)
            blind = np.isin(echoes.outcomes, _UNKNOWN) @ sensor.beam.weights > UNKNOWN_SHARE * sensor.beam.weights.sum()
            found = [edge.find(spectra, sensor.noise) for edge in edges]
            known = np.array([(one.validity == Validity.VALID) & ~blind for one in found])
            ranges = sensor.waveform.range_of_bin(np.array([one.position for one in found]))
            parts.append(np.where(known, ranges, np.nan))
        return np.concatenate(parts, axis=-1)
