"""Estimates latency and averaging time of an altimeter from its ranges and the predicted ones.

    y(t) = c + b t + g (1/W) int_{-W/2}^{W/2} r(t - tau + s) ds + noise

    y   measured ranges at their validity times
    r   predicted ranges (``fti.nav.altimetry.range_prediction``) of the same flight and beyond its ends
    tau latency: time from the middle of the averaging to the validity time;  W length of the averaging
    c, b, g bias and drift of sensor and elevation, and a scale, which absorbs the effect that errors of r would
        otherwise have on W: with a noisy r, y looks smoothed

A device that stamps the end of its averaging is late by at least W / 2.  100 ms are 6 m along the track at 60 m/s; the
height error is the slope of the ground times this.

The first lag is that of the largest cross-correlation of y and r.  Then all five parameters are estimated by least
squares (Gauss-Newton).  W enters by its square: near 0 its effect is W^2 / 24 r'', and the estimate of W^2 may be
negative.  Sigma is that of least squares with residuals correlated within blocks of ``BLOCK_S`` and not between them
(cluster-robust: Liang and Zeger 1986; degrees of freedom counted in blocks): errors of an elevation model extend over
hundreds of metres.  Ranges more than 5 robust sigma off are excluded.

Source: none of the five gives a method; the estimator is that of a regression on a delayed, averaged series.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fti.arrays import Array

#: Length of the blocks between which residuals are independent [s], and their minimum number.
BLOCK_S, MIN_BLOCKS = 10.0, 8
#: Step of the lag search [s], iterations of Gauss-Newton, spacing of the samples of r [s].
LAG_STEP_S, STEPS, FINE_S = 0.02, 12, 0.01
#: Maximum gap of the prediction [s]: ranges in a longer one are excluded.
GAP_S = 1.0
#: Limit of outliers [robust sigma]; 1.4826 times the median absolute value is one sigma of a Gaussian.
OUTLIER_SIGMAS, MAD_TO_SIGMA = 5.0, 1.4826
#: Shorter averaging counts as none [s], to avoid rounding errors of a difference of integrals.
_MIN_AVERAGING_S = 1e-3


@dataclass(frozen=True, slots=True)
class LatencyEstimate:
    """Result of the estimation.

    latency, latency_sd     : tau and its one sigma [s]; positive is late
    averaging, averaging_sd : W and its one sigma [s]; 0 where the estimated W^2 is negative
    correlation             : of measured and predicted at the best lag, trends taken out, -1 to 1
    count                   : number of ranges used
    """

    latency: float
    latency_sd: float
    averaging: float
    averaging_sd: float
    correlation: float
    count: int


def estimate_latency(
    t: ArrayLike, measured: ArrayLike, t_predicted: ArrayLike, predicted: ArrayLike, max_lag: float = 1.0
) -> LatencyEstimate | None:
    """Latency and averaging of an altimeter from one flight.

    t, measured            : (n,) [s], [m]; in any order, NaN where missing
    t_predicted, predicted : (m,) [s], [m]; 10 Hz or more; interpolated by a cubic
    max_lag                : the latency lies within +- this [s]
    Returns                : None where it is not observable: fewer than 8 blocks of 10 s with ranges, ground without
                             relief, or a lag at the limit of the search
    """
    reference = _ReferenceSeries.of(t_predicted, predicted)
    times, ranges = _sort_finite(t, measured)
    if reference is None or not max_lag > 0.0:
        return None
    known = reference.covers(times, 2.0 * max_lag)
    times, ranges = times[known], ranges[known]
    if not _has_enough_blocks(times):
        return None
    lag = _best_lag(reference, times, ranges, max_lag)
    if lag is None:
        return None
    times, ranges = _remove_outliers(reference, times, ranges, lag)
    return _refine(reference, times, ranges, lag, max_lag) if _has_enough_blocks(times) else None


@dataclass(frozen=True, eq=False)
class _ReferenceSeries:
    """A piecewise linear series and its integral, without its mean, to keep differences of integrals exact.

    Linear interpolation between samples dt apart smooths as an averaging over sqrt(2) dt does.  Therefore a cubic
    (Hermite, slopes by differences) first resamples to ``FINE_S``.
    """

    t: Array
    values: Array
    integral: Array

    @classmethod
    def of(cls, t: ArrayLike, values: ArrayLike) -> _ReferenceSeries | None:
        times, numbers = _sort_finite(t, values)
        times, first = np.unique(times, return_index=True)
        if len(times) < 3:
            return None
        fine = _fine_times(times)
        smooth = _cubic(fine, times, numbers[first] - np.mean(numbers[first]))
        steps = 0.5 * (smooth[1:] + smooth[:-1]) * np.diff(fine)
        return cls(fine, smooth, np.concatenate(([0.0], np.cumsum(steps))))

    def covers(self, t: Array, reach: float) -> NDArray[np.bool_]:
        """Whether the series has no gap within +- ``reach`` of each time."""
        gaps = np.concatenate(([0], np.cumsum(np.diff(self.t) > GAP_S)))
        first, last = (np.searchsorted(self.t, at) for at in (t - reach, t + reach))
        inside = (first > 0) & (last < len(self.t))
        return np.asarray(inside & (gaps[first - 1] == gaps[np.minimum(last, len(self.t) - 1)]))

    def at(self, t: Array) -> Array:
        return np.interp(t, self.t, self.values)

    def average(self, t: Array, square: float) -> Array:
        """Mean over W around t, W^2 = ``square`` [s^2]; for a negative one the value minus the effect of W."""
        width = math.sqrt(abs(square))
        if width < _MIN_AVERAGING_S:
            return self.at(t)
        mean = (self._integral_to(t + 0.5 * width) - self._integral_to(t - 0.5 * width)) / width
        return mean if square > 0.0 else 2.0 * self.at(t) - mean

    def _integral_to(self, t: Array) -> Array:
        k = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        since = t - self.t[k]
        slope = (self.values[k + 1] - self.values[k]) / (self.t[k + 1] - self.t[k])
        return np.asarray(self.integral[k] + since * (self.values[k] + 0.5 * slope * since))


def _fine_times(t: Array) -> Array:
    """Times ``FINE_S`` apart or less from t[0] to t[-1], none in a gap."""
    steps = np.diff(t)
    parts = np.where(steps > GAP_S, 1, np.ceil(steps / FINE_S)).astype(np.int64)
    within = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    return np.append(np.repeat(t[:-1], parts) + within * np.repeat(steps / parts, parts), t[-1])


def _cubic(at: Array, t: Array, values: Array) -> Array:
    """The cubic through values at t, with the slopes of their differences; between t[0] and t[-1]."""
    slopes = np.gradient(values, t)
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    width = t[k + 1] - t[k]
    u = (at - t[k]) / width
    rise = values[k + 1] - values[k]
    bend = (1.0 - u) * (slopes[k] * width - rise) - u * (slopes[k + 1] * width - rise)
    return np.asarray(values[k] + u * rise + u * (1.0 - u) * bend)


def _sort_finite(t: ArrayLike, values: ArrayLike) -> tuple[Array, Array]:
    """The finite samples in order of time."""
    times, numbers = np.asarray(t, dtype=np.float64).ravel(), np.asarray(values, dtype=np.float64).ravel()
    good = np.isfinite(times) & np.isfinite(numbers)
    order = np.argsort(times[good], kind="stable")
    return times[good][order], numbers[good][order]


def _has_enough_blocks(times: Array) -> bool:
    return len(times) > 0 and len(np.unique(_blocks(times))) >= MIN_BLOCKS


def _blocks(times: Array) -> NDArray[np.int64]:
    return np.asarray(np.floor((times - times[0]) / BLOCK_S), dtype=np.int64)


def _trend(times: Array) -> Array:
    """Columns of c and b (n, 2), centred and scaled to +-1."""
    half = 0.5 * (times[-1] - times[0])
    return np.stack((np.ones_like(times), (times - times[0] - half) / half), axis=-1)


def _detrend(trend: Array, values: Array) -> Array:
    """Values without their trend."""
    return np.asarray(values - trend @ np.linalg.lstsq(trend, values, rcond=None)[0])


def _best_lag(reference: _ReferenceSeries, times: Array, ranges: Array, max_lag: float) -> float | None:
    """The lag of the largest cross-correlation; None where the reference does not vary, or at the end of the search."""
    trend = _trend(times)
    measured = _detrend(trend, ranges)
    lags = np.linspace(-max_lag, max_lag, 2 * math.ceil(max_lag / LAG_STEP_S) + 1)
    correlations = np.array([_correlation(measured, _detrend(trend, reference.at(times - lag))) for lag in lags])
    best = int(np.argmax(correlations))
    return float(lags[best]) if correlations[best] > 0.0 and 0 < best < len(lags) - 1 else None


def _correlation(a: Array, b: Array) -> float:
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / size if size > 0.0 else -1.0


def _remove_outliers(reference: _ReferenceSeries, times: Array, ranges: Array, lag: float) -> tuple[Array, Array]:
    rest = _detrend(_trend(times), ranges - reference.at(times - lag))
    rest = rest - np.median(rest)
    good = np.abs(rest) <= OUTLIER_SIGMAS * MAD_TO_SIGMA * np.median(np.abs(rest)) + 1e-9
    return times[good], ranges[good]


def _refine(
    reference: _ReferenceSeries, times: Array, ranges: Array, lag: float, max_lag: float
) -> LatencyEstimate | None:
    """Gauss-Newton in tau and W^2 from the best lag on; c, b and g are linear."""
    trend, square = _trend(times), 0.0
    for _ in range(STEPS):
        solution = np.linalg.lstsq(_columns(reference, times, trend, lag, square), ranges, rcond=None)[0]
        if not solution[2] > 0.0:
            return None
        lag = float(np.clip(lag + solution[3] / solution[2], -max_lag, max_lag))
        square = float(np.clip(square + solution[4] / solution[2], -(max_lag**2), max_lag**2))
    columns = _columns(reference, times, trend, lag, square)
    linear = np.linalg.lstsq(columns[:, :3], ranges, rcond=None)[0]
    cov = _robust_cov(columns * [1.0, 1.0, 1.0, linear[2], linear[2]], ranges - columns[:, :3] @ linear, _blocks(times))
    if cov is None or abs(lag) >= max_lag:
        return None
    correlation = _correlation(_detrend(trend, ranges), _detrend(trend, columns[:, 2]))
    square_sd, width = math.sqrt(cov[4, 4]), math.sqrt(max(square, 0.0))
    width_sd = square_sd / (2.0 * max(width, math.sqrt(square_sd)))
    return LatencyEstimate(lag, math.sqrt(cov[3, 3]), width, width_sd, correlation, len(times))


def _columns(reference: _ReferenceSeries, times: Array, trend: Array, lag: float, square: float) -> Array:
    """The factors of c, b and g, and the derivatives by tau and W^2 over g, by differences: (n, 5)."""
    at, h, h2 = times - lag, 0.5 * LAG_STEP_S, 4.0 * LAG_STEP_S**2
    by_lag = (reference.average(at - h, square) - reference.average(at + h, square)) / (2.0 * h)
    by_square = (reference.average(at, square + h2) - reference.average(at, square - h2)) / (2.0 * h2)
    return np.column_stack((trend, reference.average(at, square), by_lag, by_square))


def _robust_cov(jacobian: Array, rest: Array, blocks: NDArray[np.int64]) -> Array | None:
    """Covariance of the parameters, residuals correlated within blocks; None where they are not separable."""
    normal = jacobian.T @ jacobian
    if np.linalg.cond(normal / np.sqrt(np.outer(np.diag(normal), np.diag(normal)) + 1e-300)) > 1e12:
        return None
    _, block = np.unique(blocks, return_inverse=True)
    scores = np.zeros((block[-1] + 1, jacobian.shape[1]))
    np.add.at(scores, block, jacobian * rest[:, None])
    inverse, count = np.linalg.inv(normal), len(scores)
    return np.asarray(inverse @ (scores.T @ scores) @ inverse * count / (count - jacobian.shape[1]))
