"""How late the altimeters of a session spoke: what they said beside what the known ground says they should have.

Read from the outputs that navigation wrote beside the recording (``fti reprocess`` makes them again): of each height
above ground the range that was measured and the one that was predicted, at the time at which the range is believed to
have been true.  What is found comes on top of the ``latency_ms`` that was configured.
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
    """Of each altimeter with predictions; None where it cannot be told.

    Raises MissingError where nothing was predicted: without ``[nav] terrain`` nobody knows what should have been said.
    """
    series: dict[str, list[tuple[int, float, float]]] = defaultdict(list)
    for topic, t_ns, _, _, data in recording.messages(HEIGHT):
        with using_message(topic, t_ns):
            output = parse_table(data)
            if all(output.get(name) is not None for name in NAMES):
                valid_ns, raw, predicted = (output[name] for name in NAMES)
                series[topic.removeprefix(HEIGHT)].append((whole_number(valid_ns), float(raw), float(predicted)))
    if not series:
        raise MissingError(
            f"{folder}: no height has a prediction beside it: fti reprocess, with [nav] terrain, makes them"
        )
    return {sensor: _estimate(rows) for sensor, rows in sorted(series.items())}


def _estimate(rows: list[tuple[int, float, float]]) -> LatencyEstimate | None:
    t_ns, raw, predicted = zip(*rows, strict=True)
    t = 1e-9 * (np.array(t_ns, dtype=np.int64) - min(t_ns))
    return estimate_latency(t, raw, t, predicted)


def as_line(sensor: str, found: LatencyEstimate | None) -> str:
    """What was found of an altimeter, for a person."""
    if found is None:
        return f"{sensor}: cannot be told: 80 s over ground with relief are needed, and a latency below a second"
    late, sd = 1e3 * found.latency, 1e3 * found.latency_sd
    mean, mean_sd = 1e3 * found.averaging, 1e3 * found.averaging_sd
    return (
        f"{sensor}: {late:+.0f} ms on top of its latency_ms, sigma {sd:.0f} ms; averaged over {mean:.0f} ms, sigma"
        f" {mean_sd:.0f} ms; correlation {found.correlation:.3f}, {found.count} ranges"
    )
