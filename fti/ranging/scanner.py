"""Range scanner: a laser whose beam a rotating polygon sweeps across the track, line after line.

The line lies in the sensor's y z plane: direction_s = (0, sin a, cos a), a from -fov/2 (left) to +fov/2 (right).  A
beam that meets the facets in the plane of rotation turns twice as fast as the mirror, so each of N facets sweeps
4 pi / N.  If that exceeds the field of view the rest is dead time: the beam meets an edge or the housing, without a
measurement.  With f pulses and n_l = N x revolutions lines per second

    angle step     da  = (4 pi / N) n_l / f                                   (eq. 5.1: alpha n_l / f without dead time)
    in-line        ds_y = s_y / (points per line) = 2 tan(fov / 2) h / cos(pitch) da / fov          (mean; eq. 5.2)
                   ds_y(a) = h / cos(pitch) da / cos(a)^2                                           (at the angle a)
    line distance  ds_x = v / n_l                                                                   (eq. 5.3)

over level ground h below a sensor pitched by its mounting.  A pulse must return before the next one starts:
f <= c / (2 d_max), 150 kHz at 1000 m (eq. 2.36); a faster scanner needs a coded or continuous wave.

Sources: Spiegel 2018, sections 2.1.4 and 5.1; Marshall and Stutz 2011, Optical and Laser Scanning (polygons).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.constants import SPEED_OF_LIGHT
from fti.ranging.interpolation import interpolate_poses
from fti.ranging.laser import Laser
from fti.ranging.point_grids import line_directions
from fti.ranging.sensor import Poses, RangingSensor, Returns
from fti.terrain.terrain import Terrain


def max_pulse_rate(max_range: float) -> float:
    """Maximum rate [Hz] at which each pulse returns from ``max_range`` [m] before the next one.  Eq. 2.36."""
    return SPEED_OF_LIGHT / (2.0 * max_range)


def time_to_overlap(height: ArrayLike, speed: ArrayLike, pitches: tuple[float, float]) -> Array:
    """Time from the line of one scanner to that of the other one at the same place of level ground [s].  Fig. 5.6.

        t = h (tan(pitch of the first) - tan(pitch of the second)) / v,    positive if the first one looks farther ahead

    height : above ground [m];  speed : over ground [m/s];  pitches : of the two mountings, positive ahead [rad]
    """
    ahead = np.tan(pitches[0]) - np.tan(pitches[1])
    return np.asarray(np.asarray(height) * ahead / np.asarray(speed))


@dataclass(frozen=True, eq=False)
class Scan:
    """k measurements of a scanner: times (k,) [s], sensor poses at these times, and the returns."""

    times: Array
    poses: Poses
    returns: Returns

    def points_l(self) -> Array:
        """Measured points, (k, 3) or with both returns (k, 2, 3) [m]; NaN where not valid."""
        return points_l(self.poses, self.returns)


def points_l(poses: Poses, returns: Returns) -> Array:
    """Points of returns, (n, ..., 3) [m], east, north, up: x_l = x_l(S) + mat_ls d_s; NaN where not valid."""
    d_s = returns.slant_range[..., None] * returns.direction_s
    n = len(poses)
    d_l = d_s.reshape(n, -1, 3) @ np.swapaxes(poses.mats_ls, -1, -2)
    return np.asarray((poses.origins_l[:, None] + d_l).reshape(d_s.shape))


@dataclass(frozen=True)
class RangeScanner(RangingSensor):
    """A scanner with a rotating polygon.

    laser       : its ``reach`` limits the pulse rate
    pulse_rate  : f, pulses per second [Hz]
    line_rate   : n_l, lines per second [Hz]
    field_of_view : of the line [rad]
    facets      : of the polygon
    Raises ValueError for a pulse rate above ``max_pulse_rate``, a field of view that is not positive or that a facet
    cannot sweep, and a line without a pulse.
    """

    laser: Laser = field(default_factory=lambda: Laser(max_range=1000.0))
    pulse_rate: float = 10_000.0
    line_rate: float = 50.0
    field_of_view: float = float(np.radians(80.0))
    facets: int = 8

    def __post_init__(self) -> None:
        for name in ("pulse_rate", "line_rate"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name} is {getattr(self, name)} Hz, must be positive")
        limit = max_pulse_rate(self.laser.reach)
        if self.pulse_rate > limit:
            raise ValueError(f"pulse_rate is {self.pulse_rate} Hz, must be <= {limit:.0f} for {self.laser.reach} m")
        if int(self.facets) != self.facets or self.facets < 3:
            raise ValueError(f"facets is {self.facets}, must be a whole number of at least 3")
        if not 0.0 < self.field_of_view <= min(self.sweep_angle, np.pi):
            raise ValueError(
                f"field_of_view is {self.field_of_view} rad; must be positive and at most {self.sweep_angle:.3f}"
            )
        if self.angle_step > self.field_of_view:
            raise ValueError(
                f"pulse_rate is {self.pulse_rate} Hz, too low for line_rate {self.line_rate} Hz: lines without a pulse"
            )

    @property
    def sweep_angle(self) -> float:
        """Angle swept by one facet, including dead time [rad]."""
        return 4.0 * np.pi / self.facets

    @property
    def angle_step(self) -> float:
        """Angle between measurements of a line [rad]."""
        return self.sweep_angle * self.line_rate / self.pulse_rate

    @property
    def angles(self) -> Array:
        """Angles of the measurements of one line centred on the boresight, left to right (k,) [rad]."""
        half = int(np.floor(0.5 * self.field_of_view / self.angle_step * (1.0 + 1e-12)))
        return np.asarray(self.angle_step * np.arange(-half, half + 1))

    def in_line_distance(self, height: ArrayLike, pitch: ArrayLike = 0.0) -> Array:
        """Mean distance of neighbours in a line over level ground ``height`` [m] below; pitch of the mounting [rad]."""
        width = 2.0 * np.tan(0.5 * self.field_of_view) * np.asarray(height) / np.cos(pitch)
        return np.asarray(width * self.angle_step / self.field_of_view)

    def line_distance(self, speed: ArrayLike) -> Array:
        """Distance of the lines along the track at a ground speed [m/s]."""
        return np.asarray(np.asarray(speed) / self.line_rate)

    def square_line_rate(self, height: ArrayLike, speed: ArrayLike, pitch: ArrayLike = 0.0) -> Array:
        """Lines per second [Hz] that make both distances equal.  Eq. 5.5, with the dead time."""
        per_line = self.in_line_distance(height, pitch) / self.line_rate
        return np.asarray(np.sqrt(np.asarray(speed) / per_line))

    def measure(self, terrain: Terrain, poses: Poses, rng: np.random.Generator | None = None) -> Returns:
        """One line at each pose, shape (n, k), with both returns (n, k, 2).

        The sensor is stationary during the line, so that every range belongs to the pose; for a flight, use ``scan``.
        """
        rays_s = line_directions(self.angles)
        rays_l = rays_s @ np.swapaxes(poses.mats_ls, -1, -2)
        return self.laser.measure_directions(terrain, poses.origins_l[:, None], rays_l, rays_s, rng)

    def scan(self, terrain: Terrain, times: ArrayLike, epochs: Poses, rng: np.random.Generator | None = None) -> Scan:
        """All k measurements from the first to the last epoch at ``times`` (n,) [s].

        The first pulse starts at the first epoch, when a facet begins its sweep.  Each measurement has its own pose,
        ``interpolate_poses`` between the epochs.  Raises ValueError for fewer than two of them.
        """
        knots = np.asarray(times, dtype=np.float64)
        if knots.size < 2:
            raise ValueError(f"a scan has {knots.size} epochs, must have at least 2")
        pulses = np.arange(np.floor((knots[-1] - knots[0]) * self.pulse_rate) + 1)
        angles = self.sweep_angle * ((pulses * (self.line_rate / self.pulse_rate)) % 1.0 - 0.5)
        in_view = np.abs(angles) <= 0.5 * self.field_of_view
        when = np.minimum(knots[0] + pulses[in_view] / self.pulse_rate, knots[-1])  # limits rounding of the last one
        poses = interpolate_poses(knots, epochs, when)
        rays_s = line_directions(angles[in_view])
        rays_l = (poses.mats_ls @ rays_s[..., None])[..., 0]
        return Scan(when, poses, self.laser.measure_directions(terrain, poses.origins_l, rays_l, rays_s, rng))
