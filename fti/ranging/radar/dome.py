"""Rays of equal spacing over a half sphere: a geodesic dome, each ray with its solid angle.

An icosahedron with a corner on the boresight, two rings of five corners 72 deg apart, one rotated by 36 deg against the
other, and the opposite corner.  Each face is divided into n^2 triangles and their corners are projected on the sphere:

    N_tr = 20 n^2,    N_p = 10 n^2 + 2,    of an even order n on the half dome with its equator: 5 n^2 + 5 n / 2 + 1

which is 751 rays at order 12, 2051 at order 20 and 8101 at order 40.  The triangles are not equal on the sphere: those
at the middle of a face are up to twice as large as those at its corners.  A ray represents a third of each adjacent
triangle, so a sum over rays is the integral of a function that is linear between them.

Source: Spiegel 2018, section 2.2.5, eq. 2.65, 2.66; solid angle of a triangle: van Oosterom and Strackee 1983.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array

Indices = NDArray[np.int64]

#: A ray within this distance of the equator is on it: rounding, 1e7 times less than the spacing of 10^6 rays.
_ON_EQUATOR = 1e-10


@dataclass(frozen=True, eq=False)
class Sphere:
    """A refined icosahedron.  rays : (N_p, 3) unit vectors; triangles : (N_tr, 3) rows of ``rays``, counter-clockwise
    from outside; solid_angles : (N_p,) [sr], 4 pi in all.
    """

    rays: Array
    triangles: Indices
    solid_angles: Array


@dataclass(frozen=True, eq=False)
class Dome:
    """The half of a sphere in front of the antenna.

    rays_s       : ndarray, shape (n, 3)        unit vectors in the sensor frame, boresight +z, nearest to it first
    solid_angles : ndarray, shape (n,)   [sr]   2 pi in all; a ray on the equator has half of its own
    """

    rays_s: Array
    solid_angles: Array

    def within(self, angle: float) -> Dome:
        """The rays at most ``angle`` [rad] off the boresight."""
        count = int(np.count_nonzero(self.rays_s[:, 2] >= np.cos(angle)))
        return Dome(self.rays_s[:count], self.solid_angles[:count])

    def __len__(self) -> int:
        return len(self.rays_s)


def icosahedron() -> tuple[Array, Indices]:
    """Corners (12, 3), the first on +z and the last on -z, and faces (20, 3), counter-clockwise from outside."""
    step = np.radians(72.0)
    upper = step * np.arange(5)
    azimuth = np.concatenate((upper, upper + np.radians(36.0)))
    height = np.repeat([1.0, -1.0], 5) / np.sqrt(5.0)
    radius = 2.0 / np.sqrt(5.0)
    rings = np.stack((radius * np.cos(azimuth), radius * np.sin(azimuth), height), axis=-1)
    corners = np.concatenate(([[0.0, 0.0, 1.0]], rings, [[0.0, 0.0, -1.0]]))
    here, following = np.arange(5), (np.arange(5) + 1) % 5
    up, next_up, down, next_down = 1 + here, 1 + following, 6 + here, 6 + following
    top, bottom = np.zeros(5, dtype=np.int64), np.full(5, 11)
    corners_of = [(top, up, next_up), (up, down, next_up), (next_up, down, next_down), (bottom, next_down, down)]
    return corners, np.concatenate([np.stack(face, axis=-1) for face in corners_of]).astype(np.int64)


def _face_lattice(order: int) -> tuple[Indices, Indices]:
    """Corner weights (m, 3) of the points of one face, each row of sum ``order``, and its triangles (order^2, 3)."""
    i, j = (part.ravel() for part in np.meshgrid(np.arange(order + 1), np.arange(order + 1), indexing="ij"))
    inside = i + j <= order
    weights = np.stack((order - i - j, i, j), axis=-1)[inside]
    place = np.cumsum(inside) - 1
    here = i * (order + 1) + j
    upright, turned = i + j <= order - 1, i + j <= order - 2
    first = np.stack((here, here + order + 1, here + 1), axis=-1)[upright]
    second = np.stack((here + 1, here + order + 1, here + order + 2), axis=-1)[turned]
    return weights, place[np.concatenate((first, second))]


def triangle_solid_angles(a: Array, b: Array, c: Array) -> Array:
    """Solid angle [sr] of triangles of unit vectors (n, 3), positive when counter-clockwise from outside."""
    volume = np.sum(a * np.cross(b, c), axis=-1)
    return np.asarray(2.0 * np.arctan2(volume, 1.0 + np.sum(a * b + b * c + c * a, axis=-1)))


def _freeze(array: Array) -> Array:
    """The array, read-only, because it is shared."""
    array.setflags(write=False)
    return array


@functools.cache
def sphere(order: int) -> Sphere:
    """The complete geodesic sphere of an order.  Points shared by faces are identified in integers.

    Raises ValueError for an order that is not a whole number or below 1.
    """
    if int(order) != order or order < 1:
        raise ValueError(f"the order of a geodesic dome is {order}, must be a whole number of at least 1")
    order = int(order)
    corners, faces = icosahedron()
    weights, lattice = _face_lattice(order)
    shares = np.zeros((20, len(weights), 12), dtype=np.int16)
    np.put_along_axis(shares, np.broadcast_to(faces[:, None, :], (20, len(weights), 3)), weights[None], axis=2)
    unique, number = np.unique(shares.reshape(-1, 12), axis=0, return_inverse=True)
    points = unique @ corners
    rays = points / np.linalg.norm(points, axis=-1, keepdims=True)
    triangles = number.reshape(20, -1)[:, lattice].reshape(-1, 3)
    areas = triangle_solid_angles(*(rays[triangles[:, k]] for k in range(3)))
    solid_angles = np.bincount(triangles.ravel(), np.repeat(areas / 3.0, 3)).astype(np.float64)
    return Sphere(_freeze(rays), triangles, _freeze(solid_angles))


@functools.cache
def _upright(order: int) -> Dome:
    return half_dome(order, np.eye(3))


def half_dome(order: int, turn: Array | None = None) -> Dome:
    """The rays in front of the antenna.

    order : 12, 20, 40 give 751, 2051, 8101 rays
    turn  : ndarray, shape (3, 3), a rotation of the sphere before it is halved, for the same beam by other rays: an
            independent reference.  The solid angles are still 2 pi in total, because the sphere has point symmetry; no
            ray lies on the equator then.
    Raises ValueError for an order that is not a whole number or below 1, and a turn that is not a rotation.
    """
    if turn is None:
        return _upright(order)
    square = turn.shape == (3, 3) and np.allclose(turn @ turn.T, np.eye(3), rtol=0.0, atol=1e-9)
    if not (square and np.linalg.det(turn) > 0.0):
        raise ValueError(f"turn is {turn.tolist()}, must be a rotation matrix")
    whole = sphere(order)
    rays = whole.rays @ turn.T
    part = np.where(rays[:, 2] > _ON_EQUATOR, 1.0, np.where(rays[:, 2] >= -_ON_EQUATOR, 0.5, 0.0))
    inward = np.argsort(-rays[:, 2], kind="stable")[: np.count_nonzero(part)]
    return Dome(_freeze(rays[inward]), _freeze((part * whole.solid_angles)[inward]))


def random_turn(rng: np.random.Generator) -> Array:
    """A uniformly distributed rotation matrix (3, 3), from a quaternion of normal numbers.  Source: Muller 1959."""
    w, x, y, z = (quaternion := rng.standard_normal(4)) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
