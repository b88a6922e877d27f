"""Looks from the scans of a device: which points belong together, and where the sensor was when each was measured.

A look is one scan of a range imager, or all scans of a scanner that turns within ``exposure_s``.  The next one begins
when the aircraft has flown half of its length on the ground: the product of overlap and interval is then largest
(``RangeImager.best_interval``), and two pairs in succession have no ground in common.  With shorter steps they had, and
the errors of their drifts would not be independent.

Two line scanners, one of which looks ahead, measure two strips at a time.  The next look begins when the rear one sees
what the front one has seen: each strip is in one pair only.

The time of a look is the middle of its points.  Each point has the pose of its own time, from the history of the
filter, and is stated as seen from the aircraft at the time of the look: the error of the filter hardly changes within
a look.  A look of more than ``MAX_POINTS`` is thinned to one point of each cell of the ground.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fti.arrays import Array
from fti.config import Device, ScanDriftTable
from fti.constants import SECOND_NS
from fti.geodesy.formulas import mat_nb
from fti.messages.measurements import RangeScan
from fti.nav.filter.aiding import small_turn
from fti.nav.filter.estimate import Estimate
from fti.nav.look_pairs import RangeImage
from fti.nav.scan_matching.registration import point_distance
from fti.nav.scan_matching.thinning import one_per_cell
from fti.ranging.interpolation import interpolate_poses
from fti.ranging.scan_points import scan_points
from fti.ranging.sensor import Poses

#: Points of a look that are registered: those of 75 x 75 pixels.
MAX_POINTS = 6000
#: Cells of so many times the distance of the points have points in this share; beams are at most so much farther apart.
CHECKED_CELL, MIN_OCCUPIED_SHARE, MAX_ANISOTROPY = 1.5, 0.9, 10.0
#: Points beyond are no ground of a pair [m].
MAX_RANGE_M = 10_000.0
#: Times, ranges and directions of no points.
NO_POINTS = np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 3))
#: A unit vector has this length, to the resolution of float32.
LENGTH_TOLERANCE = 1e-3
#: Shortest and longest time from one look to the next [ns].
MIN_INTERVAL_NS, MAX_INTERVAL_NS = 200_000_000, 10_000_000_000
#: The length of a look is that of this share of its points, over the share: single far points count little.
LENGTH_SHARE = 0.5
#: Points are below the aircraft if they are so much of the median range beside its track.
NEAR_SHARE = 0.3
#: Longest scan [ns].
MAX_SCAN_NS = 200_000_000
#: Scans may arrive so late after the end of a look, and the inertial samples after it [ns].
LATE_NS, MAX_WAIT_NS = 60_000_000, 600_000_000
#: Time between the strips of two looks, in which the first one is compared [ns]; shorter than any interval.
PAUSE_NS = 150_000_000
#: Time between poses of the filter within a look [ns]; between them the turn is at a constant rate.
POSE_NS = 20_000_000


class CollectedLook(NamedTuple):
    """Points with a return.

    t_ns         : time of the look, the middle of its points
    times_ns     : int64, shape (n,);  ranges : shape (n,) [m];  directions_b : shape (n, 3), in body axes of their time
    """

    t_ns: int
    times_ns: NDArray[np.int64]
    ranges: Array
    directions_b: Array


class LookCollector:
    """Collects the scans of one device, or of two at the same time.

    next_ns : a scan of this time or later begins a look
    """

    def __init__(self, settings: ScanDriftTable, devices: Sequence[Device]) -> None:
        self._exposure_ns = self._longest_ns = round(settings.exposure_s * SECOND_NS)
        self._to_body = {device.name: _mat_bs(device) for device in devices}
        self.next_ns = 0
        self._begin_ns = 0  # of the last look
        self._end_ns = 0
        self._newest_ns = dict.fromkeys(self._to_body, 0)  # of each device
        self._scans: dict[str, list[CollectedLook]] | None = None  # by device; None: complete

    @property
    def is_collecting(self) -> bool:
        """Whether a look is not complete."""
        return self._scans is not None

    def feed(self, device: str, scan: RangeScan, t_ns: int) -> None:
        """Take a scan whose first point was measured at t_ns; one that belongs to no look is left out."""
        self._newest_ns[device] = t_ns
        if t_ns >= self.next_ns:
            self._begin_ns, self._end_ns = t_ns, t_ns + self._exposure_ns
            self._scans = {name: [] for name in self._to_body}
            self.next_ns = t_ns + MAX_INTERVAL_NS
        if self._scans is None or not self._begin_ns <= t_ns <= self._end_ns:
            return
        points = _read(scan, t_ns, self._to_body[device])
        self._scans[device].append(points)
        if not self._exposure_ns and len(points.times_ns):
            self._end_ns = max(int(points.times_ns.max()), t_ns)

    def wait(self, interval_ns: int | None) -> None:
        """The next look begins so long after the beginning of the last one, and its strips end before the one after it.

        interval_ns : None if a look has no points: the next one begins soon, and has the whole exposure
        """
        self.next_ns = self._begin_ns + (MIN_INTERVAL_NS if interval_ns is None else interval_ns)
        if len(self._to_body) > 1:
            self._exposure_ns = (
                self._longest_ns if interval_ns is None else min(self._longest_ns, interval_ns - PAUSE_NS)
            )

    def take(self, t_ns: int, newest_ns: int | None) -> list[CollectedLook] | None:
        """The look that is complete at t_ns, once: one for each device, of the same time.

        newest_ns : of the inertial samples, which must reach beyond it
        """
        if self.next_ns > t_ns + MAX_INTERVAL_NS + MAX_WAIT_NS:  # a scan of a wrong time has begun the look
            self._scans, self.next_ns = None, t_ns
        if self._scans is None or t_ns < self._end_ns + LATE_NS:
            return None
        is_late = t_ns > self._end_ns + MAX_WAIT_NS
        if newest_ns is None or newest_ns <= self._end_ns:
            if is_late:
                self._scans, self.next_ns = None, t_ns
            return None
        if not (is_late or self._has_ended()):
            return None
        scans, self._scans = self._scans, None
        times = np.concatenate([scan.times_ns for each in scans.values() for scan in each])
        middle_ns = (int(times.min()) + int(times.max())) // 2 if len(times) else self._begin_ns
        return [_joined(each, middle_ns) for each in scans.values()]

    def _has_ended(self) -> bool:
        """Whether each of two devices has given a scan after the look."""
        return len(self._to_body) == 1 or min(self._newest_ns.values()) > self._end_ns


def _mat_bs(device: Device) -> Array:
    return np.array(mat_nb(*(math.radians(angle) for angle in device.rpy_bs_deg)))


def _joined(scans: Sequence[CollectedLook], t_ns: int) -> CollectedLook:
    """The points of all scans."""
    if not scans:
        return CollectedLook(t_ns, *NO_POINTS)
    times, ranges, directions = (np.concatenate([scan[part] for scan in scans]) for part in (1, 2, 3))
    return CollectedLook(t_ns, times, ranges, directions)


def _read(scan: RangeScan, t_ns: int, mat_bs: Array) -> CollectedLook:
    """The points of a scan that have a return."""
    try:
        with np.errstate(invalid="ignore"):  # offsets that are not finite
            points = scan_points(scan)
    except ValueError:  # arrays of different lengths
        return CollectedLook(t_ns, *NO_POINTS)
    begin_ns = scan.stamp.t_rx_ns if scan.stamp.t_valid_ns is None else scan.stamp.t_valid_ns
    offsets_ns = points.times_ns - begin_ns
    lengths = np.einsum("ij,ij->i", points.directions_s, points.directions_s)
    with np.errstate(invalid="ignore"):
        is_used = (points.ranges > 0.0) & (points.ranges < MAX_RANGE_M) & (abs(lengths - 1.0) < LENGTH_TOLERANCE)
    is_used &= (offsets_ns >= 0) & (offsets_ns <= MAX_SCAN_NS)
    directions_b = points.directions_s[is_used].astype(np.float64) @ mat_bs.T
    return CollectedLook(t_ns, t_ns + offsets_ns[is_used], points.ranges[is_used].astype(np.float64), directions_b)


def pose_times_ns(looks: Sequence[CollectedLook]) -> list[int]:
    """Times of the poses that place looks of one time: an odd number from the first point to the last.

    The one in the middle is the time of the looks, which is that of the points.
    """
    times = np.concatenate([look.times_ns for look in looks])
    if not len(times):
        return [looks[0].t_ns]
    first, middle, last = int(times.min()), looks[0].t_ns, int(times.max())
    count = -(-(last - first) // (2 * POSE_NS))
    before = [first + (middle - first) * k // count for k in range(count)] if count else []
    return [*before, middle, *(middle + (last - middle) * k // count for k in range(1, count + 1))]


def mean_rate(estimates: Sequence[Estimate]) -> Array | None:
    """Turn rate from the first estimate to the last, e, shape (3,) [rad/s]; None for a single one."""
    first, last = estimates[0], estimates[-1]
    if last.t_ns - first.t_ns <= MAX_SCAN_NS:
        return None
    return np.asarray(small_turn(last.mat_eb @ first.mat_eb.T) * SECOND_NS / (last.t_ns - first.t_ns))


def thin(image: RangeImage, middle: Estimate) -> RangeImage:
    """At most about ``MAX_POINTS``, as dense along the track as across.  middle : the filter's, at the time of the look

    The beams of a scanner that turns are farther apart than the points of a beam.  The lattice of the registration has
    the mean distance as its step, and finds no plane between beams unless each has points as far apart as the beams.
    """
    count = len(image.ranges)
    along, across, up = _places(image, middle)
    points_l = np.stack((along, across, up), axis=1)
    distance = point_distance(points_l) if count else 0.0
    if not distance > 0.0:
        return image
    first = cell = distance * max(math.sqrt(count / MAX_POINTS), 1.0)
    while cell < MAX_ANISOTROPY * first and _occupied_share(points_l, CHECKED_CELL * cell) < MIN_OCCUPIED_SHARE:
        cell *= 1.2
    return image if cell == distance else image.part(one_per_cell(points_l, cell))


def _occupied_share(points_l: Array, cell: float) -> float:
    """Share of the cells of a side with points, between the quartiles of both axes [m]."""
    places = points_l[:, :2]
    low, high = np.percentile(places, (25.0, 75.0), axis=0)
    inside = places[((places >= low) & (places <= high)).all(axis=1)]
    cells = np.floor((inside - low) / cell).astype(np.int64)
    if not len(cells):
        return 1.0
    return len(np.unique(cells[:, 0] * 2**31 + cells[:, 1])) / float(np.prod(cells.max(axis=0) + 1))


def interval_ns(images: Sequence[RangeImage], middle: Estimate) -> int | None:
    """Time to the next look: half of the length of a look on the ground, or until the rear scanner sees it.

    images : of the devices, None is returned if one has no points;  middle : the filter's, at the time of the look
    """
    if any(not len(image.ranges) for image in images):
        return None
    speed = float(np.linalg.norm(middle.vel_n[:2]))
    distance = _half_length(images[0], middle) if len(images) == 1 else _distance_ahead(images, middle)
    seconds = distance / speed if speed > 0.0 else 0.0
    return int(min(max(seconds * SECOND_NS, MIN_INTERVAL_NS), MAX_INTERVAL_NS))


def _half_length(image: RangeImage, middle: Estimate) -> float:
    """Half of the length of a look on the ground, below the aircraft [m]."""
    along, across, _ = _places(image, middle)
    below = along[np.abs(across) <= NEAR_SHARE * np.median(image.ranges)]
    edges = 0.5 - 0.5 * LENGTH_SHARE, 0.5 + 0.5 * LENGTH_SHARE
    first, last = np.quantile(below if len(below) else along, edges)
    return 0.5 * float(last - first) / LENGTH_SHARE


def _distance_ahead(images: Sequence[RangeImage], middle: Estimate) -> float:
    """Distance from the ground that the last scanner sees to that of the first one, along the track [m]."""
    first, last = (float(np.median(_places(images[k], middle)[0])) for k in (0, -1))
    return first - last


def _places(image: RangeImage, middle: Estimate) -> tuple[Array, Array, Array]:
    """Points along the track, across to the right and up, from the aircraft at the time of the look, (n,) each [m]."""
    speed = float(np.linalg.norm(middle.vel_n[:2]))
    north, east = middle.vel_n[:2] / speed if speed > 0.0 else (1.0, 0.0)
    to_track = np.array([[north, east, 0.0], [-east, north, 0.0], [0.0, 0.0, -1.0]])
    points_b = image.origins_b + image.ranges[:, None] * image.directions_b
    along, across, up = (points_b @ (to_track @ middle.mat_en.T @ middle.mat_eb).T).T
    return along, across, up


def as_image(look: CollectedLook, path: Sequence[Estimate], lever_arm_b: Array, sd: float) -> RangeImage:
    """The look as seen from the aircraft at its time.

    path        : of the aircraft, at the times of ``pose_times_ns``, by inertial samples alone: a correction within a
        look would displace some of its points against others
    lever_arm_b : P to the sensor [m];  sd : of a range [m]
    """
    if len(path) < 2:
        return RangeImage(look.ranges, look.directions_b, sd, lever_arm_b)
    seconds, middle = (look.times_ns - look.t_ns) / SECOND_NS, path[len(path) // 2]
    to_b = middle.mat_eb.T
    epochs = Poses(
        np.array([to_b @ (each.y[:3] - middle.y[:3]) for each in path]),
        np.array([to_b @ each.mat_eb for each in path]),
        np.array([to_b @ each.y[3:6] for each in path]),
    )
    poses = interpolate_poses([(each.t_ns - look.t_ns) / SECOND_NS for each in path], epochs, seconds)
    directions_b = (poses.mats_ls @ look.directions_b[..., None])[..., 0]
    return RangeImage(look.ranges, directions_b, sd, poses.origins_l + poses.mats_ls @ lever_arm_b, seconds)
