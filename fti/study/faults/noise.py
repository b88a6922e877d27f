"""Errors that are correlated in time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def gauss_markov(count: int, step_s: float, tau_s: float, sd: float, rng: np.random.Generator) -> Array:
    """First-order Gauss-Markov process, stationary from its first sample, shape (count,).

    x[k] = a x[k-1] + w[k], a = exp(-step / tau), var(w) = sd^2 (1 - a^2)  (Brown and Hwang, 3rd edition, section 5.3).
    The recursion is evaluated by doubling: after d rounds every sample holds the last 2^d noises.
    """
    decay = float(np.exp(-step_s / tau_s))
    x = rng.normal(0.0, sd * np.sqrt(1.0 - decay**2), count)
    if count:
        x[0] = rng.normal(0.0, sd)
    shift = 1
    while shift < count:
        x[shift:] += decay**shift * x[:-shift].copy()
        shift *= 2
    return x


def gauss_markov_n(count: int, step_s: float, tau_s: float, sds: tuple[float, ...], rng: np.random.Generator) -> Array:
    """Independent processes side by side (count, len(sds))."""
    return np.stack([gauss_markov(count, step_s, tau_s, sd, rng) for sd in sds], axis=1)
