"""What every ranging sensor has: a place and a direction on the aircraft, and ranges along a flown path."""

# ruff: noqa: PLR0917 - a pose is six numbers in the field's order

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.geodesy.local import LocalFrame
from fti.geodesy.rotations import mat_from_rpy
from fti.terrain.terrain import Terrain

Array = NDArray[np.float64]


def sensor_poses(
    frame: LocalFrame,
    lat: ArrayLike,
    lon: ArrayLike,
    alt: ArrayLike,
    roll: ArrayLike,
    pitch: ArrayLike,
    heading: ArrayLike,
    lever_arm_b: ArrayLike = (0.0, 0.0, 0.0),
    mat_bs: ArrayLike | None = None,
) -> tuple[Array, Array]:
    """Positions and attitudes of a sensor in a local frame.

        x_l = x_l(P) + mat_ln mat_nb lever_arm_b,      mat_ls = mat_ln mat_nb mat_bs

    lat, lon [rad], alt [m]           : the reference point P, ellipsoid; floats or (n,), broadcast
    roll, pitch, heading [rad]        : attitude of the body; floats or (n,)
    lever_arm_b : ndarray, shape (3,) [m]  reference point P to sensor
    mat_bs      : ndarray, shape (3, 3)    sensor to body; None: the sensor's axes are the body's (looks down)
    Returns     : origins_l (n, 3) [m], mats_ls (n, 3, 3)
    Source      : Spiegel 2018, eq. 2.38-2.40 with the sign of the lever arm as in the conventions of ``fti``.
    """
    mat_lb = frame.mat_ln(lat, lon) @ mat_from_rpy(roll, pitch, heading)
    origins = frame.to_local(lat, lon, alt) + mat_lb @ np.asarray(lever_arm_b, dtype=np.float64)
    mats = mat_lb if mat_bs is None else mat_lb @ np.asarray(mat_bs, dtype=np.float64)
    origins, _ = np.broadcast_arrays(origins, mats[..., 0])
    _, mats = np.broadcast_arrays(origins[..., None], mats)
    return np.ascontiguousarray(origins.reshape(-1, 3)), np.ascontiguousarray(mats.reshape(-1, 3, 3))


def checked_poses(origins_l: ArrayLike, mats_ls: ArrayLike) -> tuple[Array, Array]:
    """The poses as the compiled kernels read them, which check nothing.  Raises ValueError for other shapes."""
    origins = np.ascontiguousarray(origins_l, dtype=np.float64)
    mats = np.ascontiguousarray(mats_ls, dtype=np.float64)
    if origins.shape != (len(origins), 3) or mats.shape != (len(origins), 3, 3):
        raise ValueError(f"poses have the shapes {origins.shape}, {mats.shape}, must be (n, 3), (n, 3, 3)")
    return origins, mats


class RangingSensor(ABC):
    """A sensor that measures the distance to a terrain; boresight along +z of its frame."""

    @abstractmethod
    def ranges(self, terrain: Terrain, origins_l: ArrayLike, mats_ls: ArrayLike) -> Array:
        """Range [m], shape (n,); NaN without a return and where the pose is NaN.

        origins_l : ndarray, shape (n, 3)     [m]  sensor in the terrain's frame: east, north, up
        mats_ls   : ndarray, shape (n, 3, 3)       sensor to that frame
        """

    def along(
        self,
        terrain: Terrain,
        lat: ArrayLike,
        lon: ArrayLike,
        alt: ArrayLike,
        roll: ArrayLike,
        pitch: ArrayLike,
        heading: ArrayLike,
        lever_arm_b: ArrayLike = (0.0, 0.0, 0.0),
        mat_bs: ArrayLike | None = None,
    ) -> Array:
        """Range [m], shape (n,), along a flown path; the arguments are those of ``sensor_poses``."""
        poses = sensor_poses(terrain.frame, lat, lon, alt, roll, pitch, heading, lever_arm_b, mat_bs)
        return self.ranges(terrain, *poses)
