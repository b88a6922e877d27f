"""The point that an interferometric altimeter has measured, relative to the aircraft.

The altimeter gives the slant range R of the first echo from the plane of zero Doppler shift, and its look angle theta:
the angle of the line of sight off the forward-down plane of the body, positive to the right.  The plane is
perpendicular to the velocity, the look angle counts from the axes of the body; with wind they are not parallel.

    alpha = atan2(v_u, |v_e, v_n|)            effective pitch: climb angle                                  (9)
    beta  = atan2(v_e, v_n)                   effective heading: track                                      (10)
    S     = [ sin alpha sin beta   cos beta ]                                                               (12)
            [ sin alpha cos beta  -sin beta ]     down and right in the plane; east, north, up
            [    -cos alpha           0     ]

    simple        p = R C_b^n (sin theta, 0, -cos theta)           the point is in the body's own plane     (3, 4)
    conventional  p = R S (cos xi, sin xi),  xi = theta - roll                                              (13)
    proposed      p = R S (cos xi, sin xi),  xi = asin(sin theta / |t|) - atan2(t1, t2),  t = x_b' S        (30-36)

x_b is the body's axis to the right.  The body of the source is right, nose, up, as printed here; poses are forward,
right, down as everywhere in ``fti``.  The equations have the signs of docs/errata.md.

Domain of the proposed form.  Two points of the plane have the look angle, on both sides of the direction in which the
plane comes nearest to x_b.  The form gives the one on the side of the body's downward axis.  For roll of 60, pitch of
15, crab of 20 and climb of 10 deg it is the measured one if that is within ``MAX_OFF_BELLY`` of this axis; points from
there to 90 deg are refused.  Beyond, above the wings, the other point may be taken instead: antennas that look
down do not see such points.

Source: Oh 2019, section 3.  Checked against: points constructed with vectors, and direction_from_angles of
``fti.ranging.interferometric``, which has no intermediate angles; tests/nav/interferometric/test_closest_point.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum, StrEnum

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array, Codes, Mask
from fti.geodesy.rotations import rotate
from fti.ranging.sensor import Poses

#: Largest angle of the point off the body's downward axis.
MAX_OFF_BELLY = math.radians(75.0)
#: Largest sine of the angle of the point within the plane, from the direction in which the look angle is zero: at 1
#: both points of a look angle coincide, and an error of the look angle has no bound.
MAX_SINE = 0.999
#: Smallest horizontal speed over the speed: below, the plane is level and has no downward direction.
MIN_HORIZONTAL_SHARE = 1e-3
#: Largest difference of the sine of the look angle of the result from the measured one.
MAX_SINE_DIFFERENCE = 1e-12


class PointMethod(StrEnum):
    """The form of the equations."""

    SIMPLE = "simple"
    CONVENTIONAL = "conventional"
    PROPOSED = "proposed"


class PointRefusal(IntEnum):
    """Why a point is unknown; the first reason that applies.

    NONE         : it is known
    NO_SAMPLE    : range or look angle is not finite, or the range is not positive
    NO_PLANE     : without a horizontal velocity there is no plane with a downward direction
    ALONG_BASELINE : the plane comes no nearer to the line of the antennas than the look angle states, or both points
                   that have this look angle are nearly one (``MAX_SINE``)
    ABOVE        : the point is not below the aircraft
    OFF_BELLY    : the point is more than ``MAX_OFF_BELLY`` off the body's downward axis: the other point may be meant
    LOOK_ANGLE   : the point does not have the measured look angle
    """

    NONE = 0
    NO_SAMPLE = 1
    NO_PLANE = 2
    ALONG_BASELINE = 3
    ABOVE = 4
    OFF_BELLY = 5
    LOOK_ANGLE = 6


_Tests = Sequence[tuple[Mask, PointRefusal]]


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """Points of n samples.

    relative : from the sensor to the point, east, north, up, shape (n, 3) [m]; NaN where refused
    refusal  : numbers of ``PointRefusal``, shape (n,)
    """

    relative: Array
    refusal: Codes

    @property
    def is_known(self) -> Mask:
        """Which points are known, shape (n,)."""
        return np.asarray(self.refusal == PointRefusal.NONE)


def closest_points(
    slant_range: ArrayLike, look_angle: ArrayLike, poses: Poses, method: PointMethod = PointMethod.PROPOSED
) -> ClosestPoints:
    """The measured points, by one of the forms.

    slant_range [m], look_angle [rad], positive to the right : shape (n,);  poses : of the sensor, n of them
    """
    ranges, look = (np.broadcast_to(np.asarray(value, np.float64), len(poses)) for value in (slant_range, look_angle))
    has_sample = np.isfinite(ranges) & np.isfinite(look) & (np.nan_to_num(ranges) > 0.0)
    form = {
        PointMethod.SIMPLE: _simple,
        PointMethod.CONVENTIONAL: _conventional,
        PointMethod.PROPOSED: _proposed,
    }[method]
    direction, tests = form(np.where(has_sample, look, 0.0), poses)
    refusal = np.full(len(poses), PointRefusal.NONE, dtype=np.uint8)
    for holds, reason in reversed([(has_sample, PointRefusal.NO_SAMPLE), *tests]):
        refusal[~holds] = reason
    return ClosestPoints(
        np.where((refusal == PointRefusal.NONE)[:, None], ranges[:, None] * direction, np.nan), refusal
    )


def plane_axes(vels_l: Array) -> tuple[Array, Array, Mask]:
    """The columns of S, shape (n, 3) each, and whether the plane has a downward direction (eq. 9, 10, 12)."""
    level = np.hypot(vels_l[:, 0], vels_l[:, 1])
    speed = np.hypot(level, vels_l[:, 2])
    has_plane = np.asarray(level > MIN_HORIZONTAL_SHARE * speed)
    alpha, beta = np.arctan2(vels_l[:, 2], level), np.arctan2(vels_l[:, 0], vels_l[:, 1])
    down = np.stack((np.sin(alpha) * np.sin(beta), np.sin(alpha) * np.cos(beta), -np.cos(alpha)), axis=-1)
    return down, np.stack((np.cos(beta), -np.sin(beta), np.zeros_like(beta)), axis=-1), has_plane


def effective_look_angle(look_angle: Array, poses: Poses) -> tuple[Array, Mask]:
    """Angle xi of the point within the plane [rad], and whether it is determined (eq. 31 to 35)."""
    down, right, has_plane = plane_axes(poses.vels_l)
    x_b = poses.mats_ls[:, :, 1]
    t1, t2 = (x_b * down).sum(axis=1), (x_b * right).sum(axis=1)
    length = np.hypot(t1, t2)
    is_determined = has_plane & (np.abs(np.sin(look_angle)) <= MAX_SINE * length)
    sine = np.divide(np.sin(look_angle), length, out=np.zeros_like(length), where=is_determined)
    return np.arcsin(sine) - np.arctan2(t1, t2), is_determined


def _simple(look_angle: Array, poses: Poses) -> tuple[Array, _Tests]:
    in_body = np.stack((np.zeros_like(look_angle), np.sin(look_angle), np.cos(look_angle)), axis=-1)
    return rotate(poses.mats_ls, in_body), ()


def _conventional(look_angle: Array, poses: Poses) -> tuple[Array, _Tests]:
    roll = np.arctan2(-poses.mats_ls[:, 2, 1], -poses.mats_ls[:, 2, 2])
    direction, has_plane = _in_plane(look_angle - roll, poses)
    return direction, [(has_plane, PointRefusal.NO_PLANE)]


def _proposed(look_angle: Array, poses: Poses) -> tuple[Array, _Tests]:
    angle, is_determined = effective_look_angle(look_angle, poses)
    direction, has_plane = _in_plane(angle, poses)
    cos_off = (direction * poses.mats_ls[:, :, 2]).sum(axis=1)
    sine = (direction * poses.mats_ls[:, :, 1]).sum(axis=1)
    return direction, [
        (has_plane, PointRefusal.NO_PLANE),
        (is_determined, PointRefusal.ALONG_BASELINE),
        (direction[:, 2] < 0.0, PointRefusal.ABOVE),
        (cos_off >= math.cos(MAX_OFF_BELLY), PointRefusal.OFF_BELLY),
        (np.abs(sine - np.sin(look_angle)) <= MAX_SINE_DIFFERENCE, PointRefusal.LOOK_ANGLE),
    ]


def _in_plane(angle: Array, poses: Poses) -> tuple[Array, Mask]:
    """Unit vectors of the plane at an angle from its downward direction (eq. 11)."""
    down, right, has_plane = plane_axes(poses.vels_l)
    return np.cos(angle)[:, None] * down + np.sin(angle)[:, None] * right, has_plane
