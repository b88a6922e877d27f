"""Pairs of looks at the same ground in flight: which looks are compared, and the drift as aiding of the filter.

Each look is placed with the filter's estimate of its time.  It is compared with the look ``spacing`` looks before; the
drift between them is a measurement of position and attitude at both (``fti.nav.filter.look_mark``).  Each look is in
one pair as the first and in one as the second.  The filter marks position and attitude at each look.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.constants import SECOND_NS
from fti.geodesy.formulas import mat_from_quat, quat_from_turn
from fti.geodesy.local import LocalFrame
from fti.nav.filter.aiding import skew
from fti.nav.filter.error_states import FilterModel, outage_model
from fti.nav.filter.estimate import Estimate, InitialState
from fti.nav.filter.kernels import largest_sd
from fti.nav.filter.look_mark import CLOCK, SECOND_MOUNTING, LookDrift, LookMark, look_drifts
from fti.nav.filter.measurement_update import update_estimate
from fti.nav.scan_matching.look import Look, place_look
from fti.nav.scan_matching.registration import ScanDrift, point_distance, register

#: One sigma of the drift that a filter expects which has marked the first look [m].  The states of a look that it has
#: not marked are unknown (``MARK_DRIFT``): after a restart, or an exclusion that continues from a copy of the filter.
MAX_EXPECTED_SD_M = 1000.0
#: Gyro bias in ``Estimate.y``.
GYRO = slice(13, 16)
#: An error of the surface between the points is smaller in height.
HEIGHT_SHARE = 0.2
#: Step of the times with which looks are tried [s], and the twist between two looks that hardly disturbs them [rad].
LATE_S, MAX_TWIST = 0.02, 1e-3


@dataclass(frozen=True, eq=False)
class RangeImage:
    """Ranges of a look, as seen from the aircraft at its time.

    ranges       : ndarray, shape (n,) [m]   from the origins; NaN without a return
    directions_b : ndarray, shape (n, 3)     unit vectors in the body axes of the time of the look
    sd           : one sigma of the noise of a range [m]
    origins_b    : ndarray, shape (n, 3) or (3,) [m]   from P at the time of the look to the sensor when it measured
    offsets_s    : ndarray, shape (n,) [s]   times of the ranges after that of the look; None: all are measured then
    """

    ranges: Array
    directions_b: Array
    sd: float
    origins_b: Array = field(default_factory=lambda: np.zeros(3))
    offsets_s: Array | None = None

    def part(self, kept: NDArray[np.intp]) -> RangeImage:
        """The ranges of these indices only."""
        origins_b = self.origins_b if self.origins_b.ndim == 1 else self.origins_b[kept]
        offsets_s = None if self.offsets_s is None else self.offsets_s[kept]
        return RangeImage(self.ranges[kept], self.directions_b[kept], self.sd, origins_b, offsets_s)


class _PlacedImage(NamedTuple):
    """An image, and the pose that places it, at t_ns, with its velocity [m/s] and turn rate [rad/s], e."""

    image: RangeImage
    mark: LookMark
    t_ns: int
    vel_e: Array
    rate_e: Array

    def motion_at(self, point_e: Array) -> Array:
        """Velocity of a point that is fixed to the aircraft [m/s]: its error with a look that is a second late."""
        return self.vel_e + skew(self.rate_e) @ (point_e - self.mark.x_e)

    def before(self, seconds: float) -> _PlacedImage:
        """The image with the pose of so much earlier; velocity and turn rate are those of now."""
        turn = _turn(-seconds * self.rate_e)
        pose = replace(self.mark, x_e=self.mark.x_e - seconds * self.vel_e, mat_eb=turn @ self.mark.mat_eb)
        return self._replace(mark=pose)

    def turned(self, vector_b: Array) -> _PlacedImage:
        """The image of a sensor that is turned in the aircraft [rad]."""
        if not vector_b.any():
            return self
        return self._replace(image=replace(self.image, directions_b=self.image.directions_b @ _turn(vector_b).T))


def _turn(vector: Array) -> Array:
    x, y, z = vector.tolist()
    return np.array(mat_from_quat(*quat_from_turn(x, y, z)))


class PairResult(NamedTuple):
    """After a look: its mark; the drift since the first look of its pair, and the measurement; None without them."""

    mark: LookMark
    drift: ScanDrift | None
    aiding: LookDrift | None


class LookPairs:
    """The last looks.

    spacing : looks from the first of a pair to the second
    time_sd : one sigma of the time of a look, another one in each look [s]
    share_sd : one sigma of a horizontal drift over the distance of the points of a look
    """

    def __init__(self, spacing: int, *, time_sd: float = 0.0, share_sd: float = 0.0) -> None:
        self._time_sd, self._share_sd = time_sd, share_sd
        self._looks: deque[_PlacedImage] = deque(maxlen=spacing + 1)
        self._count = 0

    @property
    def slots(self) -> int:
        """Looks that the filter has states for."""
        assert self._looks.maxlen is not None
        return self._looks.maxlen

    def clear(self) -> None:
        """Forget the looks: they are not compared with later ones."""
        self._looks.clear()

    def feed(self, estimate: Estimate, images: Sequence[RangeImage], rate_e: Array | None = None) -> PairResult:
        """Compare a look with the first of its pair.

        estimate : the filter's, at the time of the look
        images   : what is compared with later looks; and what is compared with earlier ones, of the rear one of two
            scanners, if that is another one
        rate_e   : mean turn rate during the look [rad/s]; None: that of the estimate
        """
        mark = LookMark(self._count % self.slots, estimate.y[:3].copy(), estimate.mat_eb.copy())
        if rate_e is None:
            rate_e = estimate.mat_eb @ (estimate.imu[3:6] - estimate.y[GYRO])
        look = _PlacedImage(images[0], mark, estimate.t_ns, estimate.y[3:6].copy(), rate_e)
        self._looks.append(look)
        self._count += 1
        if len(self._looks) < self.slots:
            return PairResult(mark, None, None)
        return PairResult(mark, *self._compare(estimate, self._looks[0], look._replace(image=images[-1])))

    def _compare(
        self, estimate: Estimate, earlier: _PlacedImage, later: _PlacedImage
    ) -> tuple[ScanDrift | None, LookDrift | None]:
        """The drift between two looks, if the first is a state of the filter.  estimate : the filter's, at the later"""
        pair = _Pair(estimate, earlier, later, has_two_scanners=SECOND_MOUNTING[0] in estimate.model.columns)
        if not pair.sd <= MAX_EXPECTED_SD_M:
            return None, None
        drift = pair.register()
        if not len(drift.drift):
            return drift, None
        frame = pair.frame
        centre_e, axes_e = frame.origin_e + frame.mat_le.T @ drift.centre_l, drift.axes_l @ frame.mat_le
        cov = drift.cov + self._more_cov(drift.axes_l, axes_e, pair.distance, centre_e, (earlier, later))
        drift = replace(drift, cov=cov)
        motions = pair.motion_at(centre_e), later.motion_at(centre_e)
        measured = axes_e, drift.drift, drift.cov, drift.roughness, *motions
        return drift, LookDrift(earlier.mark, later.mark, centre_e, *measured)

    def _more_cov(
        self, axes_l: Array, axes_e: Array, distance: float, centre_e: Array, pair: tuple[_PlacedImage, _PlacedImage]
    ) -> Array:
        """Covariance of errors that the residuals do not show [m^2].  distance : of the points of a look [m]"""
        level = self._share_sd * distance * axes_l * [1.0, 1.0, HEIGHT_SHARE]
        moved = [self._time_sd * axes_e @ each.motion_at(centre_e) for each in pair]
        return np.asarray(level @ level.T + sum(np.outer(each, each) for each in moved))


