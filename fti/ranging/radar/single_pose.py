"""Compiled kernels for one pose: ``RadarAltimeter.measure`` without random numbers, for live use.

For one pose the array operations of that method take longer than the rays: a hundred calls on a few numbers each.
Order and form of every sum are the same, so results are identical to the last bit; logarithm, power and sine are those
of numpy, because those of compiled code differ.  tests/ranging/radar/test_single_pose.py compares both.
"""

# ruff: noqa: PLR0917 - compiled kernels take their scalars by position

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fti.ranging.radar.antenna import from_db
from fti.ranging.radar.baseband import KERNEL_BINS, hann_kernel
from fti.ranging.radar.beam import KERNEL, fill_pose, trace_pose
from fti.ranging.radar.doppler import range_error
from fti.ranging.radar.edge import SCALLOPING
from fti.ranging.sensor import Poses, Validity
from fti.terrain.kernel import kernel
from fti.terrain.pyramid import Pyramid
from fti.terrain.ray_outcome import RayOutcome
from fti.terrain.terrain import Terrain

if TYPE_CHECKING:
    from fti.ranging.radar.altimeter import RadarAltimeter

Array = NDArray[np.float64]
Codes = NDArray[np.uint8]
PosePrediction = tuple[float, Array, float, Validity]

#: Maximum distance of rays that contribute to the bin of the edge [bins].
NEAR_BINS = 8.0
_HIT, _NOTHING = int(RayOutcome.HIT), int(RayOutcome.NOTHING)
#: numpy adds blocks of this size in eight parallel sums, and halves longer arrays.
_BLOCK = 128


@kernel
def _block(a: Array, begin: int, end: int) -> float:
    """Sum of a[begin:end], a block of numpy."""
    result, whole = -0.0, begin
    if end - begin >= 8:
        whole = end - (end - begin) % 8
        r = (a[begin], a[begin + 1], a[begin + 2], a[begin + 3])
        s = (a[begin + 4], a[begin + 5], a[begin + 6], a[begin + 7])
        for i in range(begin + 8, whole, 8):
            r = (r[0] + a[i], r[1] + a[i + 1], r[2] + a[i + 2], r[3] + a[i + 3])
            s = (s[0] + a[i + 4], s[1] + a[i + 5], s[2] + a[i + 6], s[3] + a[i + 7])
        result = ((r[0] + r[1]) + (r[2] + r[3])) + ((s[0] + s[1]) + (s[2] + s[3]))
    for i in range(whole, end):
        result += a[i]
    return result


@kernel
def total(a: Array) -> float:
    """Sum of a (n,) in numpy's order: pairwise.  A tree, left half first, without recursion."""
    begins, ends, sums = np.zeros(64, np.int64), np.zeros(64, np.int64), np.zeros(64)
    halved = np.zeros(64, np.int64)  # completed halves of a node
    ends[0], depth, result = len(a), 0, 0.0
    while depth >= 0:
        begin, end = begins[depth], ends[depth]
        half = (end - begin) // 2
        half -= half % 8
        done = end - begin <= _BLOCK
        if done:
            result = _block(a, begin, end)
        elif halved[depth] == 2:
            result, done = sums[depth] + result, True
        elif halved[depth] == 1:
            sums[depth] = result
        if done:
            depth -= 1
        else:
            halved[depth] += 1
            middle, left = begin + half, halved[depth] == 1
            depth += 1
            begins[depth], ends[depth], halved[depth] = begin if left else middle, middle if left else end, 0
    return result


@kernel
def _dispersion(ranges: Array, powers: Array, power: float) -> float:
    """``altimeter.dispersion`` of one pose with some power."""
    n = len(ranges)
    weights, terms = powers / power, np.empty(n)
    for k in range(n):
        terms[k] = weights[k] * ranges[k] if weights[k] > 0.0 else 0.0
    mean = total(terms)
    for k in range(n):
        terms[k] = weights[k] * (ranges[k] - mean) ** 2 if weights[k] > 0.0 else 0.0
    return math.sqrt(total(terms))


@kernel
def trace_spectrum(
    p: Pyramid,
    origin: Array,
    mat: Array,
    vel: Array,
    rays: Array,
    gains: Array,
    power: float,
    max_range: float,
    rate_error: float,
    bin_m: float,
    n_bin: int,
    noise: float,
    table: Array,
) -> tuple[bool, Array, Array, Array, int, float]:
    """Trace one pose: whether it is ordinary, ranges (rays,), powers (rays,), range bins (n_bin,) with noise, the index
    of the largest, and the dispersion [m].

    Ordinary: every ray hit the ground or nothing, some power was received, and the pose is finite.
    """
    n = len(rays)
    ranges, rates, powers, outcomes = np.empty(n), np.empty(n), np.empty(n), np.empty(n, np.uint8)
    trace_pose(p, origin, mat, vel, rays, gains, power, max_range, ranges, rates, powers, outcomes)
    bins, at, spread = np.zeros(n_bin + table.shape[1]), 0, math.nan
    ordinary = math.isfinite(rates[0])
    for k in range(n):
        ordinary &= outcomes[k] == _HIT or outcomes[k] == _NOTHING
    sum_of_powers = total(powers)
    ordinary &= sum_of_powers > 0.0
    spectrum = bins[KERNEL_BINS : KERNEL_BINS + n_bin]
    if ordinary:
        fill_pose(ranges + rate_error * rates, powers, bin_m, n_bin, table, bins)
        for k in range(n_bin):
            spectrum[k] += noise
            if spectrum[k] > spectrum[at]:
                at = k
        spread = _dispersion(ranges, powers, sum_of_powers)
    return ordinary, ranges, powers, spectrum, at, spread


