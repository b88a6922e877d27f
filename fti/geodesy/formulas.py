"""Geodesy and rotations of one point, in plain floats: the only form of each formula.

Python runs them as they are, without numpy: drivers decode single values.  Kernels call them (``fti.kernel``); loops
over arrays are in the other modules of this package.  All angles in rad, all lengths in m.

    b   body: forward, right, down           n   navigation: north, east, down at a point
    e   earth-centred, earth-fixed           ``mat_nb`` transforms b to n; here it is its three rows

Source: NIMA TR 8350.2, third edition (constants, normal gravity); Bowring 1976 and 1985 (inverse of ``ecef``);
Titterton and Weston 2004, section 3.6 (rotations).  Checked against: pyproj, scipy and closed forms, tests/geodesy.
"""

from __future__ import annotations

import math

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Rows = tuple[Vector, Vector, Vector]
#: Posts of a cell: south-west, south-east, north-west, north-east.
Corners = tuple[float, float, float, float]

#: Semi-major axis [m] and flattening: the two defining constants of the shape.
SEMI_MAJOR = 6378137.0
FLATTENING = 1.0 / 298.257223563
SEMI_MINOR = SEMI_MAJOR * (1.0 - FLATTENING)
#: First and second eccentricity, squared.
ECC_SQ = FLATTENING * (2.0 - FLATTENING)
ECC2_SQ = ECC_SQ / (1.0 - ECC_SQ)
#: Angular rate of the Earth [rad/s].
EARTH_RATE = 7.292115e-5
#: Normal gravity at the equator [m/s^2], Somigliana's constant, free-air gradient [1/s^2].
GRAVITY_EQUATOR, SOMIGLIANA, FREE_AIR = 9.7803253359, 0.00193185265241, 3.086e-6
#: Steps of the iteration for the latitude: exact to rounding (about 1e-9 m) between 1000 km below and 50 000 km above
#: the ellipsoid.
BOWRING_STEPS = 3


def wrap_heading(angle: float) -> float:
    """The angle in [0, 2 pi); NaN for NaN."""
    wrapped = angle % math.tau
    return 0.0 if wrapped >= math.tau else wrapped  # a tiny negative angle rounds to 2 pi


def wrap_half_turn(angle: float) -> float:
    """The angle in [-pi, pi)."""
    return (angle + math.pi) % math.tau - math.pi


def bilinear(corners: Corners, u: float, v: float) -> Vector:
    """Value in a cell between four posts, and its derivatives by u and v; u east, v north from the south-west post."""
    south_west, south_east, north_west, north_east = corners
    rise_east, rise_north = south_east - south_west, north_west - south_west
    twist = north_east - north_west - rise_east
    return south_west + u * rise_east + v * (rise_north + u * twist), rise_east + v * twist, rise_north + u * twist


# ------------------------------------------------------------------------------------------------------- the ellipsoid


def radii(lat: float) -> tuple[float, float]:
    """Radii of curvature of the meridian and of the prime vertical.

    r_meridian = a (1 - e^2) / (1 - e^2 sin^2 lat)^(3/2)      r_normal = a / sqrt(1 - e^2 sin^2 lat)
    """
    root = math.sqrt(1.0 - ECC_SQ * math.sin(lat) ** 2)
    return SEMI_MAJOR * (1.0 - ECC_SQ) / root**3, SEMI_MAJOR / root


def metres_per_radian(lat: float, alt: float) -> tuple[float, float]:
    """Metres north per radian of latitude, and east per radian of longitude."""
    r_meridian, r_normal = radii(lat)
    return r_meridian + alt, (r_normal + alt) * math.cos(lat)


def ecef_from_geodetic(lat: float, lon: float, alt: float) -> Vector:
    """Position in e; alt above the ellipsoid."""
    _, r_normal = radii(lat)
    level = (r_normal + alt) * math.cos(lat)
    return level * math.cos(lon), level * math.sin(lon), (r_normal * (1.0 - ECC_SQ) + alt) * math.sin(lat)


def geodetic_from_ecef(x: float, y: float, z: float) -> Vector:
    """lat, lon and alt above the ellipsoid: the inverse of ``ecef_from_geodetic``."""
    sin_lat, cos_lat, alt = normal_at(math.hypot(x, y), z, BOWRING_STEPS)
    return math.atan2(sin_lat, cos_lat), math.atan2(y, x), alt


def normal_at(across: float, z: float, steps: int) -> Vector:
    """Sine and cosine of the latitude, and the height above the ellipsoid.

    Bowring's iteration on the reduced latitude, in sines and cosines, so that the poles need no special case.  The
    height is across cos lat + z sin lat - a sqrt(1 - e^2 sin^2 lat), without a division.

    across : distance from the axis of the Earth; z : in e; steps : of the iteration.  At the centre the latitude is 0.
    """
    up, radial, sin_lat, cos_lat = z, (1.0 - FLATTENING) * across, 0.0, 1.0
    for _ in range(steps):
        norm = math.hypot(up, radial) or 1.0
        sin_lat = z + ECC2_SQ * SEMI_MINOR * (up / norm) ** 3
        cos_lat = across - ECC_SQ * SEMI_MAJOR * (radial / norm) ** 3
        up, radial = (1.0 - FLATTENING) * sin_lat, cos_lat
    norm = math.hypot(sin_lat, cos_lat) or 1.0
    sin_lat, cos_lat = sin_lat / norm, cos_lat / norm
    return sin_lat, cos_lat, across * cos_lat + z * sin_lat - SEMI_MAJOR * math.sqrt(1.0 - ECC_SQ * sin_lat**2)