class _Pair:
    """Two looks, registered as they are stamped or with times that are all late.

    estimate : the filter's, at the later look, which has marked the earlier one
    sd       : largest horizontal sigma of the drift that it expects [m]
    distance : of the points of the later look [m]
    """

    def __init__(
        self, estimate: Estimate, earlier: _PlacedImage, later: _PlacedImage, *, has_two_scanners: bool
    ) -> None:
        mounting_b = np.array([estimate.drift(name) for name in SECOND_MOUNTING])
        self._mounting_e, self._known_late = later.mark.mat_eb @ mounting_b, estimate.drift(CLOCK)
        self.frame, self._looks = LocalFrame(*estimate.geodetic), (earlier, later.turned(-mounting_b))
        second = _place(self._looks[1], self.frame, later.t_ns)
        self.distance = point_distance(second.points_l) if len(second) else 0.0
        self._middle_l = np.mean(second.points_l, axis=0) if len(second) else np.zeros(3)
        middle_e = self.frame.origin_e + self.frame.mat_le.T @ self._middle_l
        expected_e, self.sd = _expected_drift(estimate, earlier, later, middle_e)
        self._expected_l = self.frame.mat_le @ (expected_e - self._corrected(self._known_late, middle_e))
        self._turn_l = self.frame.mat_le @ earlier.mark.states_of(estimate)[3:]
        self._tilt_axis = _across(self.frame, later.vel_e) if has_two_scanners else None

    def motion_at(self, point_e: Array) -> Array:
        """Velocity of a point that is fixed to the aircraft, at the later look minus at the earlier one [m/s]."""
        return self._looks[1].motion_at(point_e) - self._looks[0].motion_at(point_e)

    def _corrected(self, late: float, point_e: Array) -> Array:
        """Drift that the looks do not have any more: of times that are late, and of the mounting that is known [m]."""
        of_mounting = skew(self._mounting_e) @ (point_e - self._looks[1].mark.x_e)
        return np.asarray(late * self.motion_at(point_e) + of_mounting)

    def register(self) -> ScanDrift:
        """The drift.  If the aircraft rolls, the times of the looks are corrected until the looks fit.

        A roll of 5 deg/s turns a look by 4 mrad in 50 ms: it is twisted against the other one, and fits nowhere.
        """
        found, late = self._register_at(self._known_late), self._known_late
        rotation = float(np.linalg.norm(self._looks[1].rate_e - self._looks[0].rate_e))
        if rotation * LATE_S < MAX_TWIST:
            return found
        if len(found.axes_l) < 3:
            tried = [(found, late), *((self._register_at(each), each) for each in LATE_S * np.arange(-3, 4) if each)]
            found, late = min(tried, key=lambda each: _uncertainty(each[0]))
        later = self._known_late + self._more_late(found)
        if abs(later - late) * rotation < 0.5 * MAX_TWIST:
            return found
        return min(found, self._register_at(later), key=_uncertainty)

    def _register_at(self, late: float) -> ScanDrift:
        """The drift of the looks as they are stamped, found with all times so much earlier [s]."""
        first, second = (_place(each.before(late), self.frame, self._looks[1].t_ns) for each in self._looks)
        moved = second.moved(-self._expected_l - (second.points_l - self._middle_l) @ skew(self._turn_l).T)
        changing = self._looks[1].image.offsets_s is not None
        drift = register(first, moved, self.sd, changing=changing, tilt_axis=self._tilt_axis)
        if not len(drift.drift):
            return drift
        centre_e = self.frame.origin_e + self.frame.mat_le.T @ drift.centre_l
        at_centre = self._expected_l + skew(self._turn_l) @ (drift.centre_l - self._middle_l)
        at_centre = at_centre + self.frame.mat_le @ self._corrected(late, centre_e)
        return replace(drift, drift=drift.drift + drift.axes_l @ at_centre)

    def _more_late(self, found: ScanDrift) -> float:
        """Time by which the looks are later than the filter assumes, if the drift has no other cause [s]."""
        if len(found.axes_l) < 2:
            return 0.0
        motion_l = self.frame.mat_le @ self.motion_at(self.frame.origin_e + self.frame.mat_le.T @ found.centre_l)
        rest = found.drift - found.axes_l @ (self._expected_l + self._known_late * motion_l)
        weighted = np.linalg.solve(found.cov, found.axes_l @ motion_l)
        return float(weighted @ rest / (weighted @ found.axes_l @ motion_l))


