"""Predicts the range of an altimeter at a pose, and the point on the ground that gives it.

    P   reference point of the aircraft           N   the ground on the plumb line of P
    S   sensor, at lever_arm_b from P             M   the ground that gives the range

    u   unit vector from S to M                   n   unit normal of the ground at M, into the ground
    theta  angle between u and the plumb line     incidence = acos(n . u)

The beam is that of the sensor model: a pencil (``Laser``), the nearest return (``NearestReturn``), or an antenna with
its receiver (``RadarAltimeter``).  The last two return the ray that gives the range, so M lies on an actual ray: an
averaged direction (eq. 3.33) is not a ray, and its intersection with the ground is not the measured point.

Heights count along the plumb line of P, and so do N and theta: at 6 km from the origin of the terrain's frame it leans
by 0.9 mrad against the up axis of that frame.  From P to M, 1 km apart, it turns by 0.16 mrad: 0.08 m, neglected.

Source: Spiegel 2018, sections 2.2.4 to 2.2.6 and 3.3.1.3 (simulation in flight); docs/errata.md, 3.33.
"""

# ruff: noqa: PLR0917 - a pose is six numbers in the field's order

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.arrays import Array, Codes
from fti.geodesy.local import MAT_ENU_NED
from fti.geodesy.rotations import mat_from_rpy, rotate
from fti.nav.altimetry.scalar_kernels import Look, look_all, spread
from fti.ranging.nearest import NearestReturn, directions, ring_angles
from fti.ranging.receiver_error import PossibleReceivers
from fti.ranging.sensor import Poses, RangingSensor, Returns, Validity
from fti.terrain.terrain import Terrain

#: Share of half the width from which a ray lies at the edge of its beam.
AT_EDGE = 0.999


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predictions of n poses; NaN where ``validity`` is not VALID; values at N are NaN where the ground is unknown.

    slant_range : d, S to M as the instrument would measure it without noise, shape (n,) [m]
    height_p    : h(P) - h(N) (n,) [m]; negative where P lies under the surface of the model
    lever_n     : P to S (n, 3), north, east, down [m]
    direction_n : u (n, 3), north, east, down; its last component is cos(theta)
    normal_n    : n (n, 3), north, east, down; the last component positive
    nadir_n     : normal of the ground at N (n, 3), north, east, down; unknown like ``height_p``
    incidence   : angle between u and n (n,) [rad]
    dispersion  : standard deviation of the ranges across the beam (n,) [m]; 0 of a pencil.  Weighted by power if the
                  model has it
    place_l     : P (n, 3), east, north, up of the terrain's frame [m];  point_l : M in the same frame
    mats_ln     : (n, 3, 3), north, east, down at P to that frame
    validity    : numbers of ``fti.ranging.sensor.Validity`` (n,)
    model_sd    : one sigma of the range by the difference of the real receiver from the model (n,) [m]; 0 of a pencil.
                  See ``fti.ranging.receiver_error``
    at_edge     : whether the ray lies at the edge of a beam that measures its nearest return (n,): the ground beyond is
                  nearer, and the ray turns with the aircraft
    """

    slant_range: Array
    height_p: Array
    lever_n: Array
    direction_n: Array
    normal_n: Array
    nadir_n: Array
    incidence: Array
    dispersion: Array
    place_l: Array
    point_l: Array
    mats_ln: Array
    validity: Codes
    model_sd: Array
    at_edge: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.slant_range)

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Where there is a prediction."""
        return np.asarray(self.validity == Validity.VALID)

    @property
    def cosine(self) -> Array:
        """cos(theta) of the predicted ray (n,)."""
        return self.direction_n[:, 2]

    @property
    def looks(self) -> Look:
        """For the loops of ``scalar_kernels``."""
        arrays = self.place_l, self.mats_ln, self.lever_n, self.slant_range, self.direction_n, self.normal_n
        return Look._make(np.array(x, order="C") for x in (*arrays, self.point_l, self.height_p))

    @property
    def rise(self) -> Array:
        """h(M) - h(N) (n,) [m], with h(M) := h(S) - d cos(theta)."""
        return self.height_p - self.lever_n[:, 2] - self.slant_range * self.cosine


