"""Converts a range at the sensor to the height of the reference point P over the ground straight below it.

    range, beam    known ground: ``height_over_ground``, with the predicted range of a pencil or of the sensor's own
                   beam (section 3.3.1.2, 3.3.1.3)
    attitude       unknown ground: ``height_at_p``, over ground that is assumed to be level (3.3.1.1)

A laser uses range compensation, a radar beam compensation; range compensation on the boresight would make a radar
worse.  Attitude compensation with the full tilt is for a laser: the leading edge of a radar is short already, so only
the excess of the tilt over half the beam is used.  The full tilt makes a radar worse up to a bank of about twice the
full width of its beam, 20 deg for 10 deg, 60 deg for 30 deg, and at any bank for 45 deg and more (``fti study
compensation``).

The reference point is P for any lever arm of the sensor.  Navigation refers to P; ``Point`` is in each output.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from msgspec import Struct
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.config import Device, Vector
from fti.geodesy.formulas import dot, down_row, mat_nb, rotate
from fti.nav.source_interpolation import ATTITUDE_SD_UNKNOWN

if TYPE_CHECKING:
    from fti.nav.altimetry.range_prediction import Prediction

#: Errors of the tilt are evaluated up to this angle off the vertical [rad].
MAX_TILT = math.radians(60.0)


class Mounting(Struct, frozen=True, gc=False):
    """The mounting of a range sensor in the aircraft.

    boresight_b : third column of mat_bs, the direction of the beam axis in the body frame, unit
    lever_arm_b : reference point P to sensor, body frame [m]
    half_beam   : half the width of a radar's beam [rad]; 0 for a laser
    """

    boresight_b: Vector
    lever_arm_b: Vector
    half_beam: float


class CompensatedHeight(Struct, frozen=True, gc=False):
    """A height above ground at P [m] and its one sigma [m]; sd is None when the sensor's is unknown."""

    height_agl: float
    sd: float | None


def mounting_of(device: Device) -> Mounting:
    """The configured mounting.  Raises ValueError when the device is not an altimeter."""
    if device.altimeter is None:
        raise ValueError(f"device {device.name!r} has no [device.altimeter] table")
    half_beam = math.radians(device.altimeter.beam_deg) / 2 if device.altimeter.kind == "radar" else 0.0
    return Mounting(boresight(device.rpy_bs_deg), device.lever_arm_b, half_beam)


def boresight(rpy_bs_deg: Vector) -> Vector:
    """The beam axis in the body frame: mat_bs (0 0 1)^T for the mounting angles roll, pitch, yaw [deg]."""
    return rotate(mat_nb(*(math.radians(a) for a in rpy_bs_deg)), (0.0, 0.0, 1.0))


def lever_arm_drop(arm_b: Vector, roll: float, pitch: float) -> float:
    """Distance of the end of a lever arm from P [m] below P: (0 0 1) mat_nb arm_b."""
    return dot(down_row(roll, pitch), arm_b)


def tilt_of(mounting: Mounting, roll: float, pitch: float) -> float:
    """Angle between the beam axis and the vertical [rad], 0..pi."""
    return math.acos(max(-1.0, min(1.0, dot(down_row(roll, pitch), mounting.boresight_b))))


