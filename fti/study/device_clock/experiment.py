"""Hours of messages with drawn delays, through the clock model."""

from __future__ import annotations

import numpy as np

from fti.arrays import Rng
from fti.constants import SECOND_NS
from fti.messages.measurements import TimeScale
from fti.nav.device_time.clock_estimator import ClockEstimator
from fti.parallel_runs import Progress

HOUR_S = 3600
JITTER_MS, LATE_MS, LATE_SHARE = 1.0, 25.0, 0.2
FIG_6_10_PPM = 1.1
DRIFT_SD_PPM = 20.0
LATENCY_NS, MAX_AGE_NS = 50_000_000, 1_000_000_000


def estimate_drift(drift_ppm: float, delays_ms: np.ndarray) -> tuple[float, float]:
    """Drift that the model estimates [ppm] and half of its 95 % interval, one message a second with these delays."""
    clock = ClockEstimator(TimeScale.GPS, LATENCY_NS, MAX_AGE_NS)
    for k, delay in enumerate(delays_ms):
        true_ns = k * SECOND_NS
        clock.feed(true_ns + LATENCY_NS + round(1e6 * delay), true_ns + round(true_ns * 1e-6 * drift_ppm))
    clock.finish()
    segment = clock.segments[-1]
    return segment.drift_ppm, 1e6 * segment.line.slope_95


def draw_delays(rng: Rng) -> np.ndarray:
    """Delays of T11 [ms]."""
    late = np.where(rng.random(HOUR_S) < LATE_SHARE, rng.uniform(0.0, LATE_MS, HOUR_S), 0.0)
    return np.asarray(rng.normal(0.0, JITTER_MS, HOUR_S) + late)


def draw_one_sided_delays(rng: Rng) -> np.ndarray:
    """Delays that are never negative [ms]."""
    return np.asarray(rng.uniform(0.0, LATE_MS, HOUR_S))


def drift_errors(runs: int, seed: int, progress: Progress) -> dict[str, np.ndarray]:
    """Error of the drift and half of its interval [ppm], shape (runs, 2), of both cases."""
    rng = np.random.default_rng(seed)
    rows: dict[str, list[tuple[float, float]]] = {"T11": [], "I3": []}
    for run in range(runs):
        drift_ppm = float(rng.normal(0.0, DRIFT_SD_PPM))
        rows["T11"].append(_error(drift_ppm, draw_delays(rng)))
        rows["I3"].append(_error(FIG_6_10_PPM, draw_one_sided_delays(rng)))
        progress((run + 1) / runs)
    return {name: np.array(errors) for name, errors in rows.items()}


def _error(drift_ppm: float, delays_ms: np.ndarray) -> tuple[float, float]:
    """Error of the drift and half of its interval [ppm]."""
    estimate_ppm, interval_ppm = estimate_drift(drift_ppm, delays_ms)
    return estimate_ppm - drift_ppm, interval_ppm
