"""Errors of simulated sensors: Gauss-Markov, white and flicker noise, random walk, lag, quantization, backlash."""

from __future__ import annotations

import numpy as np

from fti.arrays import Array

KNOT_S = 1.0
#: Remaining share of a sample that is neglected.
NEGLIGIBLE_SHARE = 1e-18
#: Correlation times of the processes whose sum is flicker noise, one per decade [s].
FLICKER_PERIODS_S = (10.0, 100.0, 1000.0, 10_000.0)
#: Standard deviation of each process relative to the floor of the Allan deviation.
FLICKER_SHARE = float(np.sqrt(np.log(10.0) / np.pi) / np.sqrt(2.0 * np.log(2.0) / np.pi))


def gauss_markov_noise(t: Array, sd: float, period_s: float, rng: np.random.Generator) -> Array:
    """A first-order Gauss-Markov process with standard deviation sd and correlation time period_s, shape of t.

    One value per second, with linear interpolation, because the process is slow.
    """
    knots = np.arange(t[0], t[-1] + 2 * KNOT_S, KNOT_S)
    return np.asarray(np.interp(t, knots, gauss_markov(len(knots), KNOT_S, period_s, sd, rng)))


def gauss_markov(count: int, step_s: float, period_s: float, sd: float, rng: np.random.Generator) -> Array:
    """A first-order Gauss-Markov process, stationary from its first sample, shape (count,), count at least 1.

    x[k] = a x[k-1] + w[k], a = exp(-step / period), var(w) = sd^2 (1 - a^2).
    Source: Brown and Hwang, 3rd edition, section 5.3.
    """
    keep = float(np.exp(-step_s / period_s))
    kicks = rng.normal(0.0, sd * np.sqrt(1.0 - keep**2), count)
    kicks[0] = rng.normal(0.0, sd)
    return recursion(kicks, keep)


def gauss_markov_n(
    count: int, step_s: float, period_s: float, sds: tuple[float, ...], rng: np.random.Generator
) -> Array:
    """Independent Gauss-Markov processes side by side (count, len(sds))."""
    return np.stack([gauss_markov(count, step_s, period_s, sd, rng) for sd in sds], axis=1)


def recursion(kicks: Array, keep: float) -> Array:
    """x[k] = keep x[k-1] + kicks[k], for 0 <= keep < 1, in sweeps over the whole array instead of sample by sample.

    After the sweep with step s every x[k] contains the last 2 s kicks; it ends when older ones are below
    NEGLIGIBLE_SHARE.
    """
    x, step = kicks.copy(), 1
    while step < len(x) and keep**step > NEGLIGIBLE_SHARE:
        x[step:] += keep**step * x[:-step].copy()
        step *= 2
    return x


def first_order_lag(t: Array, values: Array, lag_s: float) -> Array:
    """Values after a first-order lag, shape (n,): exact for linear input between samples, settled at the first."""
    if lag_s == 0.0:
        return values
    share = lag_s / _interval(t)
    keep = float(np.exp(-1.0 / share))
    kicks = (1.0 - share * (1.0 - keep)) * values
    kicks[1:] += (share * (1.0 - keep) - keep) * values[:-1]
    kicks[0] = values[0]
    return recursion(kicks, keep)


def white_noise(t: Array, sd: float, rng: np.random.Generator) -> Array:
    """Independent errors with standard deviation sd, shape of t."""
    return rng.normal(0.0, sd, len(t))


def noise_of_density(t: Array, per_root_hz: float, rng: np.random.Generator) -> Array:
    """White noise of a spectral density [unit / sqrt(Hz)], as means over the intervals between samples, shape of t.

    Its integral is a random walk with this coefficient: rad/s/sqrt(Hz) is rad/sqrt(s).
    """
    return white_noise(t, per_root_hz / np.sqrt(_interval(t)), rng)


def random_walk(t: Array, per_root_s: float, rng: np.random.Generator) -> Array:
    """A random walk from zero with standard deviation per_root_s sqrt(time), shape of t."""
    return np.asarray(np.cumsum(white_noise(t, per_root_s * np.sqrt(_interval(t)), rng)))


def flicker_noise(t: Array, floor: float, rng: np.random.Generator) -> Array:
    """Noise with the spectrum 1/f between 10 s and 3 h, whose Allan deviation has a flat floor there, shape of t.

    A sum of Gauss-Markov processes with one variance and a correlation time per decade: their sum of spectra follows
    B^2 / (2 pi f) when each has the standard deviation B sqrt(ln 10 / pi), and the floor is B sqrt(2 ln 2 / pi).
    Source: IEEE Std 952-1997, annex C (bias instability); Keshner 1982, 1/f noise, Proc. IEEE 70 (sum of relaxations).
    """
    return np.asarray(sum(gauss_markov_noise(t, FLICKER_SHARE * floor, period, rng) for period in FLICKER_PERIODS_S))


def quantize(values: Array, resolution: float) -> Array:
    """Values rounded to whole multiples of the resolution of a converter."""
    return np.asarray(np.rint(values / resolution) * resolution)


def backlash(values: Array, width: float) -> Array:
    """Output of a linkage with this backlash from end to end for the input ``values``, shape (n,).

    Begins in the middle of the backlash.  The same operator is the hysteresis of a pickup.
    """
    output, at, half = np.empty_like(values), float(values[0]), 0.5 * width
    for k, value in enumerate(values.tolist()):
        at = min(max(at, value - half), value + half)
        output[k] = at
    return output


def _interval(t: Array) -> float:
    return float(np.median(np.diff(t))) if len(t) > 1 else KNOT_S
