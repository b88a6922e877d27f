"""Latency of the altimeters of a session, from recorded ranges and ranges predicted from terrain.

Reads the outputs of navigation (``fti reprocess`` writes them again): the measured and the predicted range of each
height above ground, at its time of validity.  The estimate is in addition to the configured ``latency_ms``.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

import numpy as np

from fti.errors import MissingError
from fti.logger.reading.json_message import parse_table, using_message, whole_number
from fti.logger.reading.recording import Recording
from fti.nav.altimetry.latency import LatencyEstimate, estimate_latency

HEIGHT = "/nav/height_above_ground/"
NAMES = ("t_valid_ns", "raw", "predicted")


def altimeter_latencies(recording: Recording, folder: Path) -> dict[str, LatencyEstimate | None]:
    """The latency of each altimeter with predictions; None where it cannot be estimated.

    Raises MissingError where nothing was predicted, as without ``[nav] terrain``.
    """
    series: dict[str, list[tuple[int, float, float]]] = defaultdict(list)
    for topic, t_ns, _, _, data in recording.messages(HEIGHT):
        with using_message(topic, t_ns):
            output = parse_table(data)
            if all(output.get(name) is not None for name in NAMES):
                valid_ns, raw, predicted = (output[name] for name in NAMES)
                series[topic.removeprefix(HEIGHT)].append((whole_number(valid_ns), float(raw), float(predicted)))
    if not series:
        raise MissingError(f"{folder}: no height has a predicted range; run fti reprocess with [nav] terrain")
    return {sensor: _estimate(rows) for sensor, rows in sorted(series.items())}


def _estimate(rows: list[tuple[int, float, float]]) -> LatencyEstimate | None:
    t_ns, raw, predicted = zip(*rows, strict=True)
    t = 1e-9 * (np.array(t_ns, dtype=np.int64) - min(t_ns))
    return estimate_latency(t, raw, t, predicted)


def as_line(sensor: str, estimate: LatencyEstimate | None) -> str:
    """The estimate of an altimeter as text."""
    if estimate is None:
        return f"{sensor}: cannot be estimated: needs 80 s over terrain with relief, and a latency below 1 s"
    late, sd = 1e3 * estimate.latency, 1e3 * estimate.latency_sd
    mean, mean_sd = 1e3 * estimate.averaging, 1e3 * estimate.averaging_sd
    return (
        f"{sensor}: {late:+.0f} ms in addition to latency_ms, sigma {sd:.0f} ms; averaged over {mean:.0f} ms, sigma"
        f" {mean_sd:.0f} ms; correlation {estimate.correlation:.3f}, {estimate.count} ranges"
    )