def _across(frame: LocalFrame, vel_e: Array) -> Array:
    """Level unit vector to the right of a velocity, east and north."""
    east, north, _ = frame.mat_le @ vel_e
    return np.array([north, -east]) / max(math.hypot(north, east), np.finfo(float).tiny)


def _uncertainty(found: ScanDrift) -> tuple[int, float]:
    """Directions that are not determined, and the sum of the variances of the others [m^2]."""
    return 3 - len(found.axes_l), float(np.trace(found.cov))


def _place(placed: _PlacedImage, frame: LocalFrame, now_ns: int) -> Look:
    """The look in a frame, with times after ``now_ns``."""
    image, mark = placed.image, placed.mark
    mat_lb = frame.mat_le @ mark.mat_eb
    origins_l = frame.mat_le @ (mark.x_e - frame.origin_e) + image.origins_b @ mat_lb.T
    t = np.full(len(image.ranges), (placed.t_ns - now_ns) / SECOND_NS)
    if image.offsets_s is not None:
        t += image.offsets_s
    return place_look(origins_l, image.directions_b @ mat_lb.T, image.ranges, t, image.sd)


def _expected_drift(
    estimate: Estimate, first: _PlacedImage, second: _PlacedImage, middle_e: Array
) -> tuple[Array, float]:
    """The drift that the filter expects, e [m], and its largest horizontal sigma [m]."""
    motion_e = second.motion_at(middle_e) - first.motion_at(middle_e)
    zero = LookDrift(first.mark, second.mark, middle_e, np.eye(3), np.zeros(3), np.eye(3), motion_e=motion_e)
    innovation, H, _ = zero.compute_matrices(estimate)
    level = estimate.mat_en.T[:2] @ H
    cov = level @ estimate.P @ level.T
    return -innovation, largest_sd(float(cov[0, 0]), float(cov[1, 1]), float(cov[0, 1]))