def normal_gravity(sin_lat: float, alt: float) -> float:
    """Normal gravity [m/s^2], positive, down along the ellipsoid's normal.

    g = g_equator (1 + k sin^2 lat) / sqrt(1 - e^2 sin^2 lat) - 3.086e-6 / s^2  alt
    """
    sin_sq = sin_lat * sin_lat
    return GRAVITY_EQUATOR * (1.0 + SOMIGLIANA * sin_sq) / math.sqrt(1.0 - ECC_SQ * sin_sq) - FREE_AIR * alt


# ----------------------------------------------------------------------------------------------------------- rotations


def dot(a: Vector, b: Vector) -> float:
    """The product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """The product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def mat_nb(roll: float, pitch: float, heading: float) -> Rows:
    """Attitude matrix Rz(heading) Ry(pitch) Rx(roll): roll right wing down, pitch nose up, heading from north."""
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    sh, ch = math.sin(heading), math.cos(heading)
    return (
        (cp * ch, sr * sp * ch - cr * sh, cr * sp * ch + sr * sh),
        (cp * sh, sr * sp * sh + cr * ch, cr * sp * sh - sr * ch),
        down_row(roll, pitch),
    )


def down_row(roll: float, pitch: float) -> Vector:
    """(0 0 1) mat_nb: gives the downward component of a body vector."""
    cp = math.cos(pitch)
    return -math.sin(pitch), math.sin(roll) * cp, math.cos(roll) * cp


def rpy_from_mat(rows: Rows) -> Vector:
    """Roll in (-pi, pi], pitch in [-pi/2, pi/2], heading in [0, 2 pi) of an attitude matrix: the inverse of ``mat_nb``.

    At a pitch of +-90 deg roll and heading rotate about one axis and only their sum or difference is defined.
    """
    forward, right, down = rows[2]
    heading = wrap_heading(math.atan2(rows[1][0], rows[0][0]))
    return math.atan2(right, down), math.atan2(-forward, math.hypot(right, down)), heading


def mat_en(lat: float, lon: float) -> Rows:
    """Navigation to earth frame: the columns are the unit vectors north, east and down at the point."""
    sin_lat, cos_lat, sin_lon, cos_lon = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
    return (
        (-sin_lat * cos_lon, -sin_lon, -cos_lat * cos_lon),
        (-sin_lat * sin_lon, cos_lon, -cos_lat * sin_lon),
        (cos_lat, 0.0, -sin_lat),
    )


def rotate(rows: Rows, v: Vector) -> Vector:
    """The product of a matrix and a vector."""
    return dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)


def rotate_back(rows: Rows, v: Vector) -> Vector:
    """The product of the transposed matrix and a vector."""
    (a, b, c), (d, e, f), (g, h, i) = rows
    return a * v[0] + d * v[1] + g * v[2], b * v[0] + e * v[1] + h * v[2], c * v[0] + f * v[1] + i * v[2]


def mat_from_quat(w: float, x: float, y: float, z: float) -> Rows:
    """Rotation matrix of a unit quaternion, w first."""
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


def quat_from_mat(rows: Rows) -> Quaternion:
    """Unit quaternion of a rotation matrix, of either sign.

    The largest of the four components is found from the diagonal and divides the others (Shepperd 1978).
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rows
    w, x, y, z = 1.0 + xx + yy + zz, zy - yz, xz - zx, yx - xy  # four times the products with the first component
    best = w
    if 1.0 + xx - yy - zz > best:
        best = 1.0 + xx - yy - zz
        w, x, y, z = zy - yz, best, xy + yx, xz + zx
    if 1.0 - xx + yy - zz > best:
        best = 1.0 - xx + yy - zz
        w, x, y, z = xz - zx, xy + yx, best, yz + zy
    if 1.0 - xx - yy + zz > best:
        best = 1.0 - xx - yy + zz
        w, x, y, z = yx - xy, xz + zx, yz + zy, best
    return normalised(w, x, y, z)


def quat_from_turn(x: float, y: float, z: float) -> Quaternion:
    """Unit quaternion of a rotation vector [rad]."""
    half = 0.5 * math.sqrt(x * x + y * y + z * z)
    scale = 0.5 * (math.sin(half) / half if half > 1e-8 else 1.0)
    return math.cos(half), scale * x, scale * y, scale * z


def quat_product(p: Quaternion, q: Quaternion) -> Quaternion:
    """Hamilton's product p q: first the rotation q, then p."""
    w, x, y, z = p
    a, b, c, d = q
    return (
        w * a - x * b - y * c - z * d,
        w * b + x * a + y * d - z * c,
        w * c - x * d + y * a + z * b,
        w * d + x * c - y * b + z * a,
    )


def normalised(w: float, x: float, y: float, z: float) -> Quaternion:
    """The same rotation as a quaternion of unit length."""
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    return w / norm, x / norm, y / norm, z / norm


def rotate_by_quat(q: Quaternion, v: Vector) -> Vector:
    """A vector rotated by a quaternion of any length: v + 2 u x (u x v + w v) / |q|^2 with the vector part u."""
    w, u = q[0], (q[1], q[2], q[3])
    a, b, c = cross(u, v)
    i, j, k = cross(u, (a + w * v[0], b + w * v[1], c + w * v[2]))
    scale = 2.0 / (w * w + dot(u, u))
    return v[0] + scale * i, v[1] + scale * j, v[2] + scale * k
