"""The estimate at one time, for aiding and for output: latitude, longitude, north, east, down, angles."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from fti.arrays import Array
from fti.geodesy.quaternions import quat_from_mat
from fti.geodesy.rotations import mat_en, mat_from_rpy, rpy_from_mat
from fti.geodesy.wgs84 import ecef_from_geodetic
from fti.nav.filter import kernels
from fti.nav.filter.error_states import FilterModel
from fti.nav.filter.kernels import EXTRAS
from fti.nav.inertial.ins_error_model import ACCEL, POS, TURN, VEL

#: Minimum cosine of the pitch for the sigmas of roll and heading.
_UPRIGHT = 1e-3
#: Time in which a velocity error causes the position error of a readmitted source [s].
INFLATION_S = 30.0


@dataclass(eq=False)  # not frozen: 1000 are created per second
class Estimate:
    """State and covariance of the filter at t_ns.  Never modified.

    y     : ndarray, shape (16 + k,)  position, velocity, quaternion e; accelerometer and gyro bias b; extras
    P     : ndarray, shape (n, n)     covariance of the errors, ``fti.nav.filter.error_states``
    imu   : ndarray, shape (6,)       accel_b [m/s^2] and gyro_b [rad/s] measured at t_ns
    model : meaning of the columns
    """

    t_ns: int
    y: Array
    P: Array
    imu: Array
    model: FilterModel

    @functools.cached_property
    def geodetic(self) -> tuple[float, float, float]:
        """lat, lon [rad], alt above the ellipsoid [m] of P."""
        return kernels.geodetic(self.y)

    @functools.cached_property
    def mat_en(self) -> Array:
        """North, east, down here to e."""
        return kernels.axes(*self.geodetic[:2])

    @functools.cached_property
    def mat_eb(self) -> Array:
        """Body to e."""
        return kernels.matrix(self.y)

    @functools.cached_property
    def mat_nb(self) -> Array:
        """Body to north, east, down."""
        return np.asarray(self.mat_en.T @ self.mat_eb)

    @property
    def vel_n(self) -> Array:
        """North, east, down [m/s]."""
        return np.asarray(self.mat_en.T @ self.y[3:6])

    def drift(self, extra: str) -> float:
        """A slow error of a source [m]; 0 if it is not a state."""
        column = self.model.columns.get(extra)
        return 0.0 if column is None else float(self.y[EXTRAS + column - self.model.base])

    def drift_sd(self, extra: str) -> float | None:
        """Its sigma [m]; None if it is not a state."""
        column = self.model.columns.get(extra)
        return None if column is None else math.sqrt(max(0.0, float(self.P[column, column])))

    @functools.cached_property
    def cov_n(self) -> Array:
        """Covariance of position [m], velocity [m/s] and turn [rad] in north, east, down: shape (9, 9)."""
        mats = np.zeros((9, 9))
        for at in (POS, VEL, TURN):
            mats[at : at + 3, at : at + 3] = self.mat_en
        return np.asarray(mats.T @ self.P[:ACCEL, :ACCEL] @ mats)

    @functools.cached_property
    def sd_n(self) -> Array:
        """Square roots of its diagonal, shape (9,)."""
        return np.sqrt(np.maximum(np.diag(self.cov_n), 0.0))

    @functools.cached_property
    def rpy(self) -> tuple[float, float, float]:
        """Roll, pitch, heading [rad]."""
        roll, pitch, heading = rpy_from_mat(self.mat_nb)
        return float(roll), float(pitch), float(heading)

    @functools.cached_property
    def rpy_sd(self) -> tuple[float, float, float]:
        """Sigma of roll, pitch and heading [rad]: rotations about three axes that are not orthogonal.

        d roll = (ch n + sh e) / cp    d pitch = ch e - sh n    d heading = d + sp d roll
        """
        _, pitch, heading = self.rpy
        sh, ch, sp, cp = math.sin(heading), math.cos(heading), math.sin(pitch), max(math.cos(pitch), _UPRIGHT)
        rows = np.array([[ch / cp, sh / cp, 0.0], [-sh, ch, 0.0], [sp * ch / cp, sp * sh / cp, 1.0]])
        variances = np.einsum("ij,jk,ik->i", rows, self.cov_n[TURN:, TURN:], rows)
        roll, pitch_sd, turn = (min(math.pi, math.sqrt(max(0.0, float(v)))) for v in variances)
        return roll, pitch_sd, turn


@dataclass(frozen=True, slots=True)
class InitialState:
    """Initial state: P at lat, lon [rad], alt [m], vel_n [m/s], roll, pitch, heading [rad]; one sigma each.

    pos_sd, vel_sd, turn_sd : north, east, down [m, m/s, rad about those axes]
    """

    lat: float
    lon: float
    alt: float
    vel_n: tuple[float, float, float]
    roll: float
    pitch: float
    heading: float
    pos_sd: tuple[float, float, float]
    vel_sd: tuple[float, float, float]
    turn_sd: tuple[float, float, float]

    def estimate(self, t_ns: int, imu: Array, model: FilterModel) -> Estimate:
        """The first estimate; biases and extras are zero."""
        to_e = mat_en(self.lat, self.lon)
        quat = quat_from_mat(to_e @ mat_from_rpy(self.roll, self.pitch, self.heading))
        slow = np.zeros(6 + len(model.extras))
        y = np.concatenate((ecef_from_geodetic(self.lat, self.lon, self.alt), to_e @ self.vel_n, quat, slow))
        return Estimate(t_ns, y, self.covariance(model), imu, model)

    def covariance(self, model: FilterModel) -> Array:
        """P0."""
        to_e, P = mat_en(self.lat, self.lon), np.zeros((model.size, model.size))
        for at, sd in ((POS, self.pos_sd), (VEL, self.vel_sd), (TURN, self.turn_sd)):
            P[at : at + 3, at : at + 3] = to_e @ np.diag(np.square(sd)) @ to_e.T
        slow = [model.unit.accel.bias_sd] * 3 + [model.unit.gyro.bias_sd] * 3 if model.biased else []
        slow += [drift.first for drift in model.extras.values()]
        np.fill_diagonal(P[ACCEL:, ACCEL:], np.square(slow))
        return P


def inflate_covariance(estimate: Estimate, disagreement: float) -> Estimate:
    """The estimate with variances enlarged by a position error [m] and the velocity that causes it in 30 s."""
    if disagreement <= 0.0:
        return estimate
    P = estimate.P.copy()
    P[POS:VEL, POS:VEL] += disagreement**2 * np.eye(3)
    P[VEL:TURN, VEL:TURN] += (disagreement / INFLATION_S) ** 2 * np.eye(3)
    return Estimate(estimate.t_ns, estimate.y, P, estimate.imu, estimate.model)
