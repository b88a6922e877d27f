"""Drift of a device's clock, estimated under jitter and delays of one sign.

Source 003, section 6.3, figure 6.10: the FTI clock drifts by 4 ms an hour (1.1 ppm) against GNSS time, and logs come
up to 25 ms late.  The record is not public; messages are drawn here.  N = runs of one hour at 1 Hz, each with a drift
of its own (normal, 20 ppm) or with 1.1 ppm; the unit is the run.

    T11   jitter of both signs, 1 ms (one sigma); one message in five late by 0 to 25 ms (uniform)
    I3    every message late by 0 to 25 ms (uniform), 1.1 ppm

The clock model is that of the product (``fti.nav.device_time.clock_estimator``), fed message by message.
"""

from __future__ import annotations

import numpy as np

from fti.messages.measurements import TimeScale
from fti.nav.device_time.clock_estimator import ClockEstimator
from fti.parallel_runs import Progress
from fti.study import StudyResult

RUNS = 100
SEED = 11

SECOND_NS = 1_000_000_000
HOUR_S = 3600
JITTER_MS, LATE_MS, LATE_SHARE = 1.0, 25.0, 0.2
FIG_6_10_PPM = 1.1
DRIFT_SD_PPM = 20.0
#: Maximum error after an hour [ppm], for this percentage of the runs.
LIMIT_PPM, MIN_PERCENT = 0.05, 95
#: Percentage of runs that must have their drift inside their own 95 % interval.
INSIDE = 90
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


def draw_delays(rng: np.random.Generator) -> np.ndarray:
    """Delays of T11 [ms]."""
    late = np.where(rng.random(HOUR_S) < LATE_SHARE, rng.uniform(0.0, LATE_MS, HOUR_S), 0.0)
    return np.asarray(rng.normal(0.0, JITTER_MS, HOUR_S) + late)


def draw_one_sided_delays(rng: np.random.Generator) -> np.ndarray:
    """Delays that are never negative [ms]."""
    return np.asarray(rng.uniform(0.0, LATE_MS, HOUR_S))


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """Both cases, ``runs`` hours each."""
    rng = np.random.default_rng(seed)
    rows: dict[str, list[tuple[float, float]]] = {"T11": [], "I3": []}
    for run in range(runs):
        drift_ppm = float(rng.normal(0.0, DRIFT_SD_PPM))
        rows["T11"].append(_error(drift_ppm, draw_delays(rng)))
        rows["I3"].append(_error(FIG_6_10_PPM, draw_one_sided_delays(rng)))
        progress((run + 1) / runs)
    return [result for name, errors in rows.items() for result in _judge(name, np.array(errors))]


def _error(drift_ppm: float, delays_ms: np.ndarray) -> tuple[float, float]:
    """Error of the drift and half of its interval [ppm]."""
    estimate_ppm, interval_ppm = estimate_drift(drift_ppm, delays_ms)
    return estimate_ppm - drift_ppm, interval_ppm


def _judge(name: str, errors: np.ndarray) -> list[StudyResult]:
    size, interval = np.abs(errors[:, 0]), errors[:, 1]
    inside = int(np.count_nonzero(size <= interval))
    min_inside = INSIDE * len(size) / 100
    percentile_ppm = float(np.percentile(size, MIN_PERCENT))
    return [
        StudyResult(
            f"{name}.interval",
            f"runs of {len(size)} with the drift inside its own 95 % interval",
            inside,
            f">= {min_inside:g}",
            inside >= min_inside,
        ),
        StudyResult(
            f"{name}.error",
            f"drift error after an hour, percentile {MIN_PERCENT} of {len(size)} runs [ppm]",
            percentile_ppm,
            f"<= {LIMIT_PPM}",
            percentile_ppm <= LIMIT_PPM,
        ),
    ]
