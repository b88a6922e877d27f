"""The formal description of one range measurement: from the beam to the ground and back, frame by frame.

    m   measurement: origin at the sensor, +z along the measured direction      d_m = (0 0 d)^T
    s   sensor: origin at the sensor, axes of its case, boresight +z            d_s = mat_sm d_m              (2.37)
    b   body: origin at the reference point P of the aircraft                   d_b = mat_bs d_s + lever_arm_b (2.38)
    n   north, east, down, origin at P                                          d_n = mat_nb d_b              (2.39)
    e   earth-centred, earth-fixed                             x_e(M) = x_e(P) + mat_en d_n                   (2.40)

d_s leads from the sensor to the point M on the ground; d_b and d_n lead from P to M.  ``lever_arm_b`` leads from P to
the sensor and is added: the printed minus puts the point of a sensor 2 m below P 4 m too high.

Every vector has the shape (..., 3) [m], every matrix (..., 3, 3); leading shapes broadcast, and NaN stays NaN.
Source: Spiegel 2018, section 2.1.6, as corrected in docs/errata.md.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fti.arrays import Array
from fti.geodesy.rotations import mat_en, rotate
from fti.geodesy.wgs84 import ecef_from_geodetic, geodetic_from_ecef, metres_per_radian


def _rotate_back(mat: ArrayLike, vec: ArrayLike) -> Array:
    return rotate(np.swapaxes(np.asarray(mat, np.float64), -1, -2), vec)


def mat_sm(direction_s: ArrayLike) -> Array:
    """Measurement frame to sensor frame: +z of m is ``direction_s``, a unit vector.

    The rotation about the beam is arbitrary; this frame has the smallest total rotation, and for beams that point
    backwards (z < 0) it is orthonormal as well.
    Source: Duff and others 2017, "Building an Orthonormal Basis, Revisited".  Eq. 2.37 needs the last column only.
    """
    x, y, z = np.moveaxis(np.asarray(direction_s, dtype=np.float64), -1, 0)
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    first = np.stack((1.0 + sign * x * x * a, sign * x * y * a, -sign * x), axis=-1)
    second = np.stack((x * y * a, sign + y * y * a, -y), axis=-1)
    return np.stack((first, second, np.stack((x, y, z), axis=-1)), axis=-1)


def in_sensor(slant_range: ArrayLike, mat_sm: ArrayLike) -> Array:
    """d_s = mat_sm (0 0 d)^T, sensor to ground; slant_range : (...) [m].  Eq. 2.37."""
    return np.asarray(np.asarray(slant_range, np.float64)[..., None] * np.asarray(mat_sm, np.float64)[..., 2])


def in_body(d_s: ArrayLike, mat_bs: ArrayLike, lever_arm_b: ArrayLike) -> Array:
    """d_b = mat_bs d_s + lever_arm_b, P to ground.  Eq. 2.38 with the sign of the lever arm corrected."""
    return rotate(mat_bs, d_s) + np.asarray(lever_arm_b, dtype=np.float64)


def in_nav(d_b: ArrayLike, mat_nb: ArrayLike) -> Array:
    """d_n = mat_nb d_b, P to ground, north, east, down; its last component is the height of P above M.  Eq. 2.39."""
    return rotate(mat_nb, d_b)


def point_e(lat: ArrayLike, lon: ArrayLike, alt: ArrayLike, d_n: ArrayLike) -> Array:
    """x_e(M) = x_e(P) + mat_en d_n: the point on the ground in the earth frame [m].  Eq. 2.40.

    lat, lon [rad], alt above the ellipsoid [m] : of P, floats or (...)
    """
    return ecef_from_geodetic(lat, lon, alt) + rotate(mat_en(lat, lon), d_n)


def metres_per_geodetic(lat: ArrayLike, alt: ArrayLike) -> Array:
    """Diagonal of D, shape (..., 3): metres north, east, down per radian of lat, radian of lon, metre of alt.

    D = diag(r_meridian + alt, (r_normal + alt) cos lat, -1)                                              (2.41)
    """
    return np.stack(np.broadcast_arrays(*metres_per_radian(lat, alt), -1.0), axis=-1)


def point_geodetic(lat: ArrayLike, lon: ArrayLike, alt: ArrayLike, d_n: ArrayLike) -> tuple[Array, Array, Array]:
    """lat, lon [rad] and alt above the ellipsoid [m] of the point on the ground: 2.40, exact to rounding.

    lat, lon, alt : of P, floats or (...);  d_n : (..., 3) [m]
    """
    return geodetic_from_ecef(point_e(lat, lon, alt, d_n))


def point_geodetic_linear(lat: ArrayLike, lon: ArrayLike, alt: ArrayLike, d_n: ArrayLike) -> tuple[Array, Array, Array]:
    """The same by lambda(M) = lambda(P) + D^-1 d_n: eq. 2.42 without its R_en, since D^-1 acts on an n-frame vector.

    Errors for a point at the horizontal distance s of P (north or east), with R = 6.37e6 m:
        height     s^2 / 2R too low:                        0.08 m at 1 km, 0.79 m at 3.2 km, 7.8 m at 10 km
        north      e^2 tan(lat) / 2R too far, e distance east: 0.08 m at 1 km and 45 deg
        east       e n tan(lat) / R too near, n distance north: 0.16 m at 1 km each and 45 deg
        both       a share down / R of the distance too near: 0.16 m at 1 km horizontally, 1 km below
    Longitude is not wrapped to +-pi.  NaN where the axis of the Earth is not farther than the point, because longitude
    is not linear there.  Use it for Jacobians and short distances.
    """
    way, metres = np.asarray(d_n, dtype=np.float64), metres_per_geodetic(lat, alt)
    off_axis = np.hypot(way[..., 0], way[..., 1]) < metres[..., 1]
    step = np.where(off_axis[..., None], way, np.nan) / metres
    at = (np.asarray(lat, np.float64), np.asarray(lon, np.float64), np.asarray(alt, np.float64))
    return at[0] + step[..., 0], at[1] + step[..., 1], at[2] + step[..., 2]


def topographic_height(alt: ArrayLike, d_n: ArrayLike) -> Array:
    """Height of M above the ellipsoid [m] from that of P: h(M) = h(P) - (0 0 1) d_n.  Eq. 2.43 to 2.45.

    Along the plumb line of P, so s^2 / 2R too low at a horizontal distance s; ``point_geodetic`` is exact.
    """
    return np.asarray(np.asarray(alt, np.float64) - np.asarray(d_n, np.float64)[..., 2])


def from_point_e(x_e: ArrayLike, lat: ArrayLike, lon: ArrayLike, alt: ArrayLike) -> Array:
    """d_n of a point in the earth frame: the inverse of ``point_e``; float64 resolves 1e-9 m there."""
    return _rotate_back(mat_en(lat, lon), np.asarray(x_e, np.float64) - ecef_from_geodetic(lat, lon, alt))


def in_measurement(
    d_n: ArrayLike, mat_nb: ArrayLike, mat_bs: ArrayLike, mat_sm: ArrayLike, lever_arm_b: ArrayLike
) -> Array:
    """d_m = mat_ms mat_sb (mat_bn d_n - lever_arm_b), sensor to ground in the frame m; d_n as from ``from_point_e``.

    (0 0 d)^T when the point lies on the measured direction; x and y are the offset from it.
    Source: eq. 2.46 with the sign of the lever arm corrected: the inverse of 2.37 to 2.39.
    """
    d_s = _rotate_back(mat_bs, _rotate_back(mat_nb, d_n) - np.asarray(lever_arm_b, dtype=np.float64))
    return _rotate_back(mat_sm, d_s)


def range_over_level(
    height_p: ArrayLike, mat_nb: ArrayLike, mat_bs: ArrayLike, mat_sm: ArrayLike, lever_arm_b: ArrayLike
) -> Array:
    """Slant range to level ground ``height_p`` = h(P) - h(M) [m] below P; NaN where the beam does not reach it.

        d = (h(P) - h(M) - (0 0 1) mat_nb lever_arm_b) / ((0 0 1) mat_nb mat_bs mat_sm (0 0 1)^T)

    Roll 20, pitch 5 deg, 300 m: 320.5 m.  NaN: the beam is level or looks up, or the sensor is under the ground.
    Source: eq. 2.47; its sign and its projection (a product with the cosine, where a division belongs) corrected.
    """
    down = in_nav(rotate(mat_bs, np.asarray(mat_sm, np.float64)[..., 2]), mat_nb)[..., 2]
    below = np.asarray(height_p, np.float64) - in_nav(lever_arm_b, mat_nb)[..., 2]
    meets = (down > 0.0) & (below >= 0.0)
    return np.where(meets, below / np.where(meets, down, 1.0), np.nan)