@kernel
def edge(spectrum: Array, level: float, noise: float) -> float:
    """Position of the edge [bins], as from ``LeadingEdge``; NaN where no bin is above the level, or the first is."""
    first = 0
    while first < len(spectrum) and spectrum[first] < level:
        first += 1
    if first in {0, len(spectrum)}:
        return math.nan
    before = math.sqrt(max(spectrum[first - 1] - noise, 0.0))
    at = math.sqrt(max(spectrum[first] - noise, 0.0))
    after = math.sqrt(max(spectrum[min(first + 1, len(spectrum) - 1)] - noise, 0.0))
    share = 1.0 if after > 2.0 * at else (math.sqrt(level - noise) - before) / (at - before)
    close, far = (2.0 * at - before) / (at + before), (2.0 * after - at) / (after + at)
    return first + (1.0 - share) * (close - 1.0) + share * far


@kernel
def rays_near(ranges: Array, powers: Array, slant_range: float, bin_m: float) -> tuple[NDArray[np.intp], Array, Array]:
    """Rays within ``NEAR_BINS`` of a range: their numbers, how far off they are [bins], and their powers."""
    rays, off, near_powers, count = np.empty(len(ranges), np.intp), np.empty(len(ranges)), np.empty(len(ranges)), 0
    for k in range(len(ranges)):
        away = (ranges[k] - slant_range) / bin_m
        if abs(away) < NEAR_BINS:
            rays[count], off[count], near_powers[count] = k, away, powers[k]
            count += 1
    return rays[:count], off[:count], near_powers[:count]


class SinglePoseRadar:
    """A radar altimeter, one pose at a time."""

    def __init__(self, sensor: RadarAltimeter) -> None:
        self._sensor, self._bin_m = sensor, sensor.waveform.range_bin
        self._tracing: tuple[Any, ...] = (
            sensor.beam.rays_s, sensor.beam.weights * float(from_db(sensor.ground.nadir_db)),
            sensor.ground.exponent - 1.0, sensor.reach,
        )  # fmt: skip
        rate_error = float(range_error(1.0, sensor.waveform))
        self._noise = sensor.noise
        self._receiving: tuple[Any, ...] = rate_error, self._bin_m, sensor.baseband.n_bin, self._noise, KERNEL

    def predict(self, terrain: Terrain, origin_l: Array, mat_ls: Array, vel_l: Array) -> PosePrediction:
        """Range [m], unit vector of its ray in the sensor frame, dispersion [m] and validity at one pose."""
        pose = np.ascontiguousarray(origin_l), np.ascontiguousarray(mat_ls), np.ascontiguousarray(vel_l)
        if not self._sensor.coherent:
            trace = trace_spectrum(terrain.pyramid, *pose, *self._tracing, *self._receiving)
            if trace[0] and (prediction := self._evaluate(*trace[1:])):
                return prediction
        return self._measure_as_batch(terrain, Poses(origin_l[None], mat_ls[None], vel_l[None]))

    def _evaluate(self, ranges: Array, powers: Array, spectrum: Array, at: int, spread: float) -> PosePrediction | None:
        """The prediction of a spectrum; None without an edge."""
        sensor, noise = self._sensor, self._noise
        level = max(sensor.edge.threshold * _peak(spectrum, at), sensor.edge.margin * noise)
        slant_range = edge(spectrum, level, noise) * self._bin_m
        if math.isnan(slant_range):
            return None
        indicated = slant_range * (1.0 + sensor.error.scale) + sensor.error.bias  # as ``RangeError.apply``
        if sensor.quantised:
            indicated = float(sensor.indicated_range(slant_range))
        if indicated < sensor.min_range or indicated > sensor.max_range:
            validity = Validity.TOO_NEAR if indicated < sensor.min_range else Validity.TOO_FAR
            return math.nan, np.full(3, math.nan), math.nan, validity
        ray = _strongest(*rays_near(ranges, powers, slant_range, self._bin_m))
        return indicated, sensor.beam.rays_s[ray], spread, Validity.VALID

    def _measure_as_batch(self, terrain: Terrain, poses: Poses) -> PosePrediction:
        returns = self._sensor.measure(terrain, poses)
        slant_range, dispersion = float(returns.slant_range[0]), float(returns.dispersion[0])
        return slant_range, returns.direction_s[0], dispersion, Validity(returns.validity[0])


def _peak(spectrum: Array, at: int) -> float:
    """Height of the highest peak, whose largest bin is ``at``, between the bins as well."""
    top = float(spectrum[at])
    inner = min(max(at, 1), len(spectrum) - 2)
    bins = spectrum[inner - 1 : inner + 2]
    left, middle, right = bins.tolist()
    rise = 0.0
    if middle == top and min(left, middle, right) > 0.0:
        left, middle, right = np.log(bins).tolist()
        bend = 2.0 * middle - left - right
        rise = (right - left) ** 2 / (8.0 * bend) if bend > 0.0 else 0.0
    return top * min(float(np.exp(rise)), SCALLOPING)


def _strongest(rays: NDArray[np.intp], off: Array, powers: Array) -> int:
    """The strongest ray at the edge; arbitrary without one."""
    if not len(rays):
        return 0
    share = powers * hann_kernel(off)
    strongest = share.argmax()
    return int(rays[strongest]) if share[strongest] else 0