def warm_up() -> None:
    """Compile the kernels, or load them from the cache: two pairs over waves of ground, 100 m below."""
    model = outage_model(FilterModel().unit, look_drifts(2))
    start = InitialState(0.0, 0.0, 0.0, (10.0, 0.0, 0.0), 0.0, 0.0, 0.0, (1.0,) * 3, (0.1,) * 3, (0.01,) * 3)
    estimate, side = start.estimate(0, np.zeros(6), model), np.linspace(-0.5, 0.5, 40)
    x, y = (each.ravel() for each in np.meshgrid(side, side))
    length = np.sqrt(1.0 + x**2 + y**2)
    directions_b = np.stack((x, y, np.ones(len(x))), axis=1) / length[:, None]
    ranges = (100.0 + np.sin(10.0 * x) * np.sin(10.0 * y)) * length
    for offsets_s in (None, np.linspace(-0.05, 0.05, len(x))):
        pairs = LookPairs(1)
        for image in 2 * [RangeImage(ranges, directions_b, 0.1, offsets_s=offsets_s)]:
            result = pairs.feed(estimate, [image])
            estimate = update_estimate(estimate, {}, result.mark, 0).estimate
        for is_on_trial in (True, False):
            if result.aiding is not None:
                update_estimate(estimate, {}, replace(result.aiding, is_on_trial=is_on_trial), 0)
