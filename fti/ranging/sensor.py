"""Common interface of ranging sensors: poses, returns, validity.

A sensor is an immutable value with the parameters of a model; ``measure`` is a pure function of terrain, poses and
random numbers.  Without random numbers (``rng=None``) it returns the measurement without noise.
"""

# ruff: noqa: PLR0917 - a pose is six numbers in the field's order

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.arrays import Array, Codes
from fti.geodesy.local import LocalFrame
from fti.geodesy.rotations import mat_from_rpy, rotate
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.terrain import Terrain

Triple = Sequence[ArrayLike]  # of three numbers or arrays


class Validity(IntEnum):
    """Validity of a measurement; the first values are those of ``RayOutcome``."""

    VALID = RayOutcome.HIT
    NO_RETURN = RayOutcome.NOTHING
    OUTSIDE = RayOutcome.OUTSIDE
    HOLE = RayOutcome.HOLE
    BURIED = RayOutcome.BURIED
    UNKNOWN = RayOutcome.UNKNOWN
    TOO_NEAR = 6  #: below the minimum range of the instrument
    TOO_FAR = 7  #: beyond the instrument's range
    WEAK = 8  #: the return lies below the receiver's threshold
    AMBIGUOUS = 9  #: more than one solution fits the received signal


@dataclass(frozen=True, eq=False)
class Poses:
    """Positions, attitudes and velocities of a sensor at n times.

    origins_l : ndarray, shape (n, 3)     [m]    sensor in the terrain's frame: east, north, up
    mats_ls   : ndarray, shape (n, 3, 3)         sensor frame to that frame; +z is the boresight
    vels_l    : ndarray, shape (n, 3)     [m/s]  velocity over the ground
    Raises ValueError for other shapes.
    """

    origins_l: Array
    mats_ls: Array
    vels_l: Array

    def __post_init__(self) -> None:
        n = len(self.origins_l)
        for name, shape in (("origins_l", (n, 3)), ("mats_ls", (n, 3, 3)), ("vels_l", (n, 3))):
            value = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            if value.shape != shape:
                raise ValueError(f"{name} has the shape {value.shape}, must be {shape}")
            object.__setattr__(self, name, value)

    @classmethod
    def stationary(cls, origins_l: ArrayLike, mats_ls: ArrayLike) -> Poses:
        """Poses without velocity."""
        origins = np.asarray(origins_l, dtype=np.float64)
        return cls(origins, np.asarray(mats_ls, dtype=np.float64), np.zeros_like(origins))

    def __len__(self) -> int:
        return len(self.origins_l)


def sensor_poses(
    frame: LocalFrame,
    position: Triple,
    rpy: Triple,
    lever_arm_b: ArrayLike = (0.0, 0.0, 0.0),
    mat_bs: ArrayLike | None = None,
    vel_n: ArrayLike = (0.0, 0.0, 0.0),
) -> Poses:
    """Poses of a sensor along a flight path.

        x_l = x_l(P) + mat_ln mat_nb lever_arm_b,      mat_ls = mat_ln mat_nb mat_bs

    position    : lat, lon [rad] and alt [m] of the reference point P, ellipsoid; floats or (n,), broadcast
    rpy         : roll, pitch, heading [rad] of the body; floats or (n,)
    lever_arm_b : ndarray, shape (3,) [m]  reference point P to sensor
    mat_bs      : ndarray, shape (3, 3)    sensor to body; None: the sensor's axes are the body's (looks down)
    vel_n       : ndarray, shape (3,) or (n, 3) [m/s]  of P; the rotation of the lever arm is neglected
    Source      : Spiegel 2018, eq. 2.38-2.40 with the sign of the lever arm as in the conventions of ``fti``.
    """
    mat_ln = frame.mat_ln(*position[:2])
    mat_lb = mat_ln @ mat_from_rpy(*rpy)
    origins = frame.to_local(*position) + mat_lb @ np.asarray(lever_arm_b, dtype=np.float64)
    mats = mat_lb if mat_bs is None else mat_lb @ np.asarray(mat_bs, dtype=np.float64)
    vels = rotate(mat_ln, vel_n)
    origins, _, vels = np.broadcast_arrays(origins, mats[..., 0], vels)
    _, mats = np.broadcast_arrays(origins[..., None], mats)
    return Poses(origins.reshape(-1, 3), mats.reshape(-1, 3, 3), vels.reshape(-1, 3))


@dataclass(frozen=True, eq=False)
class Returns:
    """Measurements of a sensor: shape (n,) for one return per pose, (n, k) for k of them.

    slant_range : [m] where not valid NaN, or the value by which the instrument indicates this
    direction_s : shape (..., 3)  unit vector from the sensor to the measured point; NaN where not valid
    dispersion  : [m] standard deviation of the ranges across the beam, weighted by their power; 0 for a pencil beam
    power       : received power over transmitted power; NaN without a return
    validity    : numbers of ``Validity``
    """

    slant_range: Array
    direction_s: Array
    dispersion: Array
    power: Array
    validity: Codes

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Where there is a measurement."""
        return np.asarray(self.validity == Validity.VALID)


class RangingSensor(ABC):
    """A sensor that measures the distance to a terrain; boresight along +z of its frame."""

    @property
    def model_beam(self) -> float | None:
        """Full width of the beam in which a real receiver may measure another range [rad]; None for a pencil.

        See ``fti.ranging.receiver_error``.
        """
        return None

    @abstractmethod
    def measure(self, terrain: Terrain, poses: Poses, rng: np.random.Generator | None = None) -> Returns:
        """The measurement at each pose; reproducible with the same generator, without noise for None."""

    def predict_ranges(self, terrain: Terrain, poses: Poses) -> Array:
        """The slant range without noise at each pose [m], in the shape of ``measure``; NaN without one."""
        returns = self.measure(terrain, poses)
        return np.where(returns.valid, returns.slant_range, np.nan)
