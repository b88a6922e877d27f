"""Collects the height profile below the track, for the position from the ground.

A laser measures a point: the attitude turns its range into that point, at the navigated position.  A radar measures its
nearest return: the profile has the apparent heights of the ground, altitude minus range, at the positions of the
sensor, and is matched with the apparent surface (``fti.nav.terrain_matching.nearest_surface``).  Samples with reasons
that come from the known ground alone are used, because the position may be wrong; all other reasons discard the sample.
Frame: east, north, up of the terrain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from fti.arrays import Array
from fti.constants import SECOND_NS
from fti.geodesy.formulas import mat_nb
from fti.messages.outputs import HeightAboveGround
from fti.nav.altimetry.altimeter_channel import TERRAIN_REASONS
from fti.nav.altimetry.compensation import Mounting
from fti.nav.altimetry.sigmas import RANGE_SD_UNKNOWN, stated_sd
from fti.nav.filter.estimate import Estimate
from fti.nav.source_interpolation import AttitudeState
from fti.nav.terrain_matching.nearest_surface import RadarTrack, nearest_surface
from fti.nav.terrain_matching.profile import MIN_SAMPLES, Profile
from fti.nav.terrain_matching.reach import corridor_m, search_area
from fti.nav.terrain_matching.search import Lattice
from fti.nav.terrain_matching.window import TerrainWindow
from fti.nav.terrain_reference import Ground

#: Shortest time between samples [ns], as in the source: 5 Hz.
PERIOD_NS = 200_000_000
#: Share of the possible samples that a profile needs.
MIN_SHARE = 0.5
#: Cells of a radar's search, each way; a far one has larger cells.
MAX_CELLS = 100
#: Largest change of the navigated position against its velocity from one sample to the next [m]: a correction of the
#: filter by more would bend the profile.
MAX_JUMP_M = 5.0


@dataclass(frozen=True, eq=False)
class ProfileSamples:
    """The samples of a profile.

    t       : times [s], shape (K,);  ranges : measured [m], shape (K,);  sds : one sigma of their independent error [m]
    origins : navigated positions of the sensor, shape (K, 3) [m];  axes : unit vectors along the beam, shape (K, 3)
    """

    t: Array
    origins: Array
    axes: Array
    ranges: Array
    sds: Array


@dataclass(slots=True)
class HeightProfile:
    """The profile of one altimeter over known ground."""

    mounting: Mounting
    ground: Ground
    _t_ns: list[int] = field(default_factory=list)
    _origins: list[Array] = field(default_factory=list)
    _axes: list[Array] = field(default_factory=list)
    _ranges: list[float] = field(default_factory=list)
    _sds: list[float] = field(default_factory=list)
    _last: Estimate | None = None

    def __len__(self) -> int:
        return len(self._t_ns)

    @property
    def begin_ns(self) -> int | None:
        """Time of the first sample; None without one."""
        return self._t_ns[0] if self._t_ns else None

    @property
    def length_m(self) -> float:
        """Distance between the first and the last sample, horizontally."""
        return math.hypot(*(self._origins[-1] - self._origins[0])[:2]) if self._origins else 0.0

    def clear(self) -> None:
        """Remove all samples."""
        self._t_ns, self._origins, self._axes, self._ranges, self._sds, self._last = [], [], [], [], [], None

    def add(self, height: HeightAboveGround, estimate: Estimate, attitude: AttitudeState) -> bool:
        """Add a height with the navigated state at its time; False begins a new profile, because the position jumped.

        A height that is no range, is too close to the last one, or has no heading is left out.
        """
        t_ns, value = height.t_valid_ns, height.raw
        if t_ns is None or value is None or attitude.heading is None or not TERRAIN_REASONS.issuperset(height.reasons):
            return True
        if self._t_ns and t_ns - self._t_ns[-1] < PERIOD_NS:
            return True
        has_jumped = self._last is not None and jump_m(self._last, estimate) > MAX_JUMP_M
        if has_jumped:
            self.clear()
        frame, (lat, lon, alt) = self.ground.terrain.frame, estimate.geodetic
        mat = frame.mat_ln(lat, lon) @ np.array(mat_nb(attitude.roll, attitude.pitch, attitude.heading))
        origin = frame.to_local(lat, lon, alt) + mat @ self.mounting.lever_arm_b
        self._t_ns.append(t_ns)
        self._origins.append(origin)
        self._axes.append(mat @ self.mounting.boresight_b)
        self._ranges.append(value)
        sd = stated_sd(height.nearest_sd, RANGE_SD_UNKNOWN)
        self._sds.append(math.hypot(sd, self.ground.sd_at(float(origin[0]), float(origin[1]))))
        self._last = estimate
        return not has_jumped

    def is_complete(self, span_ns: int) -> bool:
        """Whether it has enough samples of the time in which they were collected."""
        return len(self) >= max(MIN_SAMPLES, MIN_SHARE * span_ns / PERIOD_NS)

    @property
    def samples(self) -> ProfileSamples:
        """All samples, in order of time."""
        t = np.array(self._t_ns) / SECOND_NS
        return ProfileSamples(t, *map(np.array, (self._origins, self._axes, self._ranges, self._sds)))

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


def jump_m(before: Estimate, after: Estimate) -> float:
    """Distance of a position from the one before, moved with the mean velocity [m]."""
    seconds = (after.t_ns - before.t_ns) / SECOND_NS
    return float(np.linalg.norm(after.y[:3] - before.y[:3] - 0.5 * seconds * (before.y[3:6] + after.y[3:6])))
