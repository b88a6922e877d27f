"""Collects the height profile below the track, for the position from the ground.

A sample is the point of the ground that an altimeter has measured, at the navigated position of P: the attitude turns
the range into the vertical; known terrain is not used.  A radar reports the nearest return, at the excess of its tilt
over half its beam (``fti.nav.altimetry.compensation``).  Samples with reasons that come from the known ground alone are
used, because the position may be wrong; all other reasons discard the sample.  Frame: east, north, up of the terrain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from fti.arrays import Array
from fti.constants import SECOND_NS
from fti.geodesy.formulas import Vector, mat_nb, rotate
from fti.messages.outputs import HeightAboveGround
from fti.nav.altimetry.altimeter_channel import TERRAIN_REASONS
from fti.nav.altimetry.compensation import Mounting, tilt_of
from fti.nav.altimetry.sigmas import RANGE_SD_UNKNOWN, stated_sd
from fti.nav.filter.estimate import Estimate
from fti.nav.source_interpolation import AttitudeState
from fti.nav.terrain_matching.profile import MIN_SAMPLES, Profile
from fti.nav.terrain_reference import Ground

#: Shortest time between samples [ns], as in the source: 5 Hz.
PERIOD_NS = 200_000_000
#: Share of the possible samples that a profile needs.
MIN_SHARE = 0.5
#: Largest change of the navigated position against its velocity from one sample to the next [m]: a correction of the
#: filter by more would bend the profile.
MAX_JUMP_M = 5.0
#: Below this sine of the tilt the azimuth of the beam is not used.
LEVEL_TILT = 1e-6


@dataclass(slots=True)
class HeightProfile:
    """The profile of one altimeter over known ground."""

    mounting: Mounting
    ground: Ground
    _t_ns: list[int] = field(default_factory=list)
    _points_l: list[Array] = field(default_factory=list)
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
        return math.hypot(*(self._points_l[-1] - self._points_l[0])[:2]) if self._points_l else 0.0

    def clear(self) -> None:
        """Remove all samples."""
        self._t_ns, self._points_l, self._sds, self._last = [], [], [], None

    def add(self, height: HeightAboveGround, estimate: Estimate, attitude: AttitudeState) -> bool:
        """Add a height with the navigated state at its time; False begins a new profile, because the position jumped.

        A height that is no range, is too close to the last one, or has no heading is left out.
        """
        t_ns, value = height.t_valid_ns, height.raw
        if t_ns is None or value is None or attitude.heading is None or not TERRAIN_REASONS.issuperset(height.reasons):
            return True
        if self._t_ns and t_ns - self._t_ns[-1] < PERIOD_NS:
            return True
        has_jumped = self._last is not None and _jump_m(self._last, estimate) > MAX_JUMP_M
        if has_jumped:
            self.clear()
        frame, (lat, lon, alt) = self.ground.terrain.frame, estimate.geodetic
        foot_n = _foot(self.mounting, value, attitude.roll, attitude.pitch, attitude.heading)
        point = frame.to_local(lat, lon, alt) + frame.mat_ln(lat, lon) @ foot_n
        sd = stated_sd(height.nearest_sd, RANGE_SD_UNKNOWN)
        self._t_ns.append(t_ns)
        self._points_l.append(point)
        self._sds.append(math.hypot(sd, self.ground.sd_at(float(point[0]), float(point[1]))))
        self._last = estimate
        return not has_jumped

    def make(self, height_sd: float, span_ns: int) -> Profile | None:
        """The profile; None with too few samples.

        height_sd : one sigma of the navigated height [m];  span_ns : time in which they were collected
        """
        if len(self) < max(MIN_SAMPLES, MIN_SHARE * span_ns / PERIOD_NS):
            return None
        east, north, up = np.array(self._points_l).T
        return Profile(np.array(self._t_ns) / SECOND_NS, east, north, up, np.array(self._sds), height_sd)


def _jump_m(before: Estimate, after: Estimate) -> float:
    """Distance of a position from the one before, moved with the mean velocity [m]."""
    seconds = (after.t_ns - before.t_ns) / SECOND_NS
    return float(np.linalg.norm(after.y[:3] - before.y[:3] - 0.5 * seconds * (before.y[3:6] + after.y[3:6])))


def _foot(mounting: Mounting, slant_range: float, roll: float, pitch: float, heading: float) -> Vector:
    """From P to the measured point: north, east, down [m]."""
    mat = mat_nb(roll, pitch, heading)
    axis, arm = rotate(mat, mounting.boresight_b), rotate(mat, mounting.lever_arm_b)
    excess = max(0.0, tilt_of(mounting, roll, pitch) - mounting.half_beam)
    aside = math.hypot(axis[0], axis[1])
    out = slant_range * math.sin(excess) / aside if aside > LEVEL_TILT else 0.0
    down = arm[2] + slant_range * math.cos(excess)
    return arm[0] + out * axis[0], arm[1] + out * axis[1], down