@dataclass(frozen=True, eq=False)
class Predictor:
    """A sensor model with its mounting, over a terrain.

    terrain     : known elevation
    sensor      : model of the instrument, used without random numbers
    lever_arm_b : P to S, body frame [m]
    mat_bs      : (3, 3) sensor to body; None: the sensor's axes are the body's, boresight down
    """

    terrain: Terrain
    sensor: RangingSensor
    lever_arm_b: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mat_bs: Array | None = None

    def at(
        self,
        lat: ArrayLike,
        lon: ArrayLike,
        alt: ArrayLike,
        roll: ArrayLike,
        pitch: ArrayLike,
        heading: ArrayLike,
        vel_n: ArrayLike = (0.0, 0.0, 0.0),
    ) -> Prediction:
        """Predictions for P at lat, lon [rad], alt above the ellipsoid [m], and an attitude [rad]; floats or (n,).

        vel_n : of P over the ground, (3,) or (n, 3) [m/s]: an FMCW radar shifts its range by it (Doppler)
        NaN anywhere in a pose gives UNKNOWN, a position outside the terrain OUTSIDE; nothing raises.
        """
        place, attitude = (
            [_finite_or_nan(x) for x in (lat, lon, alt)],
            [_finite_or_nan(x) for x in (roll, pitch, heading)],
        )
        frame = self.terrain.frame
        mats_ln = frame.mat_ln(place[0], place[1])
        return self.predict_local(frame.to_local(*place), mat_from_rpy(*attitude), mats_ln, vel_n)

    def predict_local(
        self, points_l: ArrayLike, mats_nb: ArrayLike, mats_ln: ArrayLike = MAT_ENU_NED, vel_n: ArrayLike = (0, 0, 0)
    ) -> Prediction:
        """Predictions for P in the terrain's frame.

        points_l : (n, 3) or (3,) [m], east, north, up
        mats_nb  : (n, 3, 3) or (3, 3), body to north, east, down at P
        mats_ln  : (n, 3, 3) or (3, 3), north, east, down at P to the terrain's frame; default: a flat Earth
        """
        points, nb, ln, vels = (_finite_or_nan(x) for x in (points_l, mats_nb, mats_ln, vel_n))
        n = np.broadcast_shapes(points.shape[:-1], nb.shape[:-2], ln.shape[:-2], vels.shape[:-1], (1,))
        points, vels = np.broadcast_to(points, (*n, 3)), np.broadcast_to(vels, (*n, 3))
        nb, ln = np.broadcast_to(nb, (*n, 3, 3)), np.broadcast_to(ln, (*n, 3, 3))
        lever_n = nb @ np.asarray(self.lever_arm_b, dtype=np.float64)
        mats_ls = ln @ nb if self.mat_bs is None else ln @ nb @ self.mat_bs
        poses = Poses(points + rotate(ln, lever_n), mats_ls, rotate(ln, vels))
        returns = self.sensor.measure(self.terrain, poses)
        return self._predict(points, poses, ln, lever_n, returns)

    def _predict(self, points: Array, poses: Poses, mats_ln: Array, lever_n: Array, returns: Returns) -> Prediction:
        inputs = points, mats_ln, lever_n, returns.slant_range, rotate(poses.mats_ls, returns.direction_s)
        own = (np.array(value, order="C") for value in inputs)
        u, normals, met, nadirs, heights, incidences = look_all(self.terrain.pyramid, *own)
        return Prediction(
            slant_range=returns.slant_range,
            height_p=heights,
            lever_n=lever_n,
            direction_n=u,
            normal_n=normals,
            nadir_n=nadirs,
            incidence=incidences,
            dispersion=_dispersion(self.terrain, self.sensor, poses, returns),
            place_l=points,
            point_l=met,
            mats_ln=mats_ln,
            validity=returns.validity,
            model_sd=_model_sd(self.terrain, self.sensor, poses, returns),
            at_edge=_at_edge(self.sensor, returns),
        )


def _finite_or_nan(value: ArrayLike) -> Array:
    """The value with infinities as NaN."""
    number = np.asarray(value, dtype=np.float64)
    return np.where(np.isfinite(number), number, np.nan)


def _at_edge(sensor: RangingSensor, returns: Returns) -> NDArray[np.bool_]:
    if not isinstance(sensor, NearestReturn):
        return np.zeros(len(returns.slant_range), dtype=np.bool_)
    return np.asarray(returns.direction_s[:, 2] <= np.cos(AT_EDGE * 0.5 * sensor.beam_width))


def _model_sd(terrain: Terrain, sensor: RangingSensor, poses: Poses, returns: Returns) -> Array:
    if sensor.model_beam is None:
        return np.where(returns.valid, 0.0, np.nan)
    return PossibleReceivers(sensor.model_beam).error_sd(terrain, poses, returns.slant_range)


def _dispersion(terrain: Terrain, sensor: RangingSensor, poses: Poses, returns: Returns) -> Array:
    """Dispersion of the model; for the nearest return, which has none, over the rays of its bundle that meet ground."""
    if not isinstance(sensor, NearestReturn):
        return returns.dispersion
    spreads = np.full(len(poses), np.nan)
    rays_s = directions(ring_angles(sensor.beam_width, sensor.rings))
    for k in np.flatnonzero(returns.valid):
        spreads[k] = spread(terrain.pyramid, poses.origins_l[k], poses.mats_ls[k], rays_s, sensor.max_range)
    return spreads