def height_at_p(
    slant_range: float,
    roll: float,
    pitch: float,
    mounting: Mounting,
    *,
    range_sd: float | None = None,
    roll_sd: float | None = None,
    pitch_sd: float | None = None,
) -> CompensatedHeight:
    """Height of P above level ground from a range, compensated for attitude, mounting and lever arm.

        h_agl(P) = d cos(max(0, tilt - half_beam)) + (0 0 1) mat_nb lever_arm_b

    Laser (half_beam 0): the full projection (0 0 1) mat_nb (mat_bs d_s + lever_arm_b), which is eq. 2.39 as
    ``fti.ranging.frames`` has it, in plain floats for the live path.  Radar: a leading-edge receiver reports the
    nearest return; as long as the vertical lies inside the beam that is the height itself, and only the lever arm is
    compensated; beyond, the nearest return lies at the excess angle.  Never compensated for terrain.

    slant_range : [m], >= 0, first return     roll, pitch : [rad]     *_sd : one sigma [m, rad]
    Returns     : height of P [m], positive up, and its sigma: Var = (dh/dd sd_d)^2 + (dh/droll sd_roll)^2
                  + (dh/dpitch sd_pitch)^2, with 0.5 deg where the attitude source states no sigma
    Raises ValueError where the range is negative.
    Source: Spiegel 2018, eq. 2.38, 2.47, 3.30, with the signs of docs/errata.md; checked against closed forms
    (tests/nav/test_compensation.py: roll 20, pitch 5 deg, 300 m is a slant range of 320.5 m).
    """
    if slant_range < 0.0:
        raise ValueError(f"slant_range = {slant_range} m: must be >= 0")
    tilt = tilt_of(mounting, roll, pitch)
    excess = max(0.0, tilt - mounting.half_beam)
    height = slant_range * math.cos(excess) + lever_arm_drop(mounting.lever_arm_b, roll, pitch)
    if range_sd is None:
        return CompensatedHeight(height, None)
    by_roll, by_pitch = _attitude_gradient(slant_range, roll, pitch, tilt, mounting)
    sd_r = ATTITUDE_SD_UNKNOWN if roll_sd is None else roll_sd
    sd_p = ATTITUDE_SD_UNKNOWN if pitch_sd is None else pitch_sd
    return CompensatedHeight(height, math.hypot(math.cos(excess) * range_sd, by_roll * sd_r, by_pitch * sd_p))


def nonlinear_tilt_sd(slant_range: float, roll: float, pitch: float, mounting: Mounting, tilt_sd: float) -> float:
    """One sigma [m] of a range over level ground by the tilt, less its linear part (root-sum-square).

    The total is a third of the change by three sigmas of the tilt: for a level laser the linear part is zero, and 9 deg
    for 3 sigma are 1.2 % of the range.  Up to 0.5 deg, typical of valid attitudes, it is neglected: 0.01 %.

    slant_range : at this attitude [m]
    """
    if tilt_sd <= ATTITUDE_SD_UNKNOWN:
        return 0.0
    tilt, half_beam = tilt_of(mounting, roll, pitch), mounting.half_beam
    excess, farther = (min(max(0.0, angle - half_beam), MAX_TILT) for angle in (tilt, tilt + 3.0 * tilt_sd))
    whole = slant_range * (math.cos(excess) / math.cos(farther) - 1.0) / 3.0
    linear = slant_range * math.tan(excess) * tilt_sd
    return math.sqrt(whole**2 - linear**2) if whole > linear else 0.0


def _attitude_gradient(
    slant_range: float, roll: float, pitch: float, tilt: float, mounting: Mounting
) -> tuple[float, float]:
    """dh/droll and dh/dpitch [m/rad]."""
    cp, sp, sr, cr = math.cos(pitch), math.sin(pitch), math.sin(roll), math.cos(roll)
    rows = ((0.0, cr * cp, -sr * cp), (-cp, -sr * sp, -cr * sp))  # derivatives of down_row by roll and by pitch
    excess = tilt - mounting.half_beam
    beam = slant_range * math.sin(excess) / math.sin(tilt) if excess > 0.0 and tilt > 0.0 else 0.0
    by_roll, by_pitch = (beam * dot(row, mounting.boresight_b) + dot(row, mounting.lever_arm_b) for row in rows)
    return by_roll, by_pitch


# ------------------------------------------------------------------------------------------------- over known ground


def height_over_ground(slant_range: ArrayLike, prediction: Prediction) -> Array:
    """Height of P over the ground straight below it, from a measured and a predicted range.

        h_agl(P) = h(P) - h(N) + (d - d_predicted) cos(theta)

    slant_range : measured, float or (n,) [m]
    prediction  : at the navigated pose.  A pencil gives range compensation, eq. 3.32; the sensor's beam gives beam
                  compensation
    Returns     : (n,) [m]; NaN where the range or the prediction is NaN
    Errors      : ``fti.nav.altimetry.variance.height_variance``.  An error of h(P) cancels over parallel ground; one of
                  the sensor model enters with cos(theta)
    Source      : Spiegel 2018, eq. 3.33 with h(M) := h(P) - d_predicted cos(theta) (docs/errata.md).  The printed form
                  combines a height of M from an averaged direction with the range of another point; with exact surface
                  and beam its error is metres, that of this form is the noise.
    """
    return np.asarray(prediction.height_p + (np.asarray(slant_range) - prediction.slant_range) * prediction.cosine)
