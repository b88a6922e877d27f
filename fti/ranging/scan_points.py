"""The points of a range scan as arrays, and the message of arrays.

A direction is a unit vector in the frame of the sensor that the driver defines; ``mat_bs`` of the device turns it into
the body frame.  An array of a message cannot be written to.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import ArrayLike, NDArray

from fti.messages.measurements import PointArrays, RangeScan, Stamp

Floats = NDArray[np.float32]
FLOAT, BYTE = np.dtype("<f4"), np.dtype("u1")


class ScanPoints(NamedTuple):
    """The n points of a scan.

    times_ns     : int64, shape (n,)     FTI time at which each was measured [ns]
    ranges       : float32, shape (n,)   slant range [m]; NaN without a return
    directions_s : float32, shape (n, 3) unit vectors from the sensor to the point, in the sensor frame
    intensities  : uint8, shape (n,)     strength of the return as the device states it; None if it states none
    """

    times_ns: NDArray[np.int64]
    ranges: Floats
    directions_s: Floats
    intensities: NDArray[np.uint8] | None


def scan_points(scan: RangeScan) -> ScanPoints:
    """The points of a scan.  The times are those of validity; where the stamp has none, they begin at the arrival.

    Raises ValueError for arrays that do not have the same number of points.
    """
    ranges = np.frombuffer(scan.arrays.ranges, FLOAT)
    directions = np.frombuffer(scan.arrays.directions, FLOAT).reshape(-1, 3)
    offsets = np.frombuffer(scan.arrays.offsets, FLOAT)
    strengths = np.frombuffer(scan.arrays.intensities, BYTE) if scan.arrays.intensities else None
    sizes = {scan.points, *map(len, (ranges, directions, offsets)), *([] if strengths is None else [len(strengths)])}
    if len(sizes) > 1:
        raise ValueError(f"the arrays of a scan of {scan.points} points have {sorted(sizes)} points")
    begin_ns = scan.stamp.t_rx_ns if scan.stamp.t_valid_ns is None else scan.stamp.t_valid_ns
    times_ns = begin_ns + np.rint(offsets.astype(np.float64) * 1e9).astype(np.int64)
    return ScanPoints(times_ns, ranges, directions, strengths)


def make_scan(stamp: Stamp, ranges: ArrayLike, arrays: PointArrays, valid: bool = True) -> RangeScan:
    """The scan of points.

    ranges : ndarray, shape (n,) [m], NaN without a return; in the message they replace those of ``arrays``, whose
             other fields are unchanged.  Of a scan that is not valid all are NaN
    """
    values = np.asarray(ranges, FLOAT)
    if not valid:
        values = np.full_like(values, np.nan)
    known = values[values == values]  # noqa: PLR0124 - NaN is not equal to itself
    nearest, median = (float(known.min()), _median(known)) if len(known) else (None, None)
    return RangeScan(
        stamp=stamp,
        points=len(values),
        returns=len(known),
        nearest=nearest,
        median=median,
        valid=valid,
        arrays=replace(arrays, ranges=values.tobytes()),
    )


def point_arrays(directions_s: ArrayLike, offsets: ArrayLike, intensities: ArrayLike | None = None) -> PointArrays:
    """The arrays of points, but for their ranges.

    directions_s : ndarray, shape (n, 3), unit vectors;  offsets : ndarray, shape (n,) [s];  intensities : shape (n,)
    """
    strengths = b"" if intensities is None else np.asarray(intensities, BYTE).tobytes()
    directions, times = (np.asarray(values, FLOAT).tobytes() for values in (directions_s, offsets))
    return PointArrays(directions=directions, offsets=times, intensities=strengths)


def change_ranges(scan: RangeScan, change: Callable[[float], float]) -> RangeScan:
    """The scan with ``change`` applied to each range [m]; a point without a return has none afterwards either."""
    ranges = [change(value) if value == value else value for value in scan_points(scan).ranges.tolist()]  # noqa: PLR0124
    return make_scan(scan.stamp, ranges, scan.arrays, scan.valid)


def replace_far_ranges(scan: RangeScan, limit: float, value: float | None) -> RangeScan:
    """The scan with ``value`` [m], or no return, in place of ranges beyond a limit [m] and of missing ones."""
    ranges = scan_points(scan).ranges
    changed = np.where(ranges <= limit, ranges, np.nan if value is None else value)
    return make_scan(scan.stamp, changed, scan.arrays, scan.valid)


def _median(values: Floats) -> float:
    """The middle one of n values [m], of an even number the lower one of two."""
    middle = (len(values) - 1) // 2
    return float(np.partition(values, middle)[middle])
