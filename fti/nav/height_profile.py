"""Collects the profile of one altimeter below the track, for the position from the ground.

A laser measures a point: the attitude turns its range into that point, at the navigated position.  A radar measures its
nearest return: the profile has the apparent heights of the ground, altitude minus range, at the positions of the
sensor, and is matched with the apparent surface (``fti.nav.terrain_matching.nearest_surface``).  Samples with reasons
that come from the known ground alone are used, because the position may be wrong; all other reasons discard the sample.
A multi-beam altimeter measures a point with each beam; all ranges of a time are matched together
(``fti.nav.terrain_matching.beam_profile``).
Frame: east, north, up of the terrain.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from fti.arrays import Array
from fti.config import Altimeter, Device, Vector
from fti.constants import SECOND_NS
from fti.geodesy.formulas import mat_nb, rotate
from fti.messages.measurements import BeamRange
from fti.messages.outputs import HeightAboveGround
from fti.nav.altimetry.altimeter_channel import TERRAIN_REASONS
from fti.nav.altimetry.compensation import Mounting
from fti.nav.altimetry.sigmas import RANGE_SD_UNKNOWN, stated_sd
from fti.nav.altimetry.validity import Sample, reasons_against
from fti.nav.filter.estimate import Estimate
from fti.nav.source_interpolation import AttitudeState
from fti.nav.terrain_matching.nearest_surface import RadarTrack, nearest_surface
from fti.nav.terrain_matching.profile import MIN_SAMPLES, Profile
from fti.nav.terrain_matching.reach import corridor_m, search_area
from fti.nav.terrain_matching.search import Lattice
from fti.nav.terrain_matching.window import TerrainWindow
from fti.nav.terrain_reference import Ground
from fti.ranging.multibeam import beam_directions

#: Shortest time between samples [ns], as in the source: 5 Hz.
PERIOD_NS = 200_000_000
#: The same of a multi-beam altimeter, less the jitter of its clock: with 10 Hz every second frame is a sample.
BEAM_PERIOD_NS = 190_000_000
#: Share of the possible samples that a profile needs.
MIN_SHARE = 0.5
#: Cells of a radar's search, each way; a far one has larger cells.
MAX_CELLS = 100
#: Largest change of the navigated position against its velocity from one sample to the next [m]: a correction of the
#: filter by more would bend the profile.  Measured with a tactical unit: satellites twice a second correct by up to
#: 0.6 m, after an outage of 20 s by 3 m, and fixes of profiles that contain such a correction are wrong by 5 sigma.
MAX_JUMP_M = 1.0

#: Errors of elevation of 30 m and 300 m length: samples that are closer count less.  Measured: error over sigma 0.9.
CORRELATED_M = 40.0
#: The same of several beams: an error of elevation of 300 m length is common to beams that are 50 m apart.  Measured
#: (``fti.study.long_endurance``, seed 5, four flights): error^2 over covariance of a fix, halved, is 2.2 with 40 m, and
#: 0.9 with 100 m; with one beam and 40 m it is 0.8.  Low above the ground beams lie closer: there they count no more
#: than single beams that are 40 m apart.  Measured with nine beams at 30 m: 1.8 without this limit, 1.1 with it.
CORRELATED_BEAMS_M = 100.0


class MeasuredRange(NamedTuple):
    """A range [m] along a unit vector in the body frame, and one sigma of its independent error [m]."""

    direction_b: Vector
    slant_range: float
    sd: float


@dataclass(frozen=True, eq=False)
class ProfileSamples:
    """The ranges of a profile.

    t       : times [s], shape (K,);  ranges : measured [m], shape (K,);  sds : one sigma of their independent error [m]
    origins : navigated positions of the sensor, shape (K, 3) [m];  axes : unit vectors along the beam, shape (K, 3)
    range_sds, dem_sds : the parts of ``sds`` of the altimeter and of the elevation [m]
    """

    t: Array
    origins: Array
    axes: Array
    ranges: Array
    sds: Array
    range_sds: Array
    dem_sds: Array


@dataclass(frozen=True, eq=False, slots=True)
class _SensorState:
    """The altimeter at a time: origin (3,) [m], body frame to that of the terrain."""

    t_ns: int
    origin: Array
    mat_lb: Array


@dataclass(frozen=True, eq=False, slots=True)
class _PlacedRange:
    """A range with the state of its time.  axis : along the beam (3,);  dem_sd : one sigma of the elevation [m]"""

    state: _SensorState
    measured: MeasuredRange
    axis: Array
    dem_sd: float


@dataclass(slots=True)
class HeightProfile:
    """The profile of one altimeter over known ground; beams that are measured at one time share its state.

    period_ns : shortest time between samples
    """

    mounting: Mounting
    ground: Ground
    period_ns: int = PERIOD_NS
    _states: list[_SensorState] = field(default_factory=list)
    _ranges: list[_PlacedRange] = field(default_factory=list)
    _last: Estimate | None = None

    def __len__(self) -> int:
        """Number of times at which it was measured."""
        return len(self._states)

    @property
    def begin_ns(self) -> int | None:
        """Time of the first sample; None without one."""
        return self._states[0].t_ns if self._states else None

    @property
    def length_m(self) -> float:
        """Distance between the first and the last sample, horizontally."""
        if not self._states:
            return 0.0
        return math.hypot(*(self._states[-1].origin - self._states[0].origin)[:2])

    @property
    def independent_share(self) -> float:
        """Number of independent errors of elevation over the number of samples."""
        length_m, number = max(self.length_m, 1.0), len(self._ranges)
        share = length_m / number / CORRELATED_M
        if number > len(self):
            share = min(share * (1.0 + self._swath_m / CORRELATED_M), length_m / len(self) / CORRELATED_BEAMS_M)
        return min(share, 1.0)

    @property
    def _swath_m(self) -> float:
        """Horizontal distance between the outermost points of all beams of one time, mean over the profile."""
        points = np.array([each.measured.slant_range * each.axis[:2] for each in self._ranges])
        _, first = np.unique([each.state.t_ns for each in self._ranges], return_index=True)
        extent = np.maximum.reduceat(points, first) - np.minimum.reduceat(points, first)
        return float(np.mean(np.hypot(*extent.T)))

    def clear(self) -> None:
        """Remove all samples."""
        self._states, self._ranges, self._last = [], [], None

    def add(self, t_ns: int, measured: MeasuredRange, estimate: Estimate, attitude: AttitudeState) -> bool:
        """Add a range with the navigated state at its time; False begins a new profile, because the position jumped.

        A range that is too close to the last one, or has no heading, is left out.
        """
        if attitude.heading is None or not self.is_due(t_ns):
            return True
        has_jumped = self._last is not None and jump_m(self._last, estimate) > MAX_JUMP_M
        if has_jumped:
            self.clear()
        frame, (lat, lon, alt) = self.ground.terrain.frame, estimate.geodetic
        mat = frame.mat_ln(lat, lon) @ np.array(mat_nb(attitude.roll, attitude.pitch, attitude.heading))
        origin = frame.to_local(lat, lon, alt) + mat @ self.mounting.lever_arm_b
        self._states.append(_SensorState(t_ns, origin, mat))
        self._place(self._states[-1], measured)
        self._last = estimate
        return not has_jumped

    def add_beam(self, measured: MeasuredRange) -> None:
        """Add a further beam of the last time; a beam in the same direction is left out."""
        state = self._states[-1]
        beams = itertools.takewhile(lambda other: other.state is state, reversed(self._ranges))
        if all(measured.direction_b != other.measured.direction_b for other in beams):
            self._place(state, measured)

    def _place(self, state: _SensorState, measured: MeasuredRange) -> None:
        """Add a range; the sigma of the elevation is that of the measured point, or of the radar's nearest return."""
        axis = state.mat_lb @ measured.direction_b
        radius_m = measured.slant_range * math.sin(self.mounting.half_beam)
        east, north, _ = map(float, state.origin + measured.slant_range * axis)
        if radius_m > 0.0:
            east, north = self.ground.place_of_return(state.origin, radius_m)
        self._ranges.append(_PlacedRange(state, measured, axis, self.ground.sd_at(east, north)))

    def is_due(self, t_ns: int) -> bool:
        """Whether a range of this time is far enough from the last one."""
        return not self._states or t_ns - self._states[-1].t_ns >= self.period_ns

    def is_last(self, t_ns: int) -> bool:
        """Whether the last range has this time."""
        return bool(self._states) and t_ns == self._states[-1].t_ns

    def is_complete(self, span_ns: int) -> bool:
        """Whether it has enough samples of the time in which they were collected."""
        return len(self) >= max(MIN_SAMPLES, MIN_SHARE * span_ns / PERIOD_NS)

    @property
    def samples(self) -> ProfileSamples:
        """All ranges, in order of time."""
        rows = [
            (
                each.state.t_ns,
                each.state.origin,
                each.axis,
                each.measured.slant_range,
                math.hypot(each.measured.sd, each.dem_sd),
                each.measured.sd,
                each.dem_sd,
            )
            for each in self._ranges
        ]
        t_ns, *columns = map(np.array, zip(*rows, strict=True))
        return ProfileSamples(t_ns / SECOND_NS, *columns)

    def search_area(self, height_sd: float, reach_m: float) -> tuple[Profile, TerrainWindow, Lattice]:
        """The profile, and the ground and the shifts to compare it with.

        height_sd : one sigma of the navigated height [m];  reach_m : largest shift, each way [m]
        Raises ValueError with fewer than ``MIN_SAMPLES`` samples.
        """
        samples, terrain = self.samples, self.ground.terrain
        t, origins, axes, ranges, sds = samples.t, samples.origins, samples.axes, samples.ranges, samples.sds
        if self.mounting.half_beam == 0.0:
            east, north, up = (origins + ranges[:, None] * axes).T
            profile = Profile(t, east, north, up, sds, height_sd)
            return profile, *search_area(terrain, profile, reach_m)
        profile = Profile(t, origins[:, 0], origins[:, 1], origins[:, 2] - ranges, sds, height_sd)
        track = RadarTrack(origins, axes, self.mounting.half_beam)
        window, lattice = search_area(
            terrain,
            profile,
            reach_m,
            margin_m=track.footprint_m(ranges),
            min_cell_m=max(track.cell_m(ranges), reach_m / MAX_CELLS),
        )
        return profile, nearest_surface(window, track, corridor_m(window, lattice)), lattice


def range_of_height(height: HeightAboveGround, altimeter: Altimeter, mounting: Mounting) -> MeasuredRange | None:
    """The range of an altimeter with one beam; None if it is not a range to the ground."""
    if height.raw is None or not TERRAIN_REASONS.issuperset(height.reasons):
        return None
    value = altimeter.corrected_range_m(height.raw)
    return MeasuredRange(mounting.boresight_b, value, stated_sd(height.nearest_sd, RANGE_SD_UNKNOWN))


def range_of_beam(beam: BeamRange, t_ns: int, device: Device, attitude: AttitudeState | None) -> MeasuredRange | None:
    """The range of a beam that is valid at t_ns; None if it is not a range, or beyond the limits of the altimeter."""
    altimeter = device.altimeter
    assert altimeter is not None  # the configuration is checked for it
    sample = Sample(
        value=beam.slant_range,
        flagged=not beam.valid,
        age_ns=beam.stamp.t_rx_ns - t_ns,
        max_age_ns=round(device.max_age_ms * 1e6),
        roll=attitude.roll if attitude else None,
        pitch=attitude.pitch if attitude else None,
    )
    if beam.slant_range is None or reasons_against(sample, altimeter):
        return None
    to_body = mat_nb(*(math.radians(angle) for angle in device.rpy_bs_deg))
    direction_b = rotate(to_body, beam_directions(beam.along, beam.across).tolist())
    sd = stated_sd(altimeter.sd_m, RANGE_SD_UNKNOWN)
    return MeasuredRange(direction_b, altimeter.corrected_range_m(beam.slant_range), sd)


def jump_m(before: Estimate, after: Estimate) -> float:
    """Distance of a position from the one before, moved with the mean velocity [m]."""
    seconds = (after.t_ns - before.t_ns) / SECOND_NS
    return float(np.linalg.norm(after.y[:3] - before.y[:3] - 0.5 * seconds * (before.y[3:6] + after.y[3:6])))
